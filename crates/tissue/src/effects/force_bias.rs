use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Offset of the sensor: `+ F_0`, in air too.
///
/// Inactive: `F_0 = 0`. Signature: a constant in air before contact. Source: taring; 15 mN in the measured recordings.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ForceBias {
    /// Offset `F_0` in N, -100 to 100. Inactive: 0.
    pub force_n: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "force_bias",
    equation: "+ F_0, in air too",
    source: "Taring: 15 mN in the measured recordings",
    signature: "A constant in air before contact.",
    stage: ChainStage::Sensor,
    parameters: &[ParameterInfo::strength("force_n", "N", "offset")
        .allowed(-100.0, 100.0)
        .search(0.05, -100.0, 100.0)],
    proposal: Proposal::LinearColumns(&[&[&[0.1]]]),
    baseline: true,
    ..EffectInfo::DEFAULTS
};

described!(ForceBias { force_n });

impl Effect for ForceBias {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.force_n == 0.0
    }
    fn sensor_output(&self, _time_s: f64, _dt_s: f64, force_n: f64, _state: &mut EffectState) -> f64 {
        force_n + self.force_n
    }
}
