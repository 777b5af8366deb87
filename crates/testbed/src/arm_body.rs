//! What a simulated arm takes and gives.

use nalgebra::Vector3;
use stylet_dynamics::{Arm, JointVector, Posture};

/// rapier refuses a joint of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("rapier refuses the arm's joint {joint}")]
pub struct ArmChainError {
    /// Counted from 1.
    pub(crate) joint: usize,
}

/// The arm as a mechanism: takes joint torques and a force at the tip, gives joint angles and rates.
pub trait ArmBody: Sized {
    /// The arm at given joint angles (rad) and rates (rad/s), stepped every `dt_s`.
    ///
    /// # Errors
    /// [`ArmChainError`]; no checked model causes it.
    fn new(
        arm: &Arm<7>,
        q_rad: &JointVector<7>,
        qd_radps: &JointVector<7>,
        dt_s: f64,
    ) -> Result<Self, ArmChainError>;

    /// Joint angles (rad) and rates (rad/s).
    fn joints(&self) -> (JointVector<7>, JointVector<7>);

    /// Advances by one step under joint torques (N m) and a force (N, base frame) at the tip. `at` is the arm at the present joint angles.
    fn step(&mut self, at: &Posture<'_, 7>, torque_nm: &JointVector<7>, tip_force_n: &Vector3<f64>);
}
