use super::Described;
use crate::effect::{ChainStage, Effect};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// A layer that lets go of the needle at a depth of its own on the way back.
///
/// In the base law a layer touches the shaft until the tip is back at its front face. Here it lets go `depth` beyond it: with the base
/// law its friction ends there while the tip moves out; `shaft_slip` drops its hold within 0.2 mm. A layer that is pulled along
/// (`shaft_slip`) may also let go before its front face: `depth` below zero, which means nothing to the base law.
///
/// Source: steps of the force on the way out of skin and muscle phantoms, 3.4 and 15.6 mm deep. Signature: a sudden step of the force
/// towards zero on the way back.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ReleaseDepth {
    /// Layer, 1-based; one that is not there changes nothing.
    pub layer: usize,
    /// Depth in metres beyond the layer's front face, -0.1 to 0.1. Neutral: 0.
    pub depth_m: f64,
}

impl Default for ReleaseDepth {
    /// The neutral effect.
    fn default() -> Self {
        Self { layer: 1, depth_m: 0.0 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "release_depth",
    equation: "on the way back layer i touches the shaft while z > s_i + depth",
    source: "Steps of the force on the way out of skin and muscle phantoms",
    signature: "A sudden step of the force towards zero on the way back.",
    stage: ChainStage::Geometry,
    parameters: &[
        ParameterInfo::shape("layer", "", "layer, 1-based")
            .allowed(1.0, 1000.0)
            .inactive(1.0)
            .search(1.0, 1.0, 10.0)
            .integer(),
        ParameterInfo::strength("depth_m", "m", "where the layer lets go, beyond its front face")
            .allowed(-0.1, 0.1)
            .search(2e-3, -5e-3, 2e-2)
            .between_recordings_sd(5e-4),
    ],
    extended: None,
    proposal: Proposal::PerLayer,
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for ReleaseDepth {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.layer as f64, self.depth_m]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [layer, depth_m] = *values else { return None };
        let layer = libm::round(layer) as usize; // saturates, and NaN is zero, which is no layer
        Some(Self { layer, depth_m })
    }
}

impl Effect for ReleaseDepth {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.depth_m == 0.0
    }
    fn shape(&self, slabs: &mut [Slab]) {
        if let Some(slab) = self.layer.checked_sub(1).and_then(|i| slabs.get_mut(i)) {
            slab.release_m += self.depth_m;
        }
    }
}
