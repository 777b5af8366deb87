use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Compliance of needle and holder: `z_tip = z - f/k_s` (implicit); `z` and `v` in the force law are those of the tip.
///
/// The force law solves the balance at every sample (module `compliant_needle`); several springs act in series.
///
/// Inactive: `k_s = inf`. Signature: the apparent stiffness is `k k_s/(k + k_s)`, and at a rupture the tip jumps although
/// the base does not. Source: series spring of needle and holder.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct NeedleCompliance {
    /// Stiffness `k_s` in N/m, at least 1. Inactive: infinite (zero or less is taken as rigid, too).
    pub stiffness_n_per_m: f64,
}

impl Default for NeedleCompliance {
    /// The inactive effect.
    fn default() -> Self {
        Self { stiffness_n_per_m: f64::INFINITY }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "needle_compliance",
    equation: "z_tip = z - f/k_s (implicit); z and v in the force law are the tip's",
    source: "Series spring of needle and holder",
    signature: "Apparent stiffness k k_s/(k + k_s); the tip lags in proportion to the force and jumps at a rupture although the base does not.",
    stage: ChainStage::Kinematics,
    parameters: &[ParameterInfo::strength("stiffness_n_per_m", "N/m", "stiffness of needle and holder")
        .allowed(1.0, f64::INFINITY)
        .inactive(f64::INFINITY)
        .search(1000.0, 50.0, 1e5)
        .log()],
    proposal: Proposal::LinearColumns(&[&[&[8000.0]], &[&[1500.0]], &[&[300.0]]]),
    ..EffectInfo::DEFAULTS
};

described!(NeedleCompliance { stiffness_n_per_m });

impl Effect for NeedleCompliance {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        !(self.stiffness_n_per_m > 0.0 && self.stiffness_n_per_m < f64::INFINITY)
    }
}
