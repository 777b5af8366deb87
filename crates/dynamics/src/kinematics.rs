//! Link poses, tip pose, Jacobian, tip acceleration and inverse velocity kinematics.

use crate::arm_posture::{JointVector, Posture};
use crate::cholesky_solve::solve_spd;
use crate::pose::Pose;
use nalgebra::{Matrix6, SMatrix, Vector3, Vector6};

/// Joint rates to tip velocity (rows 0-2, m/s per rad/s) and angular velocity (rows 3-5), base coordinates.
pub type Jacobian<const N: usize> = SMatrix<f64, 6, N>;

impl<const N: usize> Posture<'_, N> {
    /// The tip's frame in the base.
    pub fn tip(&self) -> Pose {
        self.link_poses().last().unwrap_or(&Pose::IDENTITY).compose(&self.arm.tip)
    }

    /// Geometric Jacobian of the tip's origin.
    pub fn jacobian(&self) -> Jacobian<N> {
        self.tip_and_jacobian().1
    }

    /// Tip pose and Jacobian in one pass.
    pub fn tip_and_jacobian(&self) -> (Pose, Jacobian<N>) {
        let links = self.link_poses();
        let tip = links.last().unwrap_or(&Pose::IDENTITY).compose(&self.arm.tip);
        let mut jacobian = Jacobian::<N>::zeros();
        for (i, link) in links.iter().enumerate() {
            let axis: Vector3<f64> = link.rotation.column(2).into();
            jacobian.fixed_view_mut::<3, 1>(0, i).copy_from(&axis.cross(&(tip.position_m - link.position_m)));
            jacobian.fixed_view_mut::<3, 1>(3, i).copy_from(&axis);
        }
        (tip, jacobian)
    }

    /// Acceleration of the tip, linear (m/s^2) on top of angular (rad/s^2), base coordinates: `J qdd + dJ/dt
    /// qd`. With `qdd = 0` this is the term that computed torque along a line has to cancel.
    pub fn tip_acceleration(&self, qd_radps: &JointVector<N>, qdd_radps2: &JointVector<N>) -> Vector6<f64> {
        let links = self.link_poses();
        let (mut w, mut dw, mut a) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
        let mut from = Vector3::zeros();
        let mut move_to = |to: &Vector3<f64>, w: &Vector3<f64>, dw: &Vector3<f64>| {
            let arm = to - from;
            a += dw.cross(&arm) + w.cross(&w.cross(&arm));
            from = *to;
        };
        for (i, link) in links.iter().enumerate() {
            move_to(&link.position_m, &w, &dw);
            let axis: Vector3<f64> = link.rotation.column(2).into();
            dw += axis * qdd_radps2[i] + w.cross(&axis) * qd_radps[i];
            w += axis * qd_radps[i];
        }
        let tip = links.last().unwrap_or(&Pose::IDENTITY).compose(&self.arm.tip);
        move_to(&tip.position_m, &w, &dw);
        Vector6::new(a.x, a.y, a.z, dw.x, dw.y, dw.z)
    }

    /// Smallest joint rates that give the tip a velocity: `J^T (J J^T + damping^2 1)^-1 twist`, linear on top of
    /// angular.
    pub fn joint_rates(&self, twist: &Vector6<f64>, damping: f64) -> JointVector<N> {
        damped_inverse(&self.jacobian(), twist, damping * damping)
    }
}

/// `J^T (J J^T + damping2 1)^-1 x` (Nakamura and Hanafusa 1986; Wampler 1986).
pub(crate) fn damped_inverse<const N: usize>(
    j: &Jacobian<N>,
    x: &Vector6<f64>,
    damping2: f64,
) -> JointVector<N> {
    let normal = j * j.transpose() + Matrix6::identity() * damping2;
    j.tr_mul(&solve_spd(normal, *x))
}
