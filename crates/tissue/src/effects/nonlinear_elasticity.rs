use super::Described;
use crate::effect::{ChainStage, Effect};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Tissue that stiffens with indentation: `f_K = K x (1 + kappa x)`.
///
/// Source: Okamura, Simone, O'Leary 2004 (`f = a1 z + a2 z^2` before puncture). Signature: the
/// loading slope grows with depth before each rupture, the same at all speeds.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct NonlinearElasticity {
    /// Stiffening `kappa` in 1/m, -100 to 1000; negative: softening. Neutral: 0.
    pub kappa_per_m: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "nonlinear_elasticity",
    equation: "f_K = K x (1 + kappa x)",
    source: "Okamura, Simone, O'Leary 2004",
    signature: "The loading slope grows with depth before each rupture, the same at all speeds.",
    stage: ChainStage::Elastic,
    parameters: &[ParameterInfo::strength("kappa_per_m", "1/m", "stiffening with indentation")
        .allowed(-100.0, 1000.0)
        .search(10.0, -5.0, 100.0)],
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[1.0]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for NonlinearElasticity {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.kappa_per_m]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [kappa_per_m] = *values else { return None };
        Some(Self { kappa_per_m })
    }
}

impl Effect for NonlinearElasticity {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.kappa_per_m == 0.0
    }
    fn elastic(&self, _k_n_per_m: f64, x_m: f64, force_n: f64) -> f64 {
        force_n * (1.0 + self.kappa_per_m * x_m)
    }
}
