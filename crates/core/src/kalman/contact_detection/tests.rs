use super::super::noise_estimator::NoiseEstimator;
use super::super::test_support::{inside, near, sample, step};
use super::*;
use crate::kalman::layer_estimator::{D, K};

/// In air, with this low-passed force and a known noise.
fn air(noise: NoiseEstimator, low_passed_n: f64) -> KalmanEnhancer {
    let mut stylet = KalmanEnhancer::new(&EnhanceConfig::default(), 0.004);
    (stylet.noise, stylet.low_passed_n) = (noise, low_passed_n);
    (stylet.started, stylet.steady_drive_mps) = (true, 0.002);
    stylet
}

fn look(stylet: &mut KalmanEnhancer, config: &EnhanceConfig, sample: &Sample) {
    stylet.detect_contact(config, 0.004, &step(), sample);
}

#[test]
fn the_force_is_low_passed_from_the_first_sample_on() {
    let config = EnhanceConfig::default();
    let mut stylet = air(NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0), 0.03);
    look(&mut stylet, &config, &sample(0.001, 0.14));
    // Gain 5 ms/(5 ms + 50 ms).
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

/// Just after a contact, with a slope of 78 N/m at 2 mm/s and its standard deviation.
fn touched(sd: f64) -> KalmanEnhancer {
    let mut stylet = inside();
    (stylet.steady_drive_mps, stylet.estimator.layer_confirmed) = (0.002, false);
    stylet.estimator.belief.p[K][K] = sd * sd / stylet.noise.variance;
    stylet
}

#[test]
fn a_contact_is_confirmed_once_the_force_rises_along_a_straight_line() {
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
    // Initial force: the predictor's level above the bias, 1.43 N, as uncertain as itself, half of it elastic.
    near(stylet.estimator.belief.x[D], 0.5 * 1.43);
    near((stylet.estimator.belief.p[D][D] * stylet.noise.variance).sqrt(), 1.43 + 0.06);
}

/// Standard deviation of the low-passed force about the bias.
fn sd_n(noise: &NoiseEstimator) -> f64 {
    let spread = noise.variance * noise.long_run_factor() * 0.005 / 0.1;
    (spread.min(noise.marginal_variance()) + noise.bias_variance().min(noise.marginal_variance())).sqrt()
}

#[test]
fn contact_is_five_consecutive_samples_above_five_standard_deviations() {
    let config = EnhanceConfig::default();
    // White noise, and noise so slow that low-pass or bias are no more accurate than one sample.
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
                // Half of the rise is elastic; its standard deviation is itself plus three standard deviations.
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
fn a_force_below_the_bias_or_a_retracting_needle_is_no_contact() {
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
    // Nor is there a contact before bias and noise are estimated.
    let mut stylet = air(NoiseEstimator::known(0.0, 4e-4, 0.07, 0.0), 0.5);
    stylet.samples_above_threshold = 4;
    look(&mut stylet, &config, &sample(0.006, 0.6));
    assert!(!stylet.in_tissue && stylet.samples_above_threshold == 4);
}

#[test]
fn a_known_surface_defines_the_contact() {
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
    // With detection the known surface has no effect.
    let config = EnhanceConfig::default();
    let mut stylet = air(NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0), 0.03);
    look(&mut stylet, &config, &sample(0.006, 0.03));
    assert!(!stylet.in_tissue);
}

#[test]
fn contact_sets_wide_priors_and_the_thresholds_for_the_sampling_rate() {
    let mut stylet = air(NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0), 0.5);
    stylet.noise.interval_s = 0.001;
    stylet.start_contact(&EnhanceConfig::default(), &step(), &sample(0.006, 0.6), 0.0055, 0.2, 0.3);
    near(stylet.estimator.belief.x[K], 1000.0);
    near((stylet.estimator.belief.p[K][K] * 4e-4).sqrt(), 2000.0);
    assert_eq!(
        (stylet.predictor.level_n(), stylet.snapshot.start_m, stylet.snapshot_m),
        (0.6, 0.0055, 0.006)
    );
    // 2 N over a millimetre, in half a second at 2 mm/s, or as friction.
    let p = &stylet.predictor.belief.p;
    near((p[2][2] * 4e-4).sqrt(), 2000.0);
    near((p[1][1] * 4e-4).sqrt(), 4.0);
    near((p[3][3] * 4e-4).sqrt(), 1000.0);
    let mut alarm = CusumBank::new(0.05, 0.001);
    alarm.update(-3.0);
    stylet.cusum.update(-3.0);
    assert_eq!(stylet.cusum.relative_level(), alarm.relative_level());
    // At standstill the drive has a lower bound.
    let mut stylet = inside();
    stylet.steady_drive_mps = 0.0;
    stylet.start_contact(&EnhanceConfig::default(), &step(), &sample(0.006, 0.6), 0.0055, 0.2, 0.3);
    near(stylet.estimator.belief.x[2], 1000.0 / 1e-6);
}
