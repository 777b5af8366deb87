use super::Described;
use crate::effect::{ChainStage, Effect};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A recorded position that is `(1 + eps)` times the true one; the recorded velocity as well.
///
/// Source: stage following errors of 0.6-2.9 % in the measured recordings. Signature: boundaries come
/// at depths that are off in proportion to depth.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct PositionScale {
    /// Relative error `eps`, -0.5 to 1. Neutral: 0.
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
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[0.01]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for PositionScale {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.eps]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [eps] = *values else { return None };
        Some(Self { eps })
    }
}

impl Effect for PositionScale {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.eps == 0.0
    }
    fn position_factor(&self) -> f64 {
        1.0 + self.eps
    }
}
