//! Draws the motions of a case: a constant speed with retraction, a slow sinusoid, and programs with ripple, holds and
//! retractions.

use crate::simulator::motion_path::{MotionPath, MotionPiece};
use rand::RngExt;
use rand::rngs::ChaCha8Rng;

/// Depth in m of the stacks for which speeds are drawn; deeper ones are passed faster, so that a case stays below 45 000
/// samples at 200 Hz.
const USUAL_DEPTH_M: f64 = 0.105;

/// Uniform between two numbers.
pub fn uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// Uniform in the logarithm.
pub fn log_uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low * libm::pow(high / low, rng.random::<f64>())
}

/// Draws the motions of `count` recordings from `start_m` to `depth_m`; `hurry` divides all durations.
pub fn draw_motions(
    rng: &mut ChaCha8Rng,
    count: usize,
    start_m: f64,
    depth_m: f64,
    hurry: f64,
) -> Vec<MotionPath> {
    let range =
        MotionRange { start_m, depth_m, pace: hurry * ((depth_m - start_m) / USUAL_DEPTH_M).max(0.5) };
    (0..count)
        .map(|k| match (count, k % 4) {
            (1, _) | (_, 2 | 3) => range.program(rng),
            (2, 1) => range.program(rng),
            (_, 0) => range.constant(rng),
            _ => range.sinusoid(rng),
        })
        .collect()
}

/// Six repeats: three motions, each twice.
pub fn draw_repeats(rng: &mut ChaCha8Rng, start_m: f64, depth_m: f64) -> Vec<MotionPath> {
    let range = MotionRange { start_m, depth_m, pace: ((depth_m - start_m) / USUAL_DEPTH_M).max(0.5) };
    let three = [range.constant(rng), range.program(rng), range.constant(rng)];
    three.iter().chain(&three).cloned().collect()
}

struct MotionRange {
    start_m: f64,
    depth_m: f64,
    pace: f64,
}

impl MotionRange {
    fn length_m(&self) -> f64 {
        self.depth_m - self.start_m
    }

    fn constant(&self, rng: &mut ChaCha8Rng) -> MotionPath {
        let speed = self.pace * uniform(rng, 2.2e-3, 3.5e-3);
        let back = uniform(rng, 0.1, 0.35) * self.length_m();
        MotionPath::new(
            self.start_m,
            vec![
                MotionPiece::constant(speed, self.length_m() / speed),
                MotionPiece::constant(0.0, uniform(rng, 0.5, 1.5)),
                MotionPiece::constant(-1.5 * speed, back / (1.5 * speed)),
            ],
        )
    }

    fn sinusoid(&self, rng: &mut ChaCha8Rng) -> MotionPath {
        let frequency_hz =
            self.pace * uniform(rng, 0.0115, 0.0167) * USUAL_DEPTH_M / self.length_m().max(0.05);
        let duration_s = uniform(rng, 0.65, 0.9) / frequency_hz;
        MotionPath::new(
            self.start_m,
            vec![MotionPiece::Swing { amplitude_m: 0.5 * self.length_m(), frequency_hz, duration_s }],
        )
    }

    fn program(&self, rng: &mut ChaCha8Rng) -> MotionPath {
        let mut pieces = Vec::new();
        let mut left = self.length_m();
        // Every program has a ripple and a hold at random places.
        let (mut rippled, mut held) = (false, false);
        while left > 1e-6 {
            let speed = self.pace * uniform(rng, 1.5e-3, 6e-3);
            let travel = (uniform(rng, 0.1, 0.28) * self.length_m()).min(left);
            let last = travel >= left;
            if uniform(rng, 0.0, 1.0) < 0.55 || (last && !rippled) {
                pieces.push(MotionPiece::Move {
                    speed_mps: speed,
                    ripple_mps: speed * uniform(rng, 0.2, 0.8),
                    ripple_hz: uniform(rng, 0.2, 1.5),
                    duration_s: travel / speed,
                });
                rippled = true;
            } else {
                pieces.push(MotionPiece::constant(speed, travel / speed));
            }
            left -= travel;
            if uniform(rng, 0.0, 1.0) < 0.5 || (last && !held) {
                pieces.push(MotionPiece::constant(0.0, uniform(rng, 0.8, 3.0)));
                held = true;
            }
            if !last && uniform(rng, 0.0, 1.0) < 0.3 {
                let back = uniform(rng, 0.02, 0.06) * self.length_m();
                let speed = self.pace * 3e-3;
                pieces.push(MotionPiece::constant(-speed, back / speed));
                left += back;
            }
        }
        let speed = self.pace * uniform(rng, 3e-3, 8e-3);
        pieces.push(MotionPiece::constant(-speed, uniform(rng, 0.3, 0.8) * self.length_m() / speed));
        MotionPath::new(self.start_m, pieces)
    }
}
