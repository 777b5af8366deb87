use super::Described;
use crate::effect::{ChainStage, Effect};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A needle or holder that gives: `z_tip = z - f/k_s`, implicit; `z` and `v` in the law are the
/// tip's, and `v_tip = (z_tip - z_tip_before)/dt`.
///
/// Source: series spring of needle and holder (research notes, number 20). Signature: the apparent
/// stiffness is `k k_s/(k + k_s)`, and at a rupture the tip jumps although the base does not.
/// Solved per sample by the law (see its `bending` module); several springs act in series.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct NeedleCompliance {
    /// Stiffness `k_s` in N/m, at least 1. Neutral: infinite (zero or less is taken as rigid, too).
    pub stiffness_n_per_m: f64,
}

impl Default for NeedleCompliance {
    /// The neutral effect.
    fn default() -> Self {
        Self { stiffness_n_per_m: f64::INFINITY }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "needle_compliance",
    equation: "z_tip = z - f/k_s (implicit); z and v in the law are the tip's",
    source: "Series spring of needle and holder",
    signature: "Apparent stiffness k k_s/(k + k_s); the tip lags in proportion to the force and jumps at a rupture although the base does not.",
    stage: ChainStage::Kinematics,
    parameters: &[ParameterInfo::strength("stiffness_n_per_m", "N/m", "stiffness of needle and holder")
        .allowed(1.0, f64::INFINITY)
        .inactive(f64::INFINITY)
        .search(1000.0, 50.0, 1e5)
        .log()],
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[8000.0]], &[&[1500.0]], &[&[300.0]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for NeedleCompliance {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.stiffness_n_per_m]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [stiffness_n_per_m] = *values else { return None };
        Some(Self { stiffness_n_per_m })
    }
}

impl Effect for NeedleCompliance {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        !(self.stiffness_n_per_m > 0.0 && self.stiffness_n_per_m < f64::INFINITY)
    }
}
