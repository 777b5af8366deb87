//! Generalised momentum, Coriolis and gravity terms of the momentum observer.

use crate::arm_posture::{JointVector, Posture};
use nalgebra::Vector3;

/// Model terms of the momentum observer at one posture and joint rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MomentumTerms<const N: usize> {
    /// `p = M(q) qd` (N m s).
    pub momentum_nms: JointVector<N>,
    /// `C^T(q, qd) qd` (N m), equal to the derivative of the kinetic energy with respect to `q`.
    pub coriolis_transposed_nm: JointVector<N>,
    /// `g(q)` (N m).
    pub gravity_nm: JointVector<N>,
}

impl<const N: usize> Posture<'_, N> {
    /// `p`, `C^T qd` and `g` in one pass outwards and one inwards: no mass matrix, no Coriolis matrix.
    ///
    /// With `S_i` the axis of joint `i`, `v_i` the velocity of link `i` and `H_i` the momentum of link `i`
    /// and all links outboard (6-vectors at the link's origin): `p_i = S_i . H_i` and `(C^T qd)_i = dT/dq_i =
    /// (v_i x S_i) . H_i`. The second follows from turning all outboard links about joint `i` in the kinetic
    /// energy `T`: their inertias turn with them, their velocities do so but for the share `v_i` that comes
    /// from further inboard; only that share is left. `C` is any factorisation for which `dM/dt - 2 C` is
    /// skew-symmetric, in which case `C^T qd = dM/dt qd - C qd` does not depend on the choice. (Same purpose
    /// as De Luca and Ferrajoli, ICRA 2009; spatial cross products as in RBDA chapter 2.)
    pub fn momentum_terms(&self, qd_radps: &JointVector<N>, gravity_mps2: &Vector3<f64>) -> MomentumTerms<N> {
        let mut linear = [Vector3::zeros(); N];
        let mut angular = [Vector3::zeros(); N];
        let mut w_of = [Vector3::zeros(); N];
        let mut v_of = [Vector3::zeros(); N];
        let mut down = [Vector3::zeros(); N];
        let (mut w, mut v, mut g) = (Vector3::zeros(), Vector3::zeros(), *gravity_mps2);
        for i in 0..N {
            let r = &self.rotations[i];
            v = r.tr_mul(&(v + w.cross(self.origin(i))));
            w = r.tr_mul(&w);
            w.z += qd_radps[i];
            g = r.tr_mul(&g);
            let body = &self.arm.bodies[i];
            linear[i] = (v + w.cross(&body.com_m)) * body.mass_kg;
            angular[i] = body.inertia_kgm2 * w + body.com_m.cross(&linear[i]);
            (w_of[i], v_of[i], down[i]) = (w, v, g);
        }
        let mut terms = MomentumTerms {
            momentum_nms: JointVector::zeros(),
            coriolis_transposed_nm: JointVector::zeros(),
            gravity_nm: JointVector::zeros(),
        };
        let (mut p, mut l) = (Vector3::zeros(), Vector3::zeros());
        let (mut mass, mut first) = (0.0, Vector3::zeros());
        for i in (0..N).rev() {
            let body = &self.arm.bodies[i];
            p += linear[i];
            l += angular[i];
            mass += body.mass_kg;
            first += body.com_m * body.mass_kg;
            let (w, v, g) = (&w_of[i], &v_of[i], &down[i]);
            terms.momentum_nms[i] = l.z;
            terms.coriolis_transposed_nm[i] = w.y * l.x - w.x * l.y + v.y * p.x - v.x * p.y;
            terms.gravity_nm[i] = first.y * g.x - first.x * g.y;
            let (r, o) = (&self.rotations[i], self.origin(i));
            p = r * p;
            l = r * l + o.cross(&p);
            first = r * first + o * mass;
        }
        terms
    }
}
