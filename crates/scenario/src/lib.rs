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

mod arm_line;
mod describe;
mod enhance_file;
mod error;
mod explain;
mod joint_friction;
mod load;
mod motion;
mod observer_gain;
mod outline;
mod plan;
mod robot;
mod scenario;
mod sensor;
mod tokens;
mod validate;
mod validate_arm;
mod validate_effects;
mod validate_enhance;
mod validate_motion;
mod without_effect;

pub use arm_line::{Approach, ArmLine};
pub use describe::describe;
pub use enhance_file::EnhanceFile;
pub use error::{InputError, closest};
pub use joint_friction::{ArmFriction, CoulombViscous, Sigmoid};
pub use load::{Problem, load, motion_to_ron, parse, read_text, ron_options};
pub use motion::{FROM_REST_RAD, Motion, MotionPoint, Segment};
pub use observer_gain::ObserverGain;
pub use plan::MotionPlan;
pub use robot::{ArmConfig, ArmController, Robot};
pub use scenario::Scenario;
pub use sensor::{ForceTorque, Sensor, VirtualSensor, WrenchFrom, ZeroWindow};
pub use without_effect::without_effect;
