use super::parameters::{LAYER, layer_mut};
use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo};
use crate::layer_geometry::Slab;

/// The depth at which a layer releases the shaft in retraction: layer `i` touches the shaft while
/// `z > s_i + depth`.
///
/// In the base law the layer touches the shaft until the tip is back at its front face. With `depth > 0` its friction ends
/// earlier; `shaft_slip` drops its force within 0.2 mm. `depth < 0` has a meaning for `shaft_slip` only, where the layer
/// is pulled along and is released in front of its face.
///
/// Inactive: `depth = 0`. Signature: a sudden step of the force towards zero in retraction.
/// Source: force steps during retraction from skin and muscle phantoms, at depths of 3.4 and 15.6 mm.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ReleaseDepth {
    /// Layer, 1-based; without such a layer the effect is inactive.
    pub layer: usize,
    /// Depth in metres beyond the layer's front face, -0.1 to 0.1. Inactive: 0.
    pub depth_m: f64,
}

impl Default for ReleaseDepth {
    /// The inactive effect.
    fn default() -> Self {
        Self { layer: 1, depth_m: 0.0 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "release_depth",
    equation: "in retraction layer i touches the shaft while z > s_i + depth",
    source: "Force steps during retraction from skin and muscle phantoms",
    signature: "A sudden step of the force towards zero in retraction.",
    stage: ChainStage::Geometry,
    parameters: &[
        LAYER,
        ParameterInfo::strength("depth_m", "m", "release depth beyond the layer's front face")
            .allowed(-0.1, 0.1)
            .search(2e-3, -5e-3, 2e-2)
            .between_recordings_sd(5e-4),
    ],
    ..EffectInfo::DEFAULTS
};

described!(ReleaseDepth { layer; depth_m });

impl Effect for ReleaseDepth {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.depth_m == 0.0
    }
    fn modify_layers(&self, slabs: &mut [Slab]) {
        if let Some(slab) = layer_mut(slabs, self.layer) {
            slab.release_m += self.depth_m;
        }
    }
}
