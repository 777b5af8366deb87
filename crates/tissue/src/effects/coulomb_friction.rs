use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, InsertionState, TipState, sgn};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Dry friction along the shaft: `f_B += c sgn(v) sum l_i`.
///
/// Inactive: `c = 0`. Signature: a plateau that does not depend on speed, with a step at reversal; not identifiable at
/// one constant velocity. Source: Okamura, Simone, O'Leary 2004 (Karnopp model, per unit length).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct CoulombFriction {
    /// Friction per metre of needle inside, `c` in N/m, 0 to 10 000. Inactive: 0.
    pub c_n_per_m: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "coulomb_friction",
    equation: "+ c sgn(v) sum l_i",
    source: "Okamura, Simone, O'Leary 2004 (Karnopp model, per unit length)",
    signature: "A plateau that does not depend on speed, with a step at reversal, in proportion to the length inside.",
    stage: ChainStage::Friction,
    parameters: &[ParameterInfo::strength("c_n_per_m", "N/m", "dry friction per metre of needle inside")
        .allowed(0.0, 1e4)
        .search(3.0, 0.05, 100.0)
        .log()],
    proposal: Proposal::LinearColumns(&[&[&[1.0]]]),
    nested_in: &["stribeck_friction", "presliding_friction"],
    ..EffectInfo::DEFAULTS
};

described!(CoulombFriction { c_n_per_m });

impl Effect for CoulombFriction {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.c_n_per_m == 0.0
    }
    fn shaft_force(&self, tip: &TipState, at: &InsertionState, _state: &mut EffectState) -> f64 {
        self.c_n_per_m * sgn(tip.v_mps) * at.inside_m
    }
}
