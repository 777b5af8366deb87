use crate::chain_stage::ChainStage;
use crate::effect::{Effect, sgn};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Viscous friction that differs between advance and retraction: `b_i -> b_i (1 + eps sgn v)` for every layer, in
/// the cumulative friction `D` as well.
///
/// Inactive: `eps = 0`. Signature: the friction line has another slope in retraction; not identifiable without one.
/// Source: Okamura, Simone, O'Leary 2004, table I (`b+` 212, `b-` 293 N s/m²).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct AsymmetricFriction {
    /// Asymmetry `eps`, -1 to 1. Inactive: 0.
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
    proposal: Proposal::LinearColumns(&[&[&[0.01]]]),
    ..EffectInfo::DEFAULTS
};

described!(AsymmetricFriction { eps });

impl Effect for AsymmetricFriction {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.eps == 0.0
    }
    fn friction_factor(&self, v_mps: f64) -> f64 {
        1.0 + self.eps * sgn(v_mps)
    }
}
