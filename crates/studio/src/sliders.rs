//! Sliders: the positions of every parameter of a phantom, and the conversion of a position or text to a value.

use crate::messages::{Problem, SliderView, Target};
use stylet_report::significant;
use stylet_tissue::ParameterInfo;

/// Positions of a slider, without the one that switches off.
const POSITIONS: usize = 160;
/// Significant digits of a value that a slider sets, and of one that is shown.
const DIGITS: usize = 4;

/// The values of a slider in SI units, ascending or from the inactive value on.
pub struct Scale {
    label: &'static str,
    unit: &'static str,
    /// Shown value per SI value.
    factor: f64,
    values: Vec<f64>,
    /// Whether the number may be absent: the last position.
    optional: bool,
}

pub fn rounded(value: f64) -> f64 {
    significant(value, DIGITS).parse().unwrap_or(value)
}

/// Label, unit and factor of a scenario's number, such as `stiffness_n_per_m`; an unknown one keeps its name.
pub fn named(number: &str) -> (&str, &'static str, f64) {
    let field = number.split('_').next().unwrap_or_default();
    match Scale::of_layer(field) {
        Some(scale) => (scale.label, scale.unit, scale.factor),
        None if number == "surface_m" => ("depth of the surface", "mm", 1e3),
        None => (number, "", 1.0),
    }
}

fn spread(low: f64, high: f64, log: bool) -> Vec<f64> {
    let at = |share: f64| match log && low > 0.0 {
        true => low * libm::pow(high / low, share),
        false => low + (high - low) * share,
    };
    (0..POSITIONS).map(|k| rounded(at(k as f64 / (POSITIONS - 1) as f64))).collect()
}

impl Scale {
    const fn new(label: &'static str, unit: &'static str, factor: f64, values: Vec<f64>) -> Self {
        Self { label, unit, factor, values, optional: false }
    }

    /// The number `field` of a layer; `None` for an unknown one.
    pub fn of_layer(field: &str) -> Option<Self> {
        let from_zero = |low: f64, high: f64| [vec![0.0], spread(low, high, true)].concat();
        Some(match field {
            "thickness" => Self::new("thickness", "mm", 1e3, spread(0.5e-3, 0.2, true)),
            "stiffness" => Self::new("stiffness K", "N/m", 1.0, from_zero(1.0, 3000.0)),
            "friction" => Self::new("friction b", "N s/m²", 1.0, from_zero(50.0, 2e5)),
            "puncture" => {
                Self { optional: true, ..Self::new("puncture force F", "N", 1.0, spread(0.02, 20.0, true)) }
            }
            _ => return None,
        })
    }

    /// An uncertainty of the scenario.
    pub fn of_tolerance(field: &str) -> Option<Self> {
        Some(match field {
            "tolerance" => Self::new("of K, b and F", "%", 100.0, spread(0.01, 0.9, false)),
            "thickness_tolerance" => Self::new("of thicknesses", "%", 100.0, spread(0.0, 0.5, false)),
            "surface_tolerance_m" => Self::new("of the surface", "mm", 1e3, spread(0.0, 0.01, false)),
            _ => return None,
        })
    }

    /// A parameter of an effect.
    pub fn of_parameter(info: &ParameterInfo) -> Self {
        let (low, high) = info.search;
        let values = if info.integer {
            (low.ceil() as i64..=high.floor() as i64).map(|n| n as f64).collect()
        } else {
            let mut values = spread(low, high, info.log);
            if info.strength && !values.contains(&info.inactive) {
                // Inactive values are zero or infinite.
                let end = if info.inactive > high { values.len() } else { 0 };
                values.insert(end, info.inactive);
            }
            values
        };
        Self::new("", info.unit, 1.0, values)
    }

    pub fn view(&self, field: &str, label: &str, help: &'static str, value: Option<f64>) -> SliderView {
        let distance = |stop: f64, value: f64| if stop == value { 0.0 } else { (stop - value).abs() };
        let nearest = |value: f64| {
            let distances = self.values.iter().map(|stop| distance(*stop, value)).enumerate();
            distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(position, _)| position)
        };
        SliderView {
            field: field.to_owned(),
            label: if label.is_empty() { self.label.to_owned() } else { label.to_owned() },
            unit: self.unit,
            help,
            position: value.map_or(self.values.len(), nearest),
            positions: self.values.len() + usize::from(self.optional),
            text: match value {
                Some(value) if value == f64::INFINITY => "∞".to_owned(),
                Some(value) => significant(value * self.factor, DIGITS),
                None => String::new(),
            },
        }
    }

    /// The SI value of a target; `None` where the number is absent.
    ///
    /// # Errors When a text is not a number, or the number must not be absent.
    pub fn value(&self, to: &Target) -> Result<Option<f64>, Problem> {
        match to {
            Target::Position(position) if self.optional && *position >= self.values.len() => Ok(None),
            Target::Position(position) => Ok(self.values.get(*position).or(self.values.last()).copied()),
            Target::Text(text) => {
                let text = text.trim().replace(',', ".");
                match text.as_str() {
                    "" if self.optional => Ok(None),
                    "∞" => Ok(Some(f64::INFINITY)),
                    _ => text.parse::<f64>().map(|value| Some(value / self.factor)).map_err(|_| {
                        Problem::new(format!(
                            "{text:?} is no number; write one such as 12.5, in {}",
                            self.unit
                        ))
                    }),
                }
            }
        }
    }
}
