use super::super::test_support::{inside, near, sample, step};
use super::super::velocity_estimator::VelocityEstimator;
use super::*;

/// Six standard deviations of the noise of [`inside`], in N.
const MARGIN_N: f64 = 0.12;
/// An encoder step in m.
const ENCODER_M: f64 = 1e-5;

/// A velocity estimator that has found the encoder's step.
fn rounded() -> VelocityEstimator {
    let mut estimator = VelocityEstimator::default();
    let mut last = Sample::default();
    for k in 1..40 {
        // Two or three steps per sample.
        let position_m = ENCODER_M * (2.5 * f64::from(k)).floor();
        let next = Sample { time_s: 0.005 * f64::from(k), position_m, velocity_mps: 0.005, force_n: 0.0 };
        estimator.update(&last, &next, 0.005, 0.01);
        last = next;
    }
    estimator
}

/// Friction in N that a stop at 10 mm may take away, by the base law.
fn friction_n(stylet: &KalmanEnhancer) -> f64 {
    let (friction, sd) = stylet.snapshot.friction_and_sd(0.01, &stylet.noise);
    assert!(friction > 0.0 && sd > 0.0);
    0.002 * (friction + 2.0 * sd)
}

fn uncertain() -> KalmanEnhancer {
    let mut stylet = inside();
    stylet.snapshot.state.p[2][2] = 1e4 / 4e-4;
    stylet
}

#[test]
fn a_drop_by_no_more_than_the_friction_may_be_a_stop() {
    // The whole force of 1.43 N where the base law has not proved itself.
    type Case = (fn(&mut KalmanEnhancer), f64);
    let cases: [Case; 3] = [
        (|_| (), friction_n(&uncertain())),
        (|s| s.misfit_weight = 0.1, 1.43),
        (|s| s.base_law_failed = true, 1.43),
    ];
    for (change, friction_n) in cases {
        for (off_n, may_be) in [(-1e-3, true), (1e-3, false)] {
            let mut stylet = uncertain();
            change(&mut stylet);
            stylet.last_drop_n = (friction_n + MARGIN_N + off_n, 0.02);
            assert_eq!(
                stylet.may_be_a_stop(&sample(0.01, 1.0), None),
                may_be,
                "{friction_n} N and {off_n} N"
            );
        }
    }
    let mut pulled = uncertain();
    pulled.misfit_weight = 1.0;
    pulled.predictor.shift_level(-3.0);
    pulled.last_drop_n = (MARGIN_N + 1e-3, 0.02);
    assert!(!pulled.may_be_a_stop(&sample(0.01, 1.0), None), "a pull has no friction to lose");
}

#[test]
fn positions_decide_whether_the_needle_has_stopped() {
    let mut stylet = uncertain();
    stylet.last_drop_n = (0.01, 0.02);
    let may_be = |stylet: &KalmanEnhancer, from_m| stylet.may_be_a_stop(&sample(0.01, 1.0), Some(from_m));
    // Exact positions show any motion, rounded ones after two steps.
    assert!(may_be(&stylet, 0.01) && !may_be(&stylet, 0.01 - 1e-9));
    stylet.velocity_estimator = rounded();
    near(stylet.velocity_estimator.encoder_step_m(), ENCODER_M);
    assert!(may_be(&stylet, 0.01 - 1.9 * ENCODER_M) && !may_be(&stylet, 0.01 - 2.1 * ENCODER_M));
    // A stop that has been seen takes no more friction away: 4 um at 2 mm/s, 22 um at 2 mm/s.
    for (duration_s, seen) in [(0.002, false), (0.009, false), (0.011, true)] {
        stylet.stop = Some(Stop { duration_s, lowest_n: 1.0 });
        assert_eq!(may_be(&stylet, 0.01), !seen, "{duration_s} s");
    }
}

#[test]
fn a_stop_lasts_until_the_needle_advances() {
    let mut stylet = uncertain();
    let friction_n = friction_n(&stylet);
    stylet.deepest_m = 0.01;
    stylet.update_stop(&step(), &sample(0.01, 1.0));
    let stop = stylet.stop.expect("a stop");
    near(stop.duration_s, 0.005);
    near(stop.lowest_n, 1.5 - friction_n);
    // The level at the stop counts.
    stylet.predictor.shift_level(-0.7);
    stylet.update_stop(&step(), &sample(0.0099, 0.8));
    let stop = stylet.stop.expect("a stop");
    near(stop.duration_s, 0.01);
    near(stop.lowest_n, 1.5 - friction_n);
    stylet.update_stop(&step(), &sample(0.0101, 0.8));
    assert!(stylet.stop.is_none());
}

#[test]
fn a_late_force_loses_friction_within_a_twentieth_of_a_second() {
    for (duration_s, force_n, late) in [
        (0.049, 1.0, true),
        (0.051, 1.0, false),
        (0.03, 1.0 - 0.9 * MARGIN_N, true),
        (0.03, 1.0 - 1.1 * MARGIN_N, false),
    ] {
        let mut stylet = inside();
        assert!(!stylet.is_late_friction(&sample(0.01, force_n)), "the needle moves");
        stylet.stop = Some(Stop { duration_s, lowest_n: 1.0 });
        assert_eq!(stylet.is_late_friction(&sample(0.01, force_n)), late, "{duration_s} s, {force_n} N");
    }
    // Shorter than a rounded position stays the same.
    let mut stylet = inside();
    stylet.velocity_estimator = rounded();
    stylet.stop = Some(Stop { duration_s: 0.009, lowest_n: 1.0 });
    assert!(!stylet.is_late_friction(&sample(0.01, 1.0)));
}
