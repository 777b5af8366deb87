//! An unreachable line, friction of the wrong sign, and a virtual sensor without joints are refused before a simulation, with field and remedy.

use stylet_scenario::Scenario;

/// The message for a scenario with the given robot and sensor.
fn refused(robot: &str, sensor: &str) -> String {
    let text = format!(
        r#"Scenario(
    name: "one gel",
    tissue: (layers: [(thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0)]),
    motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0),
    robot: {robot},
    sensor: {sensor},
)"#
    );
    Scenario::parse("gel.ron", &text).expect_err("must be refused").to_string()
}

fn assert_message(robot: &str, sensor: &str, parts: &[&str]) {
    let message = refused(robot, sensor);
    println!("{message}");
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

const VIRTUAL: &str = "Virtual(gain_per_s: 5.0)";

#[test]
fn the_plain_arm_and_the_papers_virtual_sensor_are_accepted() {
    for sensor in [VIRTUAL, "Virtual()", "Both()", "Both(virtual_sensor: (gain_per_s: [5,5,5,5,8,8,8]))"] {
        let text = format!(
            r#"Scenario(name: "gel", tissue: (layers: [(thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0)]),
            motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0),
            robot: Arm(joint_friction: MeasuredDirectional), sensor: {sensor})"#
        );
        let scenario = Scenario::parse("gel.ron", &text).expect(sensor);
        let written = scenario.to_ron().expect("writable");
        assert_eq!(Scenario::parse("again.ron", &written).expect("reads its own output"), scenario);
    }
}

#[test]
fn joint_angles_outside_their_limits_are_named() {
    let robot = "Arm(start_rad: (0.0, -0.785, 0.0, 0.5, 0.0, 1.57, 0.785))";
    assert_message(robot, VIRTUAL, &["gel.ron:5", "robot.start_rad[3]", "joint 4", "0.5", "-0.0698"]);
    assert_message(
        "Arm(start_rad: (inf, 0.0, 0.0, -1.0, 0.0, 1.57, 0.785))",
        VIRTUAL,
        &["robot.start_rad[0]", "finite"],
    );
}

#[test]
fn a_line_out_of_reach_is_named_with_the_place_where_it_fails() {
    assert_message("Arm(tip_m: (1.2, 0.0, 0.4))", VIRTUAL, &["robot.tip_m", "cannot carry the needle", "mm"]);
    assert_message("Arm(direction: (0.0, 0.0, 0.0))", VIRTUAL, &["robot.direction", "not a direction"]);
    // Reachable at the start, not at the end.
    assert_message("Arm(tip_m: (0.6, 0.0, -0.42))", VIRTUAL, &["robot.tip_m", "straight line fails"]);
}

#[test]
fn a_singular_pose_is_refused() {
    // Upper arm upright and the elbow turned by a right angle: the wrist cannot leave a plane.
    let robot = "Arm(start_rad: (0.0, 0.0, 1.5708, -1.5, 0.0, 1.5, 0.0))";
    assert_message(robot, VIRTUAL, &["robot.start_rad", "singular"]);
}

#[test]
fn friction_that_would_push_the_joint_is_refused() {
    let joint = "(coulomb_nm: 0.3)";
    let wrong = format!(
        "Arm(joint_friction: PerJoint(joints: ({joint}, {joint}, (coulomb_nm: -0.3), {joint}, {joint}, {joint}, {joint})))"
    );
    assert_message(&wrong, VIRTUAL, &["robot.joint_friction.joints[2].coulomb_nm", "-0.3", "opposes"]);
    let sigmoid = "(amplitude_nm: 0.6, steepness_s_per_rad: 100.0, shift_radps: 0.0)";
    let bad = "(amplitude_nm: -0.6, steepness_s_per_rad: 100.0, shift_radps: 0.0)";
    let wrong = format!(
        "Arm(joint_friction: Sigmoid(joints: ({bad}, {sigmoid}, {sigmoid}, {sigmoid}, {sigmoid}, {sigmoid}, {sigmoid})))"
    );
    assert_message(&wrong, VIRTUAL, &["joints[0].amplitude_nm", "opposes"]);
    assert_message(
        "Arm(joint_friction: Measured, friction_scale: -1.0)",
        VIRTUAL,
        &["robot.friction_scale", "-1"],
    );
}

#[test]
fn a_virtual_sensor_needs_an_arm() {
    assert_message("Slide", VIRTUAL, &["sensor", "joint torques", "robot: Arm()"]);
    assert_message("Replay", "Both()", &["robot: Arm()"]);
}

#[test]
fn gains_noise_windows_and_model_errors_out_of_range_are_named() {
    assert_message("Arm()", "Virtual(gain_per_s: -5.0)", &["sensor.gain_per_s", "-5"]);
    assert_message("Arm()", "Virtual(gain_per_s: [5,5,0,5,5,5,5])", &["sensor.gain_per_s[2]"]);
    assert_message(
        "Arm()",
        "Both(virtual_sensor: (torque_noise_nm: -0.1))",
        &["sensor.virtual_sensor.torque_noise_nm"],
    );
    assert_message(
        "Arm()",
        "Virtual(zero: BeforeContact(lead_s: 0.5, average_s: 0.0))",
        &["sensor.zero.average_s"],
    );
    assert_message("Arm(link_mass_error: 3.0)", VIRTUAL, &["robot.link_mass_error", "per cent"]);
    assert_message("Arm(payload_error_kg: -1.0)", VIRTUAL, &["robot.payload_error_kg"]);
    assert_message(
        "Arm(controller: (natural_frequency_radps: 900.0))",
        VIRTUAL,
        &["natural_frequency_radps", "stable"],
    );
    assert_message("Arm(payload: 0.1)", VIRTUAL, &["unknown field `payload`"]);
}
