//! The scenario: what is inserted into what, how, and what listens.
#![forbid(unsafe_code)]

mod motion;
mod robot;
mod scenario;
mod sensor;

pub use motion::{FROM_REST_RAD, Motion, MotionPlan, MotionPoint, Segment};
pub use robot::{ArmConfig, Robot};
pub use scenario::Scenario;
pub use sensor::{ForceTorque, Sensor, VirtualSensor};
