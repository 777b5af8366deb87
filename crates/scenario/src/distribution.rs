//! Distributions of drawn quantities. Each is sampled by its quantile function, so that every sampling design can be used.

use crate::load_ron::FieldError;
use serde::{Deserialize, Serialize};

/// A distribution in the unit of the field that it is drawn for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Distribution {
    /// Uniform between the two values.
    Uniform(f64, f64),
    /// The logarithm is uniform between the two positive values.
    LogUniform(f64, f64),
    /// Gaussian.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        sd: f64,
    },
    /// The logarithm is Gaussian.
    LogNormal {
        /// Median, positive.
        median: f64,
        /// Standard deviation of the natural logarithm.
        sd_log: f64,
    },
    /// Triangular density.
    Triangular {
        /// Smallest value.
        min: f64,
        /// Most likely value.
        mode: f64,
        /// Largest value.
        max: f64,
    },
    /// One of the values with equal probability.
    Choice(Vec<f64>),
}

impl Distribution {
    /// Checks the parameters; `path` is the path of the field for the error.
    ///
    /// # Errors
    /// [`FieldError`] that names the valid range.
    pub fn check(&self, path: &str) -> Result<(), FieldError> {
        let fail = |what: String| Err(FieldError::new(path, what));
        let numbers: Vec<f64> = match self {
            Self::Uniform(a, b) | Self::LogUniform(a, b) => vec![*a, *b],
            Self::Normal { mean, sd } => vec![*mean, *sd],
            Self::LogNormal { median, sd_log } => vec![*median, *sd_log],
            Self::Triangular { min, mode, max } => vec![*min, *mode, *max],
            Self::Choice(values) => values.clone(),
        };
        if let Some(wrong) = numbers.iter().find(|x| !x.is_finite()) {
            return fail(format!("holds {wrong}; every number must be finite"));
        }
        match self {
            Self::Uniform(min, max) | Self::LogUniform(min, max) if max < min => fail(format!(
                "goes from {min} to {max}: the largest value is smaller than the smallest; swap them"
            )),
            Self::LogUniform(min, _) if *min <= 0.0 => {
                fail(format!("begins at {min}; a logarithm needs a smallest value above zero"))
            }
            Self::Normal { sd, .. } if *sd < 0.0 => fail(format!("has sd {sd}; it must be zero or positive")),
            Self::LogNormal { median, .. } if *median <= 0.0 => {
                fail(format!("has median {median}; it must be above zero"))
            }
            Self::LogNormal { sd_log, .. } if *sd_log < 0.0 => {
                fail(format!("has sd_log {sd_log}; it must be zero or positive"))
            }
            Self::Triangular { min, mode, max } if !(min <= mode && mode <= max) => {
                fail(format!("has min {min}, mode {mode}, max {max}; they must be in ascending order"))
            }
            Self::Choice(values) if values.is_empty() => fail("offers no value; give at least one".into()),
            _ => Ok(()),
        }
    }

    /// The `u`-quantile, `0 < u < 1`.
    #[must_use]
    pub fn quantile(&self, u: f64) -> f64 {
        match self {
            Self::Uniform(min, max) => min + (max - min) * u,
            Self::LogUniform(min, max) => {
                let (low, high) = (libm::log(*min), libm::log(*max));
                libm::exp(low + (high - low) * u).clamp(*min, *max)
            }
            Self::Normal { mean, sd } => mean + sd * stylet_stats::normal::quantile(u),
            Self::LogNormal { median, sd_log } => {
                median * libm::exp(sd_log * stylet_stats::normal::quantile(u))
            }
            Self::Triangular { min, mode, max } => {
                let width = max - min;
                if width <= 0.0 {
                    return *min;
                }
                let rising = (mode - min) / width;
                if u < rising {
                    min + libm::sqrt(u * width * (mode - min))
                } else {
                    max - libm::sqrt((1.0 - u) * width * (max - mode))
                }
            }
            Self::Choice(values) => {
                let index = (u * values.len() as f64) as usize;
                values.get(index.min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
            }
        }
    }
}
