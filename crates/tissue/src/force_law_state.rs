//! What the law remembers between samples.

use crate::effect::{EffectState, TipState};
use crate::force_law::MAX_EFFECTS;

/// What all effects of a law remember.
pub(crate) type EffectStates = [EffectState; MAX_EFFECTS];

/// What the law remembers between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceLawState {
    pub(crate) ruptured: usize,
    pub(crate) started: bool,
    pub(crate) time_s: f64,
    pub(crate) z_m: f64,
    pub(crate) v_mps: f64,
    /// Change of the velocity in the last step; only a needle that gives asks for it.
    pub(crate) dv_mps: f64,
    pub(crate) elastic_n: f64,
    /// Position of the base, and whether it is known; only a needle that gives asks for them.
    pub(crate) base_m: f64,
    pub(crate) base_known: bool,
    /// Acceleration of the base, zero where nobody tells it; only a needle that gives asks for it.
    pub(crate) base_acceleration_mps2: f64,
    pub(crate) effects: EffectStates,
}

impl Default for ForceLawState {
    fn default() -> Self {
        Self {
            ruptured: 0,
            started: false,
            time_s: 0.0,
            z_m: 0.0,
            v_mps: 0.0,
            dv_mps: 0.0,
            elastic_n: 0.0,
            base_m: 0.0,
            base_known: false,
            base_acceleration_mps2: 0.0,
            effects: [[0.0; 8]; MAX_EFFECTS],
        }
    }
}

impl ForceLawState {
    /// Number of layers that have ruptured so far.
    #[must_use]
    pub fn ruptured(&self) -> usize {
        self.ruptured
    }

    /// Position of the tip relative to the tissue at the last sample, in metres: not the one given
    /// to [`Law::step`](crate::Law::step) when the tissue moves or the needle gives.
    #[must_use]
    pub fn tip_m(&self) -> f64 {
        self.z_m
    }

    /// Velocity of the tip relative to the tissue at the last sample, in m/s.
    #[must_use]
    pub fn tip_velocity_mps(&self) -> f64 {
        self.v_mps
    }

    /// Tells the acceleration of the base (m/s²) up to the next sample: a needle that gives follows it exactly then, however
    /// long the steps; without it late by a share of the step.
    pub fn set_base_acceleration(&mut self, base_mps2: f64) {
        self.base_acceleration_mps2 = base_mps2;
    }

    /// Begins with the first sample.
    #[cold]
    pub(crate) fn begin(&mut self, time_s: f64, z_m: f64, v_mps: f64) {
        self.started = true;
        self.time_s = time_s;
        self.z_m = z_m;
        self.v_mps = v_mps;
    }

    /// What effects may look at in the sample that follows.
    #[inline]
    pub(crate) fn tip_state(&self, time_s: f64, z_m: f64, v_mps: f64) -> TipState {
        TipState {
            time_s,
            dt_s: time_s - self.time_s,
            z_m,
            dz_m: z_m - self.z_m,
            v_mps,
            ruptured: self.ruptured,
        }
    }

    /// Makes a sample the last one.
    #[inline]
    pub(crate) fn store(&mut self, moment: &TipState, elastic_n: f64) {
        self.time_s = moment.time_s;
        self.z_m = moment.z_m;
        self.dv_mps = moment.v_mps - self.v_mps;
        self.v_mps = moment.v_mps;
        self.elastic_n = elastic_n;
    }
}
