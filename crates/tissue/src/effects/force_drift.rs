use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Sensor drift, linear in the recording's time: `+ rate t`.
///
/// Inactive: `rate = 0`. Signature: the force in air after the insertion differs from that before.
/// Source: thermal drift of strain gauges.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ForceDrift {
    /// Rate in N/s, -10 to 10. Inactive: 0.
    pub rate_n_per_s: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "force_drift",
    equation: "+ rate t",
    source: "Thermal drift of strain gauges",
    signature: "Slow in time, and the force in air does not return to zero at the end.",
    stage: ChainStage::Sensor,
    parameters: &[ParameterInfo::strength("rate_n_per_s", "N/s", "drift")
        .allowed(-10.0, 10.0)
        .search(0.005, -1.0, 1.0)],
    proposal: Proposal::LinearColumns(&[&[&[1e-3]]]),
    baseline: true,
    ..EffectInfo::DEFAULTS
};

described!(ForceDrift { rate_n_per_s });

impl Effect for ForceDrift {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.rate_n_per_s == 0.0
    }
    fn sensor_output(&self, time_s: f64, _dt_s: f64, force_n: f64, _state: &mut EffectState) -> f64 {
        force_n + self.rate_n_per_s * time_s
    }
}
