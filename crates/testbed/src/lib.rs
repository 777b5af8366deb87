#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod arm_body;
mod arm_insertion;
mod arm_simulation;
mod computed_torque_control;
mod force_sensor;
mod joint_space_arm;
mod rapier_arm;
mod rapier_slide;
mod simulate;
mod slide_insertion;
mod virtual_sensor;
mod virtual_sensor_accuracy;

pub use arm_body::{ArmBody, ArmChainError};
pub use arm_insertion::{ArmRecording, ArmSetup, simulate_on_arm};
pub use arm_simulation::{ArmError, ArmSimulation, ArmStep};
pub use computed_torque_control::LineController;
pub use force_sensor::{ForceSensor, SensorNoise};
pub use joint_space_arm::JointSpaceArm;
pub use rapier_arm::RapierArm;
pub use rapier_slide::{NEEDLE_LENGTH_M, NEEDLE_MASS_KG, Slide};
pub use simulate::{SensorReadings, SimulateError, Simulation, sample_rates, simulate, true_layers};
pub use slide_insertion::{InsertionSample, SampleRates, simulate_on_slide, simulate_replay};
pub use virtual_sensor::{AxialForceObserver, JointTorqueSensors};
pub use virtual_sensor_accuracy::VirtualSensorAccuracy;
