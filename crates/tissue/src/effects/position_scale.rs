use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Scale error of the recorded position and velocity: recorded `z = (1 + eps) z`.
///
/// Inactive: `eps = 0`. Signature: boundaries at depths that are off in proportion to depth.
/// Source: following errors of the stage, 0.6-2.9 % in the measured recordings.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct PositionScale {
    /// Relative error `eps`, -0.5 to 1. Inactive: 0.
    pub eps: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "position_scale",
    equation: "recorded z = (1 + eps) z",
    source: "Following errors of 0.6-2.9 % in the measured recordings",
    signature: "All boundaries come at depths that are off in proportion to depth.",
    stage: ChainStage::Position,
    parameters: &[ParameterInfo::strength("eps", "", "relative error of the recorded position")
        .allowed(-0.5, 1.0)
        .search(0.02, -0.2, 0.2)],
    proposal: Proposal::LinearColumns(&[&[&[0.01]]]),
    ..EffectInfo::DEFAULTS
};

described!(PositionScale { eps });

impl Effect for PositionScale {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.eps == 0.0
    }
    fn position_factor(&self) -> f64 {
        1.0 + self.eps
    }
}
