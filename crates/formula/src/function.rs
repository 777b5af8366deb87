//! Operators and functions.

/// Speed in m/s up to which `sgn(v)` is zero, as for all effects (docs/reference/model.md, Effects).
pub const SGN_DEAD_BAND_MPS: f64 = 1e-5;

/// An operator or function of a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is named as in the formula")]
pub enum Function {
    Negate,
    Abs,
    Sqrt,
    Exp,
    Log,
    Sin,
    Cos,
    Tanh,
    Atan,
    Sign,
    Sgn,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Less,
    Greater,
    Min,
    Max,
    If,
}

/// The functions by name.
pub(crate) const FUNCTIONS: [(&str, Function); 14] = [
    ("abs", Function::Abs),
    ("sqrt", Function::Sqrt),
    ("exp", Function::Exp),
    ("log", Function::Log),
    ("sin", Function::Sin),
    ("cos", Function::Cos),
    ("tanh", Function::Tanh),
    ("atan", Function::Atan),
    ("sign", Function::Sign),
    ("sgn", Function::Sgn),
    ("min", Function::Min),
    ("max", Function::Max),
    ("if", Function::If),
    ("pow", Function::Power),
];

/// The name of a function in formulas; empty for operators.
pub(crate) fn name(function: Function) -> &'static str {
    FUNCTIONS.iter().find(|(_, known)| *known == function).map_or("", |(name, _)| name)
}

impl Function {
    /// Number of arguments.
    #[must_use]
    pub const fn arguments(self) -> usize {
        match self {
            Self::If => 3,
            Self::Add
            | Self::Subtract
            | Self::Multiply
            | Self::Divide
            | Self::Power
            | Self::Less
            | Self::Greater
            | Self::Min
            | Self::Max => 2,
            _ => 1,
        }
    }

    /// Value and derivative for arguments given as values and derivatives.
    #[must_use]
    #[inline]
    pub(crate) fn dual(self, [x, y, z]: [(f64, f64); 3]) -> (f64, f64) {
        let value = self.value([x.0, y.0, z.0]);
        let derivative = match self {
            Self::Negate => -x.1,
            Self::Abs => x.1 * sign(x.0),
            Self::Sqrt => x.1 / (2.0 * value),
            Self::Exp => x.1 * value,
            Self::Log => x.1 / x.0,
            Self::Sin => x.1 * libm::cos(x.0),
            Self::Cos => -x.1 * libm::sin(x.0),
            Self::Tanh => x.1 * (1.0 - value * value),
            Self::Atan => x.1 / (1.0 + x.0 * x.0),
            Self::Sign | Self::Sgn | Self::Less | Self::Greater => 0.0,
            Self::Add => x.1 + y.1,
            Self::Subtract => x.1 - y.1,
            Self::Multiply => x.1 * y.0 + x.0 * y.1,
            Self::Divide => (x.1 - value * y.1) / y.0,
            Self::Power => {
                // Skip terms that are zero: the logarithm of a negative base has no value.
                let base = if x.1 == 0.0 { 0.0 } else { x.1 * y.0 * power(x.0, y.0 - 1.0) };
                let exponent = if y.1 == 0.0 { 0.0 } else { y.1 * value * libm::log(x.0) };
                base + exponent
            }
            Self::Min => {
                if x.0 <= y.0 {
                    x.1
                } else {
                    y.1
                }
            }
            Self::Max => {
                if x.0 >= y.0 {
                    x.1
                } else {
                    y.1
                }
            }
            Self::If => {
                if x.0 == 0.0 {
                    z.1
                } else {
                    y.1
                }
            }
        };
        (value, derivative)
    }

    /// Value for these arguments; surplus ones are ignored.
    #[must_use]
    #[inline]
    pub(crate) fn value(self, [x, y, z]: [f64; 3]) -> f64 {
        match self {
            Self::Negate => -x,
            Self::Abs => x.abs(),
            Self::Sqrt => libm::sqrt(x),
            Self::Exp => libm::exp(x),
            Self::Log => libm::log(x),
            Self::Sin => libm::sin(x),
            Self::Cos => libm::cos(x),
            Self::Tanh => libm::tanh(x),
            Self::Atan => libm::atan(x),
            Self::Sign => sign(x),
            Self::Sgn => {
                if x.abs() <= SGN_DEAD_BAND_MPS {
                    0.0
                } else {
                    sign(x)
                }
            }
            Self::Add => x + y,
            Self::Subtract => x - y,
            Self::Multiply => x * y,
            Self::Divide => x / y,
            Self::Power => power(x, y),
            Self::Less => f64::from(u8::from(x < y)),
            Self::Greater => f64::from(u8::from(x > y)),
            // NaN is propagated, unlike with `f64::min`.
            Self::Min => {
                if x <= y || x.is_nan() {
                    x
                } else {
                    y
                }
            }
            Self::Max => {
                if x >= y || x.is_nan() {
                    x
                } else {
                    y
                }
            }
            Self::If => {
                if x.is_nan() {
                    x
                } else if x == 0.0 {
                    z
                } else {
                    y
                }
            }
        }
    }
}

/// -1, 0 or 1.
fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x * 0.0
    }
}

/// Small whole powers by multiplication, which is faster and exact.
#[inline]
fn power(x: f64, y: f64) -> f64 {
    if y == 2.0 {
        x * x
    } else if y == 1.0 {
        x
    } else if y == 3.0 {
        x * x * x
    } else {
        libm::pow(x, y)
    }
}
