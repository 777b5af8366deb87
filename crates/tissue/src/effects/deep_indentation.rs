use super::Described;
use crate::effect::{ChainStage, Effect};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// Layers that yield to force and not to the tip's depth: a blunt tip pushes a layer in front of it
/// beyond its far face, and only its puncture force, or `reach` metres more, ruptures it.
///
/// In the base law a layer gives way when the tip comes to its far face. Soft layers on a soft
/// foundation are indented by more than their thickness first.
///
/// Source: needle insertions into skin on muscle phantoms, indented by 12-13 mm before the skin gives
/// way; Okamura, Simone, O'Leary 2004 (capsule of liver). Signature: one rise of the force through
/// several layers, one drop at its end.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct DeepIndentation {
    /// How far in metres beyond its far face a layer can be pushed, 0 to 1. Neutral: 0.
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
    extended: None,
    proposal: Proposal::PerLayer,
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for DeepIndentation {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.reach_m]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [reach_m] = *values else { return None };
        Some(Self { reach_m })
    }
}

impl Effect for DeepIndentation {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.reach_m == 0.0
    }
    fn shape(&self, slabs: &mut [Slab]) {
        for slab in slabs {
            slab.reach_m += self.reach_m;
        }
    }
}
