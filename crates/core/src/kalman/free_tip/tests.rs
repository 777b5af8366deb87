use super::*;

fn noise() -> NoiseEstimator {
    let mut noise = NoiseEstimator::new(1e-3);
    (0..2000).for_each(|_| noise.update_in_air(0.0));
    noise
}

const SPEEDS: [f64; 3] = [0.002, 0.003, 0.0015];

/// A layer of 60 N/m and 9000 N s/m² that ruptures at 20 mm; then 4 mm with this stiffness and friction.
fn behind_a_rupture(stiffness: f64, friction: f64) -> (LayerEstimator, NoiseEstimator) {
    let (noise, mut passed_layers) = (noise(), PassedLayers::default());
    let mut estimator = LayerEstimator::at_contact(0.0, 0.0, 0.0, 2000.0, 0.002, &noise);
    for n in 1..400_usize {
        let (x, u) = (5e-5 * n as f64, SPEEDS[n / 40 % 3]);
        estimator.update(x, u, 60.0 * x + 9000.0 * x * u, 0.0);
    }
    estimator.rupture(0.02, 0.0, 0.002, &noise, &mut passed_layers);
    for n in 1..80_usize {
        let (x, u) = (5e-5 * n as f64, SPEEDS[n / 20 % 3]);
        estimator.update(0.02 + x, u, stiffness * x + (180.0 + friction * x) * u, 0.0);
    }
    (estimator, noise)
}

/// Log density of `(K, b - b')` or `(K, b)` by its definition.
fn log_density(estimator: &LayerEstimator, follows: bool, noise: &NoiseEstimator) -> f64 {
    let g = &estimator.state;
    let map = [[(K, 1.0), (K, 0.0)], [(B, 1.0), (B_PREV, if follows { -1.0 } else { 0.0 })]];
    let mean = map.map(|row| row.iter().map(|(i, w)| w * g.x[*i]).sum::<f64>());
    let cov = |a: usize, b: usize| -> f64 {
        map[a].iter().flat_map(|x| map[b].iter().map(move |y| x.1 * g.cov(x.0, y.0) * y.1)).sum::<f64>()
            * noise.variance
    };
    let (c00, c01, c11) = (cov(0, 0), cov(0, 1), cov(1, 1));
    let determinant = c00 * c11 - c01 * c01;
    let distance2 =
        (c11 * mean[0] * mean[0] - 2.0 * c01 * mean[0] * mean[1] + c00 * mean[1] * mean[1]) / determinant;
    -0.5 * (determinant.ln() + distance2)
}

#[test]
fn the_bayes_factor_of_a_free_tip_is_a_ratio_of_densities() {
    for (stiffness, friction) in [(0.0, 9000.0), (0.0, 0.0), (30.0, 4000.0)] {
        let (estimator, noise) = behind_a_rupture(stiffness, friction);
        let (other, _) = behind_a_rupture(10.0, 8000.0);
        for follows in [true, false] {
            // Up to a constant.
            let found =
                estimator.log_density_of_free(follows, &noise) - other.log_density_of_free(follows, &noise);
            let expected = log_density(&estimator, follows, &noise) - log_density(&other, follows, &noise);
            assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "{found} for {expected}");
        }
    }
}

#[test]
fn a_free_tip_is_detected_with_growing_and_constant_friction() {
    let (mut gap, noise) = behind_a_rupture(0.0, 9000.0);
    assert!(gap.test_free_tip(ODDS, true, &noise) && gap.tip_free && !gap.layer_confirmed);
    assert!(gap.state.x[K].abs() < 1e-3, "{}", gap.state.x[K]);
    assert!((gap.state.x[B] / 9000.0 - 1.0).abs() < 0.02, "{}", gap.state.x[B]);
    let (mut end, noise) = behind_a_rupture(0.0, 0.0);
    assert!(end.test_free_tip(ODDS, true, &noise) && end.tip_free);
    assert!(end.state.x[B].abs() < 10.0, "{}", end.state.x[B]);
}

#[test]
fn a_layer_is_confirmed_and_not_tested_again() {
    for (stiffness, friction) in [(60.0, 9000.0), (0.0, 20_000.0), (30.0, 0.0)] {
        let (mut estimator, noise) = behind_a_rupture(stiffness, friction);
        assert!(!estimator.test_free_tip(ODDS, true, &noise) && !estimator.tip_free, "{stiffness} N/m");
        assert!(estimator.layer_confirmed, "{stiffness} N/m");
    }
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} for {expected}");
}

/// After a rupture, with these log Bayes factors of the two free-tip hypotheses.
fn with_evidence(follows: f64, ends: f64) -> (LayerEstimator, NoiseEstimator) {
    let (mut estimator, noise) = behind_a_rupture(0.0, 9000.0);
    let now = [true, false].map(|follows| estimator.log_density_of_free(follows, &noise));
    estimator.initial_log_densities = [now[0] - follows, now[1] - ends];
    (estimator, noise)
}

#[test]
fn a_free_tip_needs_odds_of_twenty_and_four_hundred_against_the_other_case() {
    let log = |x: f64| x.ln();
    for (follows, ends, free, settled) in [
        (log(20.2), -30.0, true, false),
        (log(19.8), -30.0, false, false),
        (-30.0, log(20.2), true, false),
        (-30.0, log(19.8), false, false),
        // Threshold with the other hypothesis at three to one: 20 (1 + 20 x 3) = 1220.
        (log(1230.0), log(3.0), true, false),
        (log(1210.0), log(3.0), false, false),
        (log(3.0), log(1230.0), true, false),
        // 20^4 to one against both.
        (-4.01 * log(20.0), -30.0, false, true),
        (-30.0, -4.01 * log(20.0), false, true),
        (-3.99 * log(20.0), -30.0, false, false),
        (-30.0, -3.99 * log(20.0), false, false),
        // Log odds are limited.
        (900.0, 800.0, true, false),
        (f64::INFINITY, 0.0, false, false),
        (f64::NEG_INFINITY, 10.0, false, false),
    ] {
        let (mut estimator, noise) = with_evidence(follows, ends);
        let was = estimator.state;
        assert_eq!(estimator.test_free_tip(ODDS, true, &noise), free, "{follows} {ends}");
        assert_eq!((estimator.tip_free, estimator.layer_confirmed), (free, settled), "{follows} {ends}");
        // Conditioned on zero stiffness and on the previous layer's friction or none.
        let mut expected = was;
        let variance = |g: &crate::kalman::gaussian::Gaussian<8>, i: usize| 1e-9 * g.p[i][i];
        if free {
            let none = expected.innovation([K], [1.0], 0.0, variance(&expected, K));
            expected.update(&none);
            let h = if follows > ends { -1.0 } else { 0.0 };
            let friction = expected.innovation([B, B_PREV], [1.0, h], 0.0, variance(&expected, B));
            expected.update(&friction);
        }
        for i in 0..6 {
            let scale = was.p[i][i].sqrt();
            assert!((estimator.state.x[i] - expected.x[i]).abs() <= 1e-12 * expected.x[i].abs().max(scale));
            assert!((estimator.state.p[i][i] - expected.p[i][i]).abs() <= 1e-9 * expected.p[i][i], "{i}");
        }
    }
}

#[test]
fn the_slow_sum_dates_the_start_of_a_bend() {
    let (estimator, _) = behind_a_rupture(0.0, 9000.0);
    let mut other = estimator;
    other.start_m = 0.077;
    let FreeTipDetector { mut up, .. } = FreeTipDetector::new(0.05, 0.005, &estimator);
    // The sum leaves zero for innovations below -1/4.
    assert!(!up.update(-0.2, &other, 0.03) && up.slow == 0.0 && up.snapshot_m == 0.02);
    assert!(!up.update(-0.7, &other, 0.031));
    near(up.slow, 0.5 * (0.7 - 0.25));
    assert_eq!((up.snapshot_m, up.snapshot.start_m), (0.031, 0.077));
    up.update(-1.3, &estimator, 0.032);
    near(up.slow, 0.5 * (0.7 + 1.3 - 0.5));
    assert_eq!((up.snapshot_m, up.snapshot.start_m), (0.031, 0.077));
    up.update(3.0, &estimator, 0.033);
    assert_eq!(up.slow, 0.0);
    up.update(-0.7, &estimator, 0.034);
    assert_eq!(up.snapshot_m, 0.034);
    assert!(up.update(-9.0, &estimator, 0.035));
    up.reset();
    assert_eq!((up.slow, up.cusum.relative_level()), (0.0, 0.0));
}

#[test]
fn the_odds_are_evaluated_every_eighth_sample_until_decided() {
    let (noise, mut passed_layers) = (noise(), PassedLayers::default());
    let mut update = |estimator: &mut LayerEstimator, detector: &mut FreeTipDetector, count: u32| {
        let before = estimator.may_be_free().then_some(*estimator);
        detector.update(estimator, (before, 0.024), (0.02405, 0.0, 0.002), count, &noise, &mut passed_layers)
    };
    let (mut estimator, _) = behind_a_rupture(60.0, 9000.0);
    let mut detector = FreeTipDetector::new(0.05, 0.005, &estimator);
    assert_eq!([7, 9, 12].map(|count| update(&mut estimator, &mut detector, count)), [(42, false); 3]);
    assert!(!estimator.layer_confirmed);
    // A possible upward bend prevents confirmation.
    detector.up.update(-3.0, &estimator, 0.0);
    assert_eq!(update(&mut estimator, &mut detector, 16), (102, false));
    assert!(!estimator.layer_confirmed);
    detector.reset();
    assert_eq!(update(&mut estimator, &mut detector, 16), (102, false));
    assert!(estimator.layer_confirmed && !estimator.tip_free);
    assert_eq!(update(&mut estimator, &mut detector, 24), (0, false));
    let (mut estimator, _) = behind_a_rupture(0.0, 9000.0);
    for side in [&mut detector.up, &mut detector.down] {
        side.update(-3.0, &estimator, 0.0);
    }
    assert_eq!(update(&mut estimator, &mut detector, 8), (102, false));
    assert!(
        estimator.tip_free && detector.up.slow == 0.0 && detector.down.slow == 0.0,
        "the sums begin then"
    );
}

#[test]
fn a_layer_without_positive_stiffness_is_not_confirmed() {
    for stiffness in [60.0, -60.0] {
        let (mut estimator, noise) = behind_a_rupture(stiffness, 9000.0);
        assert!(!estimator.test_free_tip(ODDS, true, &noise) && !estimator.tip_free);
        assert_eq!(estimator.layer_confirmed, stiffness > 0.0);
    }
}

#[test]
fn an_undetected_gap_ends_at_an_upward_bend() {
    let (noise, mut passed_layers) = (noise(), PassedLayers::default());
    // While the odds are open a fall may be a rupture.
    let (undecided, _) = behind_a_rupture(0.0, 9000.0);
    for (z, bent) in [(9.0, true), (-9.0, false)] {
        let (mut estimator, mut detector) = (undecided, FreeTipDetector::new(0.05, 0.005, &undecided));
        let mut update = |estimator: &mut LayerEstimator, last_m: f64, z: f64| {
            let next = (last_m + 1e-4, z, 0.0021);
            detector.update(estimator, (Some(undecided), last_m), next, 3, &noise, &mut passed_layers).1
        };
        assert!(!update(&mut estimator, 0.0241, 0.2 * z));
        assert_eq!(update(&mut estimator, 0.0242, z), bent);
        if bent {
            let mut expected = undecided;
            expected.set_zero_stiffness();
            expected.start_after_bend(
                0.0241,
                2e-4 / 12.0_f64.sqrt(),
                true,
                0.0021,
                &noise,
                &mut PassedLayers::default(),
            );
            near(estimator.start_m, 0.0241);
            for i in 0..6 {
                near(estimator.state.x[i], expected.state.x[i]);
                near(estimator.state.p[i][i], expected.state.p[i][i]);
            }
        } else {
            near(estimator.start_m, undecided.start_m);
        }
    }
}

#[test]
fn no_layer_begins_while_the_needle_is_at_rest() {
    let (noise, mut passed_layers) = (noise(), PassedLayers::default());
    for free in [true, false] {
        let (mut estimator, _) = behind_a_rupture(0.0, 9000.0);
        assert!(!free || estimator.test_free_tip(ODDS, true, &noise));
        let before = estimator;
        let mut detector = FreeTipDetector::new(0.05, 0.005, &estimator);
        let mut update = |estimator: &mut LayerEstimator, z: f64| {
            detector
                .update(estimator, (Some(before), 0.024), (0.024, z, 0.002), 3, &noise, &mut passed_layers)
                .1
        };
        assert!(!update(&mut estimator, 2.0) && update(&mut estimator, 9.0));
        assert_eq!((estimator.tip_free, estimator.start_m), (false, before.start_m));
        // Any part of the slope of 18 N/m may have been elastic.
        let part = if free { 9.0 } else { 0.0 };
        assert!((estimator.state.x[K] - before.state.x[K] - part).abs() < 0.2, "{}", estimator.state.x[K]);
        let slope = |estimator: &LayerEstimator| estimator.slope(0.002);
        near(slope(&estimator), slope(&before));
    }
}

#[test]
fn an_upward_bend_ends_the_gap_and_a_downward_bend_its_friction_growth() {
    for up in [true, false] {
        let (mut estimator, noise) = behind_a_rupture(0.0, 9000.0);
        let mut passed_layers = PassedLayers::default();
        assert!(estimator.test_free_tip(ODDS, true, &noise));
        let before = estimator;
        let mut detector = FreeTipDetector::new(0.05, 0.005, &estimator);
        let mut update = |estimator: &mut LayerEstimator, last_m: f64, z: f64| {
            detector.update(
                estimator,
                (Some(before), last_m),
                (last_m + 1e-4, z, 0.0021),
                3,
                &noise,
                &mut passed_layers,
            )
        };
        // One neutral sample, then two outliers; the sums leave zero before the first of these.
        let sign = if up { 1.0 } else { -1.0 };
        assert_eq!(update(&mut estimator, 0.024, 0.0), (42, false));
        assert_eq!(update(&mut estimator, 0.0241, 2.0 * sign), (42, false));
        estimator.state.x[K] = 77.0;
        assert_eq!(update(&mut estimator, 0.0242, 9.0 * sign), (42 + 2 * 216 + 2 * 126, true));
        let (mut expected, mut expected_behind) = (before, PassedLayers::default());
        let place_m = (0.0243 - 0.0241) / 12.0_f64.sqrt();
        expected.start_after_bend(0.0241, place_m, up, 0.0021, &noise, &mut expected_behind);
        assert_eq!((estimator.tip_free, estimator.start_m), (!up, 0.0241));
        for i in 0..6 {
            near(estimator.state.x[i], expected.state.x[i]);
            near(estimator.state.p[i][i], expected.state.p[i][i]);
        }
        assert_eq!((detector.up.slow, detector.down.slow), (0.0, 0.0));
    }
}

#[test]
fn a_singular_covariance_has_a_finite_density() {
    let (mut estimator, noise) = behind_a_rupture(0.0, 9000.0);
    estimator.state =
        crate::kalman::gaussian::Gaussian::new([0.0; 8], [1.0, 4.0, 9.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    estimator.state.p[B][K] = 6.0;
    // The determinant is limited to 1e-12 of that without correlation.
    near(estimator.log_density_of_free(false, &noise), -0.5 * 36e-12_f64.ln());
    estimator.state.p[B][K] = -3.0;
    (estimator.state.x[K], estimator.state.x[B]) = (0.7, 1.1);
    let square = (0.49 * 9.0 + 2.0 * 0.7 * 1.1 * 3.0 + 1.21 * 4.0) / 27.0;
    near(estimator.log_density_of_free(false, &noise), -0.5 * (27.0_f64.ln() + square / noise.variance));
}
