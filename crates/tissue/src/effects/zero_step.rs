use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A step of the sensor's zero: `+ F_s` from time `t_s` on, in air too. A scenario may list several.
///
/// Inactive: `F_s = 0`. Signature: the force jumps between two samples, without a change of velocity, and stays.
/// Source: taring during a recording, mechanical shocks, amplifiers that change their range.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ZeroStep {
    /// Time `t_s` of the step in s, 0 to 1e9.
    pub time_s: f64,
    /// Size `F_s` in N, -1000 to 1000. Inactive: 0.
    pub step_n: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "zero_step",
    equation: "+ F_s from time t_s on, in air too",
    source: "Taring during a recording, shocks, amplifiers that change their range",
    signature: "The force jumps between two samples, without a change of velocity, and stays.",
    stage: ChainStage::Sensor,
    parameters: &[
        ParameterInfo::shape("time_s", "s", "time of the step").allowed(0.0, 1e9).search(5.0, 0.0, 100.0),
        ParameterInfo::strength("step_n", "N", "size of the step")
            .allowed(-1000.0, 1000.0)
            .search(0.2, -100.0, 100.0),
    ],
    proposal: Proposal::RawSamples,
    ..EffectInfo::DEFAULTS
};

described!(ZeroStep { time_s, step_n });

impl Effect for ZeroStep {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.step_n == 0.0
    }
    fn sensor_output(&self, time_s: f64, _dt_s: f64, force_n: f64, _state: &mut EffectState) -> f64 {
        if time_s >= self.time_s { force_n + self.step_n } else { force_n }
    }
    /// The part of the interval after the step counts.
    fn mean_sensor_output(
        &self,
        time_s: f64,
        span_s: f64,
        _samples: f64,
        force_n: f64,
        state: &mut EffectState,
    ) -> f64 {
        if span_s <= 0.0 {
            return self.sensor_output(time_s, span_s, force_n, state);
        }
        let after = ((time_s + 0.5 * span_s - self.time_s) / span_s).clamp(0.0, 1.0);
        force_n + self.step_n * after
    }
}
