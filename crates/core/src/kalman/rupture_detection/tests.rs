use super::super::force_predictor::ForcePredictor;
use super::super::layer_estimator::{B, B_PREV, D, K_PREV, LayerEstimator, PassedLayers};
use super::super::noise_estimator::NoiseEstimator;
use super::super::retraction_tracker::ShaftSample;
use super::super::test_support::{advancing, inside, near, sample, step};
use super::*;
use alloc::vec::Vec;

/// A candidate of `count` samples from 1.9 N to 1.6 N, with a prediction of 1.85 N.
fn fallen(count: f64) -> KalmanEnhancer {
    let mut stylet = inside();
    stylet.candidate =
        Some(DropCandidate { from_n: 1.9, mean_n: 1.6, missing_n: 0.25, duration_s: 0.005 * count, count });
    stylet
}

/// 10 mm deep and 0.3 N below the base law, which rises by 78 N/m.
fn low() -> KalmanEnhancer {
    let mut stylet = inside();
    stylet.pre_rupture = stylet.estimator;
    stylet.predictor.state.x[0] = 1.2;
    stylet.predictor.state.p[0][0] = 0.25;
    (stylet.predictor.state.p[1][0], stylet.predictor.state.p[2][0]) = (0.05, 3.0);
    stylet
}

#[test]
fn a_long_drop_is_located_where_its_line_meets_the_base_law() {
    let mut stylet = low();
    // 0.9 N/s at 2 mm/s, standard deviation 0.1 N/s.
    stylet.locate_drop_onset(&step(), &sample(0.01, 1.2), -0.9, 0.1);
    let (steep, noise_n2) = (78.0 + 450.0, 4e-4);
    let back_s = 0.3 / steep / 0.002;
    let line_n2 = 0.25 * noise_n2 + back_s * (back_s * 0.01 - 2.0 * (0.05 + 0.002 * 3.0) * noise_n2);
    let (began_m, variance) = stylet.drop_onset.expect("an onset");
    near(began_m, 0.01 - 0.3 / steep);
    near(variance, line_n2 / (steep * steep));
    let kept = stylet.drop_onset;
    // A less accurate line, or one more than four standard deviations away, is ignored.
    stylet.locate_drop_onset(&step(), &sample(0.01, 1.2), -0.85, 0.2);
    assert_eq!(stylet.drop_onset, kept);
    stylet.locate_drop_onset(&step(), &sample(0.01, 1.2), -0.5, 0.01);
    assert_eq!(stylet.drop_onset, kept);
    stylet.locate_drop_onset(&step(), &sample(0.01, 1.2), -0.88, 0.05);
    near(stylet.drop_onset.expect("a more accurate onset").0, 0.01 - 0.3 / (78.0 + 440.0));
    // A force that rises more steeply than the law has no onset.
    let mut stylet = low();
    stylet.locate_drop_onset(&step(), &sample(0.01, 1.2), 0.16, 0.1);
    assert!(stylet.drop_onset.is_none());
}

#[test]
fn the_layer_after_a_long_drop_begins_at_its_onset() {
    for (traced_m, sd_m, began_m) in [(0.0093, 4e-5, 0.0093), (0.0106, 4e-5, 0.0101), (0.0081, 4e-5, 0.0087)]
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
            near(stylet.estimator.state.x[k], expected.state.x[k]);
            near(stylet.estimator.state.p[k][k], expected.state.p[k][k]);
        }
        near(stylet.passed_layers[0][1], began_m);
    }
    // Without an onset nothing moves.
    let mut stylet = low();
    let start_m = stylet.estimator.start_m;
    stylet.relocate_rupture();
    assert_eq!((stylet.estimator.start_m, stylet.estimator.passed_count), (start_m, 0));
}

#[test]
fn a_fall_goes_from_the_level_before_to_the_mean_since_at_constant_speed() {
    let mut stylet = inside();
    stylet.level_before_fall_n = 1.48;
    // Friction 25 + 9000 x N s/m; the speed falls by 0.4 and 0.2 mm/s.
    let friction = 25.0 + 9000.0 * 0.01;
    stylet.track_candidate(&MotionStep { dv_mps: -4e-4, ..step() }, &sample(0.01, 1.3), false);
    let fall = stylet.candidate.expect("a fall");
    near(fall.from_n, 1.48 - friction * 4e-4);
    near(fall.mean_n, 1.3);
    near(fall.missing_n, 1.5 - 1.3);
    assert_eq!((fall.duration_s, fall.count), (0.005, 1.0));
    stylet.friction_drive_mps = 0.0018;
    stylet.track_candidate(&MotionStep { dv_mps: -2e-4, ..step() }, &sample(0.01, 1.2), false);
    let fall = stylet.candidate.expect("a fall");
    near(fall.from_n, 1.48 - friction * 6e-4);
    near(fall.mean_n, 0.5 * (1.3 - friction * 2e-4 + 1.2));
    near(fall.missing_n, 0.5 * (0.2 + 0.277));
    assert_eq!((fall.duration_s, fall.count), (0.01, 2.0));
    // Where the base law fails there is no correction for the speed.
    let mut stylet = inside();
    (stylet.level_before_fall_n, stylet.misfit_weight) = (1.48, 0.3);
    stylet.track_candidate(&MotionStep { dv_mps: -4e-4, ..step() }, &sample(0.01, 1.3), false);
    near(stylet.candidate.expect("a fall").from_n, 1.48);
}

#[test]
fn a_sample_that_outweighs_the_history_restarts_the_candidate_at_the_prediction() {
    let mut stylet = fallen(7.0);
    stylet.level_before_fall_n = 9.0;
    stylet.track_candidate(&step(), &sample(0.01, 1.1), true);
    let fall = stylet.candidate.expect("a fall");
    assert_eq!((fall.from_n, fall.mean_n, fall.count), (1.5, 1.1, 1.0));
    assert_eq!(stylet.level_before_fall_n, 1.5);
}

#[test]
fn the_level_is_averaged_to_a_quarter_of_the_smallest_drop() {
    // Noise of 20 mN to a quarter of 50 mN: 2.56 samples; of 5 mN: the maximum; of 1 N: one.
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
fn a_fall_that_is_too_small_after_a_tenth_of_a_second_is_discarded() {
    // Misfit weight, smallest drop, duration, force, and whether the candidate is kept. The limit is four standard deviations
    // of 20 mN, less where the base law fails.
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
        let found = (stylet.candidate.is_some(), stylet.cusum.relative_level() > 0.0, stylet.cusum_was_zero);
        assert_eq!(found, (goes_on, goes_on, !goes_on), "{rough} {least_n} N {dt_s} s {force_n} N");
    }
}

#[test]
fn the_size_is_the_smaller_of_both_measures_and_must_exceed_four_standard_deviations() {
    let size = |stylet: &KalmanEnhancer| {
        let size = stylet.candidate_size().expect("a fall");
        [size.fall_n, size.sd_n, size.min_n]
    };
    let assert = |found: [f64; 3], expected: [f64; 3]| {
        found.into_iter().zip(expected).for_each(|(f, e)| near(f, e));
    };
    // Mean of ten samples of 20 mN.
    let sd_n = 0.02 / 10.0_f64.sqrt();
    assert(size(&fallen(10.0)), [0.25, sd_n, 4.0 * sd_n]);
    let mut stylet = fallen(10.0);
    stylet.candidate = stylet.candidate.map(|fall| DropCandidate { from_n: 1.7, ..fall });
    assert(size(&stylet), [0.1, sd_n, 4.0 * sd_n]);
    // At most sixteen samples; at least one with slow noise.
    assert(size(&fallen(40.0)), [0.25, 0.005, 0.02]);
    let mut stylet = fallen(10.0);
    stylet.noise = NoiseEstimator::known(0.5, 3e-4, 0.0, 400.0);
    let sd_n = 0.02 / 5.0_f64.sqrt();
    assert(size(&stylet), [0.25, sd_n, 4.0 * sd_n]);
    stylet.candidate = stylet.candidate.map(|fall| DropCandidate { count: 1.0, ..fall });
    assert(size(&stylet), [0.25, 0.02, 0.08]);
    // Free tip: plus the growth of friction over a millimetre, 14 mN.
    let mut stylet = fallen(16.0);
    stylet.estimator.state.x[B_PREV] = 7000.0;
    assert(size(&stylet), [0.25, 0.005, 0.02]);
    stylet.estimator.tip_free = true;
    assert(size(&stylet), [0.25, 0.005, 0.034]);
    // Where the base law fails: two standard deviations or the smallest drop; in between interpolated.
    (stylet.misfit_weight, stylet.min_drop_n) = (0.5, 0.004);
    assert(size(&stylet), [0.3, 0.005, 0.022]);
    let mut stylet = fallen(16.0);
    (stylet.misfit_weight, stylet.min_drop_n) = (1.0, 0.004);
    assert(size(&stylet), [0.3, 0.005, 0.01]);
    stylet.min_drop_n = 0.2;
    assert(size(&stylet), [0.3, 0.005, 0.2]);
    stylet.candidate = None;
    assert!(stylet.candidate_size().is_none());
}

#[test]
fn a_rupture_has_the_smallest_size_and_lies_beyond_the_blind_travel_of_an_unconfirmed_law() {
    let config = EnhanceConfig::default();
    // Misfit weight, smallest drop, deepest point; contact at 1 mm.
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
    // The blind travel is exclusive.
    let mut stylet = fallen(16.0);
    (stylet.misfit_weight, stylet.contact_sample_m, stylet.deepest_m) =
        (0.3, 0.0, config.guard.blind_travel_m);
    assert!(stylet.is_rupture(&config));
    stylet.candidate = None;
    assert!(!stylet.is_rupture(&config));
}

/// The predictor restarted at a force with slope scale `scale_n`.
fn restarted(local: &ForcePredictor, force_n: f64, scale_n: f64, noise: &NoiseEstimator) -> ForcePredictor {
    let mut expected = *local;
    expected.restart(force_n, scale_n, noise, 0.002, false);
    expected
}

fn assert_same(found: &LayerEstimator, expected: &LayerEstimator) {
    assert_eq!((found.state.x, found.state.p), (expected.state.x, expected.state.p));
    assert_eq!((found.start_m, found.passed_count), (expected.start_m, expected.passed_count));
}

/// Dry shaft friction at a constant force.
fn shaft_friction_n(stylet: &KalmanEnhancer) -> f64 {
    let sample =
        ShaftSample { gain: 0.0, peak_force_n: 1.0, noise_variance_n2: 4e-4, ..advancing(0.01, 0.0) };
    let mut shaft = stylet.dry_friction;
    shaft.update(&sample).0
}

#[test]
fn a_continuing_drop_restarts_all_filters_at_its_level() {
    for (force_n, sd, scale_n) in [(0.5, 0.03, 0.43), (-0.2, 0.03, 0.27), (0.08, 0.03, 0.03)] {
        let mut stylet = fallen(3.0);
        stylet.cusum.update(-3.0);
        stylet.cusum_was_zero = false;
        let mut other = stylet.estimator;
        other.state.x[B] = 7000.0;
        stylet.post_rupture = Some(other);
        let expected = restarted(&stylet.predictor, force_n, scale_n, &stylet.noise);
        stylet.continue_drop(&step(), &sample(0.01, force_n), sd);
        assert_eq!(stylet.predictor.level_n(), force_n);
        for i in 1..5 {
            near(stylet.predictor.state.p[i][i], expected.state.p[i][i]);
        }
        assert!(stylet.cusum.relative_level() == 0.0 && stylet.cusum_was_zero && stylet.candidate.is_none());
        assert_same(&stylet.estimator, &other);
        assert_same(&stylet.snapshot, &other);
        assert_eq!(stylet.snapshot_m, 0.01);
        // The whole force less the bias is friction.
        near(shaft_friction_n(&stylet), (force_n - 0.07).max(0.0));
    }
}

#[test]
fn a_rupture_is_located_half_a_step_after_the_sums_left_zero() {
    // Snapshot position, last step, located position and its standard deviation.
    let even = 1e-4 / 12.0_f64.sqrt();
    for (before_m, dz_m, at_m, place_m) in [
        (0.0099, 1e-4, 0.00995, even),
        (0.00986, 1e-4, 0.00991, even),
        (0.00984, 1e-4, 0.00989, 1e-4),
        (0.0096, 1e-4, 0.00965, 2e-4),
        (0.00998, 1e-4, 0.00999, 2e-5 / 12.0_f64.sqrt()),
        // Standstill, and a step back.
        (0.0096, -1e-5, 0.0096, 2e-4),
        (0.0101, 1e-4, 0.0101, 0.0),
    ] {
        let mut stylet = fallen(3.0);
        stylet.snapshot_m = before_m;
        stylet.operations = 5;
        stylet.snapshot.state.x[B] = 8000.0;
        let (mut expected, mut passed_layers) = (stylet.snapshot, stylet.passed_layers);
        expected.rupture(at_m, place_m, 0.002, &stylet.noise, &mut passed_layers);
        stylet.declare_rupture(&MotionStep { dz_m, ..step() }, &sample(0.01, 0.5), 1.3);
        let fallen = stylet.post_rupture.expect("a drop that may go on");
        near(fallen.start_m, at_m);
        for i in 0..6 {
            near(fallen.state.x[i], expected.state.x[i]);
            let off = (fallen.state.p[i][i] - expected.state.p[i][i]).abs();
            assert!(off <= 1e-9 * expected.state.p[i][i], "{before_m}: {off} of {i}");
        }
        // The sample is the first of the new layer.
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
fn a_rupture_resets_counters_and_predictions() {
    // Slope scale: the remaining force or the drop.
    for (force_n, scale_n) in [(0.5, 1.0), (1.2, 1.13), (-0.9, 2.4)] {
        let mut stylet = fallen(3.0);
        stylet.cusum.update(-3.0);
        stylet.cusum_was_zero = false;
        stylet.last_drop_n = (0.31, 0.02);
        let expected = restarted(&stylet.predictor, force_n, scale_n, &stylet.noise);
        stylet.declare_rupture(&step(), &sample(0.01, force_n), 0.0);
        assert_eq!(stylet.predictor.level_n(), force_n);
        for i in 1..5 {
            near(stylet.predictor.state.p[i][i], expected.state.p[i][i]);
        }
        assert!(stylet.cusum.relative_level() == 0.0 && stylet.cusum_was_zero && stylet.candidate.is_none());
        assert_eq!(
            (stylet.samples_since_rupture, stylet.time_since_rupture_s, stylet.next_report_at),
            (0, 0.0, 16)
        );
        assert_eq!((stylet.snapshot_m, stylet.output.ruptures), (0.01, 1));
        let found = stylet.output.detection.expect("a rupture");
        assert_eq!((found.drop_n, found.drop_sd_n), (0.31, 0.02));
        near(found.confidence, 2.0 / 3.0);
        // The first rupture gives the final contact position.
        let contact_m = stylet.estimator.start_m - stylet.estimator.previous_thickness_m;
        assert_eq!(stylet.output.contact_m, Some(contact_m));
        // The first stands.
        stylet.zero_step_test = None;
        stylet.declare_rupture(&step(), &sample(0.02, force_n), 0.0);
        assert_eq!((stylet.output.contact_m, stylet.output.ruptures), (Some(contact_m), 2));
        near(shaft_friction_n(&stylet), (force_n - 0.07).max(0.0));
    }
}

#[test]
fn the_previous_layer_is_reported_again_at_the_next_rupture() {
    for (report_at, reported) in [(u32::MAX, false), (16, true)] {
        let mut stylet = fallen(3.0);
        (stylet.estimator.passed_count, stylet.estimator.previous_thickness_m, stylet.output.ruptures) =
            (1, 0.02, 1);
        stylet.estimator.state.x[K_PREV] = 50.0;
        stylet.next_report_at = report_at;
        stylet.declare_rupture(&step(), &sample(0.01, 0.5), 1.3);
        assert_eq!(stylet.output.estimate.is_some(), reported);
    }
}

#[test]
fn a_drop_continues_below_minus_three_standard_deviations_and_ends_above_minus_two() {
    // Rate in standard deviations, time since the rupture, whether it falls, and whether the drop is over.
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
        // In the second layer with a friction of 150 N s/m; the predictor estimates 170.
        (stylet.estimator.passed_count, stylet.estimator.state.x[D]) = (1, 150.0);
        (stylet.post_rupture, stylet.time_since_rupture_s) = (Some(stylet.estimator), since_s);
        let sd = (25.0 + 0.0025_f64.powi(2) * 9e6 + 0.0045_f64.powi(2) * 4e6).sqrt() * 0.02;
        stylet.predictor.state.p[1][1] = 25.0;
        stylet.predictor.state.p[2][2] = 9e6;
        stylet.predictor.state.p[3][3] = 4e6;
        // 0.9 mm/s above the low-passed speed (0.2 s): 4.5 mm/s².
        let moved = Sample { velocity_mps: 0.0034, ..sample(0.01, 1.0) };
        (stylet.predictor.state.x[2], stylet.predictor.state.x[3]) = (30.0, 170.0);
        stylet.predictor.state.x[1] = sds * sd - 30.0 * 0.0025 - 20.0 * 0.0045;
        let found = stylet.drop_is_ongoing(&MotionStep { speed_mps: 0.0025, ..step() }, &moved);
        assert_eq!((found, stylet.post_rupture.is_none()), (falls, over), "{sds} after {since_s} s");
    }
}

#[test]
fn before_the_law_is_confirmed_only_a_fall_by_half_the_force_of_a_sure_contact_is_a_rupture() {
    let config = EnhanceConfig::default();
    let is_rupture = |fall_n: f64, settled: bool, rises: bool| {
        let mut stylet = inside();
        (stylet.misfit_weight, stylet.contact_sample_m, stylet.baseline.settled) = (1.0, 0.009, settled);
        stylet.snapshot.layer_confirmed = rises;
        stylet.candidate = Some(DropCandidate {
            from_n: 1.5,
            mean_n: 1.5 - fall_n,
            missing_n: fall_n,
            duration_s: 0.005,
            count: 1.0,
        });
        stylet.is_rupture(&config)
    };
    // The largest force is 1.2 N.
    assert!(is_rupture(0.61, true, true) && !is_rupture(0.59, true, true));
    assert!(!is_rupture(0.61, false, true) && !is_rupture(0.61, true, false));
}
