//! Measuring an insertion with other noise gives the same bits as simulating it with that seed, for all effects of tool and sensor.

use stylet_scenario::{ForceTorque, Robot, Scenario, Sensor};
use stylet_testbed::simulate;
use stylet_tissue::{AnyEffect, DriveFriction, ForceGain, PositionScale, ToolInertia};

fn scenario(robot: Robot, effects: Vec<AnyEffect>) -> Scenario {
    let text = r#"Scenario(name: "moved and measured", tissue: (layers: [
        (thickness_m: 0.0282, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0),
        (thickness_m: 0.0377, stiffness_n_per_m: 60.0, friction_ns_per_m2: 12000.0, puncture_n: Some(2.2)),
    ]), motion: Sinusoidal(start_m: -0.005, amplitude_m: 0.06, frequency_hz: 0.2, phase_rad: 0.0, duration_s: 1.5))"#;
    let mut scenario = Scenario::parse("moved.ron", text).expect("a valid scenario");
    scenario.robot = robot;
    scenario.effects = effects;
    scenario.sensor = Sensor::ForceTorque(ForceTorque { noise_n: 0.02, ar1: 0.5, ..ForceTorque::default() });
    scenario
}

fn effects() -> Vec<AnyEffect> {
    vec![
        ToolInertia { mass_kg: 0.5 }.into(),
        DriveFriction { force_n: 0.3 }.into(),
        ForceGain { eps: 0.05 }.into(),
        PositionScale { eps: 0.02 }.into(),
    ]
}

#[test]
fn another_seed_is_the_same_insertion_measured_again() {
    for robot in [Robot::Slide, Robot::Replay] {
        let scenario = scenario(robot, effects());
        let (one, two) =
            (simulate(&scenario, 1).expect("simulated"), simulate(&scenario, 2).expect("simulated"));
        assert_ne!(one.recording.force_n, two.recording.force_n);
        assert_eq!(one.measured_with_seed(2).expect("a sensor"), two.recording.force_n);
    }
}

#[test]
fn the_inertia_of_the_tool_is_measured_too() {
    let with = simulate(&scenario(Robot::Slide, effects()), 1).expect("simulated");
    let without = simulate(&scenario(Robot::Slide, effects()[1..].to_vec()), 1).expect("simulated");
    let heavy = with.measured_with_seed(3).expect("a sensor");
    let light = without.measured_with_seed(3).expect("a sensor");
    for k in 5..heavy.len() {
        let inertia_n = 1.05 * 0.5 * with.motion[k].acceleration_mps2;
        assert!((heavy[k] - light[k] - inertia_n).abs() < 1e-9, "sample {k}");
    }
    assert!(with.motion.iter().any(|m| m.acceleration_mps2.abs() > 0.02), "the motion must accelerate");
}

#[test]
fn the_layers_are_those_of_the_scenario() {
    let scenario = scenario(Robot::Replay, Vec::new());
    let layers = simulate(&scenario, 1).expect("simulated").true_layers();
    assert_eq!(layers.len(), 2);
    for (truth, layer) in layers.iter().zip(&scenario.tissue.layers) {
        assert_eq!(truth.stiffness_n_per_m, layer.stiffness_n_per_m);
        assert_eq!(truth.thickness_m, layer.thickness_m);
    }
}
