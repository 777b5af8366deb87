//! The scenarios of the repository, carried by the arm.
#![allow(dead_code)]

use std::path::Path;
use stylet_scenario::{ArmConfig, ForceTorque, ObserverGain, Robot, Scenario, Sensor, VirtualSensor};

/// Liver at constant velocity and abdomen at sinusoidal velocity.
pub const FILES: [&str; 2] = ["bovine_liver_constant", "abdomen_sinusoidal"];

/// A scenario of the repository with an arm and both sensors.
pub fn with_arm(file: &str, arm: ArmConfig, sensor: VirtualSensor) -> Scenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios").join(format!("{file}.ron"));
    let mut scenario = Scenario::load(&path).expect("a scenario of the repository");
    scenario.robot = Robot::Arm(arm);
    scenario.sensor = Sensor::Both { force_torque: ForceTorque::default(), virtual_sensor: sensor };
    scenario.check().expect("the arm can carry the needle");
    scenario
}

/// An observer without noise.
pub fn noiseless(gain_per_s: f64) -> VirtualSensor {
    VirtualSensor {
        gain_per_s: ObserverGain::Uniform(gain_per_s),
        torque_noise_nm: 0.0,
        ..VirtualSensor::default()
    }
}
