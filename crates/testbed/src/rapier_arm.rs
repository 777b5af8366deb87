//! The arm as a rapier multibody, the reference for [`crate::JointSpaceArm`]: seven revolute joints, the links of `stylet-dynamics`, force/torque
//! sensor and needle fixed to the last one.
//!
//! rapier has no input for joint torques: each is applied as a pair of opposite torques on a link and its parent. There are no colliders and no
//! joint limits; an insertion that leaves the limits ends with [`crate::ArmError`]. rapier's default joint damping of 0.1 N m s/rad is removed. One
//! solver iteration per step: several would be substeps with a mass matrix each. Steps are semi-implicit:
//! `qd += dt M^-1 (tau - C qd - g + J^T F)`, then `q += dt qd`.

use crate::arm_body::{ArmBody, ArmChainError};
use nalgebra::{Matrix3, SMatrix, Vector3};
use rapier3d_f64::prelude::*;
use stylet_dynamics::{Arm, EARTH_GRAVITY_MPS2, JointVector, Pose as Frame, Posture, RigidBody as Body};

/// Index of the free coordinate (rotation about z) of a joint among rapier's six.
const ABOUT_Z: usize = 5;

/// The arm in its world.
pub struct RapierArm {
    world: PhysicsWorld,
    links: [RigidBodyHandle; 7],
    /// Centre of mass of the last link with all that it carries, in its frame, m.
    last_com_m: Vector3<f64>,
    /// Handle of the last joint, from which the chain is found.
    last: MultibodyJointHandle,
}

impl ArmBody for RapierArm {
    fn new(
        arm: &Arm<7>,
        q_rad: &JointVector<7>,
        qd_radps: &JointVector<7>,
        dt_s: f64,
    ) -> Result<Self, ArmChainError> {
        let mut world = PhysicsWorld::new();
        world.gravity = vector(&EARTH_GRAVITY_MPS2);
        world.integration_parameters.dt = dt_s;
        world.integration_parameters.num_solver_iterations = 1;

        let model = arm.model();
        let mut before = world.insert_body(RigidBodyBuilder::fixed());
        let mut links = [before; 7];
        let mut last = None;
        let mut last_com_m = Vector3::zeros();
        for (i, link) in model.links.iter().enumerate() {
            let mut body = link.body;
            if i == 6 {
                let tool = model.flange.compose(&model.tool.mount);
                body = body.combined(&model.tool.payload.in_parent_frame(&tool));
            }
            let handle = world.insert_body(
                RigidBodyBuilder::dynamic()
                    .additional_mass_properties(mass_properties(&body))
                    .can_sleep(false),
            );
            let locked = JointAxesMask::all() & !JointAxesMask::ANG_Z;
            let joint = GenericJointBuilder::new(locked).local_frame1(pose(&link.placement)).build();
            last = world.insert_multibody_joint(before, handle, joint);
            if last.is_none() {
                return Err(ArmChainError { joint: i + 1 });
            }
            links[i] = handle;
            before = handle;
            last_com_m = body.com_m;
        }
        let last = last.ok_or(ArmChainError { joint: 7 })?;
        let mut arm_body = Self { world, links, last_com_m, last };
        arm_body.place(q_rad, qd_radps);
        Ok(arm_body)
    }

    fn joints(&self) -> (JointVector<7>, JointVector<7>) {
        let (mut q, mut qd) = (JointVector::<7>::zeros(), JointVector::<7>::zeros());
        if let Some((chain, _)) = self.world.multibody_joints.get(self.last) {
            for (q, link) in q.iter_mut().zip(chain.links().skip(1)) {
                *q = link.joint().coords()[ABOUT_Z];
            }
            qd.iter_mut().zip(chain.generalized_velocity().iter()).for_each(|(to, from)| *to = *from);
        }
        (q, qd)
    }

    fn step(&mut self, at: &Posture<'_, 7>, torque_nm: &JointVector<7>, tip_force_n: &Vector3<f64>) {
        let (frames, tip_m) = (at.link_poses(), at.tip().position_m);
        let mut outboard = Vector3::zeros();
        for i in (0..7).rev() {
            let torque: Vector3<f64> = frames[i].rotation.column(2) * torque_nm[i];
            if let Some(link) = self.world.bodies.get_mut(self.links[i]) {
                link.reset_forces(false);
                link.reset_torques(false);
                let mut link_torque = torque - outboard;
                if i == 6 {
                    // `add_force_at_point` uses a centre of mass that rapier computes in its first step.
                    let lever = tip_m - frames[i].transform_point(&self.last_com_m);
                    link_torque += lever.cross(tip_force_n);
                    link.add_force(vector(tip_force_n), false);
                }
                link.add_torque(vector(&link_torque), false);
            }
            outboard = torque;
        }
        self.world.step();
    }
}

impl RapierArm {
    fn place(&mut self, q_rad: &JointVector<7>, qd_radps: &JointVector<7>) {
        let bodies = &mut self.world.bodies;
        if let Some((chain, _)) = self.world.multibody_joints.get_mut(self.last) {
            // Only after this does rapier treat the base as fixed and use seven coordinates.
            chain.forward_kinematics(bodies, true);
            chain.damping_mut().fill(0.0);
            chain.apply_displacements(q_rad.as_slice());
            chain.generalized_velocity_mut().copy_from_slice(qd_radps.as_slice());
            chain.forward_kinematics(bodies, true);
            chain.update_rigid_bodies(bodies, true);
        }
    }

    /// Inverse of the mass matrix of the last step, 1/(kg m²).
    #[must_use]
    pub fn inverse_mass_matrix(&self) -> Option<SMatrix<f64, 7, 7>> {
        let (chain, _) = self.world.multibody_joints.get(self.last)?;
        let inverse = chain.inv_augmented_mass().try_inverse()?;
        (inverse.shape() == (7, 7)).then(|| SMatrix::from_fn(|i, j| inverse[(i, j)]))
    }
}

fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

fn matrix(m: &Matrix3<f64>) -> Matrix {
    Matrix::from_cols(
        vector(&m.column(0).into_owned()),
        vector(&m.column(1).into_owned()),
        vector(&m.column(2).into_owned()),
    )
}

fn pose(frame: &Frame) -> Pose {
    Pose::from_parts(vector(&frame.position_m), Rotation::from_mat3(&matrix(&frame.rotation)).normalize())
}

fn mass_properties(body: &Body) -> MassProperties {
    MassProperties::with_inertia_matrix(vector(&body.com_m), body.mass_kg, matrix(&body.inertia_kgm2))
}
