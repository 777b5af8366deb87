use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Delay of the force against the position: `f(t) -> f(t - tau)`, linear between samples. The history is part of
/// [`MeasurementState`](crate::MeasurementState).
///
/// Inactive: `tau = 0`. Signature: loops in force against position that open with speed, whatever the depth.
/// Source: latency and misaligned clocks.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct TimeDelay {
    /// Delay `tau` in seconds, 0 to 10. Inactive: 0.
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
    proposal: Proposal::LinearColumns(&[&[&[0.003]], &[&[0.012]], &[&[0.05]], &[&[0.15]]]),
    ..EffectInfo::DEFAULTS
};

described!(TimeDelay { delay_s });

impl Effect for TimeDelay {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.delay_s <= 0.0
    }
    fn delay_s(&self) -> f64 {
        self.delay_s
    }
}
