use super::parameters::{LAYER, layer_mut};
use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo};
use crate::layer_geometry::Slab;

/// Stiffening of one layer: `K_i kappa_i x²` is added to its elastic force.
///
/// Together with `nonlinear_elasticity` the layer has `f_K = K_i x (1 + (kappa + kappa_i) x)`.
///
/// Inactive: `kappa_i = 0`. Signature: loading curves of different shape in different layers.
/// Source: skin and muscle phantoms, one with a quadratic loading curve, one with a nearly straight one.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct LayerStiffening {
    /// Layer, 1-based; without such a layer the effect is inactive.
    pub layer: usize,
    /// Stiffening `kappa_i` beyond that of all layers in 1/m, -2000 to 10 000. Inactive: 0.
    pub kappa_per_m: f64,
}

impl Default for LayerStiffening {
    /// The inactive effect.
    fn default() -> Self {
        Self { layer: 1, kappa_per_m: 0.0 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "layer_stiffening",
    equation: "f_K = K_i x (1 + (kappa + kappa_i) x) in layer i",
    source: "Skin and muscle phantoms, with loading curves of different shape",
    signature: "The loading slope grows with depth in one layer and not in another.",
    stage: ChainStage::Geometry,
    parameters: &[
        LAYER,
        ParameterInfo::strength("kappa_per_m", "1/m", "stiffening of this layer beyond that of all layers")
            .allowed(-2000.0, 1e4)
            .search(10.0, -100.0, 1000.0),
    ],
    ..EffectInfo::DEFAULTS
};

described!(LayerStiffening { layer; kappa_per_m });

impl Effect for LayerStiffening {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.kappa_per_m == 0.0
    }
    fn modify_layers(&self, slabs: &mut [Slab]) {
        if let Some(slab) = layer_mut(slabs, self.layer) {
            slab.kappa_per_m += self.kappa_per_m;
        }
    }
}
