//! Rupture detection: tracks force drops, tests them against noise and texture, and updates all filters at a rupture.

use super::continued_drop::{ContinuedDrop, LIKELY_DROP_SDS};
use super::force_predictor::{MEMORY_M, MotionStep};
use super::motion::SPEED_TIME_CONSTANT_S;
use super::state::{
    DropCandidate, KalmanEnhancer, MAX_DROP_DURATION_S, OPERATIONS_PER_RUPTURE, SURE_DROP_SDS,
};
use crate::bounds::{at_least, at_most};
use crate::config::EnhanceConfig;
use crate::sample::{Cause, Detection, Sample};

/// Samples that the level of a candidate is averaged over at most.
const MAX_AVERAGED_SAMPLES: f64 = 16.0;
/// Smallest drop before the base law is confirmed, as a share of the largest force: the elastic share of the prior at contact.
const UNCONFIRMED_DROP_SHARE: f64 = 0.5;
/// Squared distance in variances within which two estimates of a drop's onset agree.
const SAME_LINE_SDS_SQUARED: f64 = 16.0;
/// Smallest variance of a position in m²: (1 µm)².
const MIN_PLACE_VARIANCE_M2: f64 = 1e-12;

/// Size of a candidate, its standard deviation, and the smallest size that is a rupture, in N.
struct DropSize {
    fall_n: f64,
    sd_n: f64,
    min_n: f64,
}

impl KalmanEnhancer {
    /// Tracks a drop from its start; a sample that outweighs the accumulated sums restarts it.
    #[inline(always)]
    pub(super) fn track_candidate(&mut self, step: &MotionStep, sample: &Sample, outweighs_history: bool) {
        if outweighs_history {
            // What had accumulated was noise.
            (self.candidate, self.level_before_fall_n) = (None, self.predictor.level_n());
        }
        let max_count = self.averaged_samples();
        let candidate = self.candidate.get_or_insert(DropCandidate {
            from_n: self.level_before_fall_n,
            mean_n: sample.force_n,
            missing_n: 0.0,
            duration_s: 0.0,
            count: 0.0,
        });
        if self.misfit_weight == 0.0 {
            // Earlier forces are converted to the present speed.
            let change_n = self.snapshot.friction(sample.position_m) * step.dv_mps;
            candidate.from_n += change_n;
            candidate.mean_n += change_n;
        }
        candidate.duration_s += step.dt_s;
        candidate.count += 1.0;
        let gain = 1.0 / candidate.count.min(max_count);
        candidate.mean_n += gain * (sample.force_n - candidate.mean_n);
        let missing_n = self.snapshot.predict(sample.position_m, self.friction_drive_mps) - sample.force_n;
        candidate.missing_n += gain * (missing_n - candidate.missing_n);
        let over = candidate.duration_s > MAX_DROP_DURATION_S
            && (self.min_drop_n > 0.0 || self.misfit_weight == 0.0);
        if over && self.candidate_size().is_none_or(|size| size.fall_n < size.min_n) {
            // Too slow or too small.
            self.reset_detector();
        }
    }

    /// As many samples as give the force to a quarter of the smallest drop.
    pub(super) fn averaged_samples(&self) -> f64 {
        let max_count = if self.min_drop_n > 0.0 {
            16.0 * self.noise.marginal_variance() / (self.min_drop_n * self.min_drop_n)
        } else {
            MAX_AVERAGED_SAMPLES
        };
        at_least(1.0, at_most(MAX_AVERAGED_SAMPLES, max_count))
    }

    /// True if the candidate exceeds noise and texture.
    pub(super) fn is_rupture(&mut self, config: &EnhanceConfig) -> bool {
        let Some(size) = self.candidate_size() else { return false };
        self.last_drop_n = (size.fall_n, size.sd_n);
        if self.misfit_weight > 0.0 && self.deepest_m - self.contact_sample_m < config.guard.blind_travel_m {
            // Small falls are texture, or the contact is wrong.
            return size.fall_n >= at_least(size.min_n, UNCONFIRMED_DROP_SHARE * self.peak_force_n)
                && self.snapshot.layer_confirmed
                && self.is_contact_final();
        }
        size.fall_n >= size.min_n
    }

    fn candidate_size(&self) -> Option<DropSize> {
        let candidate = self.candidate?;
        let effective =
            (candidate.count.min(MAX_AVERAGED_SAMPLES) / libm::sqrt(self.noise.long_run_factor())).max(1.0);
        let sd_n = libm::sqrt(self.noise.marginal_variance() / effective);
        let fallen_n = candidate.from_n - candidate.mean_n;
        // A free tip cannot rupture anything, but where friction stops growing the force falls below the predictor's
        // extrapolation.
        let growth_n = if self.estimator.tip_free {
            self.estimator.friction_growth(self.steady_drive_mps) * MEMORY_M
        } else {
            0.0
        };
        let sds = SURE_DROP_SDS + self.misfit_weight * (LIKELY_DROP_SDS - SURE_DROP_SDS);
        let sure_n = sds * sd_n + (1.0 - self.misfit_weight) * growth_n;
        if self.misfit_weight > 0.0 {
            return Some(DropSize { fall_n: fallen_n, sd_n, min_n: at_least(self.min_drop_n, sure_n) });
        }
        // Where the base law holds, the force must lie below its prediction as well as below the earlier force.
        Some(DropSize { fall_n: at_most(candidate.missing_n, fallen_n), sd_n, min_n: sure_n })
    }

    /// Resets the CUSUMs and the drop candidate.
    #[inline(always)]
    pub(super) fn reset_detector(&mut self) {
        self.cusum.reset();
        (self.candidate, self.cusum_was_zero) = (None, true);
    }

    /// Handles a further alarm within the duration of the same drop.
    pub(super) fn continue_drop(&mut self, step: &MotionStep, sample: &Sample, sd: f64) {
        let force = (sample.force_n - self.noise.bias_n()).abs().max(sd);
        self.predictor.restart(sample.force_n, force, &self.noise, step.speed_mps, false);
        self.reset_detector();
        // A step of the zero does not continue, so this is a rupture.
        self.zero_step_test = None;
        if let Some(post_rupture) = self.post_rupture {
            self.estimator = post_rupture;
        }
        self.snapshot = self.estimator;
        self.snapshot_m = sample.position_m;
        self.dry_friction.rupture(sample.position_m, self.force_without_baseline_n(sample));
    }

    #[cold]
    pub(super) fn declare_rupture(&mut self, step: &MotionStep, sample: &Sample, excess_nats: f64) {
        if self.next_report_at < u32::MAX {
            self.report_previous_layer(sample);
        }
        self.decide_zero_step_at_rupture(sample, self.snapshot_m);
        let bias = self.noise.bias_n();
        self.zero_step_test = self.start_zero_step_test(sample);
        let (drop_n, sd_n) = self.last_drop_n;
        // Texture adds to the noise.
        let drop_sd_n = sd_n * libm::sqrt(self.innovation_widening());
        let level_n = self.candidate.map_or(sample.force_n, |candidate| candidate.mean_n);
        self.continued_drop = Some(ContinuedDrop::new(drop_n, drop_sd_n, level_n));
        let span = (sample.position_m - self.snapshot_m).max(0.0);
        // A rupture shown by one sample lies half a step before it; one accumulated over many began where the sum left zero,
        // to within a step.
        let first = span.min(step.dz_m.max(0.0));
        let at_m = self.snapshot_m + 0.5 * first;
        let sd_m = if span > 1.5 * first { first.max(0.5 * span) } else { first / libm::sqrt(12.0) };
        let drive = self.steady_drive_mps.max(1e-6);
        let predicted = self.predictor.level_n();
        self.estimator = self.snapshot;
        self.operations += OPERATIONS_PER_RUPTURE + self.estimator.extra_operations();
        self.estimator.rupture(at_m, sd_m, drive, &self.noise, &mut self.passed_layers);
        self.post_rupture = Some(self.estimator);
        self.time_since_rupture_s = 0.0;
        (self.drop_onset, self.time_since_falling_s) = (None, f64::INFINITY);
        (self.pre_rupture, self.alarm_m) = (self.snapshot, sample.position_m);
        let after = self.estimator;
        self.set_rupture_hypothesis(&after);
        self.update_zero_step_test(sample, step.rho);
        self.estimator.update(sample.position_m, self.friction_drive_mps, sample.force_n, step.rho);
        let force = (sample.force_n - bias).abs().max((predicted - sample.force_n).abs());
        self.predictor.restart(sample.force_n, force, &self.noise, step.speed_mps, false);
        self.reset_detector();
        self.free_tip.reset();
        self.snapshot = self.estimator;
        self.snapshot_m = sample.position_m;
        self.samples_since_rupture = 0;
        self.next_report_at = 16;
        if self.output.ruptures == 0 && !self.contact_given {
            self.output.contact_m = Some(self.estimator.start_m - self.estimator.previous_thickness_m);
        }
        self.output.ruptures += 1;
        self.dry_friction.rupture(sample.position_m, self.force_without_baseline_n(sample));
        // At the threshold a rupture is twice as likely as a false alarm; the excess adds to its log odds.
        let confidence = 1.0 / (1.0 + libm::exp(-(excess_nats + core::f64::consts::LN_2)));
        self.output.detection = Some(Detection {
            layer: self.output.ruptures,
            time_s: sample.time_s,
            position_m: sample.position_m,
            located_s: sample.time_s,
            located_m: at_m,
            cause: Cause::Cusum,
            drop_n,
            drop_sd_n,
            confidence,
        });
    }

    /// Reports the whole drop of the last rupture when its time is over.
    pub(super) fn complete_drop(&mut self) {
        if self.time_since_rupture_s > MAX_DROP_DURATION_S
            && let Some(drop) = self.continued_drop.take()
        {
            let noise_n2 = self.noise.marginal_variance();
            self.output.completed_drop = Some(drop.completed(self.output.ruptures, noise_n2));
        }
    }

    /// Adds what the force has fallen further, beyond noise and apart from friction that a lower speed takes away.
    pub(super) fn follow_drop(&mut self, step: &MotionStep, sample: &Sample) {
        let Some(mut drop) = self.continued_drop.filter(|_| self.stop.is_none()) else { return };
        if self.misfit_weight == 0.0 {
            drop.level_n += self.snapshot.friction(sample.position_m) * step.dv_mps;
        }
        drop.push(sample.force_n, self.noise.marginal_variance(), self.averaged_samples());
        self.continued_drop = Some(drop);
    }

    /// True while the force is still falling after a rupture. At the end of a long drop the rupture's position is revised.
    pub(super) fn drop_is_ongoing(&mut self, step: &MotionStep, sample: &Sample) -> bool {
        // Acceleration from the lag of the low-passed speed.
        let accel_mps2 = (sample.velocity_mps - step.speed_mps) / SPEED_TIME_CONSTANT_S;
        let friction = self.estimator.shaft_friction(sample.position_m, &self.noise).0;
        let (rate, variance) = self.predictor.rate(step.speed_mps, accel_mps2, friction);
        let sd = libm::sqrt(variance * self.noise.variance);
        let falling = rate < -3.0 * sd;
        self.time_since_falling_s = if falling { 0.0 } else { self.time_since_falling_s + step.dt_s };
        if self.drop_continues && !falling {
            // The slope of the drop does not apply after it.
            let force = (sample.force_n - self.noise.bias_n()).abs().max(sd * step.dt_s);
            self.predictor.restart(sample.force_n, force, &self.noise, step.speed_mps, false);
        }
        if self.time_since_rupture_s > MAX_DROP_DURATION_S {
            if falling {
                self.locate_drop_onset(step, sample, rate, sd);
            } else if rate > -2.0 * sd && self.time_since_falling_s > MAX_DROP_DURATION_S {
                self.post_rupture = None;
                self.relocate_rupture();
            }
        }
        falling
    }

    /// A long drop began where the straight line of the falling force meets the prediction of the base law; keeps the most
    /// accurate estimate.
    fn locate_drop_onset(&mut self, step: &MotionStep, sample: &Sample, rate_n_per_s: f64, sd_n_per_s: f64) {
        let drive = self.friction_drive_mps;
        let steepness = self.pre_rupture.slope(drive) - rate_n_per_s / step.speed_mps;
        let missing_n = self.pre_rupture.predict(sample.position_m, drive) - self.predictor.level_n();
        let back_m = missing_n / steepness;
        // Errors of level and slope are correlated.
        let (level, covariance) = self.predictor.level_covariance(step.speed_mps);
        let (back_s, noise_n2) = (back_m / step.speed_mps, self.noise.variance);
        let line_n2 =
            level * noise_n2 + back_s * (back_s * sd_n_per_s * sd_n_per_s - 2.0 * covariance * noise_n2);
        let variance = at_least(MIN_PLACE_VARIANCE_M2, line_n2 / (steepness * steepness));
        let onset_m = sample.position_m - back_m;
        // A line with another onset no longer describes the drop.
        let same_line = self.drop_onset.is_none_or(|(best_m, best)| {
            let off_m = onset_m - best_m;
            variance < best && off_m * off_m < SAME_LINE_SDS_SQUARED * best
        });
        if steepness > 0.0 && same_line {
            self.drop_onset = Some((onset_m, variance));
        }
    }

    /// Moves the last rupture to the start of a long drop, from the estimator before it.
    fn relocate_rupture(&mut self) {
        let Some((onset_m, variance)) = self.drop_onset.take() else { return };
        let located_m = self.estimator.start_m;
        let span_m = self.alarm_m - located_m;
        let earliest_m = located_m - at_least(MEMORY_M, span_m);
        let onset_m = at_most(self.alarm_m, at_least(earliest_m, onset_m));
        self.operations += OPERATIONS_PER_RUPTURE + self.estimator.extra_operations();
        self.estimator = self.pre_rupture;
        let drive = self.steady_drive_mps.max(1e-6);
        self.estimator.rupture(
            onset_m,
            at_most(at_least(0.0, span_m), libm::sqrt(variance)),
            drive,
            &self.noise,
            &mut self.passed_layers,
        );
    }
}

#[cfg(test)]
mod tests;
