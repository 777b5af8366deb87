use super::Described;
use crate::effect::{ChainStage, Effect, EffectState, TipState, sgn};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// Force of cutting at the tip: `+ F_c` while advancing (`sgn v > 0`) with the tip inside a layer
/// that has been punctured (puncture force given) or inside any tissue (puncture force not given).
///
/// Source: Okamura, Simone, O'Leary 2004 (0.94 N in liver). Signature: an offset during advance only,
/// zero in hold and retraction.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct CuttingForce {
    /// Cutting force `F_c` in N, 0 to 100. Neutral: 0.
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
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[0.1]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for CuttingForce {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.force_n]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [force_n] = *values else { return None };
        Some(Self { force_n })
    }
}

impl Effect for CuttingForce {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.force_n == 0.0
    }
    fn tip_force(&self, moment: &TipState, slabs: &[Slab], _memory: &mut EffectState) -> f64 {
        if sgn(moment.v_mps) <= 0.0 {
            return 0.0;
        }
        let z = moment.z_m;
        let cut = slabs.iter().enumerate().any(|(i, slab)| {
            z >= slab.front_m && z < slab.far_m() && (i < moment.ruptured || slab.puncture_n == f64::INFINITY)
        });
        if cut { self.force_n } else { 0.0 }
    }
}
