use super::test_support::{inside, sample, step};
use super::*;

#[test]
fn duplicate_and_impossible_samples_are_ignored() {
    let config = EnhanceConfig::default();
    let used = |stylet: &KalmanEnhancer, sample: Sample| {
        let mut stylet = *stylet;
        let used = stylet.step(&config, 0.0, sample).used;
        assert_eq!(stylet.last_sample == sample, used);
        used
    };
    // A fiftieth of the usual interval, within 1 us and 0.1 ms.
    for (step_s, instant_s) in [(0.005, 1e-4), (0.001, 2e-5), (1e-5, 1e-6), (0.1, 1e-4)] {
        let mut stylet = inside();
        stylet.noise.interval_s = step_s;
        for (share, later) in [(0.99, false), (1.01, true), (-1.01, false)] {
            let time_s = stylet.last_sample.time_s + share * instant_s;
            // At the extrapolated position.
            let position_m = stylet.last_sample.position_m + 0.002 * (share * instant_s);
            let sample = Sample { time_s, position_m, ..stylet.last_sample };
            assert_eq!(used(&stylet, sample), later, "{share} of {instant_s} s");
        }
    }
    let fresh = KalmanEnhancer::new(&config, 0.0);
    let of = |position_m: f64, velocity_mps: f64| Sample { position_m, velocity_mps, ..Sample::default() };
    assert!(used(&fresh, of(-0.01, 0.002)), "the first sample");
    for (position_m, v, robot) in [
        (0.0, 1.99, true),
        (0.0, 2.0, false),
        (0.0, -1.99, true),
        (0.0, -2.01, false),
        (-9.9, 0.0, true),
        (-10.1, 0.0, false),
        (-10.0, 0.0, false),
        (10.1, 0.0, false),
        (9.9, 0.0, true),
    ] {
        assert_eq!(used(&fresh, of(position_m, v)), robot, "{position_m} m, {v} m/s");
    }
    assert!(!used(&fresh, Sample { force_n: f64::NAN, ..of(-0.01, 0.002) }));
    assert!(!used(&fresh, Sample { time_s: f64::INFINITY, ..of(-0.01, 0.002) }));
}

#[test]
fn detections_and_estimates_last_one_sample() {
    let config = EnhanceConfig::default();
    let mut stylet = inside();
    stylet.output.estimate = Some(crate::sample::LayerEstimate::default());
    stylet.declare_rupture(&step(), &sample(0.0099, 0.5), 1.3);
    assert!(stylet.output.detection.is_some());
    let out = stylet.step(&config, 0.0, Sample { force_n: f64::NAN, ..stylet.last_sample });
    assert!(out.detection.is_none() && out.estimate.is_none() && !out.used);
    assert_eq!(stylet.operation_count(), 60, "per sample");
}

#[test]
fn operations_are_counted_and_velocities_checked_per_sample() {
    let config = EnhanceConfig::default();
    let mut stylet = inside();
    // Logged as creeping, but the position is unchanged.
    let still = Sample { time_s: 4.955, velocity_mps: 9e-6, ..stylet.last_sample };
    stylet.step(&config, 0.0, still);
    assert_eq!((stylet.last_sample.velocity_mps, stylet.last_sample.position_m), (0.0, 0.0099));
    assert_eq!(stylet.operation_count(), 60 + 158 + 136);
    assert!(stylet.output.used && stylet.started);
    // In air.
    let mut air = KalmanEnhancer::new(&config, 0.0);
    air.step(&config, 0.0, sample(-0.01, 0.3));
    assert_eq!((air.operation_count(), air.low_passed_n, air.is_numerically_valid()), (60, 0.3, true));
}

#[test]
fn a_state_that_is_not_finite_or_positive_definite_is_invalid() {
    assert!(inside().is_numerically_valid());
    let spoils: [fn(&mut KalmanEnhancer, f64); 8] = [
        |s, x| s.noise.variance = x,
        |s, x| s.noise.rho = x,
        |s, x| s.peak_force_n = x,
        |s, x| s.misfit = x,
        |s, x| s.roughness = x,
        |s, x| s.output.enhanced_n = x,
        |s, x| s.predictor.state.x[2] = x,
        |s, x| s.estimator.state.x[2] = x,
    ];
    for (n, spoil) in spoils.iter().enumerate() {
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut stylet = inside();
            spoil(&mut stylet, x);
            assert!(!stylet.is_numerically_valid(), "{n} with {x}");
        }
    }
    for variance in [0.0, -1.0] {
        let mut stylet = inside();
        stylet.noise.variance = variance;
        assert!(!stylet.is_numerically_valid());
    }
    let mut stylet = inside();
    stylet.predictor.state.p[1][1] = -1.0;
    assert!(!stylet.is_numerically_valid());
    let mut stylet = inside();
    stylet.estimator.state.p[1][1] = -1.0;
    assert!(!stylet.is_numerically_valid());
}
