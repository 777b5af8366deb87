//! The arm in joint coordinates, the body that insertions use.

use crate::arm_body::{ArmBody, ArmChainError};
use nalgebra::Vector3;
use stylet_dynamics::{Arm, EARTH_GRAVITY_MPS2, JointVector, Posture, Wrench};

/// The arm in joint coordinates, integrated semi-implicitly: `qd += dt M^-1 (tau - C qd - g + J^T F)`, then `q += dt qd`. The same step as that of
/// [`crate::RapierArm`], but for Coriolis terms, which rapier evaluates at the end of the step; several times faster, because it shares the posture with the
/// controller and has no constraint solver.
#[derive(Clone, Copy, Debug)]
pub struct JointSpaceArm {
    q_rad: JointVector<7>,
    qd_radps: JointVector<7>,
    dt_s: f64,
}

impl ArmBody for JointSpaceArm {
    fn new(
        _arm: &Arm<7>,
        q_rad: &JointVector<7>,
        qd_radps: &JointVector<7>,
        dt_s: f64,
    ) -> Result<Self, ArmChainError> {
        Ok(Self { q_rad: *q_rad, qd_radps: *qd_radps, dt_s })
    }

    fn joints(&self) -> (JointVector<7>, JointVector<7>) {
        (self.q_rad, self.qd_radps)
    }

    fn step(&mut self, at: &Posture<'_, 7>, torque_nm: &JointVector<7>, tip_force_n: &Vector3<f64>) {
        let push = Wrench::pure_force(*tip_force_n);
        self.qd_radps +=
            at.forward_dynamics(&self.qd_radps, torque_nm, &EARTH_GRAVITY_MPS2, &push) * self.dt_s;
        self.q_rad += self.qd_radps * self.dt_s;
    }
}
