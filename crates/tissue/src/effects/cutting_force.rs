use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, InsertionState, TipState, sgn};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Cutting force at the tip: `+ F_c` while advancing (`sgn v > 0`) with the tip inside a punctured layer, or inside
/// any layer without a puncture force.
///
/// Inactive: `F_c = 0`. Signature: an offset during advance only, zero in hold and retraction.
/// Source: Okamura, Simone, O'Leary 2004 (0.94 N in liver).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct CuttingForce {
    /// Cutting force `F_c` in N, 0 to 100. Inactive: 0.
    pub force_n: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "cutting_force",
    equation: "+ F_c while advancing with the tip inside a punctured layer (or any layer without puncture force)",
    source: "Okamura, Simone, O'Leary 2004 (0.94 N in liver)",
    signature: "An offset during advance only: zero in hold and retraction, gone behind the last layer.",
    stage: ChainStage::Tip,
    parameters: &[ParameterInfo::strength("force_n", "N", "cutting force")
        .allowed(0.0, 100.0)
        .search(0.3, 0.01, 3.0)
        .log()],
    proposal: Proposal::LinearColumns(&[&[&[0.1]]]),
    ..EffectInfo::DEFAULTS
};

described!(CuttingForce { force_n });

impl Effect for CuttingForce {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.force_n == 0.0
    }
    fn tip_force(&self, tip: &TipState, at: &InsertionState, _state: &mut EffectState) -> f64 {
        if sgn(tip.v_mps) <= 0.0 {
            return 0.0;
        }
        let z = tip.z_m;
        let cut = at.slabs.iter().enumerate().any(|(i, slab)| {
            z >= slab.front_m && z < slab.far_m() && (i < tip.ruptured || slab.puncture_n == f64::INFINITY)
        });
        if cut { self.force_n } else { 0.0 }
    }
}
