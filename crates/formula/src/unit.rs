//! Units as exponents of metre, kilogram and second.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

/// A unit without its scale: all quantities are in SI units. Radians, ratios and counts have none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unit {
    /// Exponents of metre, kilogram and second.
    exponents: [f64; 3],
}

/// Exponents closer than this are equal: roots of units give fractions.
const TOLERANCE: f64 = 1e-9;

/// Symbols with the exponents of metre, kilogram and second.
const SYMBOLS: [(&str, [f64; 3]); 9] = [
    ("m", [1.0, 0.0, 0.0]),
    ("kg", [0.0, 1.0, 0.0]),
    ("s", [0.0, 0.0, 1.0]),
    ("N", [1.0, 1.0, -2.0]),
    ("Hz", [0.0, 0.0, -1.0]),
    ("J", [2.0, 1.0, -2.0]),
    ("Pa", [-1.0, 1.0, -2.0]),
    ("W", [2.0, 1.0, -3.0]),
    ("rad", [0.0, 0.0, 0.0]),
];

/// Derived units that an error names instead of their base units.
const NAMES: [(&str, [f64; 3]); 18] = [
    ("N", [1.0, 1.0, -2.0]),
    ("N/m", [0.0, 1.0, -2.0]),
    ("N/m^2", [-1.0, 1.0, -2.0]),
    ("N/m^3", [-2.0, 1.0, -2.0]),
    ("N m", [2.0, 1.0, -2.0]),
    ("N m^2", [3.0, 1.0, -2.0]),
    ("N/s", [1.0, 1.0, -3.0]),
    ("N s", [1.0, 1.0, -1.0]),
    ("N s/m", [0.0, 1.0, -1.0]),
    ("N s/m^2", [-1.0, 1.0, -1.0]),
    ("N s^2", [1.0, 1.0, 0.0]),
    ("N/(m s)", [0.0, 1.0, -3.0]),
    ("N m/s", [2.0, 1.0, -3.0]),
    ("N^2", [2.0, 2.0, -4.0]),
    ("1/N", [-1.0, -1.0, 2.0]),
    ("m/N", [0.0, -1.0, 2.0]),
    ("m/s", [1.0, 0.0, -1.0]),
    ("m/s^2", [1.0, 0.0, -2.0]),
];

impl Unit {
    /// No unit: a ratio, an angle or a count.
    pub const NONE: Self = Self { exponents: [0.0; 3] };
    /// Metre.
    pub const METRE: Self = Self { exponents: [1.0, 0.0, 0.0] };
    /// Second.
    pub const SECOND: Self = Self { exponents: [0.0, 0.0, 1.0] };
    /// Newton.
    pub const NEWTON: Self = Self { exponents: [1.0, 1.0, -2.0] };
    /// Metre per second.
    pub const METRE_PER_SECOND: Self = Self { exponents: [1.0, 0.0, -1.0] };
    /// Metre per second squared.
    pub const METRE_PER_SECOND2: Self = Self { exponents: [1.0, 0.0, -2.0] };

    /// The unit written as `N s/m^2`, `m/s²`, `1/m` or nothing: symbols separated by blanks or `*`, a slash before each one
    /// in the denominator, or before a bracket.
    ///
    /// # Errors
    /// A message that names the symbol that is not known.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut unit = Self::NONE;
        let (mut below, mut group) = (false, false);
        let spaced = text.replace('²', "^2").replace('³', "^3");
        let mut spaced = ["*", "·"].iter().fold(spaced, |t, sign| t.replace(sign, " "));
        for sign in ["/", "(", ")"] {
            spaced = spaced.replace(sign, &format!(" {sign} "));
        }
        for word in spaced.split_whitespace() {
            match word {
                "/" => below = true,
                "(" => group = true,
                ")" => (group, below) = (false, false),
                "1" => {}
                _ => {
                    let (symbol, exponent) = word.split_once('^').unwrap_or((word, "1"));
                    let exponent = exponent.parse::<f64>().ok().filter(|e| e.abs() <= 12.0);
                    let known = SYMBOLS.iter().find(|(known, _)| *known == symbol);
                    let (Some(exponent), Some((_, exponents))) = (exponent, known) else {
                        let symbols: Vec<&str> = SYMBOLS.iter().map(|(s, _)| *s).collect();
                        return Err(format!(
                            "`{word}` is no unit; units are products and quotients of {}, for example \"N s/m^2\"; \
                             values are in SI units, without prefixes",
                            symbols.join(", ")
                        ));
                    };
                    let other = Self { exponents: *exponents }.power(exponent);
                    unit = if below { unit.divided_by(other) } else { unit.times(other) };
                    below &= group;
                }
            }
        }
        Ok(unit)
    }

    /// Product of two units.
    #[must_use]
    pub fn times(self, other: Self) -> Self {
        Self { exponents: core::array::from_fn(|k| self.exponents[k] + other.exponents[k]) }
    }

    /// Quotient of two units.
    #[must_use]
    pub fn divided_by(self, other: Self) -> Self {
        self.times(other.power(-1.0))
    }

    /// Power of a unit.
    #[must_use]
    pub fn power(self, exponent: f64) -> Self {
        Self { exponents: self.exponents.map(|e| e * exponent) }
    }
}

impl PartialEq for Unit {
    fn eq(&self, other: &Self) -> bool {
        self.exponents.iter().zip(other.exponents).all(|(a, b)| (a - b).abs() < TOLERANCE)
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::NONE {
            return f.write_str("no unit");
        }
        if let Some((name, _)) = NAMES.iter().find(|(_, e)| Self { exponents: *e } == *self) {
            return f.write_str(name);
        }
        let written = |(symbol, e): (&str, f64)| match e {
            e if e.abs() < TOLERANCE => None,
            e if (e - 1.0).abs() < TOLERANCE => Some(symbol.to_string()),
            e => Some(format!("{symbol}^{}", libm::round(e * 1000.0) / 1000.0)),
        };
        let parts: Vec<String> = ["kg", "m", "s"]
            .into_iter()
            .zip([self.exponents[1], self.exponents[0], self.exponents[2]])
            .filter_map(written)
            .collect();
        f.write_str(&parts.join(" "))
    }
}
