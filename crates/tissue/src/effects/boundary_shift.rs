use super::parameters::LAYER;
use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// The face between layers `i` and `i + 1`, moved by `delta`; the faces around it stay where they are.
///
/// The face stays between its neighbours. The last layer has no such face: nothing moves.
///
/// Inactive: `shift_m = 0`. Signature: a rupture at another depth, with the slopes before and after it unchanged.
/// Source: imaging and registration errors of a few millimetres.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct BoundaryShift {
    /// Layer `i` in front of the face, 1-based.
    pub layer: usize,
    /// Shift `delta` in metres, -1 to 1; positive: deeper. Inactive: 0.
    pub shift_m: f64,
}

impl Default for BoundaryShift {
    /// The inactive effect.
    fn default() -> Self {
        Self { layer: 1, shift_m: 0.0 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "boundary_shift",
    equation: "face between layers i and i + 1 moved by delta",
    source: "Imaging and registration errors of a few millimetres",
    signature: "A rupture at another depth, with the slopes before and after it unchanged.",
    stage: ChainStage::Geometry,
    parameters: &[
        ParameterInfo { meaning: "layer in front of the face, 1-based", ..LAYER },
        ParameterInfo::strength("shift_m", "m", "shift of the face, positive: deeper")
            .allowed(-1.0, 1.0)
            .search(0.003, -0.015, 0.015),
    ],
    proposal: Proposal::LayerFaces(1e-3),
    ..EffectInfo::DEFAULTS
};

described!(BoundaryShift { layer; shift_m });

impl Effect for BoundaryShift {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.shift_m == 0.0
    }
    fn modify_layers(&self, slabs: &mut [Slab]) {
        let Some(before) = self.layer.checked_sub(1) else { return };
        let Some([front, back]) = slabs.get_mut(before..).and_then(|rest| rest.get_mut(..2)) else { return };
        let shift = self.shift_m.min(back.thickness_m).max(-front.thickness_m);
        front.thickness_m += shift;
        back.front_m += shift;
        back.thickness_m -= shift;
    }
}
