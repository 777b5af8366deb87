use super::Described;
use crate::effect::{ChainStage, Effect};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// One layer that stiffens otherwise than the others: `K_i kappa_i x^2` is added to its elastic force.
///
/// With `nonlinear_elasticity` (`f_K = K x (1 + kappa x)` for every layer) the layer has
/// `f_K = K_i x (1 + (kappa + kappa_i) x)`.
///
/// Source: skin and muscle phantoms, whose loading curves are quadratic and nearly straight.
/// Signature: loading curves of different shape in different layers.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct LayerStiffening {
    /// Layer, 1-based; one that is not there changes nothing.
    pub layer: usize,
    /// Stiffening `kappa_i` beyond that of all layers in 1/m, -2000 to 10 000. Neutral: 0.
    pub kappa_per_m: f64,
}

impl Default for LayerStiffening {
    /// The neutral effect.
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
        ParameterInfo::shape("layer", "", "layer, 1-based")
            .allowed(1.0, 1000.0)
            .inactive(1.0)
            .search(1.0, 1.0, 10.0)
            .integer(),
        ParameterInfo::strength("kappa_per_m", "1/m", "stiffening of this layer beyond that of all layers")
            .allowed(-2000.0, 1e4)
            .search(10.0, -100.0, 1000.0),
    ],
    extended: None,
    proposal: Proposal::PerLayer,
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for LayerStiffening {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.layer as f64, self.kappa_per_m]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [layer, kappa_per_m] = *values else { return None };
        let layer = libm::round(layer) as usize; // saturates, and NaN is zero, which is no layer
        Some(Self { layer, kappa_per_m })
    }
}

impl Effect for LayerStiffening {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.kappa_per_m == 0.0
    }
    fn shape(&self, slabs: &mut [Slab]) {
        if let Some(slab) = self.layer.checked_sub(1).and_then(|i| slabs.get_mut(i)) {
            slab.kappa_per_m += self.kappa_per_m;
        }
    }
}
