//! Joint friction: torque between motor and link, not part of the rigid-body model.
//!
//! Sign: `M qdd + C qd + g = tau - friction(qd) + J^T F`; friction is positive at positive rate. An observer without a friction model reports
//! `-friction(qd)` as external torque. A simulation can subtract `friction(qd)` from the torque on the links (it then acts on the motion; stiff, see
//! [`SmoothSign::width_radps`]), or apply the commanded torque to the links and add `friction(qd)` to the measured torque (a motor whose inner loop
//! compensates friction). The residual of the observer is the same for the same motion.

use crate::arm_posture::JointVector;
use crate::error::{Error, check};

/// Coulomb and viscous friction in one direction of motion.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DirectionalFriction {
    /// Coulomb torque.
    pub coulomb_nm: f64,
    /// Viscous coefficient.
    pub viscous_nms_per_rad: f64,
}

/// Friction law of one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FrictionLaw {
    /// `sgn(qd) coulomb + viscous qd`, with coefficients of the direction of motion.
    CoulombViscous {
        /// While the joint angle grows.
        positive: DirectionalFriction,
        /// While the joint angle falls.
        negative: DirectionalFriction,
    },
    /// `k + A/(1 + exp(-a (qd + q0)))`: Coulomb friction of half-amplitude `A/2` with a soft transition (Gaz
    /// et al. 2019; the laboratory software of the paper). Without offset where `k = -A/(1 + exp(-a q0))`.
    Sigmoid {
        /// `k`.
        offset_nm: f64,
        /// `A`.
        amplitude_nm: f64,
        /// `a`.
        steepness_s_per_rad: f64,
        /// `q0`.
        shift_radps: f64,
    },
}

impl Default for FrictionLaw {
    fn default() -> Self {
        Self::NONE
    }
}

impl FrictionLaw {
    /// No friction.
    pub const NONE: Self = Self::CoulombViscous {
        positive: DirectionalFriction { coulomb_nm: 0.0, viscous_nms_per_rad: 0.0 },
        negative: DirectionalFriction { coulomb_nm: 0.0, viscous_nms_per_rad: 0.0 },
    };

    /// The same in both directions.
    pub const fn symmetric(coulomb_nm: f64, viscous_nms_per_rad: f64) -> Self {
        let both = DirectionalFriction { coulomb_nm, viscous_nms_per_rad };
        Self::CoulombViscous { positive: both, negative: both }
    }

    /// Sigmoid that is zero at rest.
    pub fn sigmoid_through_zero(amplitude_nm: f64, steepness_s_per_rad: f64, shift_radps: f64) -> Self {
        let offset_nm = -amplitude_nm / (1.0 + libm::exp(-steepness_s_per_rad * shift_radps));
        Self::Sigmoid { offset_nm, amplitude_nm, steepness_s_per_rad, shift_radps }
    }

    /// All torques multiplied by a factor.
    pub fn scaled(self, factor: f64) -> Self {
        let direction = |d: DirectionalFriction| DirectionalFriction {
            coulomb_nm: d.coulomb_nm * factor,
            viscous_nms_per_rad: d.viscous_nms_per_rad * factor,
        };
        match self {
            Self::CoulombViscous { positive, negative } => {
                Self::CoulombViscous { positive: direction(positive), negative: direction(negative) }
            }
            Self::Sigmoid { offset_nm, amplitude_nm, steepness_s_per_rad, shift_radps } => Self::Sigmoid {
                offset_nm: offset_nm * factor,
                amplitude_nm: amplitude_nm * factor,
                steepness_s_per_rad,
                shift_radps,
            },
        }
    }

    fn torque(&self, qd: f64, sign: &SmoothSign) -> f64 {
        match *self {
            Self::CoulombViscous { positive, negative } => {
                let side = if qd >= 0.0 { positive } else { negative };
                side.coulomb_nm * sign.value(qd) + side.viscous_nms_per_rad * qd
            }
            Self::Sigmoid { offset_nm, amplitude_nm, steepness_s_per_rad, shift_radps } => {
                offset_nm + amplitude_nm / (1.0 + libm::exp(-steepness_s_per_rad * (qd + shift_radps)))
            }
        }
    }

    fn validate(&self, joint: Option<usize>) -> Result<(), Error> {
        match *self {
            Self::CoulombViscous { positive, negative } => {
                for (side, coulomb, viscous) in [
                    (positive, "positive.coulomb_nm", "positive.viscous_nms_per_rad"),
                    (negative, "negative.coulomb_nm", "negative.viscous_nms_per_rad"),
                ] {
                    let (c, v) = (side.coulomb_nm, side.viscous_nms_per_rad);
                    check(coulomb, joint, c, c >= 0.0, "zero or positive: friction opposes motion")?;
                    check(viscous, joint, v, v >= 0.0, "zero or positive: friction opposes motion")?;
                }
                Ok(())
            }
            Self::Sigmoid { offset_nm, amplitude_nm, steepness_s_per_rad, shift_radps } => {
                check("offset_nm", joint, offset_nm, true, "")?;
                check(
                    "amplitude_nm",
                    joint,
                    amplitude_nm,
                    amplitude_nm >= 0.0,
                    "zero or positive: friction opposes motion",
                )?;
                check(
                    "steepness_s_per_rad",
                    joint,
                    steepness_s_per_rad,
                    steepness_s_per_rad > 0.0,
                    "positive",
                )?;
                check("shift_radps", joint, shift_radps, true, "")
            }
        }
    }
}

/// Sign of a rate: zero within the dead band, `tanh((|x| - dead_band)/width)` beyond it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothSign {
    /// No Coulomb friction below this rate.
    pub dead_band_radps: f64,
    /// Rate over which it then comes up to 76 %; zero for a hard step. A simulation that applies the torque
    /// explicitly over steps of `dt` needs at least `coulomb dt/(2 inertia)` to stay stable: 0.03 rad/s for
    /// the last joint of a Panda at 1 ms.
    pub width_radps: f64,
}

impl Default for SmoothSign {
    /// Dead band: 0.01 mm/s at half a metre. Width: a tenth of the joint rates of an insertion at 2.3 mm/s.
    fn default() -> Self {
        Self { dead_band_radps: 2e-5, width_radps: 5e-4 }
    }
}

impl SmoothSign {
    /// From -1 to 1.
    pub fn value(&self, x: f64) -> f64 {
        let beyond = x.abs() - self.dead_band_radps;
        if beyond <= 0.0 {
            0.0
        } else if self.width_radps > 0.0 {
            libm::tanh(beyond / self.width_radps).copysign(x)
        } else {
            1.0_f64.copysign(x)
        }
    }
}

/// Friction of all joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointFriction<const N: usize> {
    /// From the base outwards.
    pub joints: [FrictionLaw; N],
    /// For the Coulomb terms of all joints.
    pub sign: SmoothSign,
}

impl<const N: usize> Default for JointFriction<N> {
    fn default() -> Self {
        Self { joints: [FrictionLaw::NONE; N], sign: SmoothSign::default() }
    }
}

impl<const N: usize> JointFriction<N> {
    /// Friction torques (N m), positive at positive rate.
    pub fn torques(&self, qd_radps: &JointVector<N>) -> JointVector<N> {
        JointVector::from_fn(|i, _| self.joints[i].torque(qd_radps[i], &self.sign))
    }

    /// All torques multiplied by a factor.
    pub fn scaled(&self, factor: f64) -> Self {
        Self { joints: self.joints.map(|law| law.scaled(factor)), sign: self.sign }
    }

    /// `Ok` if every coefficient is finite and friction opposes the motion.
    pub fn validate(&self) -> Result<(), Error> {
        for (i, law) in self.joints.iter().enumerate() {
            law.validate(Some(i + 1))?;
        }
        let SmoothSign { dead_band_radps, width_radps } = self.sign;
        check("dead_band_radps", None, dead_band_radps, dead_band_radps >= 0.0, "zero or positive")?;
        check("width_radps", None, width_radps, width_radps >= 0.0, "zero or positive")
    }
}
