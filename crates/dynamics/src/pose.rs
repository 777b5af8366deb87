//! Pose of a frame in another.

use crate::error::{Error, check};
use nalgebra::{Matrix3, Vector3};

/// Rotation and translation of a child frame in its parent: `x_parent = rotation x_child + position_m`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Columns are the child's axes in parent coordinates.
    pub rotation: Matrix3<f64>,
    /// The child's origin in parent coordinates.
    pub position_m: Vector3<f64>,
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Pose {
    /// The child coincides with the parent.
    pub const IDENTITY: Self = Self {
        rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        position_m: Vector3::new(0.0, 0.0, 0.0),
    };

    /// Axes parallel to the parent's, origin at `(x, y, z)` metres.
    pub const fn translation(x_m: f64, y_m: f64, z_m: f64) -> Self {
        Self { rotation: Self::IDENTITY.rotation, position_m: Vector3::new(x_m, y_m, z_m) }
    }

    /// The grandchild's pose in this frame's parent.
    pub fn compose(&self, child: &Self) -> Self {
        Self { rotation: self.rotation * child.rotation, position_m: self.transform_point(&child.position_m) }
    }

    /// A point given in child coordinates, in parent coordinates.
    pub fn transform_point(&self, child_m: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * child_m + self.position_m
    }

    /// Rotation from this orientation to `target` as a rotation vector in parent coordinates (rad; length 0 to
    /// pi).
    pub fn rotation_vector_to(&self, target: &Self) -> Vector3<f64> {
        rotation_vector(&(target.rotation * self.rotation.transpose()))
    }

    /// `Ok` if all numbers are finite and the rotation is orthonormal and right-handed (to 1e-9).
    pub fn validate(&self, name: &'static str, joint: Option<usize>) -> Result<(), Error> {
        for &value in self.position_m.iter().chain(self.rotation.iter()) {
            check(name, joint, value, true, "")?;
        }
        let r = &self.rotation;
        let skew = (r.transpose() * r - Matrix3::identity()).amax();
        check(name, joint, skew, skew < 1e-9, "zero (deviation of the rotation from an orthonormal one)")?;
        let det = r.determinant();
        check(
            name,
            joint,
            det,
            det > 0.0,
            "1 (determinant of the rotation: a mirror image is not a rotation)",
        )
    }
}

/// Axis times angle of a rotation matrix.
fn rotation_vector(r: &Matrix3<f64>) -> Vector3<f64> {
    let twice_sine = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]);
    let sine = 0.5 * twice_sine.norm();
    let cosine = 0.5 * (r.trace() - 1.0);
    let angle = libm::atan2(sine, cosine);
    if sine > 1e-6 {
        return twice_sine * (0.5 * angle / sine);
    }
    if cosine > 0.0 {
        return twice_sine * 0.5;
    }
    // Near half a turn (R + R^T)/2 = 2 a a^T - 1: the axis is its largest column, up to sign.
    let outer = (r + r.transpose()) * 0.25 + Matrix3::identity() * 0.5;
    let largest = outer.diagonal().imax();
    let axis = outer.column(largest).normalize();
    axis * angle
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_vector_gives_back_axis_and_angle_up_to_half_a_turn() {
        let axis = Vector3::new(0.6, 0.0, 0.8);
        for angle in [0.0, 1e-9, 1e-3, 1.0, 3.0, std::f64::consts::PI] {
            let r = nalgebra::Rotation3::new(axis * angle).into_inner();
            let v = rotation_vector(&r);
            assert!((v - axis * angle).norm() < 1e-9, "angle {angle}: {v}");
        }
    }

    #[test]
    fn a_mirror_image_is_refused() {
        let mut pose = Pose::IDENTITY;
        pose.rotation[(2, 2)] = -1.0;
        assert!(pose.validate("flange", None).is_err());
    }
}
