use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Tissue that stiffens with indentation: `f_K = K x (1 + kappa x)`.
///
/// Inactive: `kappa = 0`. Signature: the loading slope grows with depth before each rupture, the same at all speeds.
/// Source: Okamura, Simone, O'Leary 2004 (`f = a1 z + a2 z²` before puncture).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct NonlinearElasticity {
    /// Stiffening `kappa` in 1/m, -100 to 1000; negative: softening. Inactive: 0.
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
    proposal: Proposal::LinearColumns(&[&[&[1.0]]]),
    ..EffectInfo::DEFAULTS
};

described!(NonlinearElasticity { kappa_per_m });

impl Effect for NonlinearElasticity {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.kappa_per_m == 0.0
    }
    fn elastic_force(&self, _k_n_per_m: f64, x_m: f64, force_n: f64) -> f64 {
        force_n * (1.0 + self.kappa_per_m * x_m)
    }
}
