use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, lag_weights, same_step};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// First-order lag of sensor or filter: `tau y' = f - y`, in steady state at the first sample.
///
/// Integrated exactly for a force that is linear between samples, so that the lag is the same at every sampling rate.
///
/// Inactive: `tau = 0`. Signature: a drop is extended in time, not in depth.
/// Source: first-order filter of the laboratory (0.01 at 200 Hz is 0.5 s).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct LowPassLag {
    /// Time constant `tau` in seconds, 0 to 100. Inactive: 0.
    pub time_constant_s: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "low_pass_lag",
    equation: "tau y' = f - y",
    source: "The laboratory's filter: 0.01 at 200 Hz is 0.5 s",
    signature: "A drop becomes a first-order step, constant in time, not in depth.",
    stage: ChainStage::Sensor,
    parameters: &[ParameterInfo::strength("time_constant_s", "s", "time constant")
        .allowed(0.0, 100.0)
        .search(0.05, 0.002, 2.0)
        .log()],
    proposal: Proposal::LinearColumns(&[&[&[0.004]], &[&[0.02]], &[&[0.08]], &[&[0.3]]]),
    ..EffectInfo::DEFAULTS
};

described!(LowPassLag { time_constant_s });

impl Effect for LowPassLag {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.time_constant_s <= 0.0
    }
    fn has_state(&self) -> bool {
        true
    }
    /// State: output, input, whether started, step, its two weights.
    fn sensor_output(&self, _time_s: f64, dt_s: f64, force_n: f64, state: &mut EffectState) -> f64 {
        if state[2] == 0.0 {
            state[2] = 1.0;
            state[0] = force_n;
        } else if dt_s > 0.0 {
            if !same_step(dt_s, state[3]) {
                let (keep, ramp) = lag_weights(dt_s, self.time_constant_s);
                state[3..6].copy_from_slice(&[dt_s, keep, ramp]);
            }
            let [output, input, _, _, keep, ramp, ..] = *state;
            state[0] = input + keep * (output - input) + ramp * (force_n - input);
        }
        state[1] = force_n;
        state[0]
    }
    /// State: interval, decay over it, output at the end of the previous interval, whether started. With the mean input `x`
    /// the mean output follows from `tau y' = x - y` integrated over the interval.
    fn mean_sensor_output(
        &self,
        _time_s: f64,
        span_s: f64,
        _samples: f64,
        force_n: f64,
        state: &mut EffectState,
    ) -> f64 {
        if state[7] == 0.0 {
            state[7] = 1.0;
            state[6] = force_n;
        }
        let before = state[6];
        if span_s <= 0.0 {
            return before;
        }
        let ratio = span_s / self.time_constant_s;
        if !same_step(span_s, state[3]) {
            (state[3], state[4]) = (span_s, -libm::expm1(-ratio));
        }
        let change = state[4] * (force_n - before);
        state[6] = before + change;
        force_n - change / ratio
    }
    fn sensor_output_at_end(&self, time_s: f64, span_s: f64, force_n: f64, state: &mut EffectState) -> f64 {
        self.mean_sensor_output(time_s, span_s, 1.0, force_n, state);
        state[6]
    }
}
