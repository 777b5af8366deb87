use super::super::layer_estimator::{B, D, K};
use super::super::state::DropCandidate;
use super::super::test_support::{inside, near, sample};
use super::*;
use crate::sample::LayerEstimate;

/// Variance of the noise of [`inside`] in N².
const NOISE_N2: f64 = 4e-4;

/// About to declare a rupture by 0.3 N at 10 mm.
fn about_to_rupture() -> KalmanEnhancer {
    let mut stylet = inside();
    stylet.candidate =
        Some(DropCandidate { from_n: 1.5, mean_n: 1.2, missing_n: 0.3, duration_s: 0.005, count: 1.0 });
    stylet.last_drop_n = (0.3, 0.02);
    (stylet.output.contact_m, stylet.output.contact_sd_m) = (Some(0.001), 1e-5);
    stylet
}

/// A quarter of a second after that rupture, with these log odds of a step.
fn doubted(nats: f64) -> (KalmanEnhancer, ZeroStepTest) {
    let mut stylet = about_to_rupture();
    let mut zero_step_test = stylet.start_zero_step_test(&sample(0.01, 1.2)).expect("a rival");
    zero_step_test.nats = nats;
    stylet.zero_step_test = Some(zero_step_test);
    stylet.time_since_rupture_s = 0.25;
    stylet.output.ruptures = 1;
    (stylet, zero_step_test)
}

/// A stiffness or friction two standard deviations below zero: 2 nats.
fn make_negative(estimator: &mut LayerEstimator, index: usize) {
    (estimator.state.x[index], estimator.state.p[index][index]) = (-6.0, 9.0 / NOISE_N2);
}

#[test]
fn a_rupture_is_not_withdrawn_while_its_drop_may_continue() {
    for (share, withdrawn) in [(0.9, false), (1.1, true)] {
        let (mut stylet, _) = doubted(100.0);
        stylet.time_since_rupture_s = share * MAX_DROP_DURATION_S;
        assert_eq!(stylet.decide_zero_step(&sample(0.0101, 1.2)), withdrawn);
        assert_eq!(stylet.zero_step_test.is_none(), withdrawn);
    }
}

#[test]
fn a_step_is_accepted_or_rejected_at_five_nats() {
    for (nats, withdrawn, kept) in [
        (4.9, false, true),
        (5.1, true, false),
        (0.0, false, true),
        (-4.9, false, true),
        (-5.1, false, false),
    ] {
        let (mut stylet, _) = doubted(nats);
        assert_eq!(stylet.decide_zero_step(&sample(0.0102, 1.2)), withdrawn, "{nats}");
        assert_eq!(stylet.zero_step_test.is_some(), kept, "{nats}");
    }
    // After 12 mm the rupture is final.
    for (position_m, kept) in [(0.0219, true), (0.0221, false)] {
        let (mut stylet, _) = doubted(0.0);
        assert!(!stylet.decide_zero_step(&sample(position_m, 1.2)));
        assert_eq!(stylet.zero_step_test.is_some(), kept, "{position_m} m");
    }
    let mut certain = inside();
    assert!(!certain.decide_zero_step(&sample(0.01, 1.2)));
}

#[test]
fn negative_stiffness_or_friction_lowers_the_odds_of_a_hypothesis() {
    for index in [K, B] {
        for (nats, withdrawn) in [(2.9, false), (3.1, true)] {
            let (mut stylet, mut zero_step_test) = doubted(nats);
            make_negative(&mut zero_step_test.rupture, index);
            stylet.zero_step_test = Some(zero_step_test);
            assert_eq!(stylet.decide_zero_step(&sample(0.0102, 1.2)), withdrawn, "{nats}");
        }
        for (nats, kept) in [(-2.9, true), (-3.1, false), (6.9, true)] {
            let (mut stylet, mut zero_step_test) = doubted(nats);
            make_negative(&mut zero_step_test.estimator, index);
            stylet.zero_step_test = Some(zero_step_test);
            assert!(!stylet.decide_zero_step(&sample(0.0102, 1.2)), "{nats}");
            assert_eq!(stylet.zero_step_test.is_some(), kept, "{nats}");
        }
    }
}

#[test]
fn a_drop_may_be_a_step_if_it_is_short_and_clear_and_the_law_holds() {
    let found = |change: fn(&mut KalmanEnhancer)| {
        let mut stylet = about_to_rupture();
        change(&mut stylet);
        stylet.start_zero_step_test(&sample(0.01, 1.2)).is_some()
    };
    assert!(found(|_| ()));
    assert!(!found(|s| s.candidate = None));
    assert!(found(|s| s.candidate = s.candidate.map(|c| DropCandidate { count: 3.0, ..c })));
    assert!(!found(|s| s.candidate = s.candidate.map(|c| DropCandidate { count: 4.0, ..c })));
    assert!(!found(|s| s.misfit_weight = 0.01));
    assert!(!found(|s| s.snapshot.tip_free = true));
    // Five standard deviations of the noise.
    assert!(!found(|s| s.last_drop_n.0 = 0.099));
    assert!(found(|s| s.last_drop_n.0 = 0.101));
}

#[test]
fn the_old_layer_continues_with_a_zero_as_uncertain_as_the_drop() {
    let mut stylet = about_to_rupture();
    (stylet.samples_since_rupture, stylet.next_report_at, stylet.time_since_rupture_s) = (70, 128, 0.35);
    let zero_step_test = stylet.start_zero_step_test(&sample(0.01, 1.2)).expect("a rival");
    let before = stylet.snapshot.state;
    assert_eq!(zero_step_test.estimator.state.x, before.x);
    near(zero_step_test.estimator.state.p[BIAS][BIAS], before.p[BIAS][BIAS] + 0.3 * 0.3 / NOISE_N2);
    assert_eq!(
        (zero_step_test.bias_n, zero_step_test.nats, zero_step_test.at),
        (0.07, -3.0, sample(0.01, 1.2))
    );
    assert_eq!((zero_step_test.contact, zero_step_test.counts), ((Some(0.001), 1e-5), (70, 128, 0.35)));
    // The drop of a rupture is uncertain by a tenth.
    stylet.zero_step_test = Some(zero_step_test);
    let mut after = stylet.estimator;
    after.state.x[K] = 33.0;
    stylet.set_rupture_hypothesis(&after);
    let found = stylet.zero_step_test.expect("a rival").rupture.state;
    assert_eq!(found.x, after.state.x);
    near(found.p[BIAS][BIAS], after.state.p[BIAS][BIAS] + 0.03 * 0.03 / NOISE_N2);
}

#[test]
fn the_odds_are_the_ratio_of_the_likelihoods() {
    let (mut stylet, mut zero_step_test) = doubted(1.0);
    zero_step_test.rupture.state.x[K] += 20.0;
    zero_step_test.rupture.state.p[BIAS][BIAS] = 0.3;
    (stylet.zero_step_test, stylet.operations) = (Some(zero_step_test), 5);
    let next = sample(0.0101, 1.4);
    let log_likelihood = |mut estimator: LayerEstimator| {
        let (e, s) = estimator.update(next.position_m, 0.002, next.force_n, 0.0);
        let variance = s * NOISE_N2;
        -0.5 * (variance.ln() + e * e / variance)
    };
    let expected = 1.0 + log_likelihood(zero_step_test.estimator) - log_likelihood(zero_step_test.rupture);
    stylet.update_zero_step_test(&next, 0.0);
    near(stylet.zero_step_test.expect("a rival").nats, expected);
    assert_eq!(stylet.operations, 5 + 440);
}

#[test]
fn a_withdrawn_rupture_leaves_the_state_of_before_and_another_zero() {
    let (mut stylet, mut zero_step_test) = doubted(9.0);
    (zero_step_test.estimator.state.x[BIAS], zero_step_test.estimator.state.p[BIAS][BIAS]) = (-0.23, 0.25);
    zero_step_test.counts = (70, 128, 0.35);
    stylet.zero_step_test = Some(zero_step_test);
    (stylet.post_rupture, stylet.drop_continues) = (Some(stylet.estimator), true);
    (stylet.drop_onset, stylet.output.ruptures) = (Some((0.01, 1e-9)), 3);
    (stylet.output.contact_m, stylet.output.contact_sd_m) = (Some(0.002), 2e-5);
    stylet.output.estimate = Some(LayerEstimate::default());
    let level_n = stylet.predictor.level_n();
    assert!(stylet.decide_zero_step(&sample(0.0102, 1.2)));
    // 0.07 N before, -0.23 N now.
    near(stylet.baseline.subtracted_n, -0.3);
    near(stylet.predictor.level_n(), level_n + 0.3);
    assert_eq!(stylet.estimator.state.x[BIAS], 0.07);
    assert_eq!(stylet.snapshot.state.x, stylet.estimator.state.x);
    assert_eq!(stylet.snapshot_m, 0.0099);
    assert_eq!((stylet.output.ruptures, stylet.baseline.zero_steps), (2, 1));
    assert_eq!((stylet.output.contact_m, stylet.output.contact_sd_m), (Some(0.001), 1e-5));
    let counts = (stylet.samples_since_rupture, stylet.next_report_at, stylet.time_since_rupture_s);
    assert_eq!(counts, (70, 128, 0.35));
    assert!(stylet.post_rupture.is_none() && !stylet.drop_continues && stylet.drop_onset.is_none());
    assert!(
        stylet.zero_step_test.is_none() && stylet.candidate.is_none() && stylet.output.estimate.is_none()
    );
    let step = stylet.output.zero_step.expect("a step");
    assert_eq!((step.time_s, step.position_m), (5.0, 0.01));
    assert_eq!((step.withdrawn, step.in_tissue), (Some(3), true));
    near(step.size_n, -0.3);
    near(step.sd_n, 0.01);
}

#[test]
fn the_next_rupture_decides_by_the_friction_that_it_shows() {
    // One explanation would need a friction of the old layer far below zero.
    for (nats, of_rupture, withdrawn) in [(50.0, false, false), (-50.0, true, true), (4.0, true, true)] {
        let (mut stylet, mut zero_step_test) = doubted(nats);
        let wrong = if of_rupture { &mut zero_step_test.rupture } else { &mut zero_step_test.estimator };
        (wrong.state.x[B], wrong.state.p[B][B]) = (-300.0, 100.0 / NOISE_N2);
        (stylet.zero_step_test, stylet.operations) = (Some(zero_step_test), 0);
        stylet.decide_zero_step_at_rupture(&sample(0.0102, 0.3), 0.0101);
        assert_eq!(stylet.output.zero_step.is_some(), withdrawn, "{nats}");
        assert_eq!(stylet.operations, 2 * OPERATIONS_PER_RUPTURE);
    }
}

#[test]
fn a_rupture_leaves_the_friction_of_the_shaft_as_far_as_it_is_known() {
    let lowest_n = |change: fn(&mut KalmanEnhancer)| {
        let mut stylet = inside();
        stylet.estimator.passed_count = 1;
        // 300 N s/m with a standard deviation of 20 N s/m.
        (stylet.estimator.state.x[D], stylet.estimator.state.p[D][D]) = (300.0, 400.0 / NOISE_N2);
        change(&mut stylet);
        stylet.lowest_after_rupture_n(0.0101)
    };
    near(lowest_n(|_| ()), 0.07 + (300.0 - 60.0) * 0.002);
    near(lowest_n(|s| s.friction_drive_mps = 0.001), 0.07 + (300.0 - 60.0) * 0.001);
    near(lowest_n(|s| s.misfit = 1.19), 0.55);
    let unknown: [fn(&mut KalmanEnhancer); 6] = [
        |s| s.estimator.passed_count = 0,
        |s| s.estimator.tip_free = true,
        |s| s.post_rupture = Some(s.estimator),
        |s| s.zero_step_test = doubted(0.0).0.zero_step_test,
        |s| s.misfit = 1.21,
        |s| s.estimator.state.p[D][D] = 110.0 * 110.0 / NOISE_N2,
    ];
    for change in unknown {
        near(lowest_n(change), 0.07);
    }
}

#[test]
fn a_step_shortly_after_contact_is_removed_from_the_history_in_air() {
    for settled in [false, true] {
        let mut stylet = inside();
        for k in 0..100 {
            let (time_s, position_m) = (0.005 * f64::from(k), 1e-5 * f64::from(k));
            let force_n = 0.01 * f64::from(k % 3) + if k < 96 { 0.0 } else { 2.0 };
            stylet.baseline.history.push(&Sample { time_s, position_m, velocity_mps: 0.002, force_n });
        }
        stylet.baseline.settled = settled;
        stylet.jump = Jump {
            sum_n: 8.0,
            count: 4,
            variance: 3.0 * NOISE_N2,
            start: sample(0.01, 3.5),
            ..Jump::default()
        };
        let total = |stylet: &KalmanEnhancer| stylet.baseline.history.evaluate().total.ff;
        let before = total(&stylet);
        stylet.accept_jump();
        let levelled = total(&stylet) < 0.01 * before;
        assert_eq!(levelled, !settled);
        let step = stylet.output.zero_step.expect("a step");
        near(step.size_n, 2.0);
        // Of the prediction, and of one sample.
        near(step.sd_n, (4.0 * NOISE_N2).sqrt());
        assert_eq!((step.time_s, step.position_m, step.withdrawn), (5.0, 0.01, None));
        assert_eq!((stylet.jump.count, stylet.spike_samples, stylet.baseline.zero_steps), (0, 0, 1));
        near(stylet.baseline.subtracted_n, 2.0);
    }
}
