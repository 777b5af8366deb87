use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Resolution of the sensor: the force is rounded to a multiple of `q`, halves away from zero.
///
/// Inactive: `q = 0`. Signature: stairs, few distinct values.
/// Source: sensor resolutions, 1/320 N (Nano17) to 1/16 N (Mini45).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Quantisation {
    /// Step `q` in N, 0 to 100. Inactive: 0.
    pub step_n: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "quantisation",
    equation: "round to a multiple of q",
    source: "Sensor resolutions: 1/320 N (Nano17) to 1/16 N (Mini45)",
    signature: "Stairs: few distinct values, equal smallest differences.",
    stage: ChainStage::Sensor,
    parameters: &[ParameterInfo::strength("step_n", "N", "step")
        .allowed(0.0, 100.0)
        .search(0.05, 0.0005, 1.0)
        .log()],
    proposal: Proposal::RawSamples,
    ..EffectInfo::DEFAULTS
};

described!(Quantisation { step_n });

impl Effect for Quantisation {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.step_n <= 0.0
    }
    fn sensor_output(&self, _time_s: f64, _dt_s: f64, force_n: f64, _state: &mut EffectState) -> f64 {
        libm::round(force_n / self.step_n) * self.step_n
    }
}
