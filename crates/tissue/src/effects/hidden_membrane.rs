use super::parameters::ParameterVector;
use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, InsertionState, TipState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// A membrane that is not among the layers: `+ K_m max(0, z - s_1 - z_m)` until its force reaches `F_m`, then zero.
///
/// Its rupture is not reported as a [`Rupture`](crate::Rupture); the active layer and its elastic force do not change, and
/// relaxation and soft boundaries do not act on it.
///
/// Inactive: `K_m = 0` or `F_m = 0`. Signature: a peak and a drop at a depth without a boundary, once.
/// Source: inner structures, vessels and capsules (Okamura, Simone, O'Leary 2004, fig. 1).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct HiddenMembrane {
    /// Depth `z_m` below the surface in metres, 0 to 1.
    pub depth_m: f64,
    /// Stiffness `K_m` in N/m, 0 to 1e6. Inactive: 0.
    pub stiffness_n_per_m: f64,
    /// Force `F_m` in N at which it ruptures, 0 to 100. Inactive: 0.
    pub puncture_n: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "hidden_membrane",
    equation: "+ K_m max(0, z - s_1 - z_m) until it reaches F_m, then gone",
    source: "Inner structures: Okamura, Simone, O'Leary 2004, fig. 1",
    signature: "A peak and a drop at a depth where no boundary is, once.",
    stage: ChainStage::Tip,
    parameters: &[
        ParameterInfo::shape("depth_m", "m", "depth below the surface")
            .allowed(0.0, 1.0)
            .inactive(0.02)
            .search(0.02, 0.001, 0.2)
            .demonstration(0.005),
        ParameterInfo::strength("stiffness_n_per_m", "N/m", "stiffness")
            .allowed(0.0, 1e6)
            .search(100.0, 5.0, 5000.0)
            .log(),
        ParameterInfo::strength("puncture_n", "N", "force at which it ruptures")
            .allowed(0.0, 100.0)
            .search(0.5, 0.02, 5.0)
            .log(),
    ],
    proposal: Proposal::MembraneRupture,
    ..EffectInfo::DEFAULTS
};

impl ParameterVector for HiddenMembrane {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.depth_m, self.stiffness_n_per_m, self.puncture_n]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [depth_m, stiffness_n_per_m, puncture_n] = *values else { return None };
        Some(Self { depth_m, stiffness_n_per_m, puncture_n })
    }
    /// The depth of its rupture instead of its own depth.
    fn coordinates(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.depth_m + self.stretch_m(), self.stiffness_n_per_m, self.puncture_n]
    }
    fn from_coordinates(coordinates: &[f64]) -> Option<Self> {
        let [breaks_m, stiffness_n_per_m, puncture_n] = *coordinates else { return None };
        let whole = Self { depth_m: 0.0, stiffness_n_per_m, puncture_n };
        Some(Self { depth_m: (breaks_m - whole.stretch_m()).max(0.0), ..whole })
    }
}

impl Effect for HiddenMembrane {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        !(self.stiffness_n_per_m > 0.0 && self.puncture_n > 0.0)
    }
    fn has_state(&self) -> bool {
        true
    }
    /// State: 1 after the rupture.
    fn ruptures_membrane(&self, z_m: f64, slabs: &[Slab], state: &mut EffectState) -> bool {
        if state[0] != 0.0 || self.force(z_m, slabs) < self.puncture_n {
            return false;
        }
        state[0] = 1.0;
        true
    }
    fn membrane_depth_m(&self) -> Option<f64> {
        Some(self.depth_m + self.stretch_m())
    }
    fn tip_force(&self, tip: &TipState, at: &InsertionState, state: &mut EffectState) -> f64 {
        if state[0] != 0.0 { 0.0 } else { self.force(tip.z_m, at.slabs) }
    }
}

impl HiddenMembrane {
    /// Deflection at its rupture, in m.
    fn stretch_m(&self) -> f64 {
        if self.stiffness_n_per_m > 0.0 { self.puncture_n / self.stiffness_n_per_m } else { 0.0 }
    }

    /// Its force in N with the tip at `z_m`, before its rupture.
    fn force(&self, z_m: f64, slabs: &[Slab]) -> f64 {
        let surface = slabs.first().map_or(0.0, |slab| slab.front_m);
        self.stiffness_n_per_m * (z_m - surface - self.depth_m).max(0.0)
    }
}
