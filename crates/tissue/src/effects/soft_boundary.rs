use super::Described;
use crate::effect::{ChainStage, Effect, EffectState, TipState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// A boundary that gives way gradually: the elastic release of a rupture is spread over travel `w`,
/// linear in the deepest travel since; what is released stays released.
///
/// With `R` the force released at `z_r`, the tip keeps `R max(0, 1 - (deepest - z_r)/w)`. What
/// `incomplete_release` keeps back is not released and not spread.
///
/// Source: tilted or blunt interfaces, width about needle tip length (research notes, number 15).
/// Signature: drops last for a travel, not for a time.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct SoftBoundary {
    /// Travel `w` in metres, 0 to 0.1. Neutral: 0.
    pub width_m: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "soft_boundary",
    equation: "+ R max(0, 1 - (deepest - z_r)/w) after a rupture at z_r that released R",
    source: "Tilted or blunt interfaces: NeedleInsertionDataAnalysis tables",
    signature: "Force drops are smeared over a travel, the same at all speeds.",
    stage: ChainStage::Release,
    parameters: &[ParameterInfo::strength("width_m", "m", "travel over which a rupture releases its force")
        .allowed(0.0, 0.1)
        .search(0.003, 1e-4, 0.02)
        .log()],
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[3e-4]], &[&[1e-3]], &[&[3e-3]], &[&[8e-3]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for SoftBoundary {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.width_m]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [width_m] = *values else { return None };
        Some(Self { width_m })
    }
}

impl Effect for SoftBoundary {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.width_m <= 0.0
    }
    fn remembers(&self) -> bool {
        true
    }
    /// Memory: the deepest position, then up to three releases under way as (force, position).
    fn on_rupture(&self, released_n: f64, z_m: f64, memory: &mut EffectState) {
        // The newest release goes first; a fourth one under way, with three layers inside one
        // width, takes over what is left of the oldest.
        let deepest = memory[0].max(z_m);
        let oldest = self.rest(memory[5], memory[6], deepest);
        memory[0] = if memory[7] == 0.0 { z_m } else { deepest };
        memory[7] = 1.0;
        memory.copy_within(1..5, 3);
        memory[1] = released_n + oldest;
        memory[2] = z_m;
    }
    fn tip_force(&self, moment: &TipState, _slabs: &[Slab], memory: &mut EffectState) -> f64 {
        if memory[7] == 0.0 {
            return 0.0;
        }
        if moment.z_m > memory[0] {
            memory[0] = moment.z_m;
        }
        let [deepest, r1, z1, r2, z2, r3, z3, _] = *memory;
        self.rest(r1, z1, deepest) + self.rest(r2, z2, deepest) + self.rest(r3, z3, deepest)
    }
}

impl SoftBoundary {
    /// What is left of a release of `force_n` at `at_m` with the deepest tip at `deepest_m`.
    fn rest(&self, force_n: f64, at_m: f64, deepest_m: f64) -> f64 {
        if force_n == 0.0 {
            return 0.0;
        }
        force_n * (1.0 - (deepest_m - at_m) / self.width_m).clamp(0.0, 1.0)
    }
}
