//! Joint friction of the arm, as in scenarios.

use serde::{Deserialize, Serialize};
use stylet_dynamics::friction::{FrictionLaw, JointFriction, SmoothSign};
use stylet_dynamics::panda;

/// Joint friction, positive at positive rate. The inner loops of the motors compensate it: it does not act on the motion, but the measured joint
/// torques contain it, and the virtual sensor reports it as external force.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ArmFriction {
    /// No friction.
    #[default]
    None,
    /// Coulomb and viscous, as identified on a Panda, the same in both directions
    /// (`stylet_dynamics::panda::MEASURED_FRICTION`).
    Measured,
    /// The same identification, with coefficients of its own for each direction.
    MeasuredDirectional,
    /// Coulomb and viscous, from the base outwards.
    PerJoint {
        /// One per joint.
        joints: [CoulombViscous; 7],
    },
    /// Sigmoid `k + A/(1 + exp(-a (qd + q0)))` with `k` such that it is zero at rest (Gaz et al. 2019;
    /// the laboratory software of the paper), from the base outwards.
    Sigmoid {
        /// One per joint.
        joints: [Sigmoid; 7],
    },
}

/// `sgn(qd) coulomb + viscous qd`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CoulombViscous {
    /// Coulomb torque, N m.
    pub coulomb_nm: f64,
    /// Viscous coefficient, N m s/rad.
    pub viscous_nms_per_rad: f64,
}

/// One joint's sigmoid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sigmoid {
    /// `A`, twice the Coulomb torque, N m.
    pub amplitude_nm: f64,
    /// `a`, s/rad.
    pub steepness_s_per_rad: f64,
    /// `q0`, rad/s.
    pub shift_radps: f64,
}

impl ArmFriction {
    /// The friction of all joints, multiplied by `scale`.
    #[must_use]
    pub fn friction_models(&self, scale: f64) -> JointFriction<7> {
        let sign = SmoothSign::default();
        let all = match self {
            Self::None => JointFriction::default(),
            Self::Measured => panda::symmetric_friction(),
            Self::MeasuredDirectional => panda::directional_friction(),
            Self::PerJoint { joints } => JointFriction {
                joints: joints.map(|j| FrictionLaw::symmetric(j.coulomb_nm, j.viscous_nms_per_rad)),
                sign,
            },
            Self::Sigmoid { joints } => JointFriction {
                joints: joints.map(|j| {
                    FrictionLaw::sigmoid_through_zero(j.amplitude_nm, j.steepness_s_per_rad, j.shift_radps)
                }),
                sign,
            },
        };
        all.scaled(scale)
    }
}
