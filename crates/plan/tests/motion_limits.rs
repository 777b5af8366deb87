//! Every proposed motion satisfies its limits, and limits that no motion can satisfy are reported.
//!
//! Speed and acceleration are computed here from positions at 20 000 times, not from the segments.

use proptest::prelude::*;
use stylet_plan::motion_programs::{
    StartConditions, infeasibility, low_discrepancy_point, motion_from_point, within_limits,
};
use stylet_plan::{Limits, PlanError, from_scenario, plan};
use stylet_scenario::{Motion, Scenario};

fn limits() -> impl Strategy<Value = Limits> {
    (0.001..0.15_f64, -3.5..-1.3_f64, -2.5..1.0_f64, 0.0..2.3_f64, 0.2..30.0_f64).prop_map(
        |(depth_m, v, a, t, force_n)| Limits {
            depth_m,
            speed_mps: 10f64.powf(v),
            acceleration_mps2: 10f64.powf(a),
            duration_s: 10f64.powf(t),
            force_n,
        },
    )
}

fn begin() -> StartConditions {
    StartConditions { start_m: -0.005, surface_m: 0.0, max_depth_m: 0.1, sample_hz: 200.0 }
}

/// Depth, speed, acceleration and duration of a motion from sampled positions, rest before and after included.
fn seen(motion: &Motion) -> (f64, f64, f64, f64) {
    let plan = motion.plan().expect("a program");
    let n = 20_000;
    let h = plan.duration_s() / f64::from(n);
    let z: Vec<f64> = (0..=n).map(|k| plan.at(f64::from(k) * h).position_m).collect();
    let depth = z.iter().fold(f64::NEG_INFINITY, |m: f64, z| m.max(*z));
    let mut v: Vec<f64> = vec![0.0];
    v.extend(z.windows(2).map(|w| (w[1] - w[0]) / h));
    v.push(0.0);
    let speed = v.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let acceleration = v.windows(2).map(|w| (w[1] - w[0]).abs() / h).fold(0.0, f64::max);
    (depth, speed, acceleration, plan.duration_s())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn every_motion_satisfies_its_limits(limits in limits(), first in 0..100_000_usize) {
        let begin = begin();
        for k in first..first + 8 {
            let Some(motion) = motion_from_point(&low_discrepancy_point(k), &limits, &begin) else { continue };
            prop_assert!(within_limits(&motion, &limits));
            let (depth, speed, acceleration, duration) = seen(&motion);
            // Differences of positions round at 1e-17 m.
            let rounding = 1e-15 / (duration / 20_000.0).powi(2);
            prop_assert!(depth <= limits.depth_m, "{depth}");
            prop_assert!(speed <= limits.speed_mps * (1.0 + 1e-9) + rounding * duration / 20_000.0, "{speed}");
            prop_assert!(acceleration <= limits.acceleration_mps2 * (1.0 + 1e-6) + rounding, "{acceleration} {motion:?}");
            prop_assert!(duration <= limits.duration_s);
            let Motion::Program { segments, .. } = &motion else { unreachable!("a program") };
            prop_assert!(segments.len() >= 2 && segments.iter().all(|s| s.duration_s() > 0.0));
        }
    }
}

#[test]
fn a_motion_that_violates_one_limit_is_rejected() {
    let wide =
        Limits { depth_m: 0.1, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 90.0, force_n: 6.0 };
    let motion = (0..50)
        .find_map(|k| motion_from_point(&low_discrepancy_point(k), &wide, &begin()))
        .expect("a motion within wide limits");
    let (depth, speed, acceleration, duration) = seen(&motion);
    assert!(within_limits(&motion, &wide));
    for narrow in [
        Limits { depth_m: 0.99 * depth, ..wide },
        Limits { speed_mps: 0.98 * speed, ..wide },
        Limits { acceleration_mps2: 0.5 * acceleration, ..wide },
        Limits { duration_s: 0.99 * duration, ..wide },
    ] {
        assert!(!within_limits(&motion, &narrow), "{narrow:?}");
    }
}

fn scenario() -> Scenario {
    Scenario::parse(
        "test",
        r#"Scenario(name: "two gels", tissue: (layers: [
            (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
            (thickness_m: 0.03, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0)]),
            motion: Constant(start_m: -0.005, velocity_mps: 0.0025, duration_s: 22.0), robot: Replay)"#,
    )
    .expect("a scenario")
}

#[test]
fn infeasible_limits_are_reported_with_a_reason() {
    let scenario = scenario();
    let (state, begin) = from_scenario(&scenario, None).expect("an information state");
    let wide =
        Limits { depth_m: 0.05, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 60.0, force_n: 20.0 };
    for (limits, word) in [
        (Limits { depth_m: -0.001, ..wide }, "depth_m"),
        (Limits { duration_s: 0.5, ..wide }, "duration_s"),
        (Limits { speed_mps: 1e-5, ..wide }, "duration_s"),
        (Limits { force_n: 0.05, ..wide }, "force_n"),
    ] {
        let Err(PlanError::Infeasible { why, remedy }) = plan(&state, &limits, &begin) else {
            unreachable!("{limits:?} cannot be kept")
        };
        assert!(why.contains(word) && !remedy.is_empty(), "{why}");
    }
    let Err(PlanError::Limit { field, .. }) = plan(&state, &Limits { speed_mps: f64::NAN, ..wide }, &begin)
    else {
        unreachable!("not a number")
    };
    assert_eq!(field, "speed_mps");
    assert!(infeasibility(&wide, &begin).is_none());
}

#[test]
fn the_expected_force_stays_below_its_limit_under_every_candidate() {
    let (state, begin) = from_scenario(&scenario(), None).expect("an information state");
    let free =
        Limits { depth_m: 0.05, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 60.0, force_n: 50.0 };
    let strong = plan(&state, &free, &begin).expect("a plan").0;
    let gentle =
        plan(&state, &Limits { force_n: 0.8 * strong.force_n, ..free }, &begin).expect("a gentler plan").0;
    let largest = state.expected_forces(&gentle.motion).expect("forces").force_n;
    let most = largest.iter().flatten().fold(0.0, |m: f64, f| m.max(f.abs()));
    assert!(most <= 0.8 * strong.force_n && gentle.force_n <= 0.8 * strong.force_n, "{most}");
    assert_ne!(strong.motion, gentle.motion);
}
