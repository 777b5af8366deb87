//! Inverse dynamics and gravity torques by the recursive Newton-Euler algorithm.

use crate::arm_posture::{JointVector, Posture};
use crate::wrench::Wrench;
use nalgebra::Vector3;

impl<const N: usize> Posture<'_, N> {
    /// `tau = M(q) qdd + C(q, qd) qd + g(q) - J^T F` (N m), without joint friction.
    ///
    /// Recursive Newton-Euler algorithm in link frames (Luh, Walker and Paul 1980; RBDA table 5.1). Gravity
    /// enters as an upward acceleration of the base. `gravity_mps2` and `tip` (wrench on the tip) in base coordinates.
    pub fn inverse_dynamics(
        &self,
        qd_radps: &JointVector<N>,
        qdd_radps2: &JointVector<N>,
        gravity_mps2: &Vector3<f64>,
        tip: &Wrench,
    ) -> JointVector<N> {
        let mut force = [Vector3::zeros(); N];
        let mut moment = [Vector3::zeros(); N];
        // Of the link at hand, in its own frame: angular velocity and acceleration, acceleration of the
        // origin, wrench on the tip.
        let (mut w, mut dw, mut a) = (Vector3::zeros(), Vector3::zeros(), -gravity_mps2);
        let (mut tip_force, mut tip_moment) = (tip.force_n, tip.moment_nm);
        for i in 0..N {
            let r = &self.rotations[i];
            let o = self.origin(i);
            let (qd, qdd) = (qd_radps[i], qdd_radps2[i]);
            a = r.tr_mul(&(a + dw.cross(o) + w.cross(&w.cross(o))));
            w = r.tr_mul(&w);
            dw = r.tr_mul(&dw) + Vector3::new(w.y * qd, -w.x * qd, qdd);
            w.z += qd;
            tip_force = r.tr_mul(&tip_force);
            tip_moment = r.tr_mul(&tip_moment);

            let body = &self.arm.bodies[i];
            let c = &body.com_m;
            force[i] = (a + dw.cross(c) + w.cross(&w.cross(c))) * body.mass_kg;
            moment[i] = body.inertia_kgm2 * dw + w.cross(&(body.inertia_kgm2 * w)) + c.cross(&force[i]);
        }
        let mut f = -tip_force;
        let mut n = -tip_moment - self.arm.tip.position_m.cross(&tip_force);
        let mut tau = JointVector::<N>::zeros();
        for i in (0..N).rev() {
            f += force[i];
            n += moment[i];
            tau[i] = n.z;
            f = self.rotations[i] * f;
            n = self.rotations[i] * n + self.origin(i).cross(&f);
        }
        tau
    }

    /// `g(q)` (N m): the torques that hold the arm still. A single backward pass over the first moments of
    /// mass.
    pub fn gravity_torques(&self, gravity_mps2: &Vector3<f64>) -> JointVector<N> {
        let mut down = [Vector3::zeros(); N];
        let mut g = *gravity_mps2;
        for (down, r) in down.iter_mut().zip(&self.rotations) {
            g = r.tr_mul(&g);
            *down = g;
        }
        let mut tau = JointVector::<N>::zeros();
        let (mut mass, mut first) = (0.0, Vector3::zeros());
        for i in (0..N).rev() {
            let body = &self.arm.bodies[i];
            mass += body.mass_kg;
            first += body.com_m * body.mass_kg;
            tau[i] = first.y * down[i].x - first.x * down[i].y;
            first = self.rotations[i] * first + self.origin(i) * mass;
        }
        tau
    }
}
