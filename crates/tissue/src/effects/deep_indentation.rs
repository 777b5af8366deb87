use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo};
use crate::layer_geometry::Slab;

/// Layers that are indented beyond their far face: layer `a` ruptures at `f_K >= F_a` or at
/// `z >= s_a + d_a + reach`, instead of at its far face.
///
/// A blunt tip pushes soft layers on a soft foundation by more than their thickness before they rupture.
///
/// Inactive: `reach = 0`. Signature: one rise of the force through several layers, one drop at its end.
/// Source: skin on muscle phantoms, indented by 12-13 mm before the skin ruptures; Okamura, Simone, O'Leary 2004
/// (capsule of liver).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct DeepIndentation {
    /// How far in metres beyond its far face a layer can be pushed, 0 to 1. Inactive: 0.
    pub reach_m: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "deep_indentation",
    equation: "rupture at f_K >= F_a, or z >= s_a + d_a + reach",
    source: "Skin on muscle phantoms, indented by 12-13 mm; Okamura, Simone, O'Leary 2004",
    signature: "The force rises through a face without a drop there; the drop comes deeper.",
    stage: ChainStage::Geometry,
    parameters: &[ParameterInfo::strength(
        "reach_m",
        "m",
        "how far beyond its far face a layer can be pushed",
    )
    .allowed(0.0, 1.0)
    .search(0.01, 0.001, 0.05)],
    ..EffectInfo::DEFAULTS
};

described!(DeepIndentation { reach_m });

impl Effect for DeepIndentation {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.reach_m == 0.0
    }
    fn modify_layers(&self, slabs: &mut [Slab]) {
        for slab in slabs {
            slab.reach_m += self.reach_m;
        }
    }
}
