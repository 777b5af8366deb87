use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, InsertionState, TipState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A gradual release: the elastic force `R` released by a rupture at `z_r` is spread over the travel `w`, so that the
/// tip keeps `R max(0, 1 - (deepest - z_r)/w)`.
///
/// What is released stays released; what `incomplete_release` retains is not spread.
///
/// Inactive: `w = 0`. Signature: drops extended over a travel, not over a time.
/// Source: tilted or blunt interfaces, width about the length of the needle tip.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct SoftBoundary {
    /// Travel `w` in metres, 0 to 0.1. Inactive: 0.
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
    proposal: Proposal::LinearColumns(&[&[&[3e-4]], &[&[1e-3]], &[&[3e-3]], &[&[8e-3]]]),
    ..EffectInfo::DEFAULTS
};

described!(SoftBoundary { width_m });

impl Effect for SoftBoundary {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.width_m <= 0.0
    }
    fn has_state(&self) -> bool {
        true
    }
    /// State: the deepest position, then up to three unfinished releases as (force, position).
    fn on_rupture(&self, released_n: f64, z_m: f64, state: &mut EffectState) {
        // The newest release comes first; a fourth one, with three layers inside one width, includes the rest of the
        // oldest.
        let deepest = state[0].max(z_m);
        let oldest = self.remaining_force(state[5], state[6], deepest);
        state[0] = if state[7] == 0.0 { z_m } else { deepest };
        state[7] = 1.0;
        state.copy_within(1..5, 3);
        state[1] = released_n + oldest;
        state[2] = z_m;
    }
    fn tip_force(&self, tip: &TipState, _at: &InsertionState, state: &mut EffectState) -> f64 {
        if state[7] == 0.0 {
            return 0.0;
        }
        if tip.z_m > state[0] {
            state[0] = tip.z_m;
        }
        let [deepest, r1, z1, r2, z2, r3, z3, _] = *state;
        self.remaining_force(r1, z1, deepest)
            + self.remaining_force(r2, z2, deepest)
            + self.remaining_force(r3, z3, deepest)
    }
}

impl SoftBoundary {
    /// Remaining force of a release of `force_n` at `at_m` with the deepest tip position `deepest_m`.
    fn remaining_force(&self, force_n: f64, at_m: f64, deepest_m: f64) -> f64 {
        if force_n == 0.0 {
            return 0.0;
        }
        force_n * (1.0 - (deepest_m - at_m) / self.width_m).clamp(0.0, 1.0)
    }
}
