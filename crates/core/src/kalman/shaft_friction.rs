//! Shaft friction where the base law does not hold: dry, building up over travel, persisting in holds.
//!
//! Measured insertions do not follow `f = D v + K x + b x v`: friction hardly depends on speed, and loading is curved.
//! Without a friction law, the following still holds:
//!
//! - Just after a rupture nothing acts at the tip. Over [`MEMORY_M`] of travel, in which friction builds up again after the
//!   slip, the whole force is friction.
//! - While the needle advances, the elastic force of an intact layer does not fall. A slowly falling force is falling
//!   friction, and friction never exceeds the force.
//! - In a hold tip force and friction relax and are not separable: their ratio is kept.
//! - During retraction nothing acts at the tip unless it is caught: friction goes from the force of the hold through zero to
//!   a pull, `P(x) = -S + (F + S) exp(-x/delta)`. `S` and `delta` cannot be learned during insertion; [`PULL_FRACTION`] and
//!   [`PRESLIDING_TRAVEL_M`] are prior means, which the tracker corrects.

use super::force_predictor::MEMORY_M;
use super::retraction_tracker::{
    ModelFriction, PRESLIDING_TRAVEL_M, RetractionTracker, ShaftSample, TRACKING_TRAVEL_M,
};
use crate::bounds::{at_least, at_most};

/// Friction pull during retraction as a fraction of the largest force: a puncture leaves half of the force as friction, and
/// the pull is half of the push (asymmetric friction, Okamura 2004).
const PULL_FRACTION: f64 = 0.25;
/// Time constant of the smoothed force in s, shorter than a drop.
pub(crate) const FORCE_TIME_CONSTANT_S: f64 = 0.05;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DryShaftFriction {
    /// Friction in N while advancing or holding.
    level_n: f64,
    smoothed_n: f64,
    rupture_m: f64,
    ruptured: bool,
    retraction: Option<Retraction>,
    model: ModelFriction,
}

#[derive(Clone, Copy, Debug)]
struct Retraction {
    turn_m: f64,
    force_n: f64,
    pull_n: f64,
    delta_m: f64,
    /// Reduction of the predicted pull in N, where there is no tracking.
    reduction_n: f64,
    tracker: RetractionTracker,
}

impl DryShaftFriction {
    /// A rupture, or the continuation of one.
    pub(crate) fn rupture(&mut self, position_m: f64, force_n: f64) {
        self.ruptured = true;
        self.rupture_m = position_m;
        self.smoothed_n = force_n;
        self.level_n = force_n.max(0.0);
        self.retraction = None;
    }

    /// All later forces are larger by `by_n`.
    pub(crate) fn shift(&mut self, by_n: f64) {
        self.smoothed_n += by_n;
        self.level_n = at_least(0.0, self.level_n + by_n);
    }

    /// Takes a sample; returns friction in N and its standard deviation.
    #[inline(always)]
    pub(crate) fn update(&mut self, sample: &ShaftSample) -> (f64, f64) {
        let before = self.smoothed_n;
        self.smoothed_n += sample.gain * (sample.force_n - before);
        if sample.retracting && self.retraction.is_none() {
            self.start_retraction(sample, before);
        }
        if let Some(retraction) = &mut self.retraction {
            if sample.advancing && sample.position_m >= retraction.turn_m {
                self.retraction = None;
                self.level_n = self.level_n.min(self.smoothed_n.max(0.0));
            } else {
                return retraction.update(sample, self.smoothed_n);
            }
        }
        if !self.ruptured {
            return (0.0, 0.0);
        }
        let change = self.smoothed_n - before;
        if sample.position_m - self.rupture_m < MEMORY_M {
            self.level_n = self.smoothed_n;
        } else if sample.advancing {
            if change < 0.0 {
                self.level_n += change;
            }
        } else if before > 0.0 {
            self.level_n *= (self.smoothed_n / before).clamp(0.0, 2.0);
        }
        self.level_n = at_least(0.0, at_most(self.smoothed_n, self.level_n));
        // Friction may still be building up, or part of it may be tip force of the new layer: known to a quarter.
        (self.level_n, 0.25 * self.level_n)
    }

    /// Friction of the sample just taken, from the friction `model_n` of an identified model.
    pub(crate) fn update_with_model(&mut self, sample: &ShaftSample, model_n: f64) -> (f64, f64) {
        self.model.update(sample, self.smoothed_n, model_n)
    }

    #[cold]
    fn start_retraction(&mut self, sample: &ShaftSample, force_n: f64) {
        let pull = (PULL_FRACTION * sample.peak_force_n).max(libm::sqrt(sample.noise_variance_n2)).max(1e-9);
        let force = force_n.max(0.05 * pull);
        self.retraction = Some(Retraction {
            turn_m: sample.position_m,
            force_n: force,
            pull_n: pull,
            delta_m: PRESLIDING_TRAVEL_M / libm::log(1.0 + force / pull),
            reduction_n: 0.0,
            tracker: RetractionTracker::new(TRACKING_TRAVEL_M, sample.position_m, 0.0),
        });
    }
}

impl Retraction {
    #[inline(never)]
    fn update(&mut self, sample: &ShaftSample, smoothed_n: f64) -> (f64, f64) {
        let travel = self.tracker.retracted_by(sample.position_m);
        let x = (self.turn_m - self.tracker.shallowest_m).max(0.0);
        let predicted = -self.pull_n + (self.force_n + self.pull_n) * libm::exp(-x / self.delta_m);
        if sample.track_retraction {
            return self.tracker.update(sample, travel, predicted);
        }
        // The tip cannot push during retraction: friction pulls at most as much as the force, and less than predicted for a
        // while afterwards.
        self.reduction_n =
            (self.reduction_n * libm::exp(-travel / TRACKING_TRAVEL_M)).max(smoothed_n - predicted);
        (predicted + self.reduction_n, 0.25 * sample.peak_force_n)
    }
}

#[cfg(test)]
mod tests;
