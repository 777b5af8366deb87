//! Steps of the sensor's zero while the needle is in tissue. A rupture relaxes the elastic force: the force falls, by no more
//! than that, and what follows is another layer. A jump between two samples that goes up, or falls further than any rupture,
//! is a step of the zero at once. A fall that may be a rupture is declared as one; where the base law holds, a rival estimator
//! carries the old layer on with another zero, and takes over when it predicts the force better: the rupture is withdrawn.

use super::air_history::MIN_JUMP_SHARE;
use super::gaussian::{at_least, at_most};
use super::layer_estimator::{BIAS, LayerEstimator};
use super::state::{KalmanEnhancer, MAX_ALARM_MISFIT, OPERATIONS_PER_RUPTURE};
use super::zero_step_state::{Jump, Rival};
use crate::sample::{Sample, ZeroStep};

/// Samples by which a jump has to last, and within which it has to be level.
const LASTING_SAMPLES: u8 = 3;
/// Largest change of the deviation within them, as a share of the jump: loading that is faster than predicted grows.
const MAX_GROWTH_SHARE: f64 = 0.3;
/// Smallest jump in standard deviations of the noise.
const MIN_JUMP_SDS: f64 = 5.0;
/// Samples within which a fall is a jump.
const JUMP_SAMPLES: f64 = 3.0;
/// Log odds of a rupture against a step of the zero before any data: twenty to one.
const RUPTURE_PRIOR_NATS: f64 = 3.0;
/// Log odds at which a step of the zero is accepted, and at which a rupture is.
const ACCEPTED_NATS: f64 = 5.0;
const DISMISSED_NATS: f64 = 5.0;
/// Standard deviation of the size of a drop, as a share of it: the elastic force at a rupture is not known better.
const DROP_SD_SHARE: f64 = 0.1;
/// Travel in m after which a rupture stands.
const MAX_RIVAL_TRAVEL_M: f64 = 12e-3;

impl KalmanEnhancer {
    /// Takes a sample far off the prediction by `e_n`. True when the zero has jumped.
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
        // Of the prediction, which all these samples share, and of the samples.
        let variance = variance + self.noise.variance * self.noise.long_run_factor();
        self.baseline.subtract_step(size_n);
        if !self.baseline.settled {
            self.baseline.history.absorb_last_samples(usize::from(count), size_n);
        }
        self.estimator.widen_bias(variance, &self.noise);
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
        // A drop may go on, and friction is known only where the base law holds and the last rupture stands. That the tip is free is
        // no more than likely: at one speed a soft layer looks like growing friction.
        let known = self.estimator.passed_count > 0
            && !self.estimator.tip_free
            && self.post_rupture.is_none()
            && self.rival.is_none()
            && self.misfit < MAX_ALARM_MISFIT;
        if !known {
            return bias;
        }
        let (friction, variance) = self.estimator.shaft_friction(position_m, &self.noise);
        let least = friction - 3.0 * libm::sqrt(at_least(0.0, variance));
        bias + at_least(0.0, least * self.friction_drive_mps)
    }

    /// A rupture is about to be declared, from the estimator before the fall. `None` where it is certainly one.
    pub(super) fn rival_of_rupture(&self, sample: &Sample) -> Option<Rival> {
        let candidate = self.candidate?;
        if self.misfit_weight > 0.0 || candidate.count > JUMP_SAMPLES || self.snapshot.tip_free {
            return None;
        }
        let (drop_n, _) = self.last_drop_n;
        if drop_n * drop_n < MIN_JUMP_SDS * MIN_JUMP_SDS * self.noise.marginal_variance() {
            return None;
        }
        let mut estimator = self.snapshot;
        let bias_n = estimator.belief.x[BIAS];
        estimator.widen_bias(drop_n * drop_n, &self.noise);
        estimator.skip_sample();
        Some(Rival {
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

    /// The rupture has been declared: its estimator, before the first sample.
    pub(super) fn set_rupture(&mut self, after: &LayerEstimator) {
        if let Some(rival) = &mut self.rival {
            let uncertain_n = DROP_SD_SHARE * self.last_drop_n.0;
            rival.rupture = *after;
            rival.rupture.widen_bias(uncertain_n * uncertain_n, &self.noise);
        }
    }

    /// Both explanations of the last rupture take a sample.
    #[inline]
    pub(super) fn compare_rival(&mut self, sample: &Sample, rho: f64) {
        let Some(rival) = &mut self.rival else { return };
        let (position_m, drive) = (sample.position_m, self.friction_drive_mps);
        rival.estimator.elapsed_s = self.estimator.elapsed_s;
        rival.rupture.elapsed_s = self.estimator.elapsed_s;
        let (rival_e, rival_s) = rival.estimator.update(position_m, drive, sample.force_n, rho);
        let (e, s) = rival.rupture.update(position_m, drive, sample.force_n, rho);
        self.operations += RIVAL_OPERATIONS;
        let unit = 1.0 / self.noise.variance;
        let ratio = libm::log(s / rival_s) + unit * (e * e / s - rival_e * rival_e / rival_s);
        rival.nats += 0.5 * ratio;
    }

    /// Decides between the explanations of the last rupture. True when it was withdrawn.
    #[inline]
    pub(super) fn decide_rival(&mut self, sample: &Sample) -> bool {
        let Some(rival) = &self.rival else { return false };
        // Stiffness and friction are not negative.
        let nats = rival.nats + rival.rupture.negative_nats(&self.noise)
            - rival.estimator.negative_nats(&self.noise);
        if nats > ACCEPTED_NATS {
            self.withdraw_rupture();
            return true;
        }
        if nats < -DISMISSED_NATS || sample.position_m - rival.at.position_m > MAX_RIVAL_TRAVEL_M {
            self.rival = None;
        }
        false
    }

    /// Another rupture before the last one is decided. Its drop tells how much of the force was elastic, hence what friction
    /// either explanation leaves; the last one is withdrawn where it would have to be negative.
    pub(super) fn decide_rival_at_rupture(&mut self, sample: &Sample, rupture_m: f64) {
        let Some(rival) = self.rival else { return };
        let negative_nats = |mut estimator: LayerEstimator| {
            let mut passed_layers = self.passed_layers;
            let drive = at_least(1e-6, self.steady_drive_mps);
            estimator.rupture(rupture_m, 0.0, drive, &self.noise, &mut passed_layers);
            estimator.update(sample.position_m, self.friction_drive_mps, sample.force_n, 0.0);
            estimator.negative_nats(&self.noise)
        };
        let nats = rival.nats + negative_nats(rival.rupture) - negative_nats(rival.estimator);
        self.operations += 2 * OPERATIONS_PER_RUPTURE;
        if nats > ACCEPTED_NATS {
            self.withdraw_rupture();
        }
    }

    /// The last rupture was a step of the zero.
    #[cold]
    fn withdraw_rupture(&mut self) {
        let Some(rival) = self.rival.take() else { return };
        let withdrawn = self.output.ruptures;
        let size_n = rival.estimator.belief.x[BIAS] - rival.bias_n;
        let variance = rival.estimator.belief.p[BIAS][BIAS] * self.noise.variance;
        self.estimator = rival.estimator;
        self.estimator.belief.x[BIAS] = rival.bias_n;
        self.baseline.subtract_step(size_n);
        self.predictor.shift_level(-size_n);
        self.skip_sample();
        self.output.ruptures = self.output.ruptures.saturating_sub(1);
        (self.output.contact_m, self.output.contact_sd_m) = rival.contact;
        self.dry_friction = rival.dry_friction;
        (self.samples_since_rupture, self.next_report_at, self.time_since_rupture_s) = rival.counts;
        (self.post_rupture, self.drop_continues, self.drop_onset) = (None, false, None);
        self.free_tip.restart_from(&self.estimator);
        self.reset_detector();
        (self.snapshot, self.snapshot_m) = (self.estimator, self.last_sample.position_m);
        self.output.estimate = None;
        self.output.zero_step = Some(ZeroStep {
            time_s: rival.at.time_s,
            position_m: rival.at.position_m,
            size_n,
            sd_n: libm::sqrt(at_least(0.0, variance)),
            in_tissue: true,
            withdrawn: Some(withdrawn),
        });
    }
}

/// Multiplications and additions of a sample of the rival.
const RIVAL_OPERATIONS: u32 = 2 * (2 * 56 + 2 * 44) + 40;
