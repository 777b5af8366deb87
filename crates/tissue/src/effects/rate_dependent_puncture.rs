use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Puncture force that depends on speed: `F_i -> F_i max(0.1, 1 + alpha ln(abs(v)/v0))`, `v0` = 1 mm/s, `abs(v)` at
/// least 0.1 mm/s.
///
/// Inactive: `alpha = 0`. Signature: the peak changes with speed while the loading curve does not.
/// Source: van Gerwen, Dankelman, van den Dobbelsteen 2012 (living tissue: falls with speed).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct RateDependentPuncture {
    /// Change per factor e in speed, `alpha`, -2 to 2. Inactive: 0.
    pub alpha: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "rate_dependent_puncture",
    equation: "F_i -> F_i max(0.1, 1 + alpha ln(|v|/v0)), v0 = 1 mm/s, |v| at least 0.1 mm/s",
    source: "van Gerwen, Dankelman, van den Dobbelsteen 2012",
    signature: "The peak before a puncture changes with speed while the loading curve does not.",
    stage: ChainStage::Puncture,
    parameters: &[ParameterInfo::strength("alpha", "", "change of the puncture force per factor e in speed")
        .allowed(-2.0, 2.0)
        .search(0.1, -0.5, 0.5)],
    proposal: Proposal::LinearColumns(&[&[&[0.02]]]),
    ..EffectInfo::DEFAULTS
};

described!(RateDependentPuncture { alpha });

impl Effect for RateDependentPuncture {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.alpha == 0.0
    }
    fn puncture_force(&self, threshold_n: f64, v_mps: f64) -> f64 {
        if threshold_n == f64::INFINITY {
            return threshold_n;
        }
        let speed = v_mps.abs().max(1e-4) / 1e-3;
        threshold_n * (1.0 + self.alpha * libm::log(speed)).max(0.1)
    }
}
