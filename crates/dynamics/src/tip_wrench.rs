//! Wrench on the tip from external joint torques, and back.

use crate::arm_posture::{JointVector, Posture};
use crate::cholesky_solve::solve_spd;
use crate::wrench::Wrench;
use nalgebra::{Matrix3, Matrix6, Vector3};

impl<const N: usize> Posture<'_, N> {
    /// Joint torques of a wrench on the tip: `J^T F` (N m).
    pub fn joint_torques(&self, tip: &Wrench) -> JointVector<N> {
        self.jacobian().tr_mul(&tip.to_vector())
    }

    /// `F = (J J^T + damping^2 1)^-1 J r`: damped pseudo-inverse of `J^T` (Haddadin et al. 2017 give the
    /// undamped one). Metres and radians weigh the same. The damping costs `damping^2/sigma^2` of a component
    /// with singular value `sigma`; 1e-3 is harmless away from singular poses, 0 is exact. At a singular pose
    /// without damping the result is not finite.
    pub fn tip_wrench(&self, residual_nm: &JointVector<N>, damping: f64) -> Wrench {
        let j = self.jacobian();
        let normal = j * j.transpose() + Matrix6::identity() * (damping * damping);
        Wrench::from_vector(&solve_spd(normal, j * residual_nm))
    }

    /// The same under the assumption that no moment acts about the tip's origin: three unknowns instead of six, less sensitive to errors of the joint
    /// torques. Damping in metres.
    pub fn tip_point_force(&self, residual_nm: &JointVector<N>, damping_m: f64) -> Vector3<f64> {
        let j = self.jacobian();
        let j = j.fixed_rows::<3>(0);
        let normal = j * j.transpose() + Matrix3::identity() * (damping_m * damping_m);
        solve_spd(normal, j * residual_nm)
    }
}
