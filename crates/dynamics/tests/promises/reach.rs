//! Infeasible poses and lines are detected before a simulation, with location and reason.

#![allow(clippy::panic)] // how a test fails

use crate::common;
use nalgebra::Vector3;
use stylet_dynamics::{
    Arm, Error, IkConfig, JointQuantity, JointVector, Pose,
    feasibility::{self, LineConfig},
    panda,
};

fn arm() -> Arm<7> {
    Arm::new(&panda::with_needle()).expect("valid")
}

#[test]
fn inverse_kinematics_reaches_every_pose_that_forward_kinematics_gives() {
    let arm = arm();
    let config = IkConfig::default();
    let mut failed = 0;
    for s in common::states() {
        let target = arm.at(&s.q).tip();
        match arm.inverse_kinematics(&target, &panda::READY_RAD, &config) {
            Ok(q) => {
                let tip = arm.at(&q).tip();
                assert!((tip.position_m - target.position_m).norm() <= config.position_tolerance_m);
                assert!(tip.rotation_vector_to(&target).norm() <= config.orientation_tolerance_rad);
                feasibility::check_joint_positions(&arm, &q).expect("within limits");
            }
            Err(_) => failed += 1,
        }
    }
    println!("inverse kinematics failed at {failed} of 1000 random reachable poses");
    assert!(failed <= 5, "{failed}");
}

#[test]
fn a_start_near_the_solution_is_kept_near() {
    let arm = arm();
    let mut target = arm.at(&panda::READY_RAD).tip();
    target.position_m.z -= 0.002;
    let q =
        arm.inverse_kinematics(&target, &panda::READY_RAD, &IkConfig { restarts: 0, ..Default::default() });
    assert!((q.expect("reachable") - panda::READY_RAD).amax() < 0.02);
}

#[test]
fn a_pose_two_metres_away_is_out_of_reach() {
    let arm = arm();
    let target = Pose { position_m: Vector3::new(2.0, 0.0, 0.5), ..arm.at(&panda::READY_RAD).tip() };
    let error =
        arm.inverse_kinematics(&target, &panda::READY_RAD, &IkConfig::default()).expect_err("too far");
    let Error::Unreachable { position_error_m, .. } = error else { panic!("{error}") };
    assert!((0.5..1.6).contains(&position_error_m), "{error}");
}

#[test]
fn an_insertion_of_120_mm_straight_down_is_possible_from_the_ready_pose() {
    let arm = arm();
    let from = arm.at(&panda::READY_RAD).tip();
    let to = from.position_m + from.rotation.column(2) * 0.12;
    let config = LineConfig { speed_mps: 0.0126, ..Default::default() };
    let line = feasibility::follow_line(&arm, &from, &to, &panda::READY_RAD, &config).expect("possible");
    assert_eq!(line.start_rad, panda::READY_RAD);
    assert!((arm.at(&line.end_rad).tip().position_m - to).norm() < 1e-9);
    assert!(line.min_singular_value > 0.05 && line.min_margin_rad > 0.1, "{line:?}");
}

#[test]
fn a_line_out_of_the_workspace_fails_where_the_arm_is_stretched() {
    let arm = arm();
    let from = arm.at(&panda::READY_RAD).tip();
    let to = from.position_m + Vector3::new(0.8, 0.0, 0.0);
    let error = feasibility::follow_line(&arm, &from, &to, &panda::READY_RAD, &LineConfig::default())
        .expect_err("too long");
    println!("{error}");
    let Error::Line { distance_m, length_m, reason } = &error else { panic!("{error}") };
    assert!((length_m - 0.8).abs() < 1e-12 && (0.1..0.7).contains(distance_m), "{error}");
    assert!(matches!(**reason, Error::Singular { .. } | Error::Unreachable { .. }), "{error}");
    // Just before that point the same line is possible.
    let to = from.position_m + Vector3::new(distance_m - 0.003, 0.0, 0.0);
    feasibility::follow_line(&arm, &from, &to, &panda::READY_RAD, &LineConfig::default())
        .expect("short enough");
}

#[test]
fn a_line_too_fast_for_a_joint_names_the_joint() {
    let arm = arm();
    let from = arm.at(&panda::READY_RAD).tip();
    let to = from.position_m - Vector3::z() * 0.1;
    let config = LineConfig { speed_mps: 5.0, ..Default::default() };
    let error = feasibility::follow_line(&arm, &from, &to, &panda::READY_RAD, &config).expect_err("too fast");
    let Error::Line { reason, .. } = &error else { panic!("{error}") };
    assert!(matches!(**reason, Error::JointLimit { quantity: JointQuantity::Velocity, .. }), "{error}");
}

#[test]
fn a_stretched_arm_is_singular_and_the_ready_pose_is_not() {
    let arm = arm();
    let q = JointVector::<7>::zeros();
    let error = feasibility::check_not_singular(&arm.at(&q), 0.02).expect_err("stretched");
    println!("{error}");
    assert!(matches!(error, Error::Singular { .. }));
    assert!(feasibility::check_not_singular(&arm.at(&panda::READY_RAD), 0.02).expect("ready") > 0.1);
}

#[test]
fn joints_outside_their_limits_are_named() {
    let arm = arm();
    let mut q = panda::READY_RAD;
    q[3] = 0.0;
    let error = feasibility::check_joint_positions(&arm, &q).expect_err("elbow");
    assert_eq!(error.to_string(), "position of joint 4 is 0.0000 rad: must be from -3.0718 to -0.0698 rad");
    q[3] = f64::NAN;
    assert!(matches!(
        feasibility::check_joint_positions(&arm, &q),
        Err(Error::Parameter { joint: Some(4), .. })
    ));
    let fast = JointVector::<7>::repeat(2.3);
    assert!(matches!(
        feasibility::check_joint_velocities(&arm, &fast),
        Err(Error::JointLimit { joint: 1, quantity: JointQuantity::Velocity, .. })
    ));
    let strong = JointVector::<7>::repeat(-20.0);
    assert!(matches!(
        feasibility::check_joint_torques(&arm, &strong),
        Err(Error::JointLimit { joint: 5, quantity: JointQuantity::Torque, .. })
    ));
}

#[test]
fn an_arm_with_impossible_numbers_is_refused() {
    let mut model = panda::with_needle();
    model.links[2].body.mass_kg = f64::NAN;
    assert!(matches!(Arm::new(&model), Err(Error::Parameter { name: "mass_kg", joint: Some(3), .. })));
    model = panda::with_needle();
    model.links[5].limits.lower_rad = 4.0;
    assert!(matches!(Arm::new(&model), Err(Error::Parameter { name: "lower_rad", joint: Some(6), .. })));
    model = panda::with_needle();
    model.tool.payload.mass_kg = -0.1;
    assert!(Arm::new(&model).is_err());
}
