//! The needle as a rigid body on an axial slide (rapier, double precision).
//!
//! A stiff joint motor follows position and velocity of the commanded motion. With one solver iteration its impulse over the step is the force at
//! the needle's base. There are no colliders: the tissue force is an external force.

use rapier3d_f64::prelude::*;

/// Mass of the needle in kg (published with the laboratory software).
pub const NEEDLE_MASS_KG: f64 = 0.068;
/// Length of the needle in metres (same source).
pub const NEEDLE_LENGTH_M: f64 = 0.153;

const MOTOR_STIFFNESS_N_PER_M: f64 = 1e9;
const MOTOR_DAMPING_NS_PER_M: f64 = 1e6;

/// A needle on its slide.
pub struct Slide {
    world: PhysicsWorld,
    needle: RigidBodyHandle,
    joint: ImpulseJointHandle,
    dt_s: f64,
}

impl Slide {
    /// The needle with its tip at `start_m`, moving at `velocity_mps`, stepped every `dt_s`.
    #[must_use]
    pub fn new(start_m: f64, velocity_mps: f64, dt_s: f64) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::ZERO;
        world.integration_parameters.dt = dt_s;
        world.integration_parameters.num_solver_iterations = 1;
        let base = world.insert_body(RigidBodyBuilder::fixed());
        // A slender rod about its centre; rotations are locked by the joint.
        let inertia = NEEDLE_MASS_KG * NEEDLE_LENGTH_M * NEEDLE_LENGTH_M / 12.0;
        let needle = world.insert_body(
            RigidBodyBuilder::dynamic()
                .translation(Vector::new(start_m, 0.0, 0.0))
                .linvel(Vector::new(velocity_mps, 0.0, 0.0))
                .additional_mass_properties(MassProperties::new(
                    Vector::ZERO,
                    NEEDLE_MASS_KG,
                    Vector::new(1e-6, inertia, inertia),
                ))
                .can_sleep(false),
        );
        let joint = PrismaticJointBuilder::new(Vector::X)
            .motor_model(MotorModel::ForceBased)
            .set_motor(start_m, velocity_mps, MOTOR_STIFFNESS_N_PER_M, MOTOR_DAMPING_NS_PER_M)
            .build();
        let joint = world.insert_impulse_joint(base, needle, joint);
        Self { world, needle, joint, dt_s }
    }

    /// Tip position (m) and velocity (m/s).
    #[must_use]
    pub fn tip(&self) -> (f64, f64) {
        let body = &self.world.bodies[self.needle];
        (body.translation().x, body.linvel().x)
    }

    /// Advances by one step to the commanded position, with the mean commanded velocity of the step, the tissue resisting with `resistance_n`.
    pub fn step(&mut self, position_m: f64, velocity_mps: f64, resistance_n: f64) {
        if let Some(joint) = self.world.impulse_joints.get_mut(self.joint, false) {
            joint.data.set_motor(
                JointAxis::LinX,
                // rapier corrects the position error at the start of the step.
                position_m - velocity_mps * self.dt_s,
                velocity_mps,
                MOTOR_STIFFNESS_N_PER_M,
                MOTOR_DAMPING_NS_PER_M,
            );
        }
        if let Some(body) = self.world.bodies.get_mut(self.needle) {
            body.reset_forces(false);
            body.add_force(Vector::new(-resistance_n, 0.0, 0.0), false);
        }
        self.world.step();
    }

    /// Force of the drive on the needle in the last step, in N: tissue force plus mass times
    /// acceleration.
    #[must_use]
    pub fn drive_force_n(&self) -> f64 {
        self.world
            .impulse_joints
            .get(self.joint)
            .map_or(0.0, |joint| -joint.data.motors[JointAxis::LinX as usize].impulse / self.dt_s)
    }
}
