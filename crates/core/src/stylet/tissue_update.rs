//! A sample in the tissue: predicted, judged, learned from.

use super::force_predictor::{self, ForcePredictor, MotionStep};
use super::gaussian::{Innovation, at_least, at_most};
use super::layer_estimator::LayerEstimator;
use super::noise_estimator::NoiseEstimator;
use super::{MAX_DROP_DURATION_S, MAX_STIFFNESS_N_PER_M, OPERATIONS_PER_RUPTURE, Stylet};
use crate::config::EnhanceConfig;
use crate::sample::Sample;

/// A force outside this many standard deviations that comes alone is a spike.
const SPIKE_SDS: f64 = 6.0;
/// A spike lasts at most this many samples.
const SPIKE_SAMPLES: u8 = 3;
/// Misfit at which the law of layers does not hold; it has to be shown that it does.
pub(super) const FAILED_MISFIT: f64 = 3.0;
/// Multiplications and additions of the local predictor: five shears, an innovation and an update of five unknowns.
const WORK_LOCAL: u32 = 5 * 14 + 2 * 24 + 2 * 20;
/// Of the layers: an innovation, and an update of six unknowns.
const WORK_EXPECT: u32 = 2 * 35;
const WORK_LEARN: u32 = 2 * 27 + 12;
/// Misfit up to which the law tells what comes: were all of what is beyond one a force that is off, by 0.45 standard deviations, the alarm's sums
/// would not grow by it.
const TELLS: f64 = 1.2;
/// Share of the speed that the usual one may be off, where the law tells what comes.
const AS_USUAL: f64 = 0.05;

impl Stylet {
    /// In the tissue.
    #[inline(always)]
    pub(super) fn update_in_tissue(&mut self, config: &EnhanceConfig, step: &MotionStep, sample: &Sample) {
        let force_n = sample.force_n;
        self.restart_if_invalid(step, sample);
        self.operations += WORK_LOCAL;
        self.predictor.advance(step, &self.noise);
        if step.sudden {
            // Friction has changed by any part of the force, at any instant of the step.
            self.predictor.reset_level(force_n, &self.noise);
            self.estimator.skip_sample();
            self.reset_detector();
            self.deferred = false;
            self.deepest_m = at_least(self.deepest_m, sample.position_m);
            return;
        }
        self.level_before_fall_n =
            if self.candidate.is_none() { self.predictor.level_n() } else { self.level_before_fall_n };
        let innovation = self.predictor.innovation(force_n, step, &self.noise);
        let sd = libm::sqrt(innovation.s * self.noise.variance);
        let z = innovation.e / sd;
        self.output.error_n = innovation.e;
        self.samples_since_rupture = self.samples_since_rupture.saturating_add(1);
        self.time_since_rupture_s += step.dt_s;
        let standstill = config.drop.standstill_mps;
        let forward = sample.velocity_mps > -standstill
            && sample.position_m > self.deepest_m - config.guard.revisit_margin_m;
        if sample.position_m > self.deepest_m {
            self.deepest_m = sample.position_m;
        }
        let share = step.dz_m.abs() / (step.dz_m.abs() + 2.0 * force_predictor::MEMORY_M);
        // A spike: upwards, or below what any rupture can leave, and not for long.
        let below = force_n - self.noise.bias_n() < -SPIKE_SDS * libm::sqrt(self.noise.marginal_variance());
        let odd = z > SPIKE_SDS || (forward && z < -SPIKE_SDS && below);
        // A release of the shaft takes as long as a drop.
        self.release_window_s =
            if z > SPIKE_SDS && !forward { MAX_DROP_DURATION_S } else { self.release_window_s - step.dt_s };
        if odd && forward && self.spike_samples < SPIKE_SAMPLES {
            self.spike_samples += 1;
            self.predictor.skip_sample();
            self.estimator.skip_sample();
            return;
        }
        if odd {
            // It stays: the force has jumped.
            let force = (force_n - self.noise.bias_n()).abs();
            self.predictor.restart(force_n, force.max(sd), &self.noise, step.speed_mps, false);
        }
        self.spike_samples = 0;
        let rough = 1.0 + self.misfit_weight * at_least(0.0, self.roughness - 1.0);
        let smoothed = if rough > 1.0 { z / libm::sqrt(rough) } else { z };
        let by_law = if forward && !odd { self.layer_innovation(step, sample) } else { None };
        let better = by_law.as_ref().filter(|law| law.s < innovation.s);
        let smoothed = better.map_or(smoothed, |law| law.e / libm::sqrt(law.s * self.noise.variance));
        let heard = self.cusum.update(if forward && !odd { smoothed } else { 0.0 });
        if !forward {
            self.cusum.reset();
        }
        if !heard.all_zero && (self.cusum_was_zero || heard.outweighs_history) {
            self.snapshot = self.estimator;
            self.snapshot_m = self.last_sample.position_m;
        }
        self.cusum_was_zero = heard.all_zero || !forward;
        if forward && !odd && !heard.all_zero {
            self.track_candidate(step, sample, heard.outweighs_history);
        }
        if heard.all_zero {
            self.candidate = None;
        }
        let far = innovation.e * innovation.e > SPIKE_SDS * SPIKE_SDS * self.noise.marginal_variance();
        self.deferred = self.velocity_estimator.uses_positions() && far && !self.deferred;
        if self.deferred {
            // Whether the speed has jumped within this step is told by the next.
            self.predictor.skip_sample();
            self.estimator.skip_sample();
            return;
        }
        if heard.alarm && forward && !odd {
            let recent = self.output.ruptures > 0 && self.time_since_rupture_s <= MAX_DROP_DURATION_S;
            if recent {
                // Still the same drop.
                self.continue_drop(step, sample, sd);
                return;
            }
            if self.is_rupture(config) {
                self.declare_rupture(step, sample, heard.excess_nats);
                return;
            }
        }
        if !odd {
            self.noise.update_in_tissue(innovation.e, innovation.s);
            self.predictor.update(&innovation, force_n);
            self.roughness += share * (at_most(36.0, z * z) - self.roughness);
        }
        self.drop_continues = self.post_rupture.is_some() && self.drop_is_ongoing(step, sample);
        if self.drop_continues {
            if let Some(fallen) = self.post_rupture {
                self.estimator = fallen;
            }
        } else if forward && sample.position_m >= self.estimator.start_m {
            let before = self.estimator.may_be_free().then_some(self.estimator);
            let (e, s) = self.estimator.apply(
                &by_law.unwrap_or_else(|| {
                    self.operations += WORK_EXPECT;
                    self.estimator.innovation(sample.position_m, self.friction_drive_mps, force_n, step.rho)
                }),
                sample.position_m,
                self.friction_drive_mps,
                force_n,
            );
            self.operations += WORK_LEARN;
            let standard = e / libm::sqrt(s * self.noise.variance);
            let z2 = at_most(400.0, standard * standard);
            if self.estimator.passed_count == 0 {
                if let Some(before) = &before {
                    self.verify_contact(config, step, sample, (standard, before));
                }
            } else if self.post_rupture.is_none() {
                let (work, bent) = self.free_tip.update(
                    &mut self.estimator,
                    (before, self.last_sample.position_m),
                    (sample.position_m, standard, at_least(1e-6, self.steady_drive_mps)),
                    self.samples_since_rupture,
                    &self.noise,
                    &mut self.passed_layers,
                );
                self.operations += work;
                if bent {
                    // What the predictor has missed since was the bend.
                    self.reset_detector();
                }
            }
            if s < 2.0 || sample.velocity_mps.abs() <= standstill {
                let share = at_least(share, at_most(0.5, step.dt_s * (0.25 / force_predictor::MEMORY_S)));
                self.misfit += share * (z2 - self.misfit);
            }
            self.peak_force_n = at_least(self.peak_force_n, self.predictor.level_n() - self.noise.bias_n());
            // Where the law of layers does not hold, small falls are texture.
            let weight = (self.misfit - 0.5 * FAILED_MISFIT) / (FAILED_MISFIT - 0.5 * FAILED_MISFIT - 1.0);
            let weight = at_most(1.0, at_least(0.0, weight));
            self.misfit_weight = weight;
            // A law that has failed is not trusted again.
            if self.misfit >= FAILED_MISFIT
                && self.deepest_m - self.contact_sample_m >= config.guard.blind_travel_m
            {
                self.base_law_failed = true;
            }
            self.min_drop_n = weight * config.stylet.min_drop_share * self.peak_force_n;
        } else {
            self.estimator.skip_sample();
        }
        if self.samples_since_rupture >= self.next_report_at {
            self.next_report_at = self.next_report_at.saturating_mul(2);
            self.report_previous_layer(sample);
        }
    }

    /// What the law of layers says of a sample, where it tells what comes: it holds, and the needle goes on as usual.
    #[inline(always)]
    fn layer_innovation(&mut self, step: &MotionStep, sample: &Sample) -> Option<Innovation<6>> {
        let layers = &self.estimator;
        let holds = self.misfit_weight == 0.0
            && self.misfit < TELLS
            && layers.layer_confirmed
            && self.post_rupture.is_none();
        let usual = (sample.velocity_mps - self.speed_mps).abs() < AS_USUAL * self.speed_mps;
        if !(holds && usual && sample.position_m >= layers.start_m) {
            return None;
        }
        self.operations += WORK_EXPECT;
        Some(layers.innovation(sample.position_m, self.friction_drive_mps, sample.force_n, step.rho))
    }

    /// Beliefs that senseless data have spoilt begin afresh.
    #[inline(always)]
    pub(super) fn restart_if_invalid(&mut self, step: &MotionStep, sample: &Sample) {
        if !(self.noise.variance.is_finite() && self.noise.variance < 1e12) {
            self.noise = NoiseEstimator::new(1e-3);
        }
        if !self.predictor.belief.is_finite() {
            self.predictor = ForcePredictor::new(sample.force_n);
            let force = (sample.force_n - self.noise.bias_n()).abs().max(1e-3);
            self.predictor.restart(sample.force_n, force, &self.noise, step.speed_mps, true);
            self.operations += OPERATIONS_PER_RUPTURE;
        }
        if !self.estimator.belief.is_finite() {
            self.estimator = LayerEstimator::at_contact(
                sample.position_m,
                0.0,
                1.0,
                MAX_STIFFNESS_N_PER_M,
                step.speed_mps,
                &self.noise,
            );
            self.snapshot = self.estimator;
            self.post_rupture = None;
            self.operations += OPERATIONS_PER_RUPTURE;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{inside, near, sample, step};
    use super::*;
    use crate::stylet::cusum::CusumBank;
    use crate::stylet::gaussian::Gaussian;
    use crate::stylet::velocity_estimator::VelocityEstimator;

    /// After one more sample of this force, at 10 mm.
    fn after(mut stylet: Stylet, force_n: f64) -> Stylet {
        stylet.update_in_tissue(&EnhanceConfig::default(), &step(), &sample(0.01, force_n));
        stylet
    }

    fn assert_same<const N: usize>(found: &Gaussian<N>, expected: &Gaussian<N>) {
        assert_eq!((found.x, found.p), (expected.x, expected.p));
    }

    /// The beliefs as they are when such a sample is taken; the misfit is that of the law.
    fn taken(stylet: &Stylet, force_n: f64) -> (ForcePredictor, LayerEstimator, NoiseEstimator, f64) {
        let (mut local, mut layers, mut noise) = (stylet.predictor, stylet.estimator, stylet.noise);
        local.advance(&step(), &noise);
        let innovation = local.innovation(force_n, &step(), &noise);
        noise.update_in_tissue(innovation.e, innovation.s);
        local.update(&innovation, force_n);
        let (e, s) = layers.update(0.01, stylet.friction_drive_mps, force_n, 0.0);
        (local, layers, noise, e * e / (s * noise.variance))
    }

    #[test]
    fn an_ordinary_sample_teaches_predictor_law_and_noise_and_costs_their_sums_of_products() {
        let mut stylet = inside();
        (stylet.operations, stylet.roughness) = (7, 3.0);
        let (local, layers, noise, square) = taken(&stylet, 1.48);
        let found = after(stylet, 1.48);
        near(found.output.error_n, -0.02);
        assert_same(&found.predictor.belief, &local.belief);
        assert_same(&found.estimator.belief, &layers.belief);
        assert_eq!((found.noise.variance, found.noise.rho), (noise.variance, noise.rho));
        // Five shears and an update of five unknowns; an update of six.
        assert_eq!(found.operations, 7 + 158 + 136);
        assert_eq!((found.samples_since_rupture, found.deepest_m), (101, 0.01));
        near(found.time_since_rupture_s, 0.505);
        near(found.release_window_s, -0.005);
        // A travel of 0.1 mm has a twenty-first of the memory; the innovation is half a standard deviation.
        near(found.roughness, 3.0 + (0.25 - 3.0) / 21.0);
        near(found.misfit, 1.0 + (square - 1.0) / 21.0);
        assert_eq!((found.misfit_weight, found.base_law_failed, found.min_drop_n), (0.0, false, 0.0));
        near(found.peak_force_n, local.level_n() - 0.07);
        near(found.level_before_fall_n, 1.5);
        assert!(found.peak_force_n > 1.2 && found.output.detection.is_none());
    }

    /// Where the law does not tell what comes.
    fn by_predictor() -> Stylet {
        Stylet { misfit: 1.3, ..inside() }
    }

    #[test]
    fn the_alarm_hears_the_law_where_it_holds_the_needle_goes_as_usual_and_it_knows_better() {
        // 50 mN too little: of the law, known to half of the noise's variance, 2.04 standard deviations; of the predictor 1.25.
        let force_n = 1.45;
        let law = -0.05 / (1.5 * 4e-4_f64).sqrt();
        type Change = fn(&mut Stylet);
        let cases: [(Change, f64); 10] = [
            (|_| (), law),
            (|s| s.misfit = 1.19, law),
            (|s| s.misfit = 1.21, -1.25),
            (|s| s.speed_mps = 0.0021, law),
            (|s| s.speed_mps = 0.0022, -1.25),
            (|s| s.speed_mps = 0.0018, -1.25),
            (|s| s.estimator.layer_confirmed = false, -1.25),
            (|s| s.estimator.start_m = 0.01005, -1.25),
            (|s| s.estimator.belief.p[5][5] = 2.9, -0.05 / (3.9 * 4e-4_f64).sqrt()),
            (|s| s.estimator.belief.p[5][5] = 3.1, -1.25),
        ];
        for (n, (change, heard)) in cases.into_iter().enumerate() {
            let mut stylet = inside();
            change(&mut stylet);
            let mut alarm = stylet.cusum;
            alarm.update(heard);
            let found = after(stylet, force_n).cusum.relative_level();
            assert!(
                (found - alarm.relative_level()).abs() < 1e-6,
                "{n}: {found} for {}",
                alarm.relative_level()
            );
        }
        // Not while the law may not hold at all, nor while a drop goes on; and what is far off is judged by the predictor.
        let mut stylet = inside();
        (stylet.misfit_weight, stylet.post_rupture) = (0.1, None);
        assert!(stylet.layer_innovation(&step(), &sample(0.01, force_n)).is_none());
        (stylet.misfit_weight, stylet.post_rupture) = (0.0, Some(stylet.estimator));
        assert!(stylet.layer_innovation(&step(), &sample(0.01, force_n)).is_none());
        stylet.post_rupture = None;
        let expected = stylet.estimator.innovation(0.01, 0.002, force_n, 0.0);
        let told = stylet.layer_innovation(&step(), &sample(0.01, force_n)).expect("it tells");
        assert_eq!((told.e, told.s), (expected.e, expected.s));
    }

    #[test]
    fn an_innovation_counts_for_texture_up_to_six_standard_deviations() {
        let mut stylet = by_predictor();
        (stylet.roughness, stylet.cusum) = (3.0, CusumBank::new(1e-9, 0.005));
        stylet.cusum.reset();
        // Seven and five standard deviations of 40 mN, in one sample: not enough for this alarm.
        near(after(stylet, 1.22).roughness, 3.0 + 33.0 / 21.0);
        near(after(stylet, 1.3).roughness, 3.0 + 22.0 / 21.0);
    }

    #[test]
    fn texture_makes_the_force_as_much_rougher_as_the_law_fails() {
        for (rough, texture, heard) in [(0.0, 5.0, -2.5), (0.4, 5.0, -2.5 / 2.6_f64.sqrt()), (0.4, 0.3, -2.5)]
        {
            let mut stylet = by_predictor();
            (stylet.misfit_weight, stylet.roughness) = (rough, texture);
            let mut alarm = stylet.cusum;
            alarm.update(heard);
            near(after(stylet, 1.4).cusum.relative_level(), alarm.relative_level());
        }
    }

    #[test]
    fn the_misfit_of_the_law_is_that_of_its_last_travel_and_in_a_hold_of_its_last_seconds() {
        let config = EnhanceConfig::default();
        let square = |stylet: &Stylet, force_n: f64| taken(stylet, force_n).3;
        // Duration of the step, travel, speed, and share.
        for (dt_s, dz_m, v, share) in [
            (0.005, 1e-4, 0.002, 1.0 / 21.0),
            (0.005, 0.0, 0.0, 0.0025),
            (0.2, 1e-4, 0.002, 0.1),
            (2.0, 1e-4, 0.002, 0.5),
            (0.005, -1e-4, 5e-5, 1.0 / 21.0),
        ] {
            let mut stylet = inside();
            stylet.misfit = 0.3;
            let square = square(&stylet, 1.53);
            let moved = Sample { velocity_mps: v, ..sample(0.01, 1.53) };
            stylet.update_in_tissue(&config, &MotionStep { dt_s, dz_m, ..step() }, &moved);
            near(stylet.misfit, 0.3 + share * (square - 0.3));
        }
        // What the law has not been able to know says nothing of it, but in a hold; a square counts up to four hundred.
        for (zero, v, force_n, counted) in [
            (1.5, 0.002, 1.53, None),
            (1.5, 0.0, 1.53, Some(0.03 * 0.03 / 2.5 / 4e-4)),
            (1.5, 5e-5, 1.53, Some(0.03 * 0.03 / 2.5 / 4e-4)),
            (0.9, 0.002, 1.53, Some(0.03 * 0.03 / 1.9 / 4e-4)),
            (0.5, 0.002, 9.5, Some(400.0)),
        ] {
            let mut stylet = inside();
            stylet.estimator.belief.p[5][5] = zero;
            stylet.misfit = 0.3;
            // What the predictor knows is no matter.
            stylet.predictor.belief.x[0] = force_n;
            let moved = Sample { velocity_mps: v, ..sample(0.01, force_n) };
            // The noise stays as it is where nothing was off: its count alone.
            stylet.noise.sample_count = 1e300;
            stylet.update_in_tissue(&config, &step(), &moved);
            let expected = counted.map_or(0.3, |square| 0.3 + (square - 0.3) / 21.0);
            assert!((stylet.misfit / expected - 1.0).abs() < 1e-9, "{} for {expected}", stylet.misfit);
        }
    }

    #[test]
    fn the_worse_the_law_fits_the_rougher_the_force_is_taken_and_the_larger_a_drop_has_to_be() {
        for (misfit, rough) in [(1.2, 0.0), (1.5, 0.0), (1.7, 0.4), (1.9, 0.8), (2.5, 1.0)] {
            let mut stylet = inside();
            // Even after the sample, whose share is a twenty-first.
            let square = taken(&stylet, 1.48).3;
            stylet.misfit = (misfit - square / 21.0) * 21.0 / 20.0;
            stylet.peak_force_n = 3.0;
            let found = after(stylet, 1.48);
            near(found.misfit, misfit);
            assert!((found.misfit_weight - rough).abs() < 1e-9, "{} for {rough}", found.misfit_weight);
            assert!((found.min_drop_n - rough * 0.08 * 3.0).abs() < 1e-9, "{} N", found.min_drop_n);
        }
        // A law that is off by three variances is not trusted again, but for the first two millimetres behind contact.
        for (misfit, first_m, dry) in
            [(3.3, 0.001, true), (2.9, 0.001, false), (3.3, 0.0081, false), (3.3, 0.0079, true)]
        {
            let mut stylet = inside();
            (stylet.misfit, stylet.contact_sample_m) = (misfit, first_m);
            assert_eq!(after(stylet, 1.48).base_law_failed, dry, "{misfit} from {first_m} m");
        }
    }

    #[test]
    fn a_spike_of_up_to_three_samples_is_passed_over_and_a_jump_that_stays_begins_anew() {
        // Of six standard deviations, up; or down to where no rupture leads, six of the noise below the sensor's zero.
        for force_n in [1.78, -0.06] {
            let mut stylet = inside();
            stylet.level_before_fall_n = 0.3;
            let (texture, was) = (stylet.roughness, stylet.estimator.belief);
            for spikes in 1..=3 {
                let count = stylet.noise.sample_count;
                stylet = after(stylet, force_n);
                assert_eq!(
                    (stylet.spike_samples, stylet.noise.sample_count, stylet.roughness),
                    (spikes, count, texture)
                );
                assert_eq!((stylet.predictor.level_n(), stylet.operations), (1.5, 158 * u32::from(spikes)));
                assert_same(&stylet.estimator.belief, &was);
            }
            let found = after(stylet, force_n);
            assert_eq!(
                (found.spike_samples, found.predictor.level_n(), found.roughness),
                (0, force_n, texture)
            );
            // Slopes as if all of the force without the zero came or went over a millimetre.
            let scale_n = (force_n - 0.07_f64).abs().max(0.04);
            let sd = (found.predictor.belief.p[2][2] * found.noise.variance).sqrt();
            assert!((sd / (scale_n / 1e-3) - 1.0).abs() < 1e-4, "{sd} N/m for {force_n} N");
            assert!(
                found.candidate.is_none()
                    && found.output.detection.is_none()
                    && found.cusum.relative_level() == 0.0
            );
            // An ordinary sample in between ends it.
            assert_eq!(after(stylet, 1.5).spike_samples, 0);
        }
        // Neither is one what is less than that.
        for force_n in [1.73, -0.04] {
            assert_eq!(after(inside(), force_n).spike_samples, 0, "{force_n} N");
        }
        // A force that jumps to where there is none is known to the innovation's standard deviation.
        let mut stylet = inside();
        (stylet.predictor.belief.x[0], stylet.spike_samples) = (-0.2, 3);
        let found = after(stylet, 0.08);
        let sd = (found.predictor.belief.p[2][2] * found.noise.variance).sqrt();
        assert!((sd / 40.0 - 1.0).abs() < 1e-4, "{sd} N/m");
    }

    /// One more sample of this force on the way back or above old ground.
    fn after_back(mut stylet: Stylet, position_m: f64, velocity_mps: f64, force_n: f64) -> Stylet {
        let moved = Sample { velocity_mps, ..sample(position_m, force_n) };
        stylet.update_in_tissue(&EnhanceConfig::default(), &step(), &moved);
        stylet
    }

    #[test]
    fn on_the_way_back_and_on_old_ground_nothing_ruptures_and_a_release_is_told_at_once() {
        for (position_m, v, forward) in [
            (0.01, 0.002, true),
            (0.01, -4e-5, true),
            (0.01, -6e-5, false),
            (0.01, -0.002, false),
            (0.0099 - 9e-5, 0.002, true),
            (0.0099 - 1.1e-4, 0.002, false),
        ] {
            let mut stylet = inside();
            stylet.cusum.update(-3.0);
            stylet.candidate = None;
            stylet.cusum_was_zero = false;
            // An ordinary sample: what was summed up is forgotten on the way back, and the law of layers says nothing there.
            let was = stylet.estimator.belief;
            let found = after_back(stylet, position_m, v, 1.45);
            assert_eq!(found.cusum.relative_level() > 0.0, forward, "{position_m} m, {v} m/s");
            assert_eq!(found.cusum_was_zero, !forward);
            assert_eq!(found.candidate.is_some(), forward);
            assert_eq!(found.estimator.belief.x != was.x, forward);
            assert_eq!(found.operations, 158 + if forward { 136 } else { 0 });
            // A jump upwards.
            let found = after_back(stylet, position_m, v, 1.8);
            assert_eq!(found.spike_samples == 1, forward);
            near(found.release_window_s, if forward { -0.005 } else { 0.1 });
            assert_eq!(found.predictor.level_n() == 1.8, !forward);
            // Downwards there is no release, and no rupture on the way back.
            let found = after_back(stylet, position_m, v, 0.5);
            near(found.release_window_s, -0.005);
            assert_eq!(found.output.detection.is_some(), forward);
            // Nor a spike downwards: what is below zero is a pull.
            let found = after_back(stylet, position_m, v, -0.5);
            assert_eq!(found.spike_samples == 1, forward);
        }
        // Above the place where the layer begins the law says nothing, though the needle advances.
        let mut stylet = inside();
        stylet.estimator.start_m = 0.0105;
        assert_eq!(after(stylet, 1.48).operations, 158);
        stylet.estimator.start_m = 0.01;
        assert_eq!(after(stylet, 1.48).operations, 158 + 136);
    }

    #[test]
    fn the_law_as_it_was_before_a_fall_is_kept_from_where_the_sums_left_zero() {
        // Whether the sums were zero, the force, and whether this sample alone outweighs what they were.
        for (quiet, force_n, kept) in
            [(true, 1.4, true), (false, 1.46, false), (false, 0.9, true), (true, 1.56, false)]
        {
            let mut stylet = inside();
            if !quiet {
                stylet.cusum.update(-3.0);
                stylet.cusum_was_zero = false;
                // A drop has to be larger than this.
                (stylet.misfit_weight, stylet.min_drop_n) = (0.5, 5.0);
            }
            stylet.snapshot.belief.x[1] = 61.0;
            let found = after(stylet, force_n);
            assert_eq!(found.snapshot_m, if kept { 0.0099 } else { 0.0097 }, "{force_n} N");
            assert_eq!(found.snapshot.belief.x[1], if kept { 60.0 } else { 61.0 });
            assert_eq!(found.cusum_was_zero, quiet && force_n > 1.5);
            assert_eq!(found.candidate.is_some(), force_n < 1.5);
        }
    }

    #[test]
    fn an_alarm_is_a_rupture_unless_it_is_too_small_or_the_same_drop_goes_on() {
        let rupture = after(inside(), 0.9);
        assert_eq!((rupture.output.ruptures, rupture.estimator.passed_count), (1, 1));
        assert!(rupture.output.detection.is_some_and(|d| d.confidence > 0.99));
        // At once after a rupture the drop goes on; at a tenth of a second, too, and not after.
        for (since_s, ruptures, goes_on) in
            [(0.02, 1, true), (0.094, 1, true), (0.096, 1, false), (0.02, 0, false)]
        {
            let mut stylet = inside();
            (stylet.output.ruptures, stylet.time_since_rupture_s) = (ruptures, since_s);
            let found = after(stylet, 0.9);
            assert_eq!(found.output.detection.is_none(), goes_on, "{since_s} s after {ruptures}");
            assert_eq!(found.predictor.level_n(), 0.9);
        }
        // A fall that is too small to be one is taken for what it is: an innovation.
        let mut stylet = inside();
        (stylet.misfit_weight, stylet.min_drop_n) = (0.5, 0.7);
        let found = after(stylet, 0.9);
        assert!(found.output.detection.is_none() && found.candidate.is_some());
        assert_eq!(found.operations, 158 + 136);
    }

    #[test]
    fn while_a_drop_goes_on_the_law_waits_as_it_was_after_the_rupture() {
        for (rate, waits) in [(-9e9, true), (0.0, false)] {
            let mut stylet = inside();
            (stylet.estimator.passed_count, stylet.time_since_rupture_s) = (1, 0.02);
            let mut fallen = stylet.estimator;
            fallen.belief.x[1] = 71.0;
            (stylet.post_rupture, stylet.predictor.belief.x[1]) = (Some(fallen), rate);
            // As predicted, whatever that is.
            let found = after(stylet, 1.5 + 0.005 * rate);
            assert_eq!(found.drop_continues, waits);
            assert_eq!(found.estimator.belief.x[1] == 71.0, waits);
        }
        // Without a rupture there is nothing that goes on.
        assert!(!after(inside(), 1.4).drop_continues);
    }

    #[test]
    fn the_evidence_for_a_free_tip_is_weighed_once_a_drop_is_over() {
        // The sums of a bend, and the look.
        for (drop_goes_on, looked) in [(false, 42 + 60), (true, 0)] {
            let mut stylet = inside();
            (stylet.estimator.passed_count, stylet.samples_since_rupture, stylet.time_since_rupture_s) =
                (1, 103, 0.02);
            stylet.estimator.layer_confirmed = false;
            stylet.post_rupture = drop_goes_on.then_some(stylet.estimator);
            stylet.estimator.belief = Gaussian::new([100.0, 60.0, 9000.0, 25.0, 8e3, 0.5], [1.0; 6]);
            assert_eq!(after(stylet, 1.48).operations, 158 + 136 + looked);
        }
    }

    /// A log that has been seen to be late.
    fn late(mut stylet: Stylet) -> Stylet {
        stylet.velocity_estimator = VelocityEstimator::known_late();
        stylet
    }

    #[test]
    fn where_the_log_is_late_a_sample_that_is_far_off_is_waited_for() {
        // Seven standard deviations of the noise below the prediction, then once more.
        for force_n in [1.36, 0.9, 1.74] {
            let stylet = late(by_predictor());
            let found = after(stylet, force_n);
            assert!(found.deferred && found.output.detection.is_none(), "{force_n} N");
            assert_eq!(
                (found.noise.sample_count, found.roughness),
                (stylet.noise.sample_count, stylet.roughness)
            );
            assert_eq!(found.predictor.level_n(), 1.5);
            assert_same(&found.estimator.belief, &stylet.estimator.belief);
            let again = after(found, force_n);
            assert!(!again.deferred && again.predictor.level_n() != 1.5);
            assert_eq!(again.output.detection.is_some(), force_n == 0.9);
            // It is the speed that has jumped.
            let mut sudden = found;
            sudden.update_in_tissue(
                &EnhanceConfig::default(),
                &MotionStep { sudden: true, ..step() },
                &sample(0.0101, force_n),
            );
            assert!(sudden.output.detection.is_none() && sudden.candidate.is_none() && !sudden.deferred);
        }
        // What is not far off, and a log that is on time, are taken at once.
        assert!(!after(late(inside()), 1.4).deferred);
        assert!(after(inside(), 0.9).output.detection.is_some());
    }

    #[test]
    fn a_rupture_that_was_waited_for_is_where_it_showed_first() {
        let (once, twice) = (after(inside(), 0.9), after(after(late(inside()), 0.9), 0.9));
        let [once, twice] = [once, twice].map(|s| s.output.detection.expect("a rupture"));
        near(twice.located_m, once.located_m);
    }

    #[test]
    fn a_sudden_change_of_speed_is_no_fall_and_teaches_nothing_of_the_slopes() {
        let mut stylet = inside();
        stylet.cusum.update(-3.0);
        stylet.cusum_was_zero = false;
        stylet.track_candidate(&step(), &sample(0.01, 1.3), false);
        let (was, count) = (stylet.estimator.belief, stylet.noise.sample_count);
        let texture = stylet.roughness;
        stylet.update_in_tissue(
            &EnhanceConfig::default(),
            &MotionStep { sudden: true, ..step() },
            &sample(0.01, 0.4),
        );
        assert_eq!((stylet.predictor.level_n(), stylet.deepest_m, stylet.operations), (0.4, 0.01, 158));
        assert_eq!((stylet.noise.sample_count, stylet.roughness), (count, texture));
        assert_same(&stylet.estimator.belief, &was);
        assert!(stylet.cusum.relative_level() == 0.0 && stylet.cusum_was_zero && stylet.candidate.is_none());
        assert!(stylet.output.detection.is_none());
    }

    #[test]
    fn the_layer_before_is_reported_again_after_twice_as_many_samples() {
        for (since, said, next) in [(14, false, 16), (15, true, 32), (16, true, 32)] {
            let mut stylet = inside();
            (stylet.estimator.passed_count, stylet.estimator.previous_thickness_m, stylet.output.ruptures) =
                (1, 0.02, 1);
            stylet.estimator.belief = Gaussian::new([100.0, 60.0, 9000.0, 25.0, 8e3, 0.07], [1.0; 6]);
            (stylet.samples_since_rupture, stylet.next_report_at) = (since, 16);
            let found = after(stylet, 1.48);
            assert_eq!((found.output.estimate.is_some(), found.next_report_at), (said, next));
        }
    }

    #[test]
    fn beliefs_that_are_no_numbers_begin_anew_and_nothing_else_does() {
        let mended = |spoil: fn(&mut Stylet)| {
            let mut stylet = inside();
            stylet.post_rupture = Some(stylet.estimator);
            spoil(&mut stylet);
            stylet.restart_if_invalid(&step(), &sample(0.01, 0.4));
            stylet
        };
        let sound = mended(|_| ());
        assert_eq!((sound.operations, sound.noise.variance), (0, 4e-4));
        assert!(sound.post_rupture.is_some());
        assert_same(&sound.predictor.belief, &inside().predictor.belief);
        assert_same(&sound.estimator.belief, &inside().estimator.belief);
        for (variance, kept) in
            [(f64::NAN, 1e-6), (f64::INFINITY, 1e-6), (1e12, 1e-6), (9e11, 9e11), (1e-13, 1e-13)]
        {
            let mut stylet = inside();
            stylet.noise.variance = variance;
            stylet.restart_if_invalid(&step(), &sample(0.01, 0.4));
            near(stylet.noise.variance, kept);
        }
        // The predictor: from the force, whose slopes are on the scale of it without the zero.
        let found = mended(|s| s.predictor.belief.x[2] = f64::NAN);
        assert_eq!((found.predictor.level_n(), found.operations), (0.4, 2 * 216 + 2 * 126 + 2 * 84));
        near((found.predictor.belief.p[2][2] * 4e-4).sqrt(), 0.33 / 1e-3);
        near((found.predictor.belief.p[3][3] * 4e-4).sqrt(), 0.33 / 0.002);
        // The law: from here, with all that tissue may be.
        let found = mended(|s| s.estimator.belief.x[2] = f64::NAN);
        assert_eq!(
            (found.estimator.start_m, found.estimator.passed_count, found.operations),
            (0.01, 0, 2 * 216 + 2 * 126 + 2 * 84)
        );
        assert!(found.post_rupture.is_none() && found.estimator.belief.is_positive_definite());
        assert_same(&found.snapshot.belief, &found.estimator.belief);
    }
}
