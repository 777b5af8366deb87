use crate::effect::{Effect, Place};

/// Tissue that stiffens with indentation: `f_K = K x (1 + kappa x)`.
///
/// Source: Okamura, Simone, O'Leary 2004 (`f = a1 z + a2 z^2` before puncture). Signature: the
/// loading slope grows with depth before each rupture, the same at all speeds.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct NonlinearElasticity {
    /// Stiffening `kappa` in 1/m. Neutral: 0.
    pub kappa_per_m: f64,
}

impl Effect for NonlinearElasticity {
    fn id(&self) -> &'static str {
        "nonlinear_elasticity"
    }
    fn place(&self) -> Place {
        Place::Elastic
    }
    fn is_neutral(&self) -> bool {
        self.kappa_per_m == 0.0
    }
    fn elastic(&self, _k_n_per_m: f64, x_m: f64, force_n: f64) -> f64 {
        force_n * (1.0 + self.kappa_per_m * x_m)
    }
}
