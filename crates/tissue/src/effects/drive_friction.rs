use crate::chain_stage::ChainStage;
use crate::effect::{BaseMotion, Effect, EffectState, sgn};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Dry friction of the drive in the measured force: `+ F_j sgn(v)`, in air too (virtual sensor).
///
/// Inactive: `F_j = 0`. Signature: a step at every reversal, also in air.
/// Source: joint friction of the KUKA LWR, 0.24-0.68 N m, about 0.3-0.9 N at the tip.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct DriveFriction {
    /// Friction `F_j` in N, 0 to 100. Inactive: 0.
    pub force_n: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "drive_friction",
    equation: "+ F_j sgn(v), in air too",
    source: "Joint friction of the KUKA LWR, 0.24-0.68 N m",
    signature: "A step at every reversal, also in air, of the same size at all depths.",
    stage: ChainStage::Tool,
    parameters: &[ParameterInfo::strength("force_n", "N", "dry friction of the drive")
        .allowed(0.0, 100.0)
        .search(0.2, 0.01, 3.0)
        .log()],
    proposal: Proposal::LinearColumns(&[&[&[0.1]]]),
    ..EffectInfo::DEFAULTS
};

described!(DriveFriction { force_n });

impl Effect for DriveFriction {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.force_n == 0.0
    }
    fn tool_force(&self, base: &BaseMotion, _force_n: f64, _state: &mut EffectState) -> f64 {
        self.force_n * sgn(base.v_mps)
    }
}
