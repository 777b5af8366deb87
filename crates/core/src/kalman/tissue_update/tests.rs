use super::super::test_support::{inside, near, sample, step};
use super::*;
use crate::kalman::cusum::CusumBank;
use crate::kalman::gaussian::Gaussian;
use crate::kalman::velocity_estimator::VelocityEstimator;

/// The enhancer after one more sample with this force at 10 mm.
fn after(mut stylet: KalmanEnhancer, force_n: f64) -> KalmanEnhancer {
    stylet.update_in_tissue(&EnhanceConfig::default(), &step(), &sample(0.01, force_n));
    stylet
}

fn assert_same<const N: usize>(found: &Gaussian<N>, expected: &Gaussian<N>) {
    assert_eq!((found.x, found.p), (expected.x, expected.p));
}

/// Predictor, estimator and noise after such a sample, and the squared standardised innovation of the estimator.
fn taken(stylet: &KalmanEnhancer, force_n: f64) -> (ForcePredictor, LayerEstimator, NoiseEstimator, f64) {
    let (mut local, mut layers, mut noise) = (stylet.predictor, stylet.estimator, stylet.noise);
    local.advance(&step(), &noise);
    let innovation = local.innovation(force_n, &step(), &noise);
    noise.update_in_tissue(innovation.e, innovation.s);
    local.update(&innovation, force_n);
    let (e, s) = layers.update(0.01, stylet.friction_drive_mps, force_n, 0.0);
    (local, layers, noise, e * e / (s * noise.variance))
}

#[test]
fn an_ordinary_sample_updates_predictor_layers_and_noise() {
    let mut stylet = inside();
    (stylet.operations, stylet.roughness) = (7, 3.0);
    let (local, layers, noise, square) = taken(&stylet, 1.48);
    let found = after(stylet, 1.48);
    near(found.output.error_n, -0.02);
    assert_same(&found.predictor.state, &local.state);
    assert_same(&found.estimator.state, &layers.state);
    assert_eq!((found.noise.variance, found.noise.rho), (noise.variance, noise.rho));
    // Prediction, and update of the layers.
    assert_eq!(found.operations, 7 + 158 + 136);
    assert_eq!((found.samples_since_rupture, found.deepest_m), (101, 0.01));
    near(found.time_since_rupture_s, 0.505);
    near(found.release_window_s, -0.005);
    // Gain 1/21 for 0.1 mm of travel; the innovation is half a standard deviation.
    near(found.roughness, 3.0 + (0.25 - 3.0) / 21.0);
    near(found.misfit, 1.0 + (square - 1.0) / 21.0);
    assert_eq!((found.misfit_weight, found.base_law_failed, found.min_drop_n), (0.0, false, 0.0));
    near(found.peak_force_n, local.level_n() - 0.07);
    near(found.level_before_fall_n, 1.5);
    assert!(found.peak_force_n > 1.2 && found.output.detection.is_none());
}

/// With a misfit at which the predictor feeds the alarm.
fn by_predictor() -> KalmanEnhancer {
    KalmanEnhancer { misfit: 1.3, ..inside() }
}

#[test]
fn the_layer_estimator_feeds_the_alarm_where_it_is_valid_and_more_accurate() {
    // 50 mN too little: 2.04 standard deviations of the layer estimator, 1.25 of the predictor.
    let force_n = 1.45;
    let by_layers = -0.05 / (1.5 * 4e-4_f64).sqrt();
    type Change = fn(&mut KalmanEnhancer);
    let cases: [(Change, f64); 10] = [
        (|_| (), by_layers),
        (|s| s.misfit = 1.19, by_layers),
        (|s| s.misfit = 1.21, -1.25),
        (|s| s.speed_mps = 0.0021, by_layers),
        (|s| s.speed_mps = 0.0022, -1.25),
        (|s| s.speed_mps = 0.0018, -1.25),
        (|s| s.estimator.layer_confirmed = false, -1.25),
        (|s| s.estimator.start_m = 0.01005, -1.25),
        (|s| s.estimator.state.p[5][5] = 2.9, -0.05 / (3.9 * 4e-4_f64).sqrt()),
        (|s| s.estimator.state.p[5][5] = 3.1, -1.25),
    ];
    for (n, (change, alarm_z)) in cases.into_iter().enumerate() {
        let mut stylet = inside();
        change(&mut stylet);
        let mut alarm = stylet.cusum;
        alarm.update(alarm_z);
        let found = after(stylet, force_n).cusum.relative_level();
        assert!((found - alarm.relative_level()).abs() < 1e-6, "{n}: {found} for {}", alarm.relative_level());
    }
    // Not while the base by_layers may fail, nor during a drop.
    let mut stylet = inside();
    (stylet.misfit_weight, stylet.post_rupture) = (0.1, None);
    assert!(stylet.layer_innovation(&step(), &sample(0.01, force_n)).is_none());
    (stylet.misfit_weight, stylet.post_rupture) = (0.0, Some(stylet.estimator));
    assert!(stylet.layer_innovation(&step(), &sample(0.01, force_n)).is_none());
    stylet.post_rupture = None;
    let expected = stylet.estimator.innovation(0.01, 0.002, force_n, 0.0);
    let found = stylet.layer_innovation(&step(), &sample(0.01, force_n)).expect("an innovation");
    assert_eq!((found.e, found.s), (expected.e, expected.s));
}

#[test]
fn roughness_clips_innovations_at_six_standard_deviations() {
    let mut stylet = by_predictor();
    (stylet.roughness, stylet.cusum) = (3.0, CusumBank::new(1e-9, 0.005));
    stylet.cusum.reset();
    // Seven and five standard deviations of 40 mN in one sample raise no alarm at this rate.
    near(after(stylet, 1.22).roughness, 3.0 + 33.0 / 21.0);
    near(after(stylet, 1.3).roughness, 3.0 + 22.0 / 21.0);
}

#[test]
fn roughness_widens_the_alarm_as_far_as_the_law_fails() {
    for (weight, roughness, alarm_z) in
        [(0.0, 5.0, -2.5), (0.4, 5.0, -2.5 / 2.6_f64.sqrt()), (0.4, 0.3, -2.5)]
    {
        let mut stylet = by_predictor();
        (stylet.misfit_weight, stylet.roughness) = (weight, roughness);
        let mut alarm = stylet.cusum;
        alarm.update(alarm_z);
        near(after(stylet, 1.4).cusum.relative_level(), alarm.relative_level());
    }
}

#[test]
fn the_misfit_is_averaged_over_travel_and_in_a_hold_over_time() {
    let config = EnhanceConfig::default();
    let square = |stylet: &KalmanEnhancer, force_n: f64| taken(stylet, force_n).3;
    // Duration, travel, speed, and gain.
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
    // Uncertain predictions do not count except in a hold; squares are clipped at 400.
    for (zero, v, force_n, counted) in [
        (1.5, 0.002, 1.53, None),
        (1.5, 0.0, 1.53, Some(0.03 * 0.03 / 2.5 / 4e-4)),
        (1.5, 5e-5, 1.53, Some(0.03 * 0.03 / 2.5 / 4e-4)),
        (0.9, 0.002, 1.53, Some(0.03 * 0.03 / 1.9 / 4e-4)),
        (0.5, 0.002, 9.5, Some(400.0)),
    ] {
        let mut stylet = inside();
        stylet.estimator.state.p[5][5] = zero;
        stylet.misfit = 0.3;
        // The predictor has no effect.
        stylet.predictor.state.x[0] = force_n;
        let moved = Sample { velocity_mps: v, ..sample(0.01, force_n) };
        // Keeps the noise estimate.
        stylet.noise.sample_count = 1e300;
        stylet.update_in_tissue(&config, &step(), &moved);
        let expected = counted.map_or(0.3, |square| 0.3 + (square - 0.3) / 21.0);
        assert!((stylet.misfit / expected - 1.0).abs() < 1e-9, "{} for {expected}", stylet.misfit);
    }
}

#[test]
fn a_larger_misfit_raises_the_smallest_drop() {
    for (misfit, rough) in [(1.2, 0.0), (1.5, 0.0), (1.7, 0.4), (1.9, 0.8), (2.5, 1.0)] {
        let mut stylet = inside();
        // The misfit after the sample, whose gain is 1/21.
        let square = taken(&stylet, 1.48).3;
        stylet.misfit = (misfit - square / 21.0) * 21.0 / 20.0;
        stylet.peak_force_n = 3.0;
        let found = after(stylet, 1.48);
        near(found.misfit, misfit);
        assert!((found.misfit_weight - rough).abs() < 1e-9, "{} for {rough}", found.misfit_weight);
        assert!((found.min_drop_n - rough * 0.08 * 3.0).abs() < 1e-9, "{} N", found.min_drop_n);
    }
    // A misfit of three is a failure, except in the first two millimetres.
    for (misfit, first_m, dry) in
        [(3.3, 0.001, true), (2.9, 0.001, false), (3.3, 0.0081, false), (3.3, 0.0079, true)]
    {
        let mut stylet = inside();
        (stylet.misfit, stylet.contact_sample_m) = (misfit, first_m);
        assert_eq!(after(stylet, 1.48).base_law_failed, dry, "{misfit} from {first_m} m");
    }
}

#[test]
fn a_spike_of_up_to_three_samples_is_ignored_and_a_lasting_jump_restarts_the_predictor() {
    // Six standard deviations up, or six standard deviations of the noise below the bias.
    for force_n in [1.78, -0.06] {
        let mut stylet = inside();
        stylet.level_before_fall_n = 0.3;
        let (texture, was) = (stylet.roughness, stylet.estimator.state);
        for spikes in 1..=3 {
            let count = stylet.noise.sample_count;
            stylet = after(stylet, force_n);
            assert_eq!(
                (stylet.spike_samples, stylet.noise.sample_count, stylet.roughness),
                (spikes, count, texture)
            );
            assert_eq!((stylet.predictor.level_n(), stylet.operations), (1.5, 158 * u32::from(spikes)));
            assert_same(&stylet.estimator.state, &was);
        }
        // Where the force does not follow the base law, it restarts the predictor.
        let mut rough = stylet;
        rough.base_law_failed = true;
        let found = after(rough, force_n);
        assert_eq!((found.spike_samples, found.predictor.level_n(), found.roughness), (0, force_n, texture));
        // Slope scale: the whole force less the bias over a millimetre.
        let scale_n = (force_n - 0.07_f64).abs().max(0.04);
        let sd = (found.predictor.state.p[2][2] * found.noise.variance).sqrt();
        assert!((sd / (scale_n / 1e-3) - 1.0).abs() < 1e-4, "{sd} N/m for {force_n} N");
        assert!(
            found.candidate.is_none()
                && found.output.detection.is_none()
                && found.cusum.relative_level() == 0.0
        );
        // Where it does, the zero has jumped, and everything else stays.
        let found = after(stylet, force_n);
        let step = found.output.zero_step.expect("a step of the zero");
        assert!((step.size_n - (force_n - 1.5)).abs() < 1e-9 && step.in_tissue && step.withdrawn.is_none());
        assert_eq!((found.spike_samples, found.predictor.level_n(), found.roughness), (0, 1.5, texture));
        assert_eq!(found.estimator.state.x, was.x);
        assert_eq!(found.baseline.subtracted_n(0.0, 0.0), step.size_n);
        // An ordinary sample ends the spike.
        assert_eq!(after(stylet, 1.5).spike_samples, 0);
    }
    // Smaller deviations are no spikes.
    for force_n in [1.73, -0.04] {
        assert_eq!(after(inside(), force_n).spike_samples, 0, "{force_n} N");
    }
    // The slope scale is at least the innovation's standard deviation.
    let mut stylet = inside();
    (stylet.predictor.state.x[0], stylet.spike_samples) = (-0.2, 3);
    let found = after(stylet, 0.08);
    let sd = (found.predictor.state.p[2][2] * found.noise.variance).sqrt();
    assert!((sd / 40.0 - 1.0).abs() < 1e-4, "{sd} N/m");
}

/// One more sample during retraction or in revisited tissue.
fn after_back(
    mut stylet: KalmanEnhancer,
    position_m: f64,
    velocity_mps: f64,
    force_n: f64,
) -> KalmanEnhancer {
    let moved = Sample { velocity_mps, ..sample(position_m, force_n) };
    stylet.update_in_tissue(&EnhanceConfig::default(), &step(), &moved);
    stylet
}

#[test]
fn retraction_and_revisited_tissue_give_no_rupture_and_a_release_opens_its_window() {
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
        // An ordinary sample: during retraction the CUSUM is reset and the estimator not updated.
        let was = stylet.estimator.state;
        let found = after_back(stylet, position_m, v, 1.45);
        assert_eq!(found.cusum.relative_level() > 0.0, forward, "{position_m} m, {v} m/s");
        assert_eq!(found.cusum_was_zero, !forward);
        assert_eq!(found.candidate.is_some(), forward);
        assert_eq!(found.estimator.state.x != was.x, forward);
        assert_eq!(found.operations, 158 + if forward { 136 } else { 0 });
        // An upward jump.
        let found = after_back(stylet, position_m, v, 1.8);
        assert_eq!(found.spike_samples == 1, forward);
        near(found.release_window_s, if forward { -0.005 } else { 0.1 });
        assert_eq!(found.predictor.level_n() == 1.8, !forward);
        // A downward jump is no release, and no rupture during retraction.
        let found = after_back(stylet, position_m, v, 0.5);
        near(found.release_window_s, -0.005);
        assert_eq!(found.output.detection.is_some(), forward);
        // Nor a spike: a force below zero is a pull.
        let found = after_back(stylet, position_m, v, -0.5);
        assert_eq!(found.spike_samples == 1, forward);
    }
    // Before the start of the layer the estimator is not updated.
    let mut stylet = inside();
    stylet.estimator.start_m = 0.0105;
    assert_eq!(after(stylet, 1.48).operations, 158);
    stylet.estimator.start_m = 0.01;
    assert_eq!(after(stylet, 1.48).operations, 158 + 136);
}

#[test]
fn the_snapshot_is_taken_when_the_sums_leave_zero() {
    // Whether the sums were zero, the force, and whether a snapshot is taken.
    for (all_zero, force_n, kept) in
        [(true, 1.4, true), (false, 1.46, false), (false, 0.9, true), (true, 1.56, false)]
    {
        let mut stylet = inside();
        if !all_zero {
            stylet.cusum.update(-3.0);
            stylet.cusum_was_zero = false;
            // Smallest drop.
            (stylet.misfit_weight, stylet.min_drop_n) = (0.5, 5.0);
        }
        stylet.snapshot.state.x[1] = 61.0;
        let found = after(stylet, force_n);
        assert_eq!(found.snapshot_m, if kept { 0.0099 } else { 0.0097 }, "{force_n} N");
        assert_eq!(found.snapshot.state.x[1], if kept { 60.0 } else { 61.0 });
        assert_eq!(found.cusum_was_zero, all_zero && force_n > 1.5);
        assert_eq!(found.candidate.is_some(), force_n < 1.5);
    }
}

#[test]
fn an_alarm_is_a_rupture_unless_it_is_too_small_or_continues_a_drop() {
    let rupture = after(inside(), 0.9);
    assert_eq!((rupture.output.ruptures, rupture.estimator.passed_count), (1, 1));
    assert!(rupture.output.detection.is_some_and(|d| d.confidence > 0.99));
    // The drop continues for a tenth of a second after a rupture.
    for (since_s, ruptures, goes_on) in
        [(0.02, 1, true), (0.094, 1, true), (0.096, 1, false), (0.02, 0, false)]
    {
        let mut stylet = inside();
        (stylet.output.ruptures, stylet.time_since_rupture_s) = (ruptures, since_s);
        let found = after(stylet, 0.9);
        assert_eq!(found.output.detection.is_none(), goes_on, "{since_s} s after {ruptures}");
        assert_eq!(found.predictor.level_n(), 0.9);
    }
    // A small fall is an ordinary innovation.
    let mut stylet = inside();
    (stylet.misfit_weight, stylet.min_drop_n) = (0.5, 0.7);
    let found = after(stylet, 0.9);
    assert!(found.output.detection.is_none() && found.candidate.is_some());
    assert_eq!(found.operations, 158 + 136);
}

#[test]
fn the_layer_estimator_waits_while_a_drop_continues() {
    for (rate, waits) in [(-9e9, true), (0.0, false)] {
        let mut stylet = inside();
        (stylet.estimator.passed_count, stylet.time_since_rupture_s) = (1, 0.02);
        let mut fallen = stylet.estimator;
        fallen.state.x[1] = 71.0;
        (stylet.post_rupture, stylet.predictor.state.x[1]) = (Some(fallen), rate);
        // A force as predicted.
        let found = after(stylet, 1.5 + 0.005 * rate);
        assert_eq!(found.drop_continues, waits);
        assert_eq!(found.estimator.state.x[1] == 71.0, waits);
    }
    // Without a rupture no drop continues.
    assert!(!after(inside(), 1.4).drop_continues);
}

#[test]
fn a_free_tip_is_tested_after_the_end_of_a_drop() {
    // Bend test and evaluation of the odds.
    for (drop_goes_on, looked) in [(false, 42 + 60), (true, 0)] {
        let mut stylet = inside();
        (stylet.estimator.passed_count, stylet.samples_since_rupture, stylet.time_since_rupture_s) =
            (1, 103, 0.02);
        stylet.estimator.layer_confirmed = false;
        stylet.post_rupture = drop_goes_on.then_some(stylet.estimator);
        stylet.estimator.state = Gaussian::new([100.0, 60.0, 9000.0, 25.0, 8e3, 0.5, 0.0, 0.0], [1.0; 8]);
        assert_eq!(after(stylet, 1.48).operations, 158 + 136 + looked);
    }
}

/// With a smoothed log.
fn late(mut stylet: KalmanEnhancer) -> KalmanEnhancer {
    stylet.velocity_estimator = VelocityEstimator::known_late();
    stylet
}

#[test]
fn with_a_smoothed_log_the_decision_on_an_outlier_is_deferred() {
    // Seven standard deviations of the noise off the prediction, twice.
    for force_n in [1.36, 0.9, 1.74] {
        let stylet = late(by_predictor());
        let found = after(stylet, force_n);
        assert!(found.deferred && found.output.detection.is_none(), "{force_n} N");
        assert_eq!(
            (found.noise.sample_count, found.roughness),
            (stylet.noise.sample_count, stylet.roughness)
        );
        assert_eq!(found.predictor.level_n(), 1.5);
        assert_same(&found.estimator.state, &stylet.estimator.state);
        let again = after(found, force_n);
        assert!(!again.deferred && again.predictor.level_n() != 1.5);
        assert_eq!(again.output.detection.is_some(), force_n == 0.9);
        // The velocity has jumped.
        let mut sudden = found;
        sudden.update_in_tissue(
            &EnhanceConfig::default(),
            &MotionStep { sudden: true, ..step() },
            &sample(0.0101, force_n),
        );
        assert!(sudden.output.detection.is_none() && sudden.candidate.is_none() && !sudden.deferred);
    }
    // Small deviations and accurate logs are not deferred.
    assert!(!after(late(inside()), 1.4).deferred);
    assert!(after(inside(), 0.9).output.detection.is_some());
}

#[test]
fn a_deferred_rupture_is_located_where_it_first_appeared() {
    let (once, twice) = (after(inside(), 0.9), after(after(late(inside()), 0.9), 0.9));
    let [once, twice] = [once, twice].map(|s| s.output.detection.expect("a rupture"));
    near(twice.located_m, once.located_m);
}

#[test]
fn a_sudden_change_of_speed_is_no_fall_and_keeps_the_slopes() {
    let mut stylet = inside();
    stylet.cusum.update(-3.0);
    stylet.cusum_was_zero = false;
    stylet.track_candidate(&step(), &sample(0.01, 1.3), false);
    let (was, count) = (stylet.estimator.state, stylet.noise.sample_count);
    let texture = stylet.roughness;
    stylet.update_in_tissue(
        &EnhanceConfig::default(),
        &MotionStep { sudden: true, ..step() },
        &sample(0.01, 0.4),
    );
    assert_eq!((stylet.predictor.level_n(), stylet.deepest_m, stylet.operations), (0.4, 0.01, 158));
    assert_eq!((stylet.noise.sample_count, stylet.roughness), (count, texture));
    assert_same(&stylet.estimator.state, &was);
    assert!(stylet.cusum.relative_level() == 0.0 && stylet.cusum_was_zero && stylet.candidate.is_none());
    assert!(stylet.output.detection.is_none());
}

#[test]
fn reports_come_after_twice_as_many_samples_each() {
    for (since, reported, next) in [(14, false, 16), (15, true, 32), (16, true, 32)] {
        let mut stylet = inside();
        (stylet.estimator.passed_count, stylet.estimator.previous_thickness_m, stylet.output.ruptures) =
            (1, 0.02, 1);
        stylet.estimator.state = Gaussian::new([100.0, 60.0, 9000.0, 25.0, 8e3, 0.07, 0.0, 0.0], [1.0; 8]);
        (stylet.samples_since_rupture, stylet.next_report_at) = (since, 16);
        let found = after(stylet, 1.48);
        assert_eq!((found.output.estimate.is_some(), found.next_report_at), (reported, next));
    }
}

#[test]
fn only_filters_that_are_not_finite_restart() {
    let mut config = EnhanceConfig::default();
    config.contact_search.min_noise_n = 5e-3;
    let restarted = |spoil: fn(&mut KalmanEnhancer)| {
        let mut stylet = inside();
        stylet.post_rupture = Some(stylet.estimator);
        spoil(&mut stylet);
        stylet.restart_if_invalid(&config, &step(), &sample(0.01, 0.4));
        stylet
    };
    let sound = restarted(|_| ());
    assert_eq!((sound.operations, sound.noise.variance), (0, 4e-4));
    assert!(sound.post_rupture.is_some());
    assert_same(&sound.predictor.state, &inside().predictor.state);
    assert_same(&sound.estimator.state, &inside().estimator.state);
    for (variance, kept) in
        [(f64::NAN, 2.5e-5), (f64::INFINITY, 2.5e-5), (1e12, 2.5e-5), (9e11, 9e11), (1e-13, 1e-13)]
    {
        let mut stylet = inside();
        stylet.noise.variance = variance;
        stylet.restart_if_invalid(&config, &step(), &sample(0.01, 0.4));
        near(stylet.noise.variance, kept);
    }
    // Predictor: level at the force, slopes on the scale of the force less the bias.
    let found = restarted(|s| s.predictor.state.x[2] = f64::NAN);
    assert_eq!((found.predictor.level_n(), found.operations), (0.4, 2 * 216 + 2 * 126 + 2 * 84));
    near((found.predictor.state.p[2][2] * 4e-4).sqrt(), 0.33 / 1e-3);
    near((found.predictor.state.p[3][3] * 4e-4).sqrt(), 0.33 / 0.002);
    // Layer estimator: a contact at this position.
    let found = restarted(|s| s.estimator.state.x[2] = f64::NAN);
    assert_eq!(
        (found.estimator.start_m, found.estimator.passed_count, found.operations),
        (0.01, 0, 2 * 216 + 2 * 126 + 2 * 84)
    );
    assert!(found.post_rupture.is_none() && found.estimator.state.is_positive_definite());
    assert_same(&found.snapshot.state, &found.estimator.state);
}

#[test]
fn the_noise_is_not_learned_from_an_event() {
    let steady = inside();
    let mut falling = inside();
    falling.post_rupture = Some(falling.estimator);
    assert!(after(steady, 1.44).noise.variance != steady.noise.variance);
    assert_eq!(after(falling, 1.44).noise.variance, falling.noise.variance);
}
