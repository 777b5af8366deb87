#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod add_candidates;
mod arm_insertion_line;
mod arm_joint_friction;
mod enhancer_config_file;
mod input_error;
mod load_ron;
mod motion;
mod motion_plan;
mod observer_gain;
mod parse_error_message;
mod range_checks;
mod renamed_names;
mod robot_config;
mod ron_dialect;
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
pub use load_ron::{FieldError, load, motion_to_ron, parse, read_text};
pub use motion::{Motion, MotionPoint, PHASE_FROM_REST_RAD, Segment};
pub use motion_plan::MotionPlan;
pub use observer_gain::ObserverGain;
pub use renamed_names::{renamed_flag, renamed_json_key, renamed_path, renamed_ron_name};
pub use robot_config::{ArmConfig, ArmController, Robot};
pub use ron_dialect::ron_options;
pub use scenario::Scenario;
pub use scenario_reference::{effect_line, effects_page, effects_table, scenario_page};
pub use sensor_config::{ForceTorque, Sensor, VirtualSensor, WrenchEstimate, ZeroWindow};
pub use unused_settings::unused_settings;
