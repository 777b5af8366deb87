use super::Described;
use crate::effect::{ChainStage, Effect};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// A boundary that is not where it was thought to be: the face between layers `i` and `i + 1` is
/// moved by `delta`; the faces around it stay.
///
/// The face stays between its neighbours. A layer that has no next one has no such face: nothing
/// moves.
///
/// Source: imaging and registration errors of a few millimetres; tenting (research notes, 16).
/// Signature: a rupture at another depth, with the slopes before and after unchanged.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct BoundaryShift {
    /// Layer `i` in front of the face, 1-based.
    pub layer: usize,
    /// Shift `delta` in metres, -1 to 1; positive: deeper. Neutral: 0.
    pub shift_m: f64,
}

impl Default for BoundaryShift {
    /// The neutral effect.
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
        ParameterInfo::shape("layer", "", "layer in front of the face, 1-based")
            .allowed(1.0, 1000.0)
            .inactive(1.0)
            .search(1.0, 1.0, 10.0)
            .integer(),
        ParameterInfo::strength("shift_m", "m", "shift of the face, positive: deeper")
            .allowed(-1.0, 1.0)
            .search(0.003, -0.015, 0.015),
    ],
    extended: None,
    proposal: Proposal::LayerFaces(1e-3),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for BoundaryShift {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.layer as f64, self.shift_m]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [layer, shift_m] = *values else { return None };
        let layer = libm::round(layer) as usize; // saturates, and NaN is zero, which moves nothing
        Some(Self { layer, shift_m })
    }
}

impl Effect for BoundaryShift {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.shift_m == 0.0
    }
    fn shape(&self, slabs: &mut [Slab]) {
        let Some(before) = self.layer.checked_sub(1) else { return };
        let Some([front, back]) = slabs.get_mut(before..).and_then(|rest| rest.get_mut(..2)) else { return };
        let shift = self.shift_m.min(back.thickness_m).max(-front.thickness_m);
        front.thickness_m += shift;
        back.front_m += shift;
        back.thickness_m -= shift;
    }
}
