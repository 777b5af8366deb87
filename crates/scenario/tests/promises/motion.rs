//! The velocity of a motion is the derivative of its position, and the acceleration that of its velocity, at every time and across the segments of a
//! program.
#![allow(clippy::unwrap_used, clippy::panic)]

use core::f64::consts::TAU;
use proptest::prelude::*;
use stylet_scenario::{Motion, MotionPlan, PHASE_FROM_REST_RAD, Scenario, Segment};

fn segment() -> impl Strategy<Value = Segment> {
    prop_oneof![
        (-0.02..0.02, 0.1..10.0)
            .prop_map(|(velocity_mps, duration_s)| Segment::Move { velocity_mps, duration_s }),
        (0.1..10.0).prop_map(|duration_s| Segment::Hold { duration_s }),
        (-0.02..0.02, -0.02..0.02, 0.05..5.0, 0.1..10.0).prop_map(
            |(velocity_mps, amplitude_mps, frequency_hz, duration_s)| Segment::Ripple {
                velocity_mps,
                amplitude_mps,
                frequency_hz,
                duration_s
            }
        ),
    ]
}

fn program() -> impl Strategy<Value = (Motion, Vec<Segment>)> {
    (-0.02..0.02, prop::collection::vec(segment(), 1..8))
        .prop_map(|(start_m, segments)| (Motion::Program { start_m, segments: segments.clone() }, segments))
}

fn single() -> impl Strategy<Value = Motion> {
    prop_oneof![
        (-0.02..0.02, -0.02..0.02, 0.1..60.0).prop_map(|(start_m, velocity_mps, duration_s)| {
            Motion::Constant { start_m, velocity_mps, duration_s }
        }),
        (-0.02..0.02, 0.001..0.2, 0.005..0.5, -7.0..7.0, 0.1..60.0).prop_map(
            |(start_m, amplitude_m, frequency_hz, phase_rad, duration_s)| Motion::Sinusoidal {
                start_m,
                amplitude_m,
                frequency_hz,
                phase_rad,
                duration_s
            }
        ),
    ]
}

/// Central differences at `t` against velocity and acceleration; the motions above stay below
/// `omega = 32 rad/s`, `v = 0.7 m/s`.
fn derivatives_agree(plan: &MotionPlan, t: f64) -> Result<(), TestCaseError> {
    let h = 1e-5;
    let (before, at, after) = (plan.at(t - h), plan.at(t), plan.at(t + h));
    let velocity = (after.position_m - before.position_m) / (2.0 * h);
    let acceleration = (after.velocity_mps - before.velocity_mps) / (2.0 * h);
    // h² omega² / 6 of the value, and the rounding of positions up to 12 m divided by 2 h.
    let v_off = (velocity - at.velocity_mps).abs();
    let a_off = (acceleration - at.acceleration_mps2).abs();
    prop_assert!(v_off < 2e-9, "v {} against {velocity} at {t} s", at.velocity_mps);
    prop_assert!(a_off < 2e-8, "a {} against {acceleration} at {t} s", at.acceleration_mps2);
    Ok(())
}

/// Start of each segment and end of the last, in s.
fn borders(segments: &[Segment]) -> Vec<f64> {
    segments.iter().fold(vec![0.0], |mut all, s| {
        all.push(all[all.len() - 1] + s.duration_s());
        all
    })
}

proptest! {
    #[test]
    fn velocity_and_acceleration_are_derivatives(motion in single(), share in 0.0..1.0f64) {
        let plan = motion.plan().unwrap();
        derivatives_agree(&plan, share * plan.duration_s())?;
    }

    #[test]
    fn velocity_and_acceleration_are_derivatives_within_every_segment(
        (motion, segments) in program(),
        share in 0.001..0.999f64,
    ) {
        let plan = motion.plan().unwrap();
        for pair in borders(&segments).windows(2) {
            derivatives_agree(&plan, pair[0] + share * (pair[1] - pair[0]))?;
        }
    }

    #[test]
    fn the_position_does_not_jump_between_segments((motion, segments) in program()) {
        let plan = motion.plan().unwrap();
        for border in borders(&segments) {
            let h = 1e-9;
            let jump = plan.at(border + h).position_m - plan.at(border - h).position_m;
            prop_assert!(jump.abs() < 0.04 * 2.0 * h + 1e-15, "{jump} m at {border} s");
        }
    }

    #[test]
    fn a_program_lasts_as_long_as_its_segments_and_ends_where_their_travel_adds_up(
        (motion, segments) in program(),
    ) {
        let plan = motion.plan().unwrap();
        let total: f64 = segments.iter().map(Segment::duration_s).sum();
        prop_assert!((plan.duration_s() - total).abs() < 1e-12);
        // The travel is the integral of the velocity: Simpson over each segment.
        let mut travel = 0.0;
        for (segment, start) in segments.iter().zip(borders(&segments)) {
            let n = 4000;
            let h = segment.duration_s() / f64::from(n);
            // A nudge off the borders, where the velocity may jump.
            let v = |k: i32| plan.at(start + (f64::from(k) * h).clamp(1e-12, segment.duration_s() - 1e-12)).velocity_mps;
            let sum: f64 = (0..n).step_by(2).map(|k| v(k) + 4.0 * v(k + 1) + v(k + 2)).sum();
            travel += sum * h / 3.0;
        }
        let moved = plan.at(total).position_m - plan.at(0.0).position_m;
        prop_assert!((moved - travel).abs() < 1e-8, "{moved} m against {travel} m");
    }

    #[test]
    fn every_motion_begins_at_its_start(motion in prop_oneof![single(), program().prop_map(|(m, _)| m)]) {
        let (Motion::Constant { start_m, .. } | Motion::Sinusoidal { start_m, .. } | Motion::Program { start_m, .. }) = &motion
        else { unreachable!() };
        prop_assert!((motion.plan().unwrap().at(0.0).position_m - start_m).abs() < 1e-15);
    }

    #[test]
    fn the_deepest_position_is_reached_and_never_passed(
        motion in prop_oneof![single(), program().prop_map(|(m, _)| m)],
    ) {
        let plan = motion.plan().unwrap();
        let n = 20_000;
        let sampled = (0..=n)
            .map(|k| plan.at(plan.duration_s() * f64::from(k) / f64::from(n)).position_m)
            .fold(f64::NEG_INFINITY, f64::max);
        // Between two samples, at 0.7 m/s at most.
        let between = 0.7 * plan.duration_s() / f64::from(n);
        let deepest = plan.deepest_m();
        prop_assert!(deepest >= sampled - 1e-12 && deepest <= sampled + between, "{deepest} against {sampled}");
    }
}

#[test]
fn the_default_sinusoid_starts_from_rest_and_moves_twice_its_amplitude() {
    let text = r#"Scenario(
        name: "sinusoid",
        tissue: (layers: [(thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0)]),
        motion: Sinusoidal(start_m: -0.005, amplitude_m: 0.12, frequency_hz: 0.0167, duration_s: 15.0),
    )"#;
    let scenario = Scenario::parse("sinusoid.ron", text).unwrap();
    let Motion::Sinusoidal { phase_rad, .. } = scenario.motion else { panic!("not a sinusoid") };
    assert_eq!(phase_rad, PHASE_FROM_REST_RAD);
    let plan = scenario.motion.plan().unwrap();
    let first = plan.at(0.0);
    assert_eq!(first.position_m, -0.005);
    assert!(first.velocity_mps.abs() < 1e-17, "at rest: {}", first.velocity_mps);
    let omega = TAU * 0.0167;
    assert!((first.acceleration_mps2 - 0.12 * omega * omega).abs() < 1e-15, "and accelerating forwards");
    // A quarter period, 14.97 s: one amplitude further, at the largest speed, 12.6 mm/s.
    let quarter = plan.at(0.25 / 0.0167);
    assert!((quarter.position_m - 0.115).abs() < 1e-12);
    assert!((quarter.velocity_mps - 0.012_591).abs() < 1e-6);
    assert!(quarter.acceleration_mps2.abs() < 1e-12);
    // Half a period: at rest again, two amplitudes further.
    let half = plan.at(0.5 / 0.0167);
    assert!((half.position_m - 0.235).abs() < 1e-12 && half.velocity_mps.abs() < 1e-12);
}

#[test]
fn a_phase_of_zero_starts_at_the_largest_speed_from_the_start_position() {
    let motion = Motion::Sinusoidal {
        start_m: -0.005,
        amplitude_m: 0.12,
        frequency_hz: 0.0167,
        phase_rad: 0.0,
        duration_s: 15.0,
    };
    let first = motion.plan().unwrap().at(0.0);
    assert_eq!(first.position_m, -0.005);
    assert!((first.velocity_mps - 0.012_591).abs() < 1e-6 && first.acceleration_mps2 == 0.0);
}

#[test]
fn a_recorded_motion_has_no_plan_of_its_own() {
    assert_eq!(Motion::Recorded.plan(), None);
}

#[test]
fn holding_and_retracting_is_holding_and_retracting() {
    let motion = Motion::Program {
        start_m: -0.005,
        segments: vec![
            Segment::Move { velocity_mps: 0.0023, duration_s: 10.0 },
            Segment::Hold { duration_s: 5.0 },
            Segment::Move { velocity_mps: -0.0046, duration_s: 5.0 },
        ],
    };
    let plan = motion.plan().unwrap();
    assert_eq!(plan.duration_s(), 20.0);
    assert_eq!(plan.at(12.0), plan.at(14.0));
    assert_eq!(plan.at(12.0).velocity_mps, 0.0);
    assert!((plan.at(10.0).position_m - 0.018).abs() < 1e-15);
    assert!((plan.at(20.0).position_m + 0.005).abs() < 1e-15);
    assert!((plan.deepest_m() - 0.018).abs() < 1e-15);
}
