use super::parameters::{LAYER, layer_mut};
use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo};
use crate::layer_geometry::Slab;

/// A layer on a compliant foundation: `z - s_i = x + c f`, `f = K_i x + b_i x²`, so that the tip's travel is shared
/// between the layer (`x`) and the layers beneath.
///
/// Solved in closed form for the layer's own spring (`K_i`, `layer_stiffening`, `shaft_slip`); effects on all layers
/// (`nonlinear_elasticity`) then act on `x`.
///
/// Inactive: `c = 0`. Signature: a layer is softer in a stack than alone, and its loading curve is straighter.
/// Source: springs in series; a skin phantom on a muscle phantom is softer than the skin alone.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct LayerCoupling {
    /// Layer, 1-based; without such a layer the effect is inactive.
    pub layer: usize,
    /// Compliance `c` of its foundation in m/N, 0 to 1. Inactive: 0.
    pub compliance_m_per_n: f64,
}

impl Default for LayerCoupling {
    /// The inactive effect.
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
        LAYER,
        ParameterInfo::strength("compliance_m_per_n", "m/N", "compliance of the layer's foundation")
            .allowed(0.0, 1.0)
            .search(1e-3, 1e-5, 1e-2),
    ],
    ..EffectInfo::DEFAULTS
};

described!(LayerCoupling { layer; compliance_m_per_n });

impl Effect for LayerCoupling {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.compliance_m_per_n == 0.0
    }
    fn modify_layers(&self, slabs: &mut [Slab]) {
        if let Some(slab) = layer_mut(slabs, self.layer) {
            slab.foundation_compliance_m_per_n += self.compliance_m_per_n;
        }
    }
}
