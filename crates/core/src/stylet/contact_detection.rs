//! From the air into the tissue.

use super::cusum::CusumBank;
use super::force_predictor::{self, ForcePredictor, MotionStep};
use super::free_tip::{FreeTipDetector, OPERATIONS_PER_BEND_TEST};
use super::layer_estimator::LayerEstimator;
use super::rupture_detection::SURE_DROP_SDS;
use super::tissue_update::FAILED_MISFIT;
use super::{MAX_STIFFNESS_N_PER_M, Stylet};
use crate::config::{Contact, EnhanceConfig};
use crate::sample::Sample;

/// Samples in a row above the threshold that are a contact.
const CONTACT_SAMPLES: u32 = 5;
/// Multiplications and additions of a slope with its variance, and of the sums.
const WORK_DOUBT: u32 = 10 + OPERATIONS_PER_BEND_TEST;

impl Stylet {
    /// In the air.
    pub(super) fn detect_contact(
        &mut self,
        config: &EnhanceConfig,
        surface_m: f64,
        step: &MotionStep,
        sample: &Sample,
    ) {
        self.deepest_m = self.deepest_m.max(sample.position_m);
        let known = config.contact == Contact::Known;
        if known && sample.position_m >= surface_m {
            self.start_contact(config, step, sample, surface_m, 0.0, 0.0);
            return;
        }
        self.noise.update_in_air(sample.force_n);
        let search = &config.contact_search;
        if !self.started {
            self.low_passed_n = sample.force_n;
        }
        let share = step.dt_s / (step.dt_s + search.time_constant_s);
        self.low_passed_n += share * (sample.force_n - self.low_passed_n);
        if known || self.noise.air_sample_count() == 0.0 {
            return;
        }
        let risen = self.low_passed_n - self.noise.bias_n();
        let spread = self.noise.variance * self.noise.long_run_factor() * self.noise.interval_s
            / (2.0 * search.time_constant_s);
        let sd = libm::sqrt(
            spread.min(self.noise.marginal_variance())
                + self.noise.bias_variance().min(self.noise.marginal_variance()),
        );
        if risen > search.noise_sds * sd
            && sample.force_n > self.noise.bias_n()
            && sample.velocity_mps > -config.drop.standstill_mps
        {
            self.samples_above_threshold += 1;
        } else {
            self.samples_above_threshold = 0;
        }
        if self.samples_above_threshold >= CONTACT_SAMPLES {
            self.start_contact(config, step, sample, sample.position_m, risen, risen + 3.0 * sd);
        }
    }

    /// Whether it was contact: air is flat until the tissue begins. A sample that the first layer's law took with the standardised innovation `z`; `before` is
    /// that law without it.
    pub(super) fn verify_contact(
        &mut self,
        config: &EnhanceConfig,
        step: &MotionStep,
        sample: &Sample,
        (z, before): (f64, &LayerEstimator),
    ) {
        self.operations += WORK_DOUBT;
        let (slope, sd) = self.estimator.slope_and_sd(self.steady_drive_mps, &self.noise);
        // It rises, and along a straight line.
        self.estimator.layer_confirmed = slope > SURE_DROP_SDS * sd && self.free_tip.is_straight();
        if !self.estimator.layer_confirmed && self.free_tip.bends_up(z, before, self.last_sample.position_m) {
            let (bias_n, marginal) = (self.noise.bias_n(), self.noise.marginal_variance());
            let risen = self.predictor.level_n() - bias_n;
            let sd_n = risen.abs() + 3.0 * libm::sqrt(marginal);
            self.start_contact(config, step, sample, sample.position_m, risen.max(0.0), sd_n);
            self.misfit = FAILED_MISFIT;
        }
    }

    #[cold]
    pub(super) fn start_contact(
        &mut self,
        config: &EnhanceConfig,
        step: &MotionStep,
        sample: &Sample,
        start_m: f64,
        force_n: f64,
        sd_n: f64,
    ) {
        self.in_tissue = true;
        self.contact_sample_m = sample.position_m;
        self.cusum = CusumBank::new(config.stylet.false_alarms_per_hour, self.noise.interval_s);
        let drive = self.steady_drive_mps.max(1e-6);
        self.estimator =
            LayerEstimator::at_contact(start_m, force_n, sd_n, MAX_STIFFNESS_N_PER_M, drive, &self.noise);
        self.snapshot = self.estimator;
        self.snapshot_m = sample.position_m;
        self.free_tip =
            FreeTipDetector::new(config.stylet.false_alarms_per_hour, self.noise.interval_s, &self.estimator);
        self.predictor = ForcePredictor::new(sample.force_n);
        self.predictor.restart(
            sample.force_n,
            MAX_STIFFNESS_N_PER_M * force_predictor::MEMORY_M,
            &self.noise,
            step.speed_mps,
            true,
        );
        self.output.contact_m = Some(start_m);
    }
}

#[cfg(test)]
mod tests {
    use super::super::noise_estimator::NoiseEstimator;
    use super::super::tests::{inside, near, sample, step};
    use super::*;
    use crate::stylet::layer_estimator::{D, K};

    /// In the air, with a low-passed force of this and a noise that is known.
    fn air(noise: NoiseEstimator, low_passed_n: f64) -> Stylet {
        let mut stylet = Stylet::new(&EnhanceConfig::default(), 0.004);
        (stylet.noise, stylet.low_passed_n) = (noise, low_passed_n);
        (stylet.started, stylet.steady_drive_mps) = (true, 0.002);
        stylet
    }

    fn look(stylet: &mut Stylet, config: &EnhanceConfig, sample: &Sample) {
        stylet.detect_contact(config, 0.004, &step(), sample);
    }

    #[test]
    fn the_force_that_is_looked_at_is_low_passed_from_the_first_sample_on() {
        let config = EnhanceConfig::default();
        let mut stylet = air(NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0), 0.03);
        look(&mut stylet, &config, &sample(0.001, 0.14));
        // 5 ms of 50 ms and that.
        near(stylet.low_passed_n, 0.04);
        assert_eq!((stylet.deepest_m, stylet.samples_above_threshold), (0.001, 0));
        look(&mut stylet, &config, &sample(0.0005, 0.04));
        near(stylet.low_passed_n, 0.04);
        assert_eq!(stylet.deepest_m, 0.001);
        stylet.started = false;
        look(&mut stylet, &config, &sample(0.001, 0.14));
        near(stylet.low_passed_n, 0.14);
        assert!(!stylet.in_tissue);
    }

    /// Just behind a contact, with a slope of 78 N/m at 2 mm/s that is known to `sd`.
    fn touched(sd: f64) -> Stylet {
        let mut stylet = inside();
        (stylet.steady_drive_mps, stylet.estimator.layer_confirmed) = (0.002, false);
        stylet.estimator.belief.p[K][K] = sd * sd / stylet.noise.variance;
        stylet
    }

    #[test]
    fn a_contact_is_sure_once_the_force_rises_along_a_straight_line() {
        let config = EnhanceConfig::default();
        for (sd, bends, sure) in [(19.0, false, true), (20.0, false, false), (19.0, true, false)] {
            let mut stylet = touched(sd);
            let before = stylet.estimator;
            if bends {
                stylet.free_tip.bends_up(1.0, &before, 0.0099);
            }
            stylet.operations = 0;
            stylet.verify_contact(&config, &step(), &sample(0.01, 1.5), (0.0, &before));
            assert_eq!((stylet.estimator.layer_confirmed, stylet.operations), (sure, 52), "{sd} N/m");
            assert_eq!(stylet.contact_sample_m, 0.001);
        }
    }

    #[test]
    fn where_a_flat_force_begins_to_rise_the_tissue_begins() {
        let config = EnhanceConfig::default();
        let mut stylet = touched(60.0);
        let before = stylet.estimator;
        stylet.verify_contact(&config, &step(), &sample(0.01, 1.5), (3.0, &before));
        assert_eq!(stylet.contact_sample_m, 0.001, "once is not enough");
        stylet.verify_contact(&config, &step(), &sample(0.01, 1.5), (9.0, &before));
        assert_eq!(
            (stylet.contact_sample_m, stylet.estimator.start_m, stylet.output.contact_m),
            (0.01, 0.01, Some(0.01))
        );
        assert_eq!((stylet.misfit, stylet.estimator.passed_count), (FAILED_MISFIT, 0));
        // What acts already: the predictor's level above the zero, 1.43 N, and as uncertain, half of it elastic.
        near(stylet.estimator.belief.x[D], 0.5 * 1.43);
        near((stylet.estimator.belief.p[D][D] * stylet.noise.variance).sqrt(), 1.43 + 0.06);
    }

    /// Standard deviation of the low-passed force about the bias.
    fn sd_n(noise: &NoiseEstimator) -> f64 {
        let spread = noise.variance * noise.long_run_factor() * 0.005 / 0.1;
        (spread.min(noise.marginal_variance()) + noise.bias_variance().min(noise.marginal_variance())).sqrt()
    }

    #[test]
    fn contact_is_five_samples_in_a_row_that_stand_out_by_five_standard_deviations() {
        let config = EnhanceConfig::default();
        // White noise, and two that are so slow that low-pass or bias are known no better than one sample.
        for noise in [
            NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0),
            NoiseEstimator::known(0.98, 4e-4, 0.07, 4000.0),
            NoiseEstimator::known(0.9, 4e-4, 0.07, 8.0),
        ] {
            let sd = sd_n(&noise);
            for (sds, counts) in [(5.001, true), (4.999, false)] {
                let force_n = 0.07 + sds * sd;
                let mut stylet = air(noise, force_n);
                for above in 1..=4_u32 {
                    look(&mut stylet, &config, &sample(0.006, force_n));
                    assert_eq!(stylet.samples_above_threshold, if counts { above } else { 0 }, "{sds}");
                }
                assert!(!stylet.in_tissue);
                look(&mut stylet, &config, &sample(0.0061, force_n));
                assert_eq!(stylet.in_tissue, counts);
                if counts {
                    // Half of what it has risen by is elastic; it is known to itself and three standard deviations.
                    let l = &stylet.estimator;
                    assert_eq!(
                        (l.start_m, stylet.contact_sample_m, stylet.output.contact_m),
                        (0.0061, 0.0061, Some(0.0061))
                    );
                    near(l.belief.x[D], 0.5 * sds * sd);
                    near((l.belief.p[D][D] * stylet.noise.variance).sqrt(), (sds + 3.0) * sd);
                }
            }
        }
    }

    #[test]
    fn a_force_that_is_gone_or_a_needle_that_goes_back_is_no_contact() {
        let config = EnhanceConfig::default();
        let noise = NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0);
        for (force_n, v, above) in [
            (0.6, 0.002, 4),
            (0.0701, 0.002, 4),
            (0.07, 0.002, 0),
            (0.6, -4e-5, 4),
            (0.6, -5e-5, 0),
            (0.6, -6e-5, 0),
        ] {
            let mut stylet = air(noise, 0.5);
            stylet.samples_above_threshold = 3;
            look(&mut stylet, &config, &Sample { velocity_mps: v, ..sample(0.006, force_n) });
            assert_eq!(stylet.samples_above_threshold, above, "{force_n} N at {v} m/s");
        }
        // Before bias and noise are known there is none, either.
        let mut stylet = air(NoiseEstimator::known(0.0, 4e-4, 0.07, 0.0), 0.5);
        stylet.samples_above_threshold = 4;
        look(&mut stylet, &config, &sample(0.006, 0.6));
        assert!(!stylet.in_tissue && stylet.samples_above_threshold == 4);
    }

    #[test]
    fn a_surface_that_is_known_is_where_contact_is_and_nowhere_else() {
        let config = EnhanceConfig { contact: Contact::Known, ..EnhanceConfig::default() };
        let mut stylet = air(NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0), 0.5);
        for _ in 0..9 {
            look(&mut stylet, &config, &sample(0.0039, 0.6));
        }
        assert!(!stylet.in_tissue && stylet.samples_above_threshold == 0);
        for position_m in [0.004, 0.0043] {
            let mut touched = stylet;
            look(&mut touched, &config, &sample(position_m, 0.6));
            assert!(touched.in_tissue);
            assert_eq!((touched.estimator.start_m, touched.contact_sample_m), (0.004, position_m));
            assert_eq!((touched.estimator.belief.x[D], touched.output.contact_m), (0.0, Some(0.004)));
            assert!(touched.estimator.belief.p[D][D] < 1e-12);
        }
        // And a surface that is not known is found behind it and before it.
        let config = EnhanceConfig::default();
        let mut stylet = air(NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0), 0.03);
        look(&mut stylet, &config, &sample(0.006, 0.03));
        assert!(!stylet.in_tissue);
    }

    #[test]
    fn at_contact_tissue_may_be_as_stiff_as_any_and_the_alarm_is_that_of_the_sampling_rate() {
        let mut stylet = air(NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0), 0.5);
        stylet.noise.interval_s = 0.001;
        stylet.start_contact(&EnhanceConfig::default(), &step(), &sample(0.006, 0.6), 0.0055, 0.2, 0.3);
        near(stylet.estimator.belief.x[K], 1000.0);
        near((stylet.estimator.belief.p[K][K] * 4e-4).sqrt(), 2000.0);
        assert_eq!(
            (stylet.predictor.level_n(), stylet.snapshot.start_m, stylet.snapshot_m),
            (0.6, 0.0055, 0.006)
        );
        // Two newtons over a millimetre, or at 2 mm/s in half a second; friction of up to them.
        let p = &stylet.predictor.belief.p;
        near((p[2][2] * 4e-4).sqrt(), 2000.0);
        near((p[1][1] * 4e-4).sqrt(), 4.0);
        near((p[3][3] * 4e-4).sqrt(), 1000.0);
        let mut alarm = CusumBank::new(0.05, 0.001);
        alarm.update(-3.0);
        stylet.cusum.update(-3.0);
        assert_eq!(stylet.cusum.relative_level(), alarm.relative_level());
        // A needle that stands has friction of its own to be found.
        let mut stylet = inside();
        stylet.steady_drive_mps = 0.0;
        stylet.start_contact(&EnhanceConfig::default(), &step(), &sample(0.006, 0.6), 0.0055, 0.2, 0.3);
        near(stylet.estimator.belief.x[2], 1000.0 / 1e-6);
    }
}
