use super::Described;
use crate::effect::{ChainStage, Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A sensor that is not calibrated: `f -> (1 + eps) f`.
///
/// Source: calibration errors of force sensors. Signature: all forces scaled; invisible once
/// `K_i, b_i, F_i` are fitted again, so check it with a known load.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ForceGain {
    /// Relative error `eps`, -0.99 to 10. Neutral: 0.
    pub eps: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "force_gain",
    equation: "f -> (1 + eps) f",
    source: "Calibration of force sensors",
    signature: "All forces scaled, known loads too; invisible in the shape of an insertion.",
    stage: ChainStage::Sensor,
    parameters: &[ParameterInfo::strength("eps", "", "relative error of the force")
        .allowed(-0.99, 10.0)
        .search(0.05, -0.5, 0.5)],
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[0.01]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for ForceGain {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.eps]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [eps] = *values else { return None };
        Some(Self { eps })
    }
}

impl Effect for ForceGain {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.eps == 0.0
    }
    fn sense(&self, _time_s: f64, _dt_s: f64, force_n: f64, _memory: &mut EffectState) -> f64 {
        (1.0 + self.eps) * force_n
    }
}
