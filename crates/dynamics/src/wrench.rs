//! Force and moment on the tip.

use nalgebra::{Vector3, Vector6};

/// Wrench on the tip in base coordinates, moment about the tip's origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wrench {
    /// Force on the tip.
    pub force_n: Vector3<f64>,
    /// Moment about the tip's origin.
    pub moment_nm: Vector3<f64>,
}

impl Wrench {
    /// A force through the tip's origin.
    pub fn pure_force(force_n: Vector3<f64>) -> Self {
        Self { force_n, moment_nm: Vector3::zeros() }
    }

    /// Component of the force along a unit vector (base coordinates). Tissue that resists motion along it
    /// gives a negative number.
    pub fn component_along(&self, unit: &Vector3<f64>) -> f64 {
        self.force_n.dot(unit)
    }

    /// Force on top of moment, in the order of the Jacobian's rows.
    pub fn to_vector(&self) -> Vector6<f64> {
        let (f, m) = (&self.force_n, &self.moment_nm);
        Vector6::new(f.x, f.y, f.z, m.x, m.y, m.z)
    }

    /// The reverse of [`Wrench::to_vector`].
    pub fn from_vector(v: &Vector6<f64>) -> Self {
        Self { force_n: Vector3::new(v[0], v[1], v[2]), moment_nm: Vector3::new(v[3], v[4], v[5]) }
    }
}
