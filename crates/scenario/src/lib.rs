//! The scenario: what is inserted into what, how, and what listens (SPEC section 8).
//!
//! ```
//! let text = r#"Scenario(
//!     name: "one gel",
//!     tissue: (layers: [(thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0)]),
//!     motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0),
//! )"#;
//! let scenario = stylet_scenario::Scenario::parse("gel.ron", text)?;
//! assert_eq!(scenario.sample_hz, 200.0);
//! # Ok::<(), stylet_scenario::InputError>(())
//! ```
#![forbid(unsafe_code)]

mod arm_insertion_line;
mod arm_joint_friction;
mod enhancer_config_file;
mod input_error;
mod load_ron;
mod motion;
mod motion_plan;
mod observer_gain;
mod parse_error_message;
mod robot_config;
mod ron_outline;
mod ron_tokens;
mod scenario;
mod scenario_reference;
mod sensor_config;
mod unused_settings;
mod validate_arm;
mod validate_effects;
mod validate_enhancer;
mod validate_motion;
mod validate_scenario;

pub use arm_insertion_line::{Approach, ArmInsertionLine};
pub use arm_joint_friction::{ArmFriction, CoulombViscous, Sigmoid};
pub use enhancer_config_file::EnhancerConfigFile;
pub use input_error::{InputError, closest_name};
pub use load_ron::{FieldError, load, motion_to_ron, parse, read_text, ron_options};
pub use motion::{Motion, MotionPoint, PHASE_FROM_REST_RAD, Segment};
pub use motion_plan::MotionPlan;
pub use observer_gain::ObserverGain;
pub use robot_config::{ArmConfig, ArmController, Robot};
pub use scenario::Scenario;
pub use scenario_reference::scenario_reference;
pub use sensor_config::{ForceTorque, Sensor, VirtualSensor, WrenchEstimate, ZeroWindow};
pub use unused_settings::unused_settings;
