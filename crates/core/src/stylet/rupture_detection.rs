//! A fall of the force: whether it is a rupture, and what a rupture does.

use super::force_predictor::{MEMORY_M, MotionStep};
use super::gaussian::{at_least, at_most};
use super::motion::SPEED_TIME_CONSTANT_S;
use super::{MAX_DROP_DURATION_S, OPERATIONS_PER_RUPTURE, Stylet};
use crate::config::EnhanceConfig;
use crate::sample::{Cause, Detection, Sample};

/// Samples that the level of a fall is averaged over at most.
const MOST_AVERAGED: f64 = 16.0;

/// Standard deviations that a fall below the law has to have: whatever else set off the alarm, noise makes it so low once in 30 000 looks.
pub(super) const SURE_DROP_SDS: f64 = 4.0;

/// Where it does not hold: a drop below its own interval is none.
const LIKELY_SDS: f64 = 2.0;

/// Squared number of standard deviations within which two lines lead to the same place: 4.
const SAME_LINE: f64 = 16.0;

/// A place is not known better than to a micrometre, in m².
const TINY_M2: f64 = 1e-12;

/// A fall of the force that may become a rupture.
#[derive(Clone, Copy, Debug)]
pub(super) struct DropCandidate {
    from_n: f64,
    mean_n: f64,
    /// What the law of layers said before it began, less what is measured.
    missing_n: f64,
    since_s: f64,
    count: f64,
}

/// How large a fall is, its standard deviation, and the least that is a rupture, in N.
struct Size {
    fall_n: f64,
    sd_n: f64,
    least_n: f64,
}

impl Stylet {
    /// Follows a fall from where it began: anew where this sample alone says more than all before.
    #[inline(always)]
    pub(super) fn track_candidate(&mut self, step: &MotionStep, sample: &Sample, outweighs: bool) {
        if outweighs {
            // What was summed up before was noise.
            (self.candidate, self.level_before_fall_n) = (None, self.predictor.level_n());
        }
        let fall = self.candidate.get_or_insert(DropCandidate {
            from_n: self.level_before_fall_n,
            mean_n: sample.force_n,
            missing_n: 0.0,
            since_s: 0.0,
            count: 0.0,
        });
        if self.misfit_weight == 0.0 {
            // A change of speed changes the friction: what was measured before counts as it would be at this speed.
            let change_n = self.snapshot.friction(sample.position_m) * step.dv_mps;
            fall.from_n += change_n;
            fall.mean_n += change_n;
        }
        fall.since_s += step.dt_s;
        fall.count += 1.0;
        // As many samples as it takes to know the force to a quarter of the drop that counts.
        let most = if self.min_drop_n > 0.0 {
            16.0 * self.noise.marginal_variance() / (self.min_drop_n * self.min_drop_n)
        } else {
            MOST_AVERAGED
        };
        let most = most.clamp(1.0, MOST_AVERAGED);
        let share = 1.0 / fall.count.min(most);
        fall.mean_n += share * (sample.force_n - fall.mean_n);
        let missing_n = self.snapshot.predict(sample.position_m, self.friction_drive_mps) - sample.force_n;
        fall.missing_n += share * (missing_n - fall.missing_n);
        let over = fall.since_s > MAX_DROP_DURATION_S && (self.min_drop_n > 0.0 || self.misfit_weight == 0.0);
        if over && self.size().is_none_or(|size| size.fall_n < size.least_n) {
            // Too slow, or too small: not a rupture.
            self.reset_detector();
        }
    }

    /// Whether the fall so far is a drop: larger than what the noise may feign, and than texture.
    pub(super) fn is_rupture(&mut self, config: &EnhanceConfig) -> bool {
        // As long as the law has not been seen to hold, the first travel after contact is no layer.
        if self.misfit_weight > 0.0 && self.deepest_m - self.contact_sample_m < config.guard.blind_travel_m {
            return false;
        }
        let Some(size) = self.size() else { return false };
        self.last_drop_n = (size.fall_n, size.sd_n);
        size.fall_n >= size.least_n
    }

    /// Size of the fall so far, how well it is known, and what it would have to be.
    fn size(&self) -> Option<Size> {
        let fall = self.candidate?;
        let effective = (fall.count.min(MOST_AVERAGED) / libm::sqrt(self.noise.long_run_factor())).max(1.0);
        let sd_n = libm::sqrt(self.noise.marginal_variance() / effective);
        let fallen_n = fall.from_n - fall.mean_n;
        // A free tip has nothing to lose, but where friction stops to grow the force is below what the predictor's memory makes of the growth.
        let growth_n = if self.estimator.tip_free {
            self.estimator.friction_growth(self.steady_drive_mps) * MEMORY_M
        } else {
            0.0
        };
        let sure_sds = SURE_DROP_SDS + self.misfit_weight * (LIKELY_SDS - SURE_DROP_SDS);
        let sure_n = sure_sds * sd_n + (1.0 - self.misfit_weight) * growth_n;
        if self.misfit_weight > 0.0 {
            return Some(Size { fall_n: fallen_n, sd_n, least_n: at_least(self.min_drop_n, sure_n) });
        }
        // Where the law of layers holds it knows what the force would be; and the force has to have fallen, too.
        let (fall_n, least_n) = (at_most(fall.missing_n, fallen_n), sure_n);
        Some(Size { fall_n, sd_n, least_n })
    }

    /// Nothing that was summed up so far counts.
    #[inline(always)]
    pub(super) fn reset_detector(&mut self) {
        self.cusum.reset();
        (self.candidate, self.cusum_was_zero) = (None, true);
    }

    pub(super) fn continue_drop(&mut self, step: &MotionStep, sample: &Sample, sd: f64) {
        let force = (sample.force_n - self.noise.bias_n()).abs().max(sd);
        self.predictor.restart(sample.force_n, force, &self.noise, step.speed_mps, false);
        self.reset_detector();
        if let Some(fallen) = self.post_rupture {
            self.estimator = fallen;
        }
        self.snapshot = self.estimator;
        self.snapshot_m = sample.position_m;
        self.dry_friction.rupture(sample.position_m, sample.force_n - self.noise.bias_n());
    }

    #[cold]
    pub(super) fn declare_rupture(&mut self, step: &MotionStep, sample: &Sample, evidence: f64) {
        if self.next_report_at < u32::MAX {
            self.report_previous_layer(sample);
        }
        let bias = self.noise.bias_n();
        let span = (sample.position_m - self.snapshot_m).max(0.0);
        // One sample that says it all lies half a step behind the rupture; a sum over many began where it left zero, give or take
        // a step.
        let first = span.min(step.dz_m.max(0.0));
        let at_m = self.snapshot_m + 0.5 * first;
        let place_m = if span > 1.5 * first { first.max(0.5 * span) } else { first / libm::sqrt(12.0) };
        let drive = self.steady_drive_mps.max(1e-6);
        let predicted = self.predictor.level_n();
        self.estimator = self.snapshot;
        self.operations += OPERATIONS_PER_RUPTURE;
        self.estimator.rupture(at_m, place_m, drive, &self.noise, &mut self.passed_layers);
        self.post_rupture = Some(self.estimator);
        self.time_since_rupture_s = 0.0;
        (self.drop_onset, self.time_since_falling_s) = (None, f64::INFINITY);
        (self.pre_rupture, self.alarm_m) = (self.snapshot, sample.position_m);
        self.estimator.update(sample.position_m, self.friction_drive_mps, sample.force_n, step.rho);
        let force = (sample.force_n - bias).abs().max((predicted - sample.force_n).abs());
        self.predictor.restart(sample.force_n, force, &self.noise, step.speed_mps, false);
        self.reset_detector();
        self.free_tip.reset();
        self.snapshot = self.estimator;
        self.snapshot_m = sample.position_m;
        self.samples_since_rupture = 0;
        self.next_report_at = 16;
        if self.output.ruptures == 0 {
            self.output.contact_m = Some(self.estimator.start_m - self.estimator.previous_thickness_m);
        }
        self.output.ruptures += 1;
        self.dry_friction.rupture(sample.position_m, sample.force_n - bias);
        // Before the sum passed its threshold a rupture was as likely as a false alarm; what is above it counts.
        let confidence = 1.0 / (1.0 + libm::exp(-(evidence + core::f64::consts::LN_2)));
        let (drop_n, drop_sd_n) = self.last_drop_n;
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

    /// Whether the drop still goes on; once it is over, that is settled.
    pub(super) fn drop_is_ongoing(&mut self, step: &MotionStep, sample: &Sample) -> bool {
        // How the speed changes: by as much as it is away from its low-passed self.
        let accel_mps2 = (sample.velocity_mps - step.speed_mps) / SPEED_TIME_CONSTANT_S;
        let friction = self.estimator.shaft_friction(sample.position_m, &self.noise).0;
        let (rate, variance) = self.predictor.rate(step.speed_mps, accel_mps2, friction);
        let sd = libm::sqrt(variance * self.noise.variance);
        let falling = rate < -3.0 * sd;
        self.time_since_falling_s = if falling { 0.0 } else { self.time_since_falling_s + step.dt_s };
        if self.drop_continues && !falling {
            // The slope of a fall that may be over is not that of what follows.
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

    /// A drop that lasts began where the straight line of the force that falls meets what the law says: the best known of what its samples say.
    fn locate_drop_onset(&mut self, step: &MotionStep, sample: &Sample, rate_n_per_s: f64, sd_n_per_s: f64) {
        let steep = self.pre_rupture.slope(self.friction_drive_mps) - rate_n_per_s / step.speed_mps;
        let back_m = (self.pre_rupture.predict(sample.position_m, self.friction_drive_mps)
            - self.predictor.level_n())
            / steep;
        // Level and slope are wrong together: what makes the one too high makes the line less steep.
        let (level, both) = self.predictor.level_covariance(step.speed_mps);
        let (by_m, noise_n2) = (back_m / step.speed_mps, self.noise.variance);
        let line_n2 = level * noise_n2 + by_m * (by_m * sd_n_per_s * sd_n_per_s - 2.0 * both * noise_n2);
        let variance = at_least(TINY_M2, line_n2 / (steep * steep));
        let began_m = sample.position_m - back_m;
        // A line that does not lead to where it led before is not that of the fall any more.
        let same_line = self.drop_onset.is_none_or(|(best_m, best)| {
            let off_m = began_m - best_m;
            variance < best && off_m * off_m < SAME_LINE * best
        });
        if steep > 0.0 && same_line {
            self.drop_onset = Some((began_m, variance));
        }
    }

    /// What was taken for a sudden drop began before: the belief of before moves on from there.
    fn relocate_rupture(&mut self) {
        let Some((began_m, variance)) = self.drop_onset.take() else { return };
        let located_m = self.estimator.start_m;
        let span_m = self.alarm_m - located_m;
        let earliest_m = located_m - at_least(MEMORY_M, span_m);
        let began_m = at_most(self.alarm_m, at_least(earliest_m, began_m));
        self.operations += OPERATIONS_PER_RUPTURE;
        self.estimator = self.pre_rupture;
        let drive = self.steady_drive_mps.max(1e-6);
        self.estimator.rupture(
            began_m,
            at_most(at_least(0.0, span_m), libm::sqrt(variance)),
            drive,
            &self.noise,
            &mut self.passed_layers,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::force_predictor::ForcePredictor;
    use super::super::layer_estimator::{B, B_PREV, D, K_PREV, LayerEstimator, PassedLayers};
    use super::super::noise_estimator::NoiseEstimator;
    use super::super::shaft_friction::ShaftSample;
    use super::super::tests::{inside, near, sample, step};
    use super::*;
    use alloc::vec::Vec;

    /// A fall that has gone on for `count` samples, from 1.9 N to 1.6 N, where the law says 1.85 N.
    fn fallen(count: f64) -> Stylet {
        let mut stylet = inside();
        stylet.candidate =
            Some(DropCandidate { from_n: 1.9, mean_n: 1.6, missing_n: 0.25, since_s: 0.005 * count, count });
        stylet
    }

    /// 10 mm deep and .3 N below the law, which grows by 78 N/m.
    fn low() -> Stylet {
        let mut stylet = inside();
        stylet.pre_rupture = stylet.estimator;
        stylet.predictor.belief.x[0] = 1.2;
        stylet.predictor.belief.p[0][0] = 0.25;
        (stylet.predictor.belief.p[1][0], stylet.predictor.belief.p[2][0]) = (0.05, 3.0);
        stylet
    }

    #[test]
    fn a_drop_that_lasts_is_traced_back_to_where_its_line_meets_the_law() {
        let mut stylet = low();
        // .9 N/s at 2 mm/s, known to .1 N/s.
        stylet.locate_drop_onset(&step(), &sample(0.01, 1.2), -0.9, 0.1);
        let (steep, noise_n2) = (78.0 + 450.0, 4e-4);
        let back_s = 0.3 / steep / 0.002;
        let line_n2 = 0.25 * noise_n2 + back_s * (back_s * 0.01 - 2.0 * (0.05 + 0.002 * 3.0) * noise_n2);
        let (began_m, variance) = stylet.drop_onset.expect("a place");
        near(began_m, 0.01 - 0.3 / steep);
        near(variance, line_n2 / (steep * steep));
        let kept = stylet.drop_onset;
        // Known worse: it stays. Better, but four standard deviations and more from there: another line.
        stylet.locate_drop_onset(&step(), &sample(0.01, 1.2), -0.85, 0.2);
        assert_eq!(stylet.drop_onset, kept);
        stylet.locate_drop_onset(&step(), &sample(0.01, 1.2), -0.5, 0.01);
        assert_eq!(stylet.drop_onset, kept);
        stylet.locate_drop_onset(&step(), &sample(0.01, 1.2), -0.88, 0.05);
        near(stylet.drop_onset.expect("a better place").0, 0.01 - 0.3 / (78.0 + 440.0));
        // A force that falls less than the law is no line to trace back.
        let mut stylet = low();
        stylet.locate_drop_onset(&step(), &sample(0.01, 1.2), 0.16, 0.1);
        assert!(stylet.drop_onset.is_none());
    }

    #[test]
    fn the_layer_behind_a_drop_that_lasted_begins_where_the_drop_did() {
        for (traced_m, sd_m, began_m) in
            [(0.0093, 4e-5, 0.0093), (0.0106, 4e-5, 0.0101), (0.0081, 4e-5, 0.0087)]
        {
            let mut stylet = low();
            (stylet.estimator.start_m, stylet.alarm_m) = (0.0097, 0.0101);
            stylet.drop_onset = Some((traced_m, sd_m * sd_m));
            let mut expected = stylet.pre_rupture;
            expected.rupture(began_m, sd_m, 0.002, &stylet.noise, &mut PassedLayers::default());
            stylet.relocate_rupture();
            assert!(stylet.drop_onset.is_none());
            near(stylet.estimator.start_m, began_m);
            for k in 0..6 {
                near(stylet.estimator.belief.x[k], expected.belief.x[k]);
                near(stylet.estimator.belief.p[k][k], expected.belief.p[k][k]);
            }
            near(stylet.passed_layers[0][1], began_m);
        }
        // One that did not last is left as it is.
        let mut stylet = low();
        let start_m = stylet.estimator.start_m;
        stylet.relocate_rupture();
        assert_eq!((stylet.estimator.start_m, stylet.estimator.passed_count), (start_m, 0));
    }

    #[test]
    fn a_fall_is_from_the_level_before_to_the_mean_since_as_if_the_speed_had_stayed() {
        let mut stylet = inside();
        stylet.level_before_fall_n = 1.48;
        // Friction of 25 + 9000 x N s/m, while the speed falls by 0.4 and 0.2 mm/s.
        let friction = 25.0 + 9000.0 * 0.01;
        stylet.track_candidate(&MotionStep { dv_mps: -4e-4, ..step() }, &sample(0.01, 1.3), false);
        let fall = stylet.candidate.expect("a fall");
        near(fall.from_n, 1.48 - friction * 4e-4);
        near(fall.mean_n, 1.3);
        near(fall.missing_n, 1.5 - 1.3);
        assert_eq!((fall.since_s, fall.count), (0.005, 1.0));
        stylet.friction_drive_mps = 0.0018;
        stylet.track_candidate(&MotionStep { dv_mps: -2e-4, ..step() }, &sample(0.01, 1.2), false);
        let fall = stylet.candidate.expect("a fall");
        near(fall.from_n, 1.48 - friction * 6e-4);
        near(fall.mean_n, 0.5 * (1.3 - friction * 2e-4 + 1.2));
        near(fall.missing_n, 0.5 * (0.2 + 0.277));
        assert_eq!((fall.since_s, fall.count), (0.01, 2.0));
        // Where the law does not hold, nobody knows what the speed makes of the force.
        let mut stylet = inside();
        (stylet.level_before_fall_n, stylet.misfit_weight) = (1.48, 0.3);
        stylet.track_candidate(&MotionStep { dv_mps: -4e-4, ..step() }, &sample(0.01, 1.3), false);
        near(stylet.candidate.expect("a fall").from_n, 1.48);
    }

    #[test]
    fn what_outweighs_all_before_begins_the_fall_anew_at_what_was_expected() {
        let mut stylet = fallen(7.0);
        stylet.level_before_fall_n = 9.0;
        stylet.track_candidate(&step(), &sample(0.01, 1.1), true);
        let fall = stylet.candidate.expect("a fall");
        assert_eq!((fall.from_n, fall.mean_n, fall.count), (1.5, 1.1, 1.0));
        assert_eq!(stylet.level_before_fall_n, 1.5);
    }

    #[test]
    fn the_level_of_a_fall_is_the_mean_of_as_many_samples_as_a_quarter_of_the_least_drop_takes() {
        // Noise of 20 mN, to a quarter of 50 mN: 2.56 samples; of 5 mN: sixteen and no more; of 1 N: one.
        for (least_n, most) in [(0.0, 16.0), (0.05, 2.56), (0.005, 16.0), (1.0, 1.0)] {
            let mut stylet = inside();
            (stylet.min_drop_n, stylet.level_before_fall_n) = (least_n, 5.0);
            let (mut mean_n, mut missing_n) = (0.0, 0.0);
            for k in 1..=19_u32 {
                let force_n = 1.0 + 0.1 * f64::from(k * 7 % 5);
                stylet.track_candidate(&step(), &sample(0.01, force_n), false);
                let share = 1.0 / f64::from(k).min(most);
                mean_n += share * (force_n - mean_n);
                missing_n += share * (1.5 - force_n - missing_n);
                let fall = stylet.candidate.expect("a fall");
                near(fall.mean_n, mean_n);
                assert!((fall.missing_n - missing_n).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_fall_that_is_too_small_after_a_tenth_of_a_second_is_none() {
        // Roughness, least drop, duration, force after it, and whether the fall goes on. Least is four standard deviations of the level's
        // 20 mN, or half of that where the law does not hold.
        for (rough, least_n, dt_s, force_n, goes_on) in [
            (0.0, 0.0, 0.101, 1.45, false),
            (0.0, 0.0, 0.101, 1.3, true),
            (0.0, 0.0, 0.1, 1.45, true),
            (0.0, 0.0, 0.09, 1.45, true),
            (0.4, 0.0, 0.101, 1.48, true),
            (0.4, 0.25, 0.101, 1.45, false),
            (0.4, 0.25, 0.101, 1.0, true),
            (0.4, 0.25, 0.101, 1.25, true),
            (0.4, 0.25, 0.1, 1.45, true),
        ] {
            let mut stylet = inside();
            (stylet.misfit_weight, stylet.min_drop_n, stylet.level_before_fall_n) = (rough, least_n, 1.5);
            stylet.cusum.update(-1.0);
            stylet.cusum_was_zero = false;
            stylet.track_candidate(&MotionStep { dt_s, ..step() }, &sample(0.01, force_n), false);
            let found =
                (stylet.candidate.is_some(), stylet.cusum.relative_level() > 0.0, stylet.cusum_was_zero);
            assert_eq!(found, (goes_on, goes_on, !goes_on), "{rough} {least_n} N {dt_s} s {force_n} N");
        }
    }

    #[test]
    fn a_fall_is_as_large_as_both_law_and_level_say_and_has_to_be_four_standard_deviations() {
        let size = |stylet: &Stylet| {
            let size = stylet.size().expect("a fall");
            [size.fall_n, size.sd_n, size.least_n]
        };
        let assert = |found: [f64; 3], expected: [f64; 3]| {
            found.into_iter().zip(expected).for_each(|(f, e)| near(f, e));
        };
        // Of ten samples of 20 mN.
        let sd_n = 0.02 / 10.0_f64.sqrt();
        assert(size(&fallen(10.0)), [0.25, sd_n, 4.0 * sd_n]);
        let mut stylet = fallen(10.0);
        stylet.candidate = stylet.candidate.map(|fall| DropCandidate { from_n: 1.7, ..fall });
        assert(size(&stylet), [0.1, sd_n, 4.0 * sd_n]);
        // Of no more than sixteen; of less than one where the noise is slow.
        assert(size(&fallen(40.0)), [0.25, 0.005, 0.02]);
        let mut stylet = fallen(10.0);
        stylet.noise = NoiseEstimator::known(0.5, 3e-4, 0.0, 400.0);
        let sd_n = 0.02 / 5.0_f64.sqrt();
        assert(size(&stylet), [0.25, sd_n, 4.0 * sd_n]);
        stylet.candidate = stylet.candidate.map(|fall| DropCandidate { count: 1.0, ..fall });
        assert(size(&stylet), [0.25, 0.02, 0.08]);
        // A free tip: and what friction of 7000 N s/m² grows by over a millimetre, 14 mN.
        let mut stylet = fallen(16.0);
        stylet.estimator.belief.x[B_PREV] = 7000.0;
        assert(size(&stylet), [0.25, 0.005, 0.02]);
        stylet.estimator.tip_free = true;
        assert(size(&stylet), [0.25, 0.005, 0.034]);
        // Where the law does not hold it is not asked: two standard deviations, and the least drop; in between as much of either.
        (stylet.misfit_weight, stylet.min_drop_n) = (0.5, 0.004);
        assert(size(&stylet), [0.3, 0.005, 0.022]);
        let mut stylet = fallen(16.0);
        (stylet.misfit_weight, stylet.min_drop_n) = (1.0, 0.004);
        assert(size(&stylet), [0.3, 0.005, 0.01]);
        stylet.min_drop_n = 0.2;
        assert(size(&stylet), [0.3, 0.005, 0.2]);
        stylet.candidate = None;
        assert!(stylet.size().is_none());
    }

    #[test]
    fn a_drop_is_a_fall_of_the_least_size_and_none_in_the_blind_travel_of_a_law_that_is_not_seen_to_hold() {
        let config = EnhanceConfig::default();
        // Roughness, least drop, deepest point behind contact at 1 mm.
        for (rough, least_n, deepest_m, drop) in [
            (0.0, 0.0, 0.0099, true),
            (0.0, 0.0, 0.0029, true),
            (0.3, 0.0, 0.0099, true),
            (0.3, 0.0, 0.0029, false),
            (0.3, 0.31, 0.0099, false),
            (0.3, 0.29, 0.0099, true),
        ] {
            let mut stylet = fallen(16.0);
            (stylet.misfit_weight, stylet.min_drop_n, stylet.deepest_m) = (rough, least_n, deepest_m);
            assert_eq!(stylet.is_rupture(&config), drop, "{rough} {least_n} N {deepest_m} m");
            if deepest_m > 0.003 {
                near(stylet.last_drop_n.0, if rough > 0.0 { 0.3 } else { 0.25 });
                near(stylet.last_drop_n.1, 0.005);
            }
        }
        // Two millimetres of blind travel are over at two.
        let mut stylet = fallen(16.0);
        (stylet.misfit_weight, stylet.contact_sample_m, stylet.deepest_m) =
            (0.3, 0.0, config.guard.blind_travel_m);
        assert!(stylet.is_rupture(&config));
        stylet.candidate = None;
        assert!(!stylet.is_rupture(&config));
    }

    /// The predictor as it begins anew at a force, with slopes on the scale of `scale_n`.
    fn begun_anew(
        local: &ForcePredictor,
        force_n: f64,
        scale_n: f64,
        noise: &NoiseEstimator,
    ) -> ForcePredictor {
        let mut expected = *local;
        expected.restart(force_n, scale_n, noise, 0.002, false);
        expected
    }

    fn assert_same(found: &LayerEstimator, expected: &LayerEstimator) {
        assert_eq!((found.belief.x, found.belief.p), (expected.belief.x, expected.belief.p));
        assert_eq!((found.start_m, found.passed_count), (expected.start_m, expected.passed_count));
    }

    /// Friction along the shaft without a law, at a force that stays.
    fn shaft_friction_n(stylet: &Stylet) -> f64 {
        let felt = ShaftSample {
            gain: 0.0,
            position_m: 0.01,
            force_n: 0.0,
            advancing: true,
            retracting: false,
            peak_force_n: 1.0,
            released: false,
            noise_variance_n2: 4e-4,
            track_retraction: true,
        };
        let mut shaft = stylet.dry_friction;
        shaft.update(&felt).0
    }

    #[test]
    fn while_a_drop_goes_on_all_begins_anew_where_it_has_come_to() {
        for (force_n, sd, scale_n) in [(0.5, 0.03, 0.43), (-0.2, 0.03, 0.27), (0.08, 0.03, 0.03)] {
            let mut stylet = fallen(3.0);
            stylet.cusum.update(-3.0);
            stylet.cusum_was_zero = false;
            let mut other = stylet.estimator;
            other.belief.x[B] = 7000.0;
            stylet.post_rupture = Some(other);
            let expected = begun_anew(&stylet.predictor, force_n, scale_n, &stylet.noise);
            stylet.continue_drop(&step(), &sample(0.01, force_n), sd);
            assert_eq!(stylet.predictor.level_n(), force_n);
            for i in 1..5 {
                near(stylet.predictor.belief.p[i][i], expected.belief.p[i][i]);
            }
            assert!(
                stylet.cusum.relative_level() == 0.0 && stylet.cusum_was_zero && stylet.candidate.is_none()
            );
            assert_same(&stylet.estimator, &other);
            assert_same(&stylet.snapshot, &other);
            assert_eq!(stylet.snapshot_m, 0.01);
            // All of the force without the sensor's zero is friction now.
            near(shaft_friction_n(&stylet), (force_n - 0.07).max(0.0));
        }
    }

    #[test]
    fn a_rupture_is_half_a_step_behind_where_the_sums_left_zero_and_known_by_how_long_they_took() {
        // Where the sums left zero, the last step, and the place and its standard deviation.
        let even = 1e-4 / 12.0_f64.sqrt();
        for (before_m, dz_m, at_m, place_m) in [
            (0.0099, 1e-4, 0.00995, even),
            (0.00986, 1e-4, 0.00991, even),
            (0.00984, 1e-4, 0.00989, 1e-4),
            (0.0096, 1e-4, 0.00965, 2e-4),
            (0.00998, 1e-4, 0.00999, 2e-5 / 12.0_f64.sqrt()),
            // The needle stood, or is above where it was.
            (0.0096, -1e-5, 0.0096, 2e-4),
            (0.0101, 1e-4, 0.0101, 0.0),
        ] {
            let mut stylet = fallen(3.0);
            stylet.snapshot_m = before_m;
            stylet.operations = 5;
            stylet.snapshot.belief.x[B] = 8000.0;
            let (mut expected, mut behind) = (stylet.snapshot, stylet.passed_layers);
            expected.rupture(at_m, place_m, 0.002, &stylet.noise, &mut behind);
            stylet.declare_rupture(&MotionStep { dz_m, ..step() }, &sample(0.01, 0.5), 1.3);
            let fallen = stylet.post_rupture.expect("a drop that may go on");
            near(fallen.start_m, at_m);
            for i in 0..6 {
                near(fallen.belief.x[i], expected.belief.x[i]);
                let off = (fallen.belief.p[i][i] - expected.belief.p[i][i]).abs();
                assert!(off <= 1e-9 * expected.belief.p[i][i], "{before_m}: {off} of {i}");
            }
            // The sample itself is the first of the new layer.
            let mut taken = fallen;
            taken.update(0.01, 0.002, 0.5, 0.0);
            assert_same(&stylet.estimator, &taken);
            assert_same(&stylet.snapshot, &taken);
            let found = stylet.output.detection.expect("a rupture");
            near(found.located_m, at_m);
            near(found.confidence, 1.0 / (1.0 + 0.5 * (-1.3_f64).exp()));
            assert_eq!((found.layer, found.time_s, found.position_m), (1, 5.0, 0.01));
            assert_eq!(stylet.operations, 5 + 2 * 216 + 2 * 126 + 2 * 84);
        }
    }

    #[test]
    fn after_a_rupture_all_is_counted_and_expected_anew() {
        // Scale of what may come: the force that is left, or what is gone.
        for (force_n, scale_n) in [(0.5, 1.0), (1.2, 1.13), (-0.9, 2.4)] {
            let mut stylet = fallen(3.0);
            stylet.cusum.update(-3.0);
            stylet.cusum_was_zero = false;
            stylet.last_drop_n = (0.31, 0.02);
            let expected = begun_anew(&stylet.predictor, force_n, scale_n, &stylet.noise);
            stylet.declare_rupture(&step(), &sample(0.01, force_n), 0.0);
            assert_eq!(stylet.predictor.level_n(), force_n);
            for i in 1..5 {
                near(stylet.predictor.belief.p[i][i], expected.belief.p[i][i]);
            }
            assert!(
                stylet.cusum.relative_level() == 0.0 && stylet.cusum_was_zero && stylet.candidate.is_none()
            );
            assert_eq!(
                (stylet.samples_since_rupture, stylet.time_since_rupture_s, stylet.next_report_at),
                (0, 0.0, 16)
            );
            assert_eq!((stylet.snapshot_m, stylet.output.ruptures), (0.01, 1));
            let found = stylet.output.detection.expect("a rupture");
            assert_eq!((found.drop_n, found.drop_sd_n), (0.31, 0.02));
            near(found.confidence, 2.0 / 3.0);
            // What the first rupture says of the first contact is the last word on it.
            let contact_m = stylet.estimator.start_m - stylet.estimator.previous_thickness_m;
            assert_eq!(stylet.output.contact_m, Some(contact_m));
            stylet.declare_rupture(&step(), &sample(0.02, force_n), 0.0);
            assert_eq!((stylet.output.contact_m, stylet.output.ruptures), (Some(contact_m), 2));
            near(shaft_friction_n(&stylet), (force_n - 0.07).max(0.0));
        }
    }

    #[test]
    fn the_ruptured_layer_has_its_last_word_when_the_next_one_gives_way() {
        for (report_at, reported) in [(u32::MAX, false), (16, true)] {
            let mut stylet = fallen(3.0);
            (stylet.estimator.passed_count, stylet.estimator.previous_thickness_m, stylet.output.ruptures) =
                (1, 0.02, 1);
            stylet.estimator.belief.x[K_PREV] = 50.0;
            stylet.next_report_at = report_at;
            stylet.declare_rupture(&step(), &sample(0.01, 0.5), 1.3);
            assert_eq!(stylet.output.estimate.is_some(), reported);
        }
    }

    #[test]
    fn a_drop_goes_on_while_the_force_falls_by_three_standard_deviations_and_is_over_at_two() {
        // Rate in standard deviations of itself; time since the rupture; whether it falls, and whether that is settled.
        let cases: Vec<(f64, f64, bool, bool)> = [0.1001, 0.0999]
            .into_iter()
            .flat_map(|since_s| {
                let late = since_s > 0.1;
                [
                    (-3.1, true, false),
                    (-2.9, false, false),
                    (-2.1, false, false),
                    (-1.9, false, late),
                    (3.0, false, late),
                ]
                .map(|(sds, falls, over)| (sds, since_s, falls, over))
            })
            .collect();
        for (sds, since_s, falls, over) in cases {
            let mut stylet = inside();
            // In the second layer, with 150 N s/m behind; the predictor thinks it knows 170, and a rate of its own.
            (stylet.estimator.passed_count, stylet.estimator.belief.x[D]) = (1, 150.0);
            (stylet.post_rupture, stylet.time_since_rupture_s) = (Some(stylet.estimator), since_s);
            let sd = (25.0 + 0.0025_f64.powi(2) * 9e6 + 0.0045_f64.powi(2) * 4e6).sqrt() * 0.02;
            stylet.predictor.belief.p[1][1] = 25.0;
            stylet.predictor.belief.p[2][2] = 9e6;
            stylet.predictor.belief.p[3][3] = 4e6;
            // 0.9 mm/s faster than its low-passed self over 0.2 s: 4.5 mm/s².
            let moved = Sample { velocity_mps: 0.0034, ..sample(0.01, 1.0) };
            (stylet.predictor.belief.x[2], stylet.predictor.belief.x[3]) = (30.0, 170.0);
            stylet.predictor.belief.x[1] = sds * sd - 30.0 * 0.0025 - 20.0 * 0.0045;
            let found = stylet.drop_is_ongoing(&MotionStep { speed_mps: 0.0025, ..step() }, &moved);
            assert_eq!((found, stylet.post_rupture.is_none()), (falls, over), "{sds} after {since_s} s");
        }
    }
}
