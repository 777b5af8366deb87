use super::Described;
use crate::effect::{ChainStage, Effect, EffectState, lag_weights, same_step};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A sensor or filter that lags: first order, `tau y' = f - y`, at rest at the first sample.
///
/// Integrated exactly for a force that is linear between samples, so that the lag is the same at every
/// sampling rate.
///
/// Source: the laboratory's filter (0.01 at 200 Hz is 0.5 s). Signature: a drop lasts longer than the
/// sampling, for a time and not for a depth.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct LowPassLag {
    /// Time constant `tau` in seconds, 0 to 100. Neutral: 0.
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
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[0.004]], &[&[0.02]], &[&[0.08]], &[&[0.3]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for LowPassLag {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.time_constant_s]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [time_constant_s] = *values else { return None };
        Some(Self { time_constant_s })
    }
}

impl Effect for LowPassLag {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.time_constant_s <= 0.0
    }
    fn remembers(&self) -> bool {
        true
    }
    /// Memory: output, input, whether started, step, its two weights.
    fn sense(&self, _time_s: f64, dt_s: f64, force_n: f64, memory: &mut EffectState) -> f64 {
        if memory[2] == 0.0 {
            memory[2] = 1.0;
            memory[0] = force_n;
        } else if dt_s > 0.0 {
            if !same_step(dt_s, memory[3]) {
                let (keep, ramp) = lag_weights(dt_s, self.time_constant_s);
                memory[3..6].copy_from_slice(&[dt_s, keep, ramp]);
            }
            let [output, input, _, _, keep, ramp, ..] = *memory;
            memory[0] = input + keep * (output - input) + ramp * (force_n - input);
        }
        memory[1] = force_n;
        memory[0]
    }
    /// Memory: span and what of a step is through after it, output at the end of the span before, and whether started. With `x` the mean that comes in, the mean of
    /// `y` follows from `tau y' = x - y` integrated over the span.
    fn sense_mean(
        &self,
        _time_s: f64,
        span_s: f64,
        _samples: f64,
        force_n: f64,
        memory: &mut EffectState,
    ) -> f64 {
        if memory[7] == 0.0 {
            memory[7] = 1.0;
            memory[6] = force_n;
        }
        let before = memory[6];
        if span_s <= 0.0 {
            return before;
        }
        let ratio = span_s / self.time_constant_s;
        if !same_step(span_s, memory[3]) {
            (memory[3], memory[4]) = (span_s, -libm::expm1(-ratio));
        }
        let change = memory[4] * (force_n - before);
        memory[6] = before + change;
        force_n - change / ratio
    }
    fn sense_after(&self, time_s: f64, span_s: f64, force_n: f64, memory: &mut EffectState) -> f64 {
        self.sense_mean(time_s, span_s, 1.0, force_n, memory);
        memory[6]
    }
}
