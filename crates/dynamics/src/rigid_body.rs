//! Mass, centre of mass and inertia of one rigid body.

use crate::error::{Error, check};
use crate::pose::Pose;
use nalgebra::{Matrix3, Vector3};

/// A rigid body in some frame. Inertia is about the centre of mass, along the axes of that frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidBody {
    /// Mass.
    pub mass_kg: f64,
    /// Centre of mass.
    pub com_m: Vector3<f64>,
    /// Inertia about the centre of mass (symmetric).
    pub inertia_kgm2: Matrix3<f64>,
}

impl Default for RigidBody {
    fn default() -> Self {
        Self::MASSLESS
    }
}

impl RigidBody {
    /// A body without mass.
    pub const MASSLESS: Self = Self {
        mass_kg: 0.0,
        com_m: Vector3::new(0.0, 0.0, 0.0),
        inertia_kgm2: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// Homogeneous cylinder along z about its centre at `com_m`.
    pub fn cylinder(mass_kg: f64, com_m: Vector3<f64>, radius_m: f64, length_m: f64) -> Self {
        let across = mass_kg * (3.0 * radius_m * radius_m + length_m * length_m) / 12.0;
        let along = 0.5 * mass_kg * radius_m * radius_m;
        Self { mass_kg, com_m, inertia_kgm2: Matrix3::from_diagonal(&Vector3::new(across, across, along)) }
    }

    /// The same body in the parent of the frame it is given in.
    pub fn in_parent_frame(&self, frame: &Pose) -> Self {
        Self {
            mass_kg: self.mass_kg,
            com_m: frame.transform_point(&self.com_m),
            inertia_kgm2: frame.rotation * self.inertia_kgm2 * frame.rotation.transpose(),
        }
    }

    /// Both bodies, given in the same frame, rigidly connected.
    pub fn combined(&self, other: &Self) -> Self {
        let mass_kg = self.mass_kg + other.mass_kg;
        if mass_kg == 0.0 {
            return *self;
        }
        let com_m = (self.com_m * self.mass_kg + other.com_m * other.mass_kg) / mass_kg;
        let about = |body: &Self| body.inertia_kgm2 + point_inertia(body.mass_kg, &(body.com_m - com_m));
        Self { mass_kg, com_m, inertia_kgm2: about(self) + about(other) }
    }

    /// Inertia about the frame's origin (Steiner).
    pub fn inertia_about_origin_kgm2(&self) -> Matrix3<f64> {
        self.inertia_kgm2 + point_inertia(self.mass_kg, &self.com_m)
    }

    /// `Ok` if some distribution of positive mass has these values: mass not negative, inertia symmetric, its
    /// principal moments not negative and each at most the sum of the other two (with a margin of 1e-6 of the
    /// largest for rounded data).
    pub fn validate(&self, joint: Option<usize>) -> Result<(), Error> {
        check("mass_kg", joint, self.mass_kg, self.mass_kg >= 0.0, "zero or positive")?;
        for &x in &self.com_m {
            check("com_m", joint, x, true, "")?;
        }
        for &x in &self.inertia_kgm2 {
            check("inertia_kgm2", joint, x, true, "")?;
        }
        let size = self.inertia_kgm2.amax();
        let skew = (self.inertia_kgm2 - self.inertia_kgm2.transpose()).amax();
        check("inertia_kgm2", joint, skew, skew <= 1e-9 * size, "symmetric (largest difference)")?;
        // Second moments of mass, 1/2 tr(I) 1 - I, are positive semi-definite (Wensing, Kim and Slotine
        // 2018).
        let second = Matrix3::identity() * (0.5 * self.inertia_kgm2.trace()) - self.inertia_kgm2;
        let least = second.symmetric_eigenvalues().min();
        check(
            "inertia_kgm2",
            joint,
            least,
            least >= -1e-6 * size,
            "that of a real body (least second moment of mass >= 0)",
        )
    }
}

/// Inertia about the origin of a point mass at `r`.
fn point_inertia(mass_kg: f64, r: &Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * mass_kg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_halves_of_a_rod_make_the_rod() {
        let half = |z| RigidBody::cylinder(0.5, Vector3::new(0.0, 0.0, z), 0.01, 0.5);
        let rod = RigidBody::cylinder(1.0, Vector3::zeros(), 0.01, 1.0);
        let joined = half(0.25).combined(&half(-0.25));
        assert!((joined.inertia_kgm2 - rod.inertia_kgm2).amax() < 1e-15);
        assert_eq!(joined.com_m, rod.com_m);
    }

    #[test]
    fn an_inertia_that_no_body_can_have_is_refused() {
        let mut body = RigidBody::cylinder(1.0, Vector3::zeros(), 0.1, 0.1);
        body.inertia_kgm2[(0, 0)] = 1.0;
        assert!(matches!(
            body.validate(Some(3)),
            Err(Error::Parameter { name: "inertia_kgm2", joint: Some(3), .. })
        ));
        body.mass_kg = -1.0;
        assert!(matches!(body.validate(None), Err(Error::Parameter { name: "mass_kg", .. })));
    }
}
