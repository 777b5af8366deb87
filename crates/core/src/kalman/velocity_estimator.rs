//! Needle velocity from logged velocity and positions.
//!
//! Logged velocities are often smoothed or delayed: at a stop within one sample they decay over twenty, while friction, and
//! with it the force, vanishes at once. The mean velocity `w` of a step, from the positions, has no lag but carries the
//! encoder noise, `sqrt(2) sigma/dt`. The logged velocity is used as long as it agrees with `w` within four times their
//! usual difference, and within the step of the encoder, which is the smallest change of the travel from step to step.
//!
//! The second difference of `w` is free of smooth motion; encoder noise gives it the variance `20 sigma²/dt²`, so that a tenth of its
//! mean square is the noise variance of `w`. `w` extrapolated by half a step is the velocity at the sample, with variance
//! `6.5 sigma²/dt²`. Where that is as accurate as a good log and the log has been found to be smoothed, positions alone are used from
//! then on; a velocity jump is a second difference that is significant.

use crate::bounds::{at_least, at_most};
use crate::sample::Sample;

/// Squared difference in variances from which log and positions disagree.
const DISAGREEMENT_SDS_SQUARED: f64 = 16.0;
/// Smallest standard deviation of the difference as a fraction of the speed: resolution and synchronisation of a good log.
const MIN_SD_FRACTION: f64 = 0.005;
/// Time constant of the usual difference, in s: much longer than smoothing or a lag, so that these are not learned as usual.
pub(crate) const DISAGREEMENT_MEMORY_S: f64 = 2.0;

/// Below this speed the needle is at rest, in m/s.
pub(crate) const REST_SPEED_MPS: f64 = 1e-5;

/// Variance of white position noise in the mean velocities over that in their second differences (2 of 20), and variance in
/// the extrapolated velocity over that in the mean velocities (6.5 of 2).
const STEP_NOISE_RATIO: f64 = 0.1;
const EXTRAPOLATED_NOISE_RATIO: f64 = 3.25;

/// Encoder detection: smallest change of the travel from step to step that is not a rounding error, in m; largest error of a travel in
/// encoder steps (half a step at either end, and an error of the log); number of changes by one step that confirm an encoder.
const MIN_ENCODER_STEP_M: f64 = 1e-12;
const ENCODER_STEPS: f64 = 1.5;
const MIN_OCCURRENCES: u8 = 4;

/// Consecutive samples that must agree before the log is used again.
const AGREEING_SAMPLES: u8 = 2;

#[derive(Clone, Copy, Debug)]
pub(crate) struct VelocityEstimator {
    /// Mean square of the usual difference, and its part from position noise, in (m/s)².
    usual: f64,
    noise: f64,
    logged_mps: f64,
    /// Travel of the last step in m, its smallest change so far (the encoder step, if there is one), and how often that change occurred.
    moved_m: f64,
    encoder_step_m: f64,
    sightings: u8,
    /// Travel in m by the logged velocity since the position last changed.
    unmoved_m: f64,
    /// Mean velocities of the last three steps in m/s, newest first, and whether they have jumped.
    step_mps: [f64; 3],
    jumped: bool,
    /// The needle has not moved and is not logged as moving.
    at_rest: bool,
    /// Log and positions count as disagreeing for at least this many more samples: a jump of the velocity may cross a
    /// smoothed one.
    disagreeing: u8,
    /// The positions are accurate; the log is smoothed.
    accurate_positions: bool,
    smoothed_log: bool,
}

impl Default for VelocityEstimator {
    fn default() -> Self {
        Self {
            usual: 0.0,
            noise: 0.0,
            logged_mps: 0.0,
            moved_m: 0.0,
            encoder_step_m: f64::INFINITY,
            sightings: 0,
            unmoved_m: 0.0,
            step_mps: [0.0; 3],
            jumped: false,
            at_rest: false,
            disagreeing: 0,
            accurate_positions: false,
            smoothed_log: false,
        }
    }
}

impl VelocityEstimator {
    /// Velocity in m/s at a sample, and whether log and positions disagree, in which case friction changes at an unknown
    /// time within the step. `gain` is the low-pass gain of the usual difference.
    #[inline(always)]
    pub(crate) fn update(
        &mut self,
        last: &Sample,
        sample: &Sample,
        speed_mps: f64,
        gain: f64,
    ) -> (f64, bool) {
        let logged = sample.velocity_mps;
        let dt_s = sample.time_s - last.time_s;
        let moved_m = sample.position_m - last.position_m;
        let before = core::mem::replace(&mut self.logged_mps, logged);
        self.update_encoder_step(moved_m);
        if moved_m == 0.0 && (self.at_rest || logged.abs() <= REST_SPEED_MPS) {
            // A velocity smoothed forward and backward in time rises before the needle moves.
            self.smoothed_log |= before.abs() > REST_SPEED_MPS && logged.abs() > REST_SPEED_MPS;
            (self.at_rest, self.step_mps, self.jumped) = (true, [0.0; 3], false);
            return (0.0, false);
        }
        // A rounded position shows a stop where the needle should have moved by more than the rounding.
        let expected_m = self.unmoved_m + logged.abs() * dt_s;
        self.unmoved_m = if moved_m == 0.0 { expected_m } else { 0.0 };
        let encoder_step_m = self.encoder_step_m();
        if encoder_step_m > 0.0 && self.unmoved_m > ENCODER_STEPS * encoder_step_m {
            (self.at_rest, self.step_mps, self.jumped) = (true, [0.0; 3], false);
            return (0.0, true);
        }
        let starts = core::mem::take(&mut self.at_rest);
        if dt_s <= 0.0 {
            return (logged, starts);
        }
        let step = moved_m / dt_s;
        self.step_mps = [step, self.step_mps[0], self.step_mps[1]];
        if starts {
            return (logged, true);
        }
        let difference = step - 0.5 * (logged + before);
        let min_variance = MIN_SD_FRACTION * speed_mps * (MIN_SD_FRACTION * speed_mps);
        let resolution_mps = ENCODER_STEPS * self.encoder_step_m() / dt_s;
        let limit = at_least(
            resolution_mps * resolution_mps,
            DISAGREEMENT_SDS_SQUARED * at_least(min_variance, self.usual),
        );
        if difference != 0.0 || logged != 0.0 {
            self.usual += gain * (at_most(limit, difference * difference) - self.usual);
        }
        let (noise, position_mps) = self.velocity_from_positions(
            DISAGREEMENT_SDS_SQUARED * at_least(min_variance, self.noise / STEP_NOISE_RATIO),
        );
        // Velocity jumps must not count as noise.
        let clip = at_least(min_variance, DISAGREEMENT_SDS_SQUARED * self.noise);
        self.noise += gain * (at_most(clip, noise) - self.noise);
        self.accurate_positions = EXTRAPOLATED_NOISE_RATIO * self.noise <= min_variance;
        if self.uses_positions() {
            return (position_mps, self.jumped);
        }
        if difference * difference > limit || self.disagreeing > 0 {
            let resolved = self.resolve_disagreement(before, logged, step, limit);
            self.smoothed_log |= self.accurate_positions
                && EXTRAPOLATED_NOISE_RATIO * noise <= min_variance
                && self.disagreeing > 0;
            return resolved;
        }
        (logged, false)
    }

    /// Step of the encoder in m; zero while unknown.
    pub(super) fn encoder_step_m(&self) -> f64 {
        if self.sightings == MIN_OCCURRENCES { self.encoder_step_m } else { 0.0 }
    }

    /// Updates the encoder step: travels of a rounded position differ by multiples of it, those of an exact one by arbitrarily small
    /// amounts.
    #[inline(always)]
    fn update_encoder_step(&mut self, moved_m: f64) {
        let change_m = (moved_m - core::mem::replace(&mut self.moved_m, moved_m)).abs();
        if change_m <= MIN_ENCODER_STEP_M || change_m > ENCODER_STEPS * self.encoder_step_m {
            return;
        }
        if ENCODER_STEPS * change_m < self.encoder_step_m {
            (self.encoder_step_m, self.sightings) = (change_m, 0);
        }
        if self.sightings < MIN_OCCURRENCES {
            self.sightings += 1;
        }
    }

    /// The log is smoothed and positions are used: a velocity jump within a step shows one sample later.
    #[inline(always)]
    pub(super) fn uses_positions(&self) -> bool {
        self.accurate_positions && self.smoothed_log
    }

    /// Noise variance in (m/s)² estimated from this step, and velocity from the positions. Sets `jumped` if the squared second
    /// difference exceeds `limit`.
    fn velocity_from_positions(&mut self, limit: f64) -> (f64, f64) {
        let [now, last, before] = self.step_mps;
        let (change, previous_change) = (now - last, last - before);
        let second_difference = (change - previous_change) * (change - previous_change);
        // A jump in the middle of a step gives two equal changes.
        self.jumped = second_difference > limit || (self.jumped && change * change > limit);
        // After a jump the velocity stays as it is now.
        let smooth = !self.jumped || change * change <= limit;
        (STEP_NOISE_RATIO * second_difference, if smooth { now + 0.5 * change } else { now })
    }

    /// Velocity when log and positions disagree: the log, if a jump within the step explains the mean velocity (which then lies between
    /// the logged ones); otherwise the mean velocity.
    #[cold]
    fn resolve_disagreement(&mut self, before: f64, logged: f64, step: f64, limit: f64) -> (f64, bool) {
        let between = at_most(logged.max(before), at_least(logged.min(before), step));
        let off = step - between;
        // Hysteresis: once they disagree, they must come twice as close.
        let far = off * off > if self.disagreeing > 0 { 0.25 * limit } else { limit };
        self.disagreeing = if far { AGREEING_SAMPLES } else { self.disagreeing.saturating_sub(1) };
        (if self.disagreeing > 0 { step } else { logged }, true)
    }
}

#[cfg(test)]
mod tests;
