//! Baseline in air: its history, the part subtracted from the force, and the state of the decisions on contact and steps of the
//! zero.

use super::air_history::AirHistory;
use super::baseline_fit::BaselineFit;
use crate::bounds::at_least;
use crate::sample::Sample;

/// Samples between two evaluations, as a share of those so far.
const EVALUATION_SHARE: f64 = 0.25;
/// Samples before the first evaluation.
pub(super) const MIN_SAMPLES: f64 = 40.0;

#[derive(Clone, Copy, Debug)]
pub(crate) struct AirBaseline {
    pub(super) history: AirHistory,
    /// Subtracted from the force: `n + drift (t - t0) + line (z - z0)`.
    pub(super) subtracted_n: f64,
    pub(super) rate: [f64; 2],
    pub(super) origin: [f64; 2],
    /// Last fit of a moving baseline, to the force as measured.
    pub(super) fit: BaselineFit,
    pub(super) moving: bool,
    pub(super) next_evaluation: f64,
    /// The contact is final, or was configured.
    pub(super) settled: bool,
    /// Measured force of the current sample in N.
    pub(super) measured_n: f64,
    pub(super) zero_steps: usize,
}

impl AirBaseline {
    pub(super) fn new(least_n2: f64) -> Self {
        Self {
            history: AirHistory::new(least_n2),
            subtracted_n: 0.0,
            rate: [0.0; 2],
            origin: [0.0; 2],
            fit: BaselineFit::default(),
            moving: false,
            next_evaluation: MIN_SAMPLES,
            settled: false,
            measured_n: 0.0,
            zero_steps: 0,
        }
    }

    /// Baseline subtracted from the force at this time and position, in N.
    #[inline(always)]
    pub(super) fn subtracted_n(&self, time_s: f64, position_m: f64) -> f64 {
        self.subtracted_n
            + self.rate[0] * (time_s - self.origin[0])
            + self.rate[1] * (position_m - self.origin[1])
    }

    /// Subtracts drift and line of a fit from here on, without a jump.
    pub(super) fn follow(&mut self, fit: &BaselineFit, moving: bool, sample: &Sample) {
        self.subtracted_n = self.subtracted_n(sample.time_s, sample.position_m);
        self.origin = [sample.time_s, sample.position_m];
        self.rate = if moving { [fit.x[1], fit.x[2]] } else { [0.0; 2] };
        (self.fit, self.moving) = (*fit, moving);
    }

    /// Subtracts a step of the zero from here on.
    pub(super) fn subtract_step(&mut self, size_n: f64) {
        self.subtracted_n += size_n;
        self.zero_steps += 1;
    }

    pub(super) fn schedule(&mut self) {
        let samples = self.history.samples;
        self.next_evaluation = samples + at_least(8.0, EVALUATION_SHARE * samples);
    }
}

#[cfg(test)]
mod tests;
