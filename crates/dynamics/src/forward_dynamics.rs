//! Forward dynamics: joint accelerations under joint torques, gravity and a wrench on the tip.

use crate::arm_posture::{JointVector, Posture};
use crate::cholesky_solve::solve_spd;
use crate::wrench::Wrench;
use nalgebra::Vector3;

impl<const N: usize> Posture<'_, N> {
    /// `qdd = M(q)^-1 (tau - C(q, qd) qd - g(q) + J^T F)` (rad/s²), without joint friction; arguments as in
    /// [`Posture::inverse_dynamics`].
    ///
    /// Composite-rigid-body algorithm, recursive Newton-Euler algorithm and a Cholesky factorisation (RBDA table 6.2 and section 6.5): for seven
    /// joints about as fast as the articulated-body algorithm.
    pub fn forward_dynamics(
        &self,
        qd_radps: &JointVector<N>,
        torque_nm: &JointVector<N>,
        gravity_mps2: &Vector3<f64>,
        tip: &Wrench,
    ) -> JointVector<N> {
        let bias = self.inverse_dynamics(qd_radps, &JointVector::zeros(), gravity_mps2, tip);
        solve_spd(self.mass_matrix(), torque_nm - bias)
    }
}
