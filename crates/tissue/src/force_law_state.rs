//! State of the force law between samples.

use crate::effect::{EffectState, TipState};

/// How many tissue effects one force law can hold.
pub const MAX_EFFECTS: usize = 16;

/// The states of all effects of a force law.
pub(crate) type EffectStates = [EffectState; MAX_EFFECTS];

/// State of a [`ForceLaw`](crate::ForceLaw) between samples. The default is the state before the first sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceLawState {
    pub(crate) ruptured: usize,
    pub(crate) started: bool,
    pub(crate) time_s: f64,
    pub(crate) z_m: f64,
    pub(crate) v_mps: f64,
    /// Change of the velocity in the last step; used by a compliant needle only.
    pub(crate) dv_mps: f64,
    pub(crate) elastic_n: f64,
    /// Position of the base, and whether it is known; used by a compliant needle only.
    pub(crate) base_m: f64,
    pub(crate) base_known: bool,
    /// Acceleration of the base, zero where it was not set; used by a compliant needle only.
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

    /// Position of the tip relative to the tissue at the last sample, in metres. It differs from the position given to
    /// [`ForceLaw::step`](crate::ForceLaw::step) when the tissue moves or the needle is compliant.
    #[must_use]
    pub fn tip_m(&self) -> f64 {
        self.z_m
    }

    /// Velocity of the tip relative to the tissue at the last sample, in m/s.
    #[must_use]
    pub fn tip_velocity_mps(&self) -> f64 {
        self.v_mps
    }

    /// Sets the acceleration of the base (m/s²) up to the next sample. A compliant needle then follows the base exactly,
    /// however long the steps; without it, the tip lags by a fraction of the step.
    pub fn set_base_acceleration(&mut self, base_mps2: f64) {
        self.base_acceleration_mps2 = base_mps2;
    }

    /// Starts at the first sample.
    #[cold]
    pub(crate) fn begin(&mut self, time_s: f64, z_m: f64, v_mps: f64) {
        self.started = true;
        self.time_s = time_s;
        self.z_m = z_m;
        self.v_mps = v_mps;
    }

    /// Motion of the tip up to a sample, for the effects.
    #[inline]
    pub(crate) fn tip_state(&self, time_s: f64, z_m: f64, v_mps: f64) -> TipState {
        TipState {
            time_s,
            dt_s: time_s - self.time_s,
            z_m,
            dz_m: z_m - self.z_m,
            v_mps,
            dv_mps: v_mps - self.v_mps,
            ruptured: self.ruptured,
        }
    }

    /// Stores a sample as the last one.
    #[inline]
    pub(crate) fn store(&mut self, tip: &TipState, elastic_n: f64) {
        self.time_s = tip.time_s;
        self.z_m = tip.z_m;
        self.dv_mps = tip.v_mps - self.v_mps;
        self.v_mps = tip.v_mps;
        self.elastic_n = elastic_n;
    }
}
