//! What carries the needle.

use serde::{Deserialize, Serialize};

/// The robot of a scenario.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Robot {
    /// A velocity-controlled axial slide, simulated as a rigid body.
    #[default]
    Slide,
    /// No rigid bodies: the needle is where the motion commands it.
    Replay,
    /// A seven-joint arm.
    Arm(ArmConfig),
}

/// The arm.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArmConfig {}
