//! A checked arm, and the arm at given joint angles.

use crate::arm_model::{ArmModel, JointLimits};
use crate::error::Error;
use crate::pose::Pose;
use crate::rigid_body::RigidBody;
use nalgebra::{Matrix3, SVector};

/// One number per joint.
pub type JointVector<const N: usize> = SVector<f64, N>;

/// A checked arm, with the tool's payload merged into the last link.
#[derive(Debug, Clone)]
pub struct Arm<const N: usize> {
    model: ArmModel<N>,
    pub(crate) bodies: [RigidBody; N],
    /// Tip in the last link's frame.
    pub(crate) tip: Pose,
}

impl<const N: usize> Arm<N> {
    /// Checks the model, see [`ArmModel::validate`].
    pub fn new(model: &ArmModel<N>) -> Result<Self, Error> {
        model.validate()?;
        let mut bodies = model.links.map(|link| link.body);
        let tool = model.flange.compose(&model.tool.mount);
        if let Some(last) = bodies.last_mut() {
            *last = last.combined(&model.tool.payload.in_parent_frame(&tool));
        }
        Ok(Self { model: *model, bodies, tip: tool.compose(&model.tool.tip) })
    }

    /// The data this arm was built from.
    pub fn model(&self) -> &ArmModel<N> {
        &self.model
    }

    /// The joints' ranges.
    pub fn limits(&self) -> [JointLimits; N] {
        self.model.links.map(|link| link.limits)
    }

    /// The arm at joint angles `q_rad`: computes sines, cosines and frames once for everything derived from it.
    pub fn at(&self, q_rad: &JointVector<N>) -> Posture<'_, N> {
        let mut rotations = [Matrix3::zeros(); N];
        for (i, rotation) in rotations.iter_mut().enumerate() {
            let (s, c) = libm::sincos(q_rad[i]);
            let fixed = &self.model.links[i].placement.rotation;
            let (x, y, z) = (fixed.column(0), fixed.column(1), fixed.column(2));
            *rotation = Matrix3::from_columns(&[x * c + y * s, y * c - x * s, z.into_owned()]);
        }
        let mut links = [Pose::IDENTITY; N];
        let mut pose = Pose::IDENTITY;
        for (i, link) in links.iter_mut().enumerate() {
            let position_m = self.model.links[i].placement.position_m;
            pose = pose.compose(&Pose { rotation: rotations[i], position_m });
            *link = pose;
        }
        Posture { arm: self, rotations, links }
    }
}

/// An [`Arm`] at given joint angles. Angles that are not finite give results that are not finite.
#[derive(Debug, Clone)]
pub struct Posture<'a, const N: usize> {
    pub(crate) arm: &'a Arm<N>,
    /// Link `i`'s orientation in link `i - 1`.
    pub(crate) rotations: [Matrix3<f64>; N],
    /// Frames of all links in the base.
    links: [Pose; N],
}

impl<const N: usize> Posture<'_, N> {
    /// The arm in this posture.
    pub fn arm(&self) -> &Arm<N> {
        self.arm
    }

    /// Frames of all links in the base.
    pub fn link_poses(&self) -> &[Pose; N] {
        &self.links
    }

    /// Origin of link `i`'s frame in link `i - 1`'s.
    pub(crate) fn origin(&self, i: usize) -> &nalgebra::Vector3<f64> {
        &self.arm.model.links[i].placement.position_m
    }
}
