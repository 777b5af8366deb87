use super::Described;
use crate::effect::{ChainStage, Effect};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// A layer that presses into the one beneath: what the tip travels is shared between both.
///
/// `z - s_i = x + c f`, `f = K_i x + b_i x^2`: the layer itself is indented by `x` only, the rest is how far its ground gives, `c` being
/// the ground's compliance. Solved in closed form for the layer's own spring (`K_i`, `layer_stiffening`, `shaft_slip`); effects on
/// all layers (`nonlinear_elasticity`) then see `x`.
///
/// Source: springs in series; a skin phantom on a muscle phantom is softer than the skin alone. Signature: a layer is softer in a stack
/// than by itself, and straighter.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct LayerCoupling {
    /// Layer, 1-based; one that is not there changes nothing.
    pub layer: usize,
    /// Compliance `c` of its ground in m/N, 0 to 1. Neutral: 0.
    pub compliance_m_per_n: f64,
}

impl Default for LayerCoupling {
    /// The neutral effect.
    fn default() -> Self {
        Self { layer: 1, compliance_m_per_n: 0.0 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "layer_coupling",
    equation: "z - s_i = x + c f_K, f_K = K_i x + b_i x^2",
    source: "Springs in series; skin phantom on muscle phantom",
    signature: "A layer is softer in a stack than alone, and its loading is straighter.",
    stage: ChainStage::Geometry,
    parameters: &[
        ParameterInfo::shape("layer", "", "layer, 1-based")
            .allowed(1.0, 1000.0)
            .inactive(1.0)
            .search(1.0, 1.0, 10.0)
            .integer(),
        ParameterInfo::strength("compliance_m_per_n", "m/N", "compliance of the layer's ground")
            .allowed(0.0, 1.0)
            .search(1e-3, 1e-5, 1e-2),
    ],
    extended: None,
    proposal: Proposal::PerLayer,
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for LayerCoupling {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.layer as f64, self.compliance_m_per_n]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [layer, compliance_m_per_n] = *values else { return None };
        let layer = libm::round(layer) as usize; // saturates, and NaN is zero, which is no layer
        Some(Self { layer, compliance_m_per_n })
    }
}

impl Effect for LayerCoupling {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.compliance_m_per_n == 0.0
    }
    fn shape(&self, slabs: &mut [Slab]) {
        if let Some(slab) = self.layer.checked_sub(1).and_then(|i| slabs.get_mut(i)) {
            slab.foundation_compliance_m_per_n += self.compliance_m_per_n;
        }
    }
}
