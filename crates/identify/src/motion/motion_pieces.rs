//! Mean motion over time spans, cut at velocity jumps and reversals.

use super::Motion;

/// Where the velocity jumps of the motion appear in the force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JumpAppearance {
    /// In a force without delay: between the samples before and after the jump.
    BetweenSamples,
    /// In a force with this delay (s), or a low-pass filtered force: at the exact times plus the delay.
    Delayed(f64),
    /// In a delayed force without low-pass filter: between samples.
    DelayedBetweenSamples {
        /// Delay in s.
        delay_s: f64,
        /// Delay in s that determines between which samples the jumps lie.
        jump_delay_s: f64,
    },
}

/// A time span with smooth motion: means and acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionPiece {
    /// Index of the block it belongs to.
    pub block: u32,
    /// Start in s.
    pub start_s: f64,
    /// End in s.
    pub end_s: f64,
    /// Mean recorded position in m.
    pub position_m: f64,
    /// Mean velocity in m/s.
    pub velocity_mps: f64,
    /// Acceleration in m/s².
    pub acceleration_mps2: f64,
}

impl MotionPiece {
    /// Position and velocity at a time within the span.
    #[must_use]
    pub fn at(&self, t: f64) -> (f64, f64) {
        let s = t - 0.5 * (self.start_s + self.end_s);
        (self.position_m + self.velocity_mps * s, self.velocity_mps + self.acceleration_mps2 * s)
    }
}

impl Motion {
    /// Cuts consecutive spans `(start, end)` in s at velocity jumps and reversals, and returns the mean motion of every piece. `between`
    /// gives the midpoint of the samples around a time.
    #[must_use]
    pub fn pieces(
        &self,
        spans: impl Iterator<Item = (f64, f64)>,
        appearance: JumpAppearance,
        between: impl Fn(f64) -> f64,
    ) -> Vec<MotionPiece> {
        let (interpolant, delay) = match appearance {
            JumpAppearance::BetweenSamples => (&self.sampled, 0.0),
            JumpAppearance::Delayed(delay) | JumpAppearance::DelayedBetweenSamples { delay_s: delay, .. } => {
                (&self.exact, delay)
            }
        };
        let apparent_time = |at_s: f64, between_s: f64| match appearance {
            JumpAppearance::BetweenSamples => between_s,
            JumpAppearance::Delayed(delay) => at_s + delay,
            JumpAppearance::DelayedBetweenSamples { jump_delay_s: jump_delay, .. } => {
                between(at_s + jump_delay)
            }
        };
        let jumps: Vec<f64> = self.jumps.iter().map(|j| apparent_time(j.time_s, j.sample_mid_s)).collect();
        let reversals: Vec<f64> = self.reversals_s.iter().map(|t| apparent_time(t.0, t.1)).collect();
        let mut out = Vec::new();
        let mut near = 0;
        let (mut jump, mut reversal) = (0, 0);
        for (block, (from, to)) in spans.enumerate() {
            let mut at = from;
            let whole = to - from;
            loop {
                while jumps.get(jump).is_some_and(|j| *j <= at + 1e-6 * whole) {
                    jump += 1;
                }
                while reversals.get(reversal).is_some_and(|t| *t <= at + 1e-6 * whole) {
                    reversal += 1;
                }
                let cut = |next: Option<&f64>| next.copied().filter(|j| *j < to - 1e-6 * whole).unwrap_or(to);
                let end = cut(jumps.get(jump)).min(cut(reversals.get(reversal)));
                // The jump is placed between samples, so the motion on either side is extrapolated up to there.
                let (before, next) = match appearance {
                    JumpAppearance::DelayedBetweenSamples { .. } => {
                        (jump.checked_sub(1).and_then(|k| self.jumps.get(k)), self.jumps.get(jump))
                    }
                    _ => (None, None),
                };
                let mut sums = |at_s: f64| match (before, next) {
                    (Some(j), _) if at_s < j.time_s => {
                        interpolant.integrals_beyond_jump(j, 1, at_s, &mut near)
                    }
                    (_, Some(j)) if at_s > j.time_s => {
                        interpolant.integrals_beyond_jump(j, 0, at_s, &mut near)
                    }
                    _ => interpolant.integrals(at_s, &mut near),
                };
                // Acceleration from the mean velocities of both halves.
                let (z0, v0) = sums(at - delay);
                let (_, vm) = sums(0.5 * (at + end) - delay);
                let (z1, v1) = sums(end - delay);
                let dt = (end - at).max(1e-12);
                let a = ((v1 - vm) - (vm - v0)) / (0.25 * dt * dt);
                out.push(MotionPiece {
                    block: block as u32,
                    start_s: at,
                    end_s: end,
                    position_m: (z1 - z0) / dt,
                    velocity_mps: (v1 - v0) / dt,
                    acceleration_mps2: a,
                });
                if end >= to {
                    break;
                }
                at = end;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests;
