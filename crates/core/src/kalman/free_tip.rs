//! Detection of a free tip. A layer that ruptures before its far face leaves a gap: until the next face, or permanently
//! behind the last layer, no force acts at the tip and the whole force is friction.
//!
//! After a rupture the estimator assumes that the next layer begins at once. Two alternatives are nested in its law:
//!
//! ```text
//! K = 0, b = b'     free tip, the shaft is still entering the ruptured layer
//! K = 0, b = 0      free tip, beyond the far face
//! ```
//!
//! The Bayes factor of each is the density of the state at that point over its density when the layer began (Savage-Dickey
//! ratio: Dickey 1971, Ann. Math. Statist. 42, 204), so that no second filter is needed. At odds of [`ODDS`] the state is
//! conditioned on the hypothesis. The gap ends with a bend of the force, detected by the CUSUMs: upwards at a face, where a
//! layer begins; downwards at the far face of the previous layer, where friction stops growing. While the odds are undecided
//! only upward bends count: the loading curve of a layer is straight, and a drop may be its rupture.

use super::cusum::CusumBank;
use super::layer_estimator::{B, B_PREV, K, LayerEstimator, PassedLayers};
use super::noise_estimator::NoiseEstimator;
use crate::bounds::at_least;

/// Odds at which the tip is taken to be free.
const ODDS: f64 = 20.0;
/// Shift of the slow sum that locates the start of a bend, in standard deviations of an innovation.
const SLOW_SHIFT: f64 = 0.5;
/// Limit on log odds, in nats.
const MAX_LOG_ODDS_NATS: f64 = 500.0;
/// A layer is confirmed at [`ODDS`] to this power against a free tip: soft layers look like a free tip at first.
const CONFIRMATION_POWER: f64 = 4.0;
/// Fraction of a variance that remains after conditioning.
const CONDITIONED_VARIANCE_FRACTION: f64 = 1e-9;
/// Samples between two evaluations of the odds.
const EVALUATION_INTERVAL: u32 = 8;
/// Multiplications and additions of an evaluation of the odds, of the sums, and of a bend (a linear map of six unknowns).
const OPERATIONS_PER_EVALUATION: u32 = 60;
pub(super) const OPERATIONS_PER_BEND_TEST: u32 = 42;
pub(super) const OPERATIONS_PER_BEND: u32 = 2 * 216 + 2 * 126;

#[derive(Clone, Copy, Debug)]
pub(super) struct FreeTipDetector {
    up: BendDetector,
    down: BendDetector,
}

/// Bends of the force in one direction.
#[derive(Clone, Copy, Debug)]
struct BendDetector {
    cusum: CusumBank,
    /// Sum for a smaller shift: a bend builds up gradually, and this sum leaves zero closer to its start.
    slow: f64,
    /// Estimator and position when the slow sum last left zero.
    snapshot: LayerEstimator,
    snapshot_m: f64,
}

impl BendDetector {
    fn reset(&mut self) {
        self.cusum.reset();
        self.slow = 0.0;
    }

    /// Adds an innovation, of which negative values count; true when the force has bent.
    #[inline(always)]
    fn update(&mut self, z: f64, estimator: &LayerEstimator, last_m: f64) -> bool {
        let next = at_least(0.0, self.slow + SLOW_SHIFT * (-z - 0.5 * SLOW_SHIFT));
        if self.slow == 0.0 && next > 0.0 {
            (self.snapshot, self.snapshot_m) = (*estimator, last_m);
        }
        self.slow = next;
        self.cusum.update(z).alarm
    }
}

impl FreeTipDetector {
    pub(super) fn new(false_alarms_per_hour: f64, interval_s: f64, estimator: &LayerEstimator) -> Self {
        let cusum = CusumBank::new(false_alarms_per_hour, interval_s);
        let side = BendDetector { cusum, slow: 0.0, snapshot: *estimator, snapshot_m: estimator.start_m };
        Self { up: side, down: side }
    }

    pub(super) fn reset(&mut self) {
        self.up.reset();
        self.down.reset();
    }

    /// Starts again from another estimator.
    pub(super) fn restart_from(&mut self, estimator: &LayerEstimator) {
        self.reset();
        (self.up.snapshot, self.down.snapshot) = (*estimator, *estimator);
    }

    /// True while the slow upward sum is zero: no sign of a bend.
    pub(super) fn is_straight(&self) -> bool {
        self.up.slow == 0.0
    }

    /// Takes a standardised innovation `z`; true when the force has risen above a straight line.
    pub(super) fn bends_up(&mut self, z: f64, before: &LayerEstimator, last_m: f64) -> bool {
        let bent = self.up.update(-z, before, last_m);
        if bent {
            self.reset();
        }
        bent
    }

    /// After a sample at `position_m` with the estimator's standardised innovation `z`. `before` is the estimator without the
    /// sample while the tip may be free, `last_m` the previous position. Returns the operations done and whether the force
    /// has bent.
    #[inline(always)]
    pub(super) fn update(
        &mut self,
        estimator: &mut LayerEstimator,
        (before, last_m): (Option<LayerEstimator>, f64),
        (position_m, z, drive): (f64, f64, f64),
        count: u32,
        noise: &NoiseEstimator,
        passed_layers: &mut PassedLayers,
    ) -> (u32, bool) {
        let Some(before) = &before else { return (0, false) };
        let mut operations = OPERATIONS_PER_BEND_TEST;
        if !estimator.tip_free && count.is_multiple_of(EVALUATION_INTERVAL) {
            operations += OPERATIONS_PER_EVALUATION;
            if estimator.test_free_tip(ODDS, self.is_straight(), noise) {
                self.reset();
                return (operations, false);
            }
        }
        let bent_up = self.up.update(-z, before, last_m);
        let bent_down = estimator.tip_free && self.down.update(z, before, last_m);
        if !bent_up && !bent_down {
            return (operations, false);
        }
        let side = if bent_up { &self.up } else { &self.down };
        let (span_m, at_m) = ((position_m - side.snapshot_m).max(0.0), side.snapshot_m);
        *estimator = side.snapshot;
        if span_m == 0.0 {
            // No layer begins while the needle stands still: the tip was loaded before.
            if estimator.tip_free {
                estimator.reopen_split(drive, 1.0 / noise.variance);
            }
            self.reset();
            return (operations, true);
        }
        if !estimator.tip_free {
            // The loading curve of a layer is straight, so there was no layer before the bend.
            estimator.set_zero_stiffness();
        }
        estimator.start_after_bend(at_m, span_m / libm::sqrt(12.0), bent_up, drive, noise, passed_layers);
        self.reset();
        (operations + OPERATIONS_PER_BEND + estimator.extra_operations(), true)
    }
}

impl LayerEstimator {
    /// Conditions the state on a free tip where that is `odds` times as probable as a layer that began at the rupture.
    fn test_free_tip(&mut self, odds: f64, straight: bool, noise: &NoiseEstimator) -> bool {
        let [initial_follows, initial_ends] = self.initial_log_densities;
        let follows = self.log_density_of_free(true, noise) - initial_follows;
        let ends = self.log_density_of_free(false, noise) - initial_ends;
        self.layer_confirmed =
            straight && self.state.x[K] > 0.0 && follows.max(ends) < -CONFIRMATION_POWER * libm::log(odds);
        // Against a layer and the other hypothesis together, the latter weighted by the odds.
        let others = libm::log(odds * (1.0 + odds * libm::exp(follows.min(ends).min(MAX_LOG_ODDS_NATS))));
        if follows.max(ends) < others || !(follows + ends).is_finite() {
            return false;
        }
        self.tip_free = true;
        self.set_zero_stiffness();
        let r = CONDITIONED_VARIANCE_FRACTION * self.state.p[B][B];
        let condition = if follows > ends {
            self.state.innovation([B, B_PREV], [1.0, -1.0], 0.0, r)
        } else {
            self.state.innovation([B], [1.0], 0.0, r)
        };
        self.state.update(&condition);
        true
    }

    /// Conditions the state on a layer without stiffness.
    fn set_zero_stiffness(&mut self) {
        let r = CONDITIONED_VARIANCE_FRACTION * self.state.p[K][K];
        let zero = self.state.innovation([K], [1.0], 0.0, r);
        self.state.update(&zero);
    }
}

#[cfg(test)]
mod tests;
