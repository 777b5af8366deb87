//! Robots that move the needle.

use crate::arm_joint_friction::ArmFriction;
use serde::{Deserialize, Serialize};
use stylet_dynamics::{ArmModel, panda};

/// The robot of a scenario.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "there is one per scenario")]
pub enum Robot {
    /// A velocity-controlled axial slide, simulated as a rigid body.
    #[default]
    Slide,
    /// No rigid bodies: the needle is where the motion commands it.
    Replay,
    /// A seven-joint arm.
    Arm(ArmConfig),
}

/// The arm: a Franka Emika Panda that carries force/torque sensor and needle (see
/// `stylet_dynamics::panda`), and moves the needle's tip along a straight line.
///
/// The line starts where the tip is at the motion's start (`start_m` of the motion) and points in the
/// insertion direction; the needle lies along it. By default the arm stands in its ready pose with
/// the needle straight down.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArmConfig {
    /// Joint angles near which the start pose is searched, rad. Without `tip_m` and `direction` they are the start pose.
    pub start_rad: [f64; 7],
    /// Tip at the motion's start, in the arm's base frame (z up), m; where `start_rad` puts it when
    /// left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_m: Option<[f64; 3]>,
    /// Insertion direction in the base frame, of any length; the needle's axis at `start_rad` when
    /// left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
    /// Controller.
    pub controller: ArmController,
    /// Joint friction in the measured torques.
    pub joint_friction: ArmFriction,
    /// Multiplies `joint_friction`; zero or positive.
    pub friction_scale: f64,
    /// Error of the payload mass (sensor and needle) assumed by the virtual sensor, kg.
    pub payload_error_kg: f64,
    /// Relative error of the link masses and inertias assumed by the virtual sensor: 0.03 is three per cent too heavy.
    pub link_mass_error: f64,
}

impl Default for ArmConfig {
    fn default() -> Self {
        Self {
            start_rad: panda::READY_RAD.into(),
            tip_m: None,
            direction: None,
            controller: ArmController::default(),
            joint_friction: ArmFriction::None,
            friction_scale: 1.0,
            payload_error_kg: 0.0,
            link_mass_error: 0.0,
        }
    }
}

impl ArmConfig {
    /// The arm as it is.
    #[must_use]
    pub fn model(&self) -> ArmModel<7> {
        panda::with_needle()
    }

    /// The model assumed by the virtual sensor.
    #[must_use]
    pub fn assumed_model(&self) -> ArmModel<7> {
        if self.payload_error_kg == 0.0 && self.link_mass_error == 0.0 {
            return self.model();
        }
        let mut model = self.model().with_link_mass_scaled(1.0 + self.link_mass_error);
        let payload = &mut model.tool.payload;
        let factor = (payload.mass_kg + self.payload_error_kg) / payload.mass_kg;
        payload.mass_kg *= factor;
        payload.inertia_kgm2 *= factor;
        model
    }
}

/// Computed-torque control of the tip: `a = a_plan + 2 w (v_plan - v) + w² (x_plan - x)` along and
/// across the line and for the needle's orientation, and a disturbance observer whose estimate of
/// the external joint torques is fed forward.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArmController {
    /// Natural frequency `w` of the critically damped tip error, rad/s.
    pub natural_frequency_radps: f64,
    /// Damping of the elbow's motion that does not move the tip, 1/s.
    pub elbow_damping_per_s: f64,
    /// Gain of the disturbance observer, 1/s.
    pub disturbance_gain_per_s: f64,
}

impl Default for ArmController {
    /// Chosen here: 8 Hz, as a stiff torque-controlled arm reaches; observer as fast.
    fn default() -> Self {
        Self { natural_frequency_radps: 50.0, elbow_damping_per_s: 20.0, disturbance_gain_per_s: 50.0 }
    }
}
