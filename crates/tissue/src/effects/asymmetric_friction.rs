use super::Described;
use crate::effect::{ChainStage, Effect, sgn};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Friction that differs between advance and retraction: `b_i -> b_i (1 + eps sgn v)`, in the
/// cumulative friction `D` as well.
///
/// Source: Okamura, Simone, O'Leary 2004, table I (b+ 212, b- 293 N s/m^2). Signature: the friction
/// line has another slope in retraction; invisible without a retraction.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct AsymmetricFriction {
    /// Asymmetry `eps`, -1 to 1. Neutral: 0.
    pub eps: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "asymmetric_friction",
    equation: "b_i -> b_i (1 + eps sgn v)",
    source: "Okamura, Simone, O'Leary 2004, table I",
    signature: "Viscous friction has another size in retraction than in advance, in proportion to speed and length.",
    stage: ChainStage::Friction,
    parameters: &[ParameterInfo::strength("eps", "", "asymmetry between advance and retraction")
        .allowed(-1.0, 1.0)
        .search(0.2, -0.9, 0.9)],
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[0.01]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for AsymmetricFriction {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.eps]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [eps] = *values else { return None };
        Some(Self { eps })
    }
}

impl Effect for AsymmetricFriction {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.eps == 0.0
    }
    fn friction_factor(&self, v_mps: f64) -> f64 {
        1.0 + self.eps * sgn(v_mps)
    }
}
