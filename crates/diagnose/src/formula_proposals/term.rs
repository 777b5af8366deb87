//! Terms of proposed formulas: a function of one variable, times a factor.

use core::f64::consts::TAU;
use stylet_identify::block_averages::BlockAverages;
use stylet_tissue::Prior;
use stylet_tissue::effect::sgn;

/// A variable that a force may be a function of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Variable {
    Time,
    Position,
    Velocity,
    Acceleration,
    /// Travel since the last change of direction.
    Travel,
    /// Length of the whole path.
    Path,
}

/// Exponents of newton, metre and second.
type Dimensions = [i32; 3];

impl Variable {
    pub const ALL: [Self; 6] =
        [Self::Time, Self::Position, Self::Velocity, Self::Acceleration, Self::Travel, Self::Path];

    /// Name in formulas, dimensions, and value at a sample.
    const fn properties(self) -> (&'static str, Dimensions, fn(&Sample) -> f64) {
        match self {
            Self::Time => ("t", [0, 0, 1], |s| s.time_s),
            Self::Position => ("z", [0, 1, 0], |s| s.z_m),
            Self::Velocity => ("v", [0, 1, -1], |s| s.v_mps),
            Self::Acceleration => ("a", [0, 1, -2], |s| s.a_mps2),
            Self::Travel => ("travel", [0, 1, 0], |s| s.travel_m),
            Self::Path => ("path", [0, 1, 0], |s| s.path_m),
        }
    }

    pub const fn name(self) -> &'static str {
        self.properties().0
    }

    const fn dimensions(self) -> Dimensions {
        self.properties().1
    }

    /// Unit, for plots.
    pub fn unit(self) -> String {
        unit(self.dimensions())
    }

    fn of(self, s: &Sample) -> f64 {
        self.properties().2(s)
    }
}

/// What the function of the variable is multiplied by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Factor {
    One,
    /// One in the tissue, else zero.
    InTissue,
    /// Along the shaft, against the direction of motion.
    DryFriction,
    /// Along the shaft, proportional to the velocity.
    ViscousFriction,
}

impl Factor {
    pub const ALL: [Self; 4] = [Self::One, Self::InTissue, Self::DryFriction, Self::ViscousFriction];

    const fn dimensions(self) -> Dimensions {
        match self {
            Self::One | Self::InTissue => [0; 3],
            Self::DryFriction => [0, 1, 0],
            Self::ViscousFriction => [0, 2, -1],
        }
    }

    fn of(self, s: &Sample) -> f64 {
        match self {
            Self::One => 1.0,
            Self::InTissue => f64::from(s.inserted_m > 0.0),
            Self::DryFriction => sgn(s.v_mps) * s.inserted_m,
            Self::ViscousFriction => s.v_mps * s.inserted_m,
        }
    }

    /// The factor times a sum of terms.
    pub fn times(self, sum: &str) -> String {
        match self {
            Self::One => sum.to_owned(),
            Self::InTissue => format!("if(inserted > 0, {sum}, 0)"),
            Self::DryFriction => format!("sgn(v)*inserted*({sum})"),
            Self::ViscousFriction => format!("v*inserted*({sum})"),
        }
    }
}

/// Motion in the middle of a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    time_s: f64,
    z_m: f64,
    v_mps: f64,
    a_mps2: f64,
    travel_m: f64,
    path_m: f64,
    inserted_m: f64,
}

impl Sample {
    /// The motion of every block of a recording.
    pub fn of_recording(b: &BlockAverages, surface_m: f64) -> Vec<Self> {
        let (mut travel_m, mut path_m, mut direction) = (0.0, 0.0, 0.0);
        let mut before: Option<Self> = None;
        (0..b.len())
            .map(|k| {
                let time_s = b.mid_s(k);
                let (z_m, v_mps) = b.motion.at(time_s);
                let (mut a_mps2, mut moved_m) = (0.0, 0.0);
                if let Some(before) = before {
                    a_mps2 = (v_mps - before.v_mps) / (time_s - before.time_s).max(1e-9);
                    moved_m = (z_m - before.z_m).abs();
                }
                let sign = sgn(v_mps);
                if sign != 0.0 {
                    travel_m = if sign == direction { travel_m + moved_m } else { moved_m };
                    direction = sign;
                }
                path_m += moved_m;
                let inserted_m = (z_m - surface_m).max(0.0);
                let sample = Self { time_s, z_m, v_mps, a_mps2, travel_m, path_m, inserted_m };
                before = Some(sample);
                sample
            })
            .collect()
    }
}

/// A factor times a function of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Carrier {
    pub variable: Variable,
    pub factor: Factor,
}

impl Carrier {
    pub fn of(self, s: &Sample) -> (f64, f64) {
        (self.variable.of(s), self.factor.of(s))
    }
}

/// A function of a variable `x`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    /// `x`
    Linear,
    /// `x^2`
    Square,
    /// `exp(-x/s)`
    Decay { s: f64 },
    /// `sin(2 pi x/s)` and `cos(2 pi x/s)`
    Wave { s: f64 },
    /// `exp(-((x - m)/s)^2)`
    Bump { m: f64, s: f64 },
    /// `tanh((x - m)/s)`
    Step { m: f64, s: f64 },
}

/// A parameter of a formula: name, value, unit, and whether it is a strength; shapes have a prior.
#[derive(Clone, Debug)]
pub(super) struct NamedValue {
    pub name: String,
    pub value: f64,
    pub unit: String,
    pub prior: Option<Prior>,
}

impl Shape {
    /// All shapes over a range of the variable.
    pub fn all(low: f64, high: f64) -> Vec<Self> {
        /// Largest number of waves in the range, and their step: neighbours differ by a quarter of a period over the range.
        const WAVES: (f64, f64) = (120.0, 0.25);
        /// Places of bumps and steps over the range.
        const PLACES: usize = 24;
        /// Widths as shares of the range.
        const WIDTHS: [f64; 4] = [0.02, 0.05, 0.12, 0.3];
        let range = high - low;
        let mut shapes = vec![Self::Linear, Self::Square];
        shapes.extend([0.03, 0.1, 0.3, 1.0].map(|share| Self::Decay { s: share * range }));
        let waves = (WAVES.0 / WAVES.1) as usize;
        shapes.extend((2..=waves).map(|k| Self::Wave { s: range / (k as f64 * WAVES.1) }));
        for k in 0..PLACES {
            let m = low + range * (k as f64 + 0.5) / PLACES as f64;
            shapes.extend(WIDTHS.map(|width| Self::Bump { m, s: width * range }));
            shapes.extend(WIDTHS.map(|width| Self::Step { m, s: width * range }));
        }
        shapes
    }

    /// Its functions of the variable, each with a strength.
    pub fn functions(self) -> Vec<Box<dyn Fn(f64) -> f64>> {
        match self {
            Self::Linear => vec![Box::new(|x| x)],
            Self::Square => vec![Box::new(|x| x * x)],
            Self::Decay { s } => vec![Box::new(move |x| libm::exp(-x / s))],
            Self::Wave { s } => {
                vec![Box::new(move |x| libm::sin(TAU * x / s)), Box::new(move |x| libm::cos(TAU * x / s))]
            }
            Self::Bump { m, s } => vec![Box::new(move |x| libm::exp(-((x - m) / s).powi(2)))],
            Self::Step { m, s } => vec![Box::new(move |x| libm::tanh((x - m) / s))],
        }
    }

    /// Formula with strengths of these values, and its parameters; `k` numbers the term.
    pub fn formula(self, k: usize, carrier: Carrier, strengths: &[f64]) -> (String, Vec<NamedValue>) {
        let x = carrier.variable.name();
        let of = |name: &str| format!("{name}{k}");
        let (a, b, s, m) = (of("a_"), of("b_"), of("s_"), of("m_"));
        let (text, power) = match self {
            Self::Linear => (format!("{a}*{x}"), 1),
            Self::Square => (format!("{a}*{x}^2"), 2),
            Self::Decay { .. } => (format!("{a}*exp(-{x}/{s})"), 0),
            Self::Wave { .. } => (format!("{a}*sin(2*pi*{x}/{s}) + {b}*cos(2*pi*{x}/{s})"), 0),
            Self::Bump { .. } => (format!("{a}*exp(-(({x} - {m})/{s})^2)"), 0),
            Self::Step { .. } => (format!("{a}*tanh(({x} - {m})/{s})"), 0),
        };
        let [variable, factor] = [carrier.variable.dimensions(), carrier.factor.dimensions()];
        let below = |i: usize| power * variable[i] + factor[i];
        let strength = unit([1 - below(0), -below(1), -below(2)]);
        let mut out: Vec<NamedValue> = [a, b]
            .into_iter()
            .zip(strengths)
            .map(|(name, value)| NamedValue { name, value: *value, unit: strength.clone(), prior: None })
            .collect();
        let mut shape = |name: &str, value: f64, prior: Prior| {
            let unit = carrier.variable.unit();
            out.push(NamedValue { name: name.to_owned(), value, unit, prior: Some(prior) });
        };
        match self {
            Self::Linear | Self::Square => {}
            // A period is known to a fraction of a wave over the range; a width only to its size.
            Self::Wave { s: period } => shape(&s, period, Prior::LogNormal { median: period, factor: 1.1 }),
            Self::Decay { s: scale } => shape(&s, scale, Prior::LogNormal { median: scale, factor: 2.0 }),
            Self::Bump { m: place, s: width } | Self::Step { m: place, s: width } => {
                shape(&m, place, Prior::Normal { mean: place, sd: width });
                shape(&s, width, Prior::LogNormal { median: width, factor: 2.0 });
            }
        }
        (text, out)
    }
}

/// A unit such as `N s/m^2`.
fn unit([n, m, s]: Dimensions) -> String {
    let part = |above: bool| {
        let signed = |e: i32| if above { e } else { -e };
        let symbols = [("N", n), ("s", s), ("m", m)].into_iter().filter(|(_, e)| signed(*e) > 0);
        let words: Vec<String> = symbols
            .map(
                |(symbol, e)| {
                    if signed(e) == 1 { symbol.to_owned() } else { format!("{symbol}^{}", signed(e)) }
                },
            )
            .collect();
        (words.join(" "), words.len())
    };
    let ((above, _), (below, count)) = (part(true), part(false));
    let above = if above.is_empty() && count > 0 { "1".to_owned() } else { above };
    match count {
        0 => above,
        1 => format!("{above}/{below}"),
        _ => format!("{above}/({below})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_written_as_formulas_read_them() {
        assert_eq!(unit([1, -2, 1]), "N s/m^2");
        assert_eq!(unit([0, 1, -2]), "m/s^2");
        assert_eq!(unit([1, -1, -1]), "N/(s m)");
        assert_eq!(unit([0, -1, 0]), "1/m");
        assert_eq!(unit([0, 0, 0]), "");
    }
}
