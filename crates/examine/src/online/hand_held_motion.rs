//! Hand-held motion with tremor, stick-slip motion of a drive, and short disturbance forces.

use crate::cases::draw_motion::{log_uniform, uniform};
use crate::simulator::insertion::UnmodelledForce;
use crate::simulator::motion_path::{MotionPath, MotionPiece, MotionState};
use core::f64::consts::{PI, TAU};
use rand::RngExt;
use rand::rngs::ChaCha8Rng;

/// Speeds of a hand in m/s.
const HAND_MPS: (f64, f64) = (1e-3, 40e-3);
/// Frequencies of physiological tremor in Hz.
const TREMOR_HZ: (f64, f64) = (8.0, 12.0);
/// Share of the pieces of a motion in which the hand pauses, and in which it goes back a little.
const PAUSES: f64 = 0.2;
const RETRACTIONS: f64 = 0.1;
/// Mean speed of a sticking drive in m/s.
const STICKING_MPS: f64 = 3e-3;

/// A piece from one speed to another with whole periods of tremor in it, so that the speed has no jump.
fn blend(rng: &mut ChaCha8Rng, from_mps: f64, to_mps: f64, about_s: f64, tremor_m: f64) -> MotionPiece {
    let ripple_hz = uniform(rng, TREMOR_HZ.0, TREMOR_HZ.1);
    let duration_s = libm::ceil(about_s * ripple_hz).max(1.0) / ripple_hz;
    MotionPiece::Blend { from_mps, to_mps, ripple_mps: TAU * ripple_hz * tremor_m, ripple_hz, duration_s }
}

/// Hand-held motion from `start_m` to `depth_m` and part of the way back, with a tremor of this amplitude.
#[must_use]
pub fn hand_held(rng: &mut ChaCha8Rng, start_m: f64, depth_m: f64, tremor_m: f64) -> MotionPath {
    let mut pieces = Vec::new();
    let mut speed_mps = 0.0;
    let mut push = |rng: &mut ChaCha8Rng, to_mps: f64, about_s: f64| {
        let piece = blend(rng, speed_mps, to_mps, about_s, tremor_m);
        speed_mps = to_mps;
        pieces.push(piece);
        MotionPath::new(start_m, pieces.clone()).end_m()
    };
    let mut here_m = start_m;
    while here_m < depth_m {
        let kind = rng.random::<f64>();
        if kind < PAUSES {
            let _ = push(rng, 0.0, 0.2);
            let pause_s = uniform(rng, 0.3, 1.5);
            here_m = push(rng, 0.0, pause_s);
        } else if kind < PAUSES + RETRACTIONS {
            let _ = push(rng, -5e-3, 0.2);
            here_m = push(rng, 0.0, 0.2);
        } else {
            let to_mps = log_uniform(rng, HAND_MPS.0, HAND_MPS.1);
            // At most a third of the way in one piece, so that fast hands change their speed as well.
            let about_s = uniform(rng, 0.2, 0.8).min((depth_m - start_m) / (3.0 * to_mps));
            here_m = push(rng, to_mps, about_s);
        }
    }
    let _ = push(rng, 0.0, 0.2);
    let pause_s = uniform(rng, 0.5, 1.5);
    let _ = push(rng, 0.0, pause_s);
    let _ = push(rng, -15e-3, 0.4);
    let _ = push(rng, -15e-3, 0.7);
    MotionPath::new(start_m, pieces)
}

/// Stick-slip motion with jumps of about `jump_m`.
#[must_use]
pub fn stick_slip(rng: &mut ChaCha8Rng, start_m: f64, depth_m: f64, jump_m: f64) -> MotionPath {
    let mut pieces = Vec::new();
    let mut here_m = start_m;
    while here_m < depth_m {
        let jump_m = jump_m * uniform(rng, 0.6, 1.4);
        let slip_s = uniform(rng, 0.03, 0.08);
        let peak_mps = 2.0 * jump_m / slip_s;
        let half = |from_mps, to_mps| MotionPiece::Blend {
            from_mps,
            to_mps,
            ripple_mps: 0.0,
            ripple_hz: 0.0,
            duration_s: 0.5 * slip_s,
        };
        let stick_s = (jump_m / STICKING_MPS - slip_s).max(0.02) * uniform(rng, 0.7, 1.3);
        pieces.extend([MotionPiece::constant(0.0, stick_s), half(0.0, peak_mps), half(peak_mps, 0.0)]);
        here_m += jump_m;
    }
    MotionPath::new(start_m, pieces)
}

/// Short forces at the needle's base from contacts from the side; each rises and falls as one period of a raised cosine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DisturbanceForces(Vec<(f64, f64, f64)>);

impl DisturbanceForces {
    /// `count` short forces of about `size_n` in N within `duration_s`.
    #[must_use]
    pub fn draw(rng: &mut ChaCha8Rng, count: usize, size_n: f64, duration_s: f64) -> Self {
        let disturbance = |_| {
            let start_s = uniform(rng, 0.0, duration_s);
            let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
            (start_s, uniform(rng, 0.06, 0.3), sign * size_n * uniform(rng, 0.5, 1.5))
        };
        Self((0..count).map(disturbance).collect())
    }
}

impl UnmodelledForce for DisturbanceForces {
    fn force_n(&mut self, at: &MotionState, _ruptures: &[f64]) -> f64 {
        let one = |&(start_s, length_s, size_n): &(f64, f64, f64)| {
            let x = (at.t - start_s) / length_s;
            if (0.0..1.0).contains(&x) { 0.5 * size_n * (1.0 - libm::cos(2.0 * PI * x)) } else { 0.0 }
        };
        self.0.iter().map(one).sum()
    }
}
