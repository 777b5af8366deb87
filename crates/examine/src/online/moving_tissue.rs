//! Tissue that moves under the needle: the force law is evaluated with the relative motion.

use crate::simulator::force_law::{ForceKnot, ForceLaw};
use crate::simulator::motion_path::MotionState;
use core::f64::consts::TAU;

/// A sinusoidal motion of the tissue along the needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TissueMotion {
    /// Amplitude in m.
    pub amplitude_m: f64,
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Phase in rad.
    pub phase_rad: f64,
}

/// A law in moving tissue.
pub struct MovingTissue<'a> {
    /// The law of the tissue at rest.
    pub law: &'a mut dyn ForceLaw,
    /// Its motion.
    pub tissue_motion: TissueMotion,
}

impl MovingTissue<'_> {
    fn relative(&self, at: &MotionState) -> MotionState {
        let w = TAU * self.tissue_motion.frequency_hz;
        let (sin, cos) = libm::sincos(w * at.t + self.tissue_motion.phase_rad);
        let a = self.tissue_motion.amplitude_m;
        MotionState { t: at.t, z: at.z - a * sin, v: at.v - a * w * cos, a: at.a + a * w * w * sin }
    }
}

impl ForceLaw for MovingTissue<'_> {
    fn start(&mut self, at: &MotionState) -> f64 {
        let at = self.relative(at);
        self.law.start(&at)
    }

    fn advance(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>) {
        let to = self.relative(to);
        self.law.advance(&to, knots);
    }

    fn jump(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>) {
        let to = self.relative(to);
        self.law.jump(&to, knots);
    }

    fn ruptures(&self) -> &[f64] {
        self.law.ruptures()
    }

    fn released_n(&self) -> &[f64] {
        self.law.released_n()
    }

    fn tip_n(&self) -> f64 {
        self.law.tip_n()
    }
}
