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
    stylet.estimator.state.p[K][K] = sd * sd / stylet.noise.variance;
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
    near(stylet.estimator.state.x[D], 0.5 * 1.43);
    near((stylet.estimator.state.p[D][D] * stylet.noise.variance).sqrt(), 1.43 + 0.06);
}

/// Standard deviation of the low-passed force about the bias.
fn sd_n(noise: &NoiseEstimator) -> f64 {
    let spread = noise.variance * noise.long_run_factor() * 0.005 / 0.1;
    (spread.min(noise.marginal_variance()) + noise.bias_variance().min(noise.marginal_variance())).sqrt()
}

/// In air for two seconds with noise of 20 mN, then advancing with this force beyond the offset at `k` samples since.
fn advance(config: &EnhanceConfig, force_n: impl Fn(f64) -> f64) -> KalmanEnhancer {
    let mut stylet = KalmanEnhancer::new(config, 0.004);
    for k in 0..600_u32 {
        let since = f64::from(k) - 400.0;
        let noise_n = 0.02 * [1.0, -1.2, 0.4, -0.6, 1.1, -0.7][(k % 6) as usize];
        let sample = Sample {
            time_s: 0.005 * f64::from(k),
            position_m: 1e-5 * since,
            velocity_mps: 0.002,
            force_n: 0.07 + noise_n + force_n(since),
        };
        stylet.step(config, 0.004, sample);
    }
    stylet
}

#[test]
fn five_consecutive_samples_above_five_standard_deviations_make_the_air_looked_at() {
    let config = EnhanceConfig::default();
    // White noise, and noise so slow that low-pass or bias are no more accurate than one sample.
    for noise in [
        NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0),
        NoiseEstimator::known(0.98, 4e-4, 0.07, 4000.0),
        NoiseEstimator::known(0.9, 4e-4, 0.07, 8.0),
    ] {
        let sd = sd_n(&noise);
        for (sds, counts) in [(5.001, true), (4.999, false), (-5.001, true), (-4.999, false)] {
            let force_n = 0.07 + sds * sd;
            let mut stylet = air(noise, force_n);
            for away in 1..=5_u32 {
                look(&mut stylet, &config, &sample(0.006, force_n));
                let expected = if counts { away } else { 0 };
                let (above, below) = (stylet.samples_above_threshold, stylet.samples_below_threshold);
                assert_eq!(if sds > 0.0 { above } else { below }, expected, "{sds}");
                assert_eq!(if sds > 0.0 { below } else { above }, 0, "{sds}");
            }
            // Without a history there is no evidence of anything.
            assert!(!stylet.in_tissue);
        }
    }
}

#[test]
fn contact_is_where_the_force_bends_up() {
    let stylet = advance(&EnhanceConfig::default(), |since| 2e-3 * since.max(0.0));
    assert!(stylet.in_tissue && stylet.baseline.settled && !stylet.baseline.moving);
    let contact_m = stylet.output.contact_m.expect("a contact");
    assert!(contact_m.abs() < 2e-4, "{contact_m}");
    assert!((2e-6..2e-4).contains(&stylet.output.contact_sd_m), "{}", stylet.output.contact_sd_m);
}

#[test]
fn a_drift_a_line_and_a_step_are_no_contact() {
    let config = EnhanceConfig::default();
    for rate in [1e-3, -1e-3] {
        let stylet = advance(&config, |since| rate * (since + 400.0));
        assert!(!stylet.in_tissue && stylet.baseline.moving, "{rate}");
        let found = stylet.baseline_now(&stylet.last_sample);
        // 1 mN per sample of 5 ms and 10 um.
        let per_sample = found.drift_n_per_s * 0.005 + found.line_n_per_m * 1e-5;
        assert!((per_sample / rate - 1.0).abs() < 0.1, "{found:?}");
        assert_eq!(found.kind, crate::BaselineKind::DriftOrLine);
    }
    for size_n in [0.3, -4.0] {
        let stylet = advance(&config, |since| if since < 0.0 { 0.0 } else { size_n });
        assert!(!stylet.in_tissue && !stylet.baseline.moving, "{size_n}");
        assert_eq!(stylet.baseline.zero_steps, 1, "{size_n}");
        assert!((stylet.noise.bias_n() - 0.07 - size_n).abs() < 0.02, "{size_n}");
    }
}

#[test]
fn without_air_the_needle_is_in_tissue_and_there_is_no_contact() {
    let config = EnhanceConfig { contact: Contact::None, ..EnhanceConfig::default() };
    let stylet = advance(&config, |since| 2e-3 * (since + 400.0));
    assert!(stylet.in_tissue && stylet.contact_given);
    assert_eq!(stylet.output.contact_m, None);
    assert!((0.01..0.04).contains(&stylet.noise.marginal_variance().sqrt()), "{:?}", stylet.noise);
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
    assert!(!stylet.in_tissue);
    for position_m in [0.004, 0.0043] {
        let mut touched = stylet;
        look(&mut touched, &config, &sample(position_m, 0.6));
        assert!(touched.in_tissue);
        assert_eq!((touched.estimator.start_m, touched.contact_sample_m), (0.004, position_m));
        assert_eq!((touched.estimator.state.x[D], touched.output.contact_m), (0.0, Some(0.004)));
        assert!(touched.estimator.state.p[D][D] < 1e-12);
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
    near(stylet.estimator.state.x[K], 1000.0);
    near((stylet.estimator.state.p[K][K] * 4e-4).sqrt(), 2000.0);
    assert_eq!(
        (stylet.predictor.level_n(), stylet.snapshot.start_m, stylet.snapshot_m),
        (0.6, 0.0055, 0.006)
    );
    // 2 N over a millimetre, in half a second at 2 mm/s, or as friction.
    let p = &stylet.predictor.state.p;
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
    near(stylet.estimator.state.x[2], 1000.0 / 1e-6);
}
