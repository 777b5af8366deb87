//! Stops of the needle. A stop takes away the shaft friction, which looks like a rupture. Velocities from positions show it one
//! sample late, and a force that is filtered or recorded late loses the friction only afterwards.

use super::force_predictor::MotionStep;
use super::state::{KalmanEnhancer, Stop};
use super::tissue_update::SPIKE_SDS;
use crate::bounds::at_least;
use crate::sample::Sample;

/// Standard deviations (95 %) of the friction that a stop may take away.
const FRICTION_SDS: f64 = 2.0;
/// Longest delay of the force against the position, in s: that of sensor electronics and low-pass filters. A puncture within this
/// time after a stop is not found if it releases less than the friction.
const MAX_FORCE_DELAY_S: f64 = 0.05;

impl KalmanEnhancer {
    /// True if the needle may have stopped: the force has dropped by no more than the shaft friction, and no position since
    /// `waiting_from_m` shows further motion.
    #[cold]
    pub(super) fn may_be_a_stop(&self, sample: &Sample, waiting_from_m: Option<f64>) -> bool {
        if self.confirmed_stop().is_some() {
            return false;
        }
        let shown_m = 2.0 * self.velocity_estimator.encoder_step_m();
        if waiting_from_m.is_some_and(|from_m| sample.position_m - from_m > shown_m) {
            return false;
        }
        let friction_n = self.largest_friction_n(sample);
        let margin_n = SPIKE_SDS * libm::sqrt(self.noise.marginal_variance());
        self.last_drop_n.0 < friction_n + margin_n
    }

    /// The largest shaft friction at a steady advance, in N: the whole force where the base law has not proved itself.
    #[cold]
    fn largest_friction_n(&self, sample: &Sample) -> f64 {
        if self.misfit_weight > 0.0 || self.base_law_failed {
            return at_least(0.0, self.predictor.level_n() - self.noise.bias_n());
        }
        let (friction, sd) = self.snapshot.friction_and_sd(sample.position_m, &self.noise);
        (friction + FRICTION_SDS * sd) * self.steady_drive_mps
    }

    /// Keeps force and friction of the last advance while the needle does not advance.
    #[inline(always)]
    pub(super) fn update_stop(&mut self, step: &MotionStep, sample: &Sample) {
        if sample.position_m > self.deepest_m {
            self.stop = None;
        } else if let Some(stop) = &mut self.stop {
            stop.duration_s += step.dt_s;
        } else {
            self.stop = Some(Stop {
                duration_s: step.dt_s,
                lowest_n: self.predictor.level_n() - self.largest_friction_n(sample),
            });
        }
    }

    /// True if the needle has just stopped and the force has fallen by no more than the friction of the advance: forces that are
    /// filtered or recorded late lose it after the stop.
    #[cold]
    pub(super) fn is_late_friction(&self, sample: &Sample) -> bool {
        let margin_n = SPIKE_SDS * libm::sqrt(self.noise.marginal_variance());
        self.confirmed_stop().is_some_and(|stop| {
            stop.duration_s <= MAX_FORCE_DELAY_S && sample.force_n > stop.lowest_n - margin_n
        })
    }

    /// The stop, if it has lasted longer than a rounded position stays the same.
    fn confirmed_stop(&self) -> Option<Stop> {
        let rounding_m = 2.0 * self.velocity_estimator.encoder_step_m();
        self.stop.filter(|stop| stop.duration_s * self.speed_mps > rounding_m)
    }
}

#[cfg(test)]
mod tests;
