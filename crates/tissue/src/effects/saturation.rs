use super::Described;
use crate::effect::{ChainStage, Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A sensor at the end of its range: `clamp(f, -L, L)`.
///
/// Source: sensor ranges. Signature: a flat top, many equal maxima.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Saturation {
    /// Range `L` in N, 0 or more. Neutral: infinite.
    pub limit_n: f64,
}

impl Default for Saturation {
    /// The neutral effect.
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
    extended: None,
    proposal: Proposal::RawSamples,
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for Saturation {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.limit_n]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [limit_n] = *values else { return None };
        Some(Self { limit_n })
    }
}

impl Effect for Saturation {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.limit_n == f64::INFINITY
    }
    fn sense(&self, _time_s: f64, _dt_s: f64, force_n: f64, _memory: &mut EffectState) -> f64 {
        if force_n > self.limit_n {
            self.limit_n
        } else if force_n < -self.limit_n {
            -self.limit_n
        } else {
            force_n
        }
    }
}
