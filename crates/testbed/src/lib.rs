//! The testbed: from a scenario to a recording with its ground truth.
//!
//! A motion is carried out by a robot (the rapier [`Slide`], the seven-joint arm of [`ArmRig`], or the
//! kinematic replay), the tissue law of `stylet-tissue` makes the force, a force/torque sensor at the
//! needle's base or a virtual sensor on the arm's joint torques ([`AxialObserver`]) records it.
#![forbid(unsafe_code)]

mod arm;
mod arm_insertion;
mod arm_rig;
mod control;
mod insertion;
mod sensor;
mod simulate;
mod slide;
mod virtual_error;
mod virtual_sensor;

pub use arm::{NotAChain, RapierArm};
pub use arm_insertion::{ArmRecord, ArmSetup, on_arm};
pub use arm_rig::{ArmError, ArmMoment, ArmRig};
pub use control::LineControl;
pub use insertion::{InsertionSample, Rates, on_slide, replayed};
pub use sensor::{Measuring, Noise};
pub use simulate::{Reading, SimulateError, Simulation, layers, rates, simulate};
pub use slide::{NEEDLE_LENGTH_M, NEEDLE_MASS_KG, Slide};
pub use virtual_error::VirtualError;
pub use virtual_sensor::{AxialObserver, TorqueSensors};
