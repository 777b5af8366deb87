//! Optional syntax of scenario files: `Some`, the outer name, RON headers, one pair of brackets for effects, robots and sensors.
#![allow(clippy::unwrap_used, clippy::panic)]

use stylet_scenario::{ArmConfig, ForceTorque, Robot, Scenario, Sensor, VirtualSensor};
use stylet_tissue::{AnyEffect, CoulombFriction, PronyTerm, StressRelaxation};

fn scenario(header: &str, layer: &str, rest: &str) -> Scenario {
    let text = format!(
        "{header}(
    name: \"gel\",
    tissue: (layers: [(thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0{layer})]),
    motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0),{rest}
)"
    );
    Scenario::parse("gel.ron", &text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

#[test]
fn a_puncture_force_is_written_with_and_without_some() {
    for (layer, force) in [
        ("", None),
        (", puncture_n: 2.2", Some(2.2)),
        (", puncture_n: Some(2.2)", Some(2.2)),
        (", puncture_n: None", None),
    ] {
        assert_eq!(scenario("Scenario", layer, "").tissue.layers[0].puncture_n, force, "`{layer}`");
    }
}

#[test]
fn the_outer_name_and_rons_headers_are_optional() {
    let plain = scenario("Scenario", ", puncture_n: 2.2", "");
    for header in [
        "",
        "#![enable(implicit_some)]\n",
        "#![enable(implicit_some)]\nScenario",
        "#![enable(implicit_some, unwrap_newtypes)]\n#![enable(unwrap_variant_newtypes)]\n// a gel\nScenario",
    ] {
        assert_eq!(scenario(header, ", puncture_n: 2.2", ""), plain, "`{header}`");
    }
}

#[test]
fn effects_take_one_pair_of_brackets() {
    let effects = "\n    effects: [CoulombFriction(c_n_per_m: 6.0), StressRelaxation(terms: [(fraction: 0.3, time_constant_s: 2.7)])],";
    assert_eq!(
        scenario("Scenario", "", effects).effects,
        [
            AnyEffect::CoulombFriction(CoulombFriction { c_n_per_m: 6.0 }),
            AnyEffect::StressRelaxation(StressRelaxation {
                terms: vec![PronyTerm { fraction: 0.3, time_constant_s: 2.7 }]
            }),
        ]
    );
}

#[test]
fn every_robot_can_be_written() {
    for (text, robot) in [
        ("", Robot::Slide),
        ("\n    robot: Slide,", Robot::Slide),
        ("\n    robot: Replay,", Robot::Replay),
        ("\n    robot: Arm(),", Robot::Arm(ArmConfig::default())),
    ] {
        assert_eq!(scenario("Scenario", "", text).robot, robot, "`{text}`");
    }
}

#[test]
fn every_sensor_can_be_written_and_what_is_left_out_is_a_default() {
    let force_torque = ForceTorque { noise_n: 0.01, ..ForceTorque::default() };
    for (text, sensor) in [
        ("", Sensor::ForceTorque(ForceTorque::default())),
        ("\n    sensor: ForceTorque(),", Sensor::ForceTorque(ForceTorque::default())),
        ("\n    sensor: ForceTorque(noise_n: 0.01),", Sensor::ForceTorque(force_torque.clone())),
        (
            "\n    sensor: ForceTorque(noise_n: 0.01, range_n: 50),",
            Sensor::ForceTorque(ForceTorque { range_n: Some(50.0), ..force_torque.clone() }),
        ),
        ("\n    robot: Arm(),\n    sensor: Virtual(),", Sensor::Virtual(VirtualSensor::default())),
        (
            "\n    robot: Arm(),\n    sensor: Both(force_torque: (noise_n: 0.01)),",
            Sensor::Both { force_torque, virtual_sensor: VirtualSensor::default() },
        ),
    ] {
        assert_eq!(scenario("Scenario", "", text).sensor, sensor, "`{text}`");
    }
}
