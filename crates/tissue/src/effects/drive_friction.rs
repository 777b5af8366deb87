use super::Described;
use crate::effect::{ChainStage, Effect, sgn};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Dry friction of the drive that the sensor feels: `+ F_j sgn(v)`, in air too (virtual sensor).
///
/// Source: joint friction of the KUKA LWR, 0.24-0.68 N m, about 0.3-0.9 N at the tip. Signature: a
/// step at reversal, also in air.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct DriveFriction {
    /// Friction `F_j` in N, 0 to 100. Neutral: 0.
    pub force_n: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "drive_friction",
    equation: "+ F_j sgn(v), in air too",
    source: "Joint friction of the KUKA LWR, 0.24-0.68 N m",
    signature: "A step at every reversal, also in air, of the same size at all depths.",
    stage: ChainStage::Tool,
    parameters: &[ParameterInfo::strength("force_n", "N", "dry friction of the drive")
        .allowed(0.0, 100.0)
        .search(0.2, 0.01, 3.0)
        .log()],
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[0.1]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for DriveFriction {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.force_n]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [force_n] = *values else { return None };
        Some(Self { force_n })
    }
}

impl Effect for DriveFriction {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.force_n == 0.0
    }
    fn tool_force(&self, v_mps: f64, _a_mps2: f64) -> f64 {
        self.force_n * sgn(v_mps)
    }
}
