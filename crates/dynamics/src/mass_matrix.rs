//! Joint-space mass matrix.

use crate::arm_posture::Posture;
use nalgebra::{Matrix3, SMatrix, Vector3};

impl<const N: usize> Posture<'_, N> {
    /// `M(q)` (kg m^2), symmetric and positive definite.
    ///
    /// Composite-rigid-body algorithm (RBDA table 6.2), bodies as mass, first moment and inertia about the
    /// link's origin.
    pub fn mass_matrix(&self) -> SMatrix<f64, N, N> {
        let mut matrix = SMatrix::<f64, N, N>::zeros();
        let (mut mass, mut first, mut inertia) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for j in (0..N).rev() {
            let body = &self.arm.bodies[j];
            mass += body.mass_kg;
            first += body.com_m * body.mass_kg;
            inertia += body.inertia_about_origin_kgm2();
            // Force and moment about the origin that give all outboard links a unit acceleration of joint j.
            let mut f = Vector3::new(-first.y, first.x, 0.0);
            let mut n: Vector3<f64> = inertia.column(2).into();
            matrix[(j, j)] = n.z;
            for i in (0..j).rev() {
                f = self.rotations[i + 1] * f;
                n = self.rotations[i + 1] * n + self.origin(i + 1).cross(&f);
                matrix[(i, j)] = n.z;
                matrix[(j, i)] = n.z;
            }
            // The composite body in the frame of the previous link.
            let (r, o) = (&self.rotations[j], self.origin(j));
            let turned = r * first;
            first = turned + o * mass;
            let cross = (turned + first) * o.transpose();
            inertia = r * inertia * r.transpose() + Matrix3::identity() * cross.trace()
                - (cross + cross.transpose()) * 0.5;
        }
        matrix
    }
}
