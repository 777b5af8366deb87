//! Steps of the sensor's zero while the needle is in tissue. At a rupture the force drops by at most the elastic force, and another
//! layer follows. A jump between two samples that goes up, or drops further than a rupture can, is accepted as a step of the zero at
//! once. A drop that may be a rupture is declared as one; where the base law holds, a second estimator assumes the old layer with
//! another zero. If it predicts the force better, the rupture is withdrawn.

use super::air_history::MIN_JUMP_SHARE;
use super::layer_estimator::{BIAS, LayerEstimator};
use super::state::{KalmanEnhancer, MAX_ALARM_MISFIT, MAX_DROP_DURATION_S, OPERATIONS_PER_RUPTURE};
use super::zero_step_state::{Jump, ZeroStepTest};
use crate::bounds::{at_least, at_most};
use crate::sample::{Sample, ZeroStep};

/// Number of samples over which a jump must last and be level.
const LASTING_SAMPLES: u8 = 3;
/// Largest change of the deviation within them, as a share of the jump; if loading is faster than predicted, the deviation grows.
const MAX_GROWTH_SHARE: f64 = 0.3;
/// Smallest jump in standard deviations of the noise.
const MIN_JUMP_SDS: f64 = 5.0;
/// Longest drop that may be a step, in samples.
const JUMP_SAMPLES: f64 = 3.0;
/// Prior log odds of a rupture against a step of the zero: 20 to 1.
const RUPTURE_PRIOR_NATS: f64 = 3.0;
/// Log odds at which a step of the zero is accepted, and at which it is rejected.
const ACCEPTED_NATS: f64 = 5.0;
const DISMISSED_NATS: f64 = 5.0;
/// Relative standard deviation of the size of a drop, from the uncertainty of the elastic force at a rupture.
const DROP_SD_SHARE: f64 = 0.1;
/// Travel in m after which a rupture is final.
const MAX_ZERO_STEP_TEST_TRAVEL_M: f64 = 12e-3;

impl KalmanEnhancer {
    /// Adds a sample that deviates from the prediction by `e_n`; true when the deviations show a step of the zero.
    pub(super) fn is_lasting_jump(&mut self, sample: &Sample, (e_n, s): (f64, f64)) -> bool {
        let jump = &mut self.jump;
        if self.spike_samples <= 1 || jump.count == 0 {
            let first_n = sample.force_n - self.last_sample.force_n;
            *jump = Jump { low_n: e_n, high_n: e_n, first_n, start: *sample, ..Jump::default() };
        }
        jump.sum_n += e_n;
        jump.variance = at_least(jump.variance, s * self.noise.variance);
        jump.low_n = at_most(jump.low_n, e_n);
        jump.high_n = at_least(jump.high_n, e_n);
        jump.count = jump.count.saturating_add(1);
        let mean_n = jump.sum_n / f64::from(jump.count);
        let marginal = self.noise.marginal_variance();
        let level = MAX_GROWTH_SHARE * mean_n.abs() + MIN_JUMP_SDS * libm::sqrt(marginal);
        jump.count > LASTING_SAMPLES
            && !self.base_law_failed
            && jump.high_n - jump.low_n < level
            && jump.first_n * mean_n > MIN_JUMP_SHARE * mean_n * mean_n
            && mean_n * mean_n > MIN_JUMP_SDS * MIN_JUMP_SDS * marginal
    }

    /// Subtracts the jump that has just been found.
    #[cold]
    pub(super) fn accept_jump(&mut self) {
        let Jump { sum_n, count, start, variance, .. } = self.jump;
        let n = f64::from(count.max(1));
        let size_n = sum_n / n;
        // Variance of the prediction, common to all these samples, plus that of the samples.
        let variance = variance + self.noise.variance * self.noise.long_run_factor();
        self.baseline.subtract_step(size_n);
        if !self.baseline.settled {
            self.baseline.history.absorb_last_samples(usize::from(count), size_n);
        }
        self.estimator.widen_bias(variance, &self.noise);
        self.estimator.zero_step_variance += variance;
        self.skip_sample();
        self.jump = Jump::default();
        self.spike_samples = 0;
        self.reset_detector();
        self.output.zero_step = Some(ZeroStep {
            time_s: start.time_s,
            position_m: start.position_m,
            size_n,
            sd_n: libm::sqrt(variance),
            in_tissue: true,
            withdrawn: None,
        });
    }

    /// The lowest force in N that a rupture may leave.
    pub(super) fn lowest_after_rupture_n(&self, position_m: f64) -> f64 {
        let bias = self.noise.bias_n();
        // Friction is known only where the base law holds, the drop is over and the last rupture is final. A free tip is not
        // certain: at constant speed a soft layer looks like growing friction.
        let known = self.estimator.passed_count > 0
            && !self.estimator.tip_free
            && self.post_rupture.is_none()
            && self.zero_step_test.is_none()
            && self.misfit < MAX_ALARM_MISFIT;
        if !known {
            return bias;
        }
        let (friction, variance) = self.estimator.shaft_friction(position_m, &self.noise);
        let least = friction - 3.0 * libm::sqrt(at_least(0.0, variance));
        bias + at_least(0.0, least * self.friction_drive_mps)
    }

    /// Starts the test of a step of the zero against the rupture about to be declared, from the estimator before the drop. `None` if a
    /// step of the zero is excluded.
    pub(super) fn start_zero_step_test(&self, sample: &Sample) -> Option<ZeroStepTest> {
        let candidate = self.candidate?;
        if self.misfit_weight > 0.0 || candidate.count > JUMP_SAMPLES || self.snapshot.tip_free {
            return None;
        }
        let (drop_n, _) = self.last_drop_n;
        if drop_n * drop_n < MIN_JUMP_SDS * MIN_JUMP_SDS * self.noise.marginal_variance() {
            return None;
        }
        let mut estimator = self.snapshot;
        let bias_n = estimator.state.x[BIAS];
        estimator.widen_bias(drop_n * drop_n, &self.noise);
        estimator.skip_sample();
        Some(ZeroStepTest {
            estimator,
            rupture: estimator,
            bias_n,
            nats: -RUPTURE_PRIOR_NATS,
            at: *sample,
            dry_friction: self.dry_friction,
            contact: (self.output.contact_m, self.output.contact_sd_m),
            counts: (self.samples_since_rupture, self.next_report_at, self.time_since_rupture_s),
        })
    }

    /// Sets the estimator of the declared rupture, before its first sample.
    pub(super) fn set_rupture_hypothesis(&mut self, after: &LayerEstimator) {
        if let Some(zero_step_test) = &mut self.zero_step_test {
            let uncertain_n = DROP_SD_SHARE * self.last_drop_n.0;
            zero_step_test.rupture = *after;
            zero_step_test.rupture.widen_bias(uncertain_n * uncertain_n, &self.noise);
        }
    }

    /// Updates both explanations of the last rupture with a sample and accumulates their log-likelihood ratio.
    #[inline]
    pub(super) fn update_zero_step_test(&mut self, sample: &Sample, rho: f64) {
        let Some(zero_step_test) = &mut self.zero_step_test else { return };
        let (position_m, drive) = (sample.position_m, self.friction_drive_mps);
        zero_step_test.estimator.elapsed_s = self.estimator.elapsed_s;
        zero_step_test.rupture.elapsed_s = self.estimator.elapsed_s;
        let (zero_step_e, zero_step_s) =
            zero_step_test.estimator.update(position_m, drive, sample.force_n, rho);
        let (e, s) = zero_step_test.rupture.update(position_m, drive, sample.force_n, rho);
        self.operations += ZERO_STEP_TEST_OPERATIONS;
        let unit = 1.0 / self.noise.variance;
        let ratio = libm::log(s / zero_step_s) + unit * (e * e / s - zero_step_e * zero_step_e / zero_step_s);
        zero_step_test.nats += 0.5 * ratio;
    }

    /// Decides between the explanations of the last rupture. True when it was withdrawn.
    #[inline]
    pub(super) fn decide_zero_step(&mut self, sample: &Sample) -> bool {
        let Some(zero_step_test) = &self.zero_step_test else { return false };
        // Stiffness and friction are not negative.
        let nats = zero_step_test.nats + zero_step_test.rupture.negative_nats(&self.noise)
            - zero_step_test.estimator.negative_nats(&self.noise);
        // While an ordinary drop may continue, its first part looks like a step.
        if nats > ACCEPTED_NATS && self.time_since_rupture_s > MAX_DROP_DURATION_S {
            self.withdraw_rupture();
            return true;
        }
        if nats < -DISMISSED_NATS
            || sample.position_m - zero_step_test.at.position_m > MAX_ZERO_STEP_TEST_TRAVEL_M
        {
            self.zero_step_test = None;
        }
        false
    }

    /// Decides on the last rupture when another follows. The new drop shows how much of the force was elastic, and so the friction
    /// under either explanation; the last rupture is withdrawn if its friction would be negative.
    pub(super) fn decide_zero_step_at_rupture(&mut self, sample: &Sample, rupture_m: f64) {
        let Some(zero_step_test) = self.zero_step_test else { return };
        let negative_nats = |mut estimator: LayerEstimator| {
            let mut passed_layers = self.passed_layers;
            let drive = at_least(1e-6, self.steady_drive_mps);
            estimator.rupture(rupture_m, 0.0, drive, &self.noise, &mut passed_layers);
            estimator.update(sample.position_m, self.friction_drive_mps, sample.force_n, 0.0);
            estimator.negative_nats(&self.noise)
        };
        let nats = zero_step_test.nats + negative_nats(zero_step_test.rupture)
            - negative_nats(zero_step_test.estimator);
        self.operations += 2 * OPERATIONS_PER_RUPTURE;
        if nats > ACCEPTED_NATS {
            self.withdraw_rupture();
        }
    }

    /// Withdraws the last rupture, which was a step of the zero.
    #[cold]
    fn withdraw_rupture(&mut self) {
        let Some(zero_step_test) = self.zero_step_test.take() else { return };
        let withdrawn = self.output.ruptures;
        let size_n = zero_step_test.estimator.state.x[BIAS] - zero_step_test.bias_n;
        let variance = zero_step_test.estimator.state.p[BIAS][BIAS] * self.noise.variance;
        self.estimator = zero_step_test.estimator;
        self.estimator.state.x[BIAS] = zero_step_test.bias_n;
        self.estimator.zero_step_variance = variance;
        self.baseline.subtract_step(size_n);
        self.predictor.shift_level(-size_n);
        self.skip_sample();
        self.output.ruptures = self.output.ruptures.saturating_sub(1);
        (self.output.contact_m, self.output.contact_sd_m) = zero_step_test.contact;
        self.dry_friction = zero_step_test.dry_friction;
        (self.samples_since_rupture, self.next_report_at, self.time_since_rupture_s) = zero_step_test.counts;
        (self.post_rupture, self.drop_continues, self.drop_onset) = (None, false, None);
        (self.continued_drop, self.output.completed_drop) = (None, None);
        self.free_tip.restart_from(&self.estimator);
        self.reset_detector();
        (self.snapshot, self.snapshot_m) = (self.estimator, self.last_sample.position_m);
        self.output.estimate = None;
        self.output.zero_step = Some(ZeroStep {
            time_s: zero_step_test.at.time_s,
            position_m: zero_step_test.at.position_m,
            size_n,
            sd_n: libm::sqrt(at_least(0.0, variance)),
            in_tissue: true,
            withdrawn: Some(withdrawn),
        });
    }
}

/// Multiplications and additions of the test per sample.
const ZERO_STEP_TEST_OPERATIONS: u32 = 2 * (2 * 56 + 2 * 44) + 40;

#[cfg(test)]
mod tests;
