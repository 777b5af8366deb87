//! Errors of arms, poses and parameters; each message says what is expected.

use std::fmt;

/// The joint quantity that left its limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointQuantity {
    /// Joint angle (rad).
    Position,
    /// Joint rate (rad/s).
    Velocity,
    /// Joint torque (N m).
    Torque,
}

impl JointQuantity {
    /// The unit in which values of this quantity are given.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Position => "rad",
            Self::Velocity => "rad/s",
            Self::Torque => "N m",
        }
    }
}

/// All errors of this crate. Joints are counted from 1, as on the arm's data sheet.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// A parameter or an input is not finite or out of its range.
    Parameter {
        /// Field or argument, with its unit as suffix.
        name: &'static str,
        /// The joint or link it belongs to, counted from 1.
        joint: Option<usize>,
        /// The offending value.
        value: f64,
        /// The expected value.
        expected: &'static str,
    },
    /// A joint is outside its limits.
    JointLimit {
        /// Counted from 1.
        joint: usize,
        /// Which limit.
        quantity: JointQuantity,
        /// The offending value.
        value: f64,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// The arm is in, or close to, a pose in which the tip cannot be moved in some direction.
    Singular {
        /// Of the tip Jacobian (m and rad as units).
        smallest_singular_value: f64,
        /// The smallest allowed value.
        threshold: f64,
    },
    /// No joint angles within the limits bring the tip to the pose.
    Unreachable {
        /// Distance left at the best joint angles found.
        position_error_m: f64,
        /// Angle left at the best joint angles found.
        orientation_error_rad: f64,
        /// The first joint (from 1) that sits at a limit there.
        joint_at_limit: Option<usize>,
    },
    /// The tip can go on only if the arm first swings over to another configuration.
    Jump {
        /// Counted from 1.
        joint: usize,
        /// Change of the joint's angle from one point of the line to the next.
        change_rad: f64,
        /// The greatest change allowed.
        allowed_rad: f64,
    },
    /// A straight line of the tip fails somewhere.
    Line {
        /// Distance from the start of the line at which it first fails.
        distance_m: f64,
        /// Length of the line.
        length_m: f64,
        /// Why.
        reason: Box<Error>,
    },
}

impl Error {
    pub(crate) fn not_finite(name: &'static str, joint: Option<usize>, value: f64) -> Self {
        Self::Parameter { name, joint, value, expected: "a finite number" }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Parameter { name, joint, value, expected } => {
                write!(f, "`{name}`")?;
                if let Some(joint) = joint {
                    write!(f, " of joint {joint}")?;
                }
                write!(f, " is {value}: must be {expected}")
            }
            Self::JointLimit { joint, quantity, value, lower, upper } => {
                let (what, unit) = (format!("{quantity:?}").to_lowercase(), quantity.unit());
                write!(
                    f,
                    "{what} of joint {joint} is {value:.4} {unit}: must be from {lower:.4} to {upper:.4} {unit}"
                )
            }
            Self::Singular { smallest_singular_value, threshold } => write!(
                f,
                "singular pose: the smallest singular value of the tip Jacobian is {smallest_singular_value:.4}, must be at least \
                 {threshold:.4}; bend the elbow or move the target"
            ),
            Self::Unreachable { position_error_m, orientation_error_rad, joint_at_limit } => {
                write!(
                    f,
                    "tip pose out of reach: {:.3} mm and {:.3} deg remain at the best joint angles found",
                    position_error_m * 1e3,
                    orientation_error_rad.to_degrees()
                )?;
                match joint_at_limit {
                    Some(joint) => write!(f, ", with joint {joint} at its limit"),
                    None => Ok(()),
                }
            }
            Self::Jump { joint, change_rad, allowed_rad } => write!(
                f,
                "joint {joint} would have to jump by {change_rad:.3} rad to go on: must be at most {allowed_rad:.3} rad from point to \
                 point; start from other joint angles"
            ),
            Self::Line { distance_m, length_m, reason } => write!(
                f,
                "straight line fails {:.1} mm from its start (of {:.1} mm): {reason}",
                distance_m * 1e3,
                length_m * 1e3
            ),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Line { reason, .. } => Some(reason.as_ref()),
            _ => None,
        }
    }
}

/// `Ok` if the value is finite and fulfils the condition.
pub(crate) fn check(
    name: &'static str,
    joint: Option<usize>,
    value: f64,
    right: bool,
    expected: &'static str,
) -> Result<(), Error> {
    if !value.is_finite() {
        Err(Error::not_finite(name, joint, value))
    } else if !right {
        Err(Error::Parameter { name, joint, value, expected })
    } else {
        Ok(())
    }
}

/// `Ok` if all values are finite; joints counted from 1 in the error.
pub(crate) fn check_finite_joints(name: &'static str, values: &[f64]) -> Result<(), Error> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(i) => Err(Error::not_finite(name, Some(i + 1), values[i])),
        None => Ok(()),
    }
}
