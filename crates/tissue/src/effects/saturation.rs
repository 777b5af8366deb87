use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Range of the sensor: `clamp(f, -L, L)`.
///
/// Inactive: `L = inf`. Signature: a flat top, many equal maxima. Source: sensor ranges.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Saturation {
    /// Range `L` in N, 0 or more. Inactive: infinite.
    pub limit_n: f64,
}

impl Default for Saturation {
    /// The inactive effect.
    fn default() -> Self {
        Self { limit_n: f64::INFINITY }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "saturation",
    equation: "clamp(f, -L, L)",
    source: "Sensor ranges",
    signature: "A flat top: many equal maxima.",
    stage: ChainStage::Sensor,
    parameters: &[ParameterInfo::strength("limit_n", "N", "range of the sensor")
        .allowed(0.0, f64::INFINITY)
        .inactive(f64::INFINITY)
        .search(4.0, 0.2, 50.0)
        .demonstration(1.6)
        .log()],
    proposal: Proposal::RawSamples,
    ..EffectInfo::DEFAULTS
};

described!(Saturation { limit_n });

impl Effect for Saturation {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.limit_n == f64::INFINITY
    }
    fn sensor_output(&self, _time_s: f64, _dt_s: f64, force_n: f64, _state: &mut EffectState) -> f64 {
        if force_n > self.limit_n {
            self.limit_n
        } else if force_n < -self.limit_n {
            -self.limit_n
        } else {
            force_n
        }
    }
}
