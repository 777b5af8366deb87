use super::Described;
use crate::effect::{ChainStage, Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// An offset of the sensor: `+ F_0`, in air too.
///
/// Source: taring; 15 mN in the measured recordings. Signature: constant in air before contact.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ForceBias {
    /// Offset `F_0` in N, -100 to 100. Neutral: 0.
    pub force_n: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "force_bias",
    equation: "+ F_0, in air too",
    source: "Taring: 15 mN in the measured recordings",
    signature: "A constant in air before contact.",
    stage: ChainStage::Sensor,
    parameters: &[ParameterInfo::strength("force_n", "N", "offset")
        .allowed(-100.0, 100.0)
        .search(0.05, -2.0, 2.0)],
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[0.1]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for ForceBias {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.force_n]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [force_n] = *values else { return None };
        Some(Self { force_n })
    }
}

impl Effect for ForceBias {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.force_n == 0.0
    }
    fn sense(&self, _time_s: f64, _dt_s: f64, force_n: f64, _memory: &mut EffectState) -> f64 {
        force_n + self.force_n
    }
}
