use super::Described;
use crate::effect::{ChainStage, Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A sensor that drifts: `+ rate t`, `t` being the recording's time.
///
/// Source: thermal drift of strain gauges. Signature: slow, and the force in air does not come back
/// after the needle has left.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ForceDrift {
    /// Rate in N/s, -10 to 10. Neutral: 0.
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
        .search(0.005, -0.1, 0.1)],
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[1e-3]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for ForceDrift {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.rate_n_per_s]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [rate_n_per_s] = *values else { return None };
        Some(Self { rate_n_per_s })
    }
}

impl Effect for ForceDrift {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.rate_n_per_s == 0.0
    }
    fn sense(&self, time_s: f64, _dt_s: f64, force_n: f64, _memory: &mut EffectState) -> f64 {
        force_n + self.rate_n_per_s * time_s
    }
}
