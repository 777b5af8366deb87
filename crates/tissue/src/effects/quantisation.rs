use super::Described;
use crate::effect::{ChainStage, Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A sensor with a coarse step: round to a multiple of `q` (halves away from zero).
///
/// Source: sensor resolutions, 1/320 N (Nano17) to 1/16 N (Mini45). Signature: stairs, few distinct
/// values.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Quantisation {
    /// Step `q` in N, 0 to 100. Neutral: 0.
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
    extended: None,
    proposal: Proposal::RawSamples,
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for Quantisation {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.step_n]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [step_n] = *values else { return None };
        Some(Self { step_n })
    }
}

impl Effect for Quantisation {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.step_n <= 0.0
    }
    fn sense(&self, _time_s: f64, _dt_s: f64, force_n: f64, _memory: &mut EffectState) -> f64 {
        libm::round(force_n / self.step_n) * self.step_n
    }
}
