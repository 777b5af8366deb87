use super::Described;
use crate::effect::{ChainStage, Effect};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A force that arrives late against the position: `f(t) -> f(t - tau)`, linear between samples.
///
/// Source: latency and misaligned clocks. Signature: loops in force against position that open with
/// the speed, whatever the depth. The history lives in
/// [`MeasurementState`](crate::MeasurementState).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct TimeDelay {
    /// Delay `tau` in seconds, 0 to 10. Neutral: 0.
    pub delay_s: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "time_delay",
    equation: "f(t) -> f(t - tau)",
    source: "Latency and misaligned clocks",
    signature: "Starts, stops and drops come late by the same time at every depth and speed.",
    stage: ChainStage::Sensor,
    parameters: &[ParameterInfo::strength("delay_s", "s", "delay of the force")
        .allowed(0.0, 10.0)
        .search(0.03, 0.001, 0.5)
        .log()],
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[0.003]], &[&[0.012]], &[&[0.05]], &[&[0.15]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for TimeDelay {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.delay_s]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [delay_s] = *values else { return None };
        Some(Self { delay_s })
    }
}

impl Effect for TimeDelay {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.delay_s <= 0.0
    }
    fn delay_s(&self) -> f64 {
        self.delay_s
    }
}
