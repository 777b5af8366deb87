//! Feasibility of a straight line of the tip: joint limits, singular poses, jumps.

use crate::arm_posture::{Arm, JointVector, Posture};
use crate::error::{Error, JointQuantity, check, check_finite_joints};
use crate::inverse_kinematics::IkConfig;
use crate::pose::Pose;
use nalgebra::{Vector3, Vector6};

/// `Ok` if every joint angle is within its limits.
pub fn check_joint_positions<const N: usize>(arm: &Arm<N>, q_rad: &JointVector<N>) -> Result<(), Error> {
    check_finite_joints("q_rad", q_rad.as_slice())?;
    let limits = arm.limits();
    within(q_rad, JointQuantity::Position, |i| (limits[i].lower_rad, limits[i].upper_rad))
}

/// `Ok` if every joint rate is within its limits.
pub fn check_joint_velocities<const N: usize>(arm: &Arm<N>, qd_radps: &JointVector<N>) -> Result<(), Error> {
    check_finite_joints("qd_radps", qd_radps.as_slice())?;
    let limits = arm.limits();
    within(qd_radps, JointQuantity::Velocity, |i| (-limits[i].velocity_radps, limits[i].velocity_radps))
}

/// `Ok` if every joint torque is within its limits.
pub fn check_joint_torques<const N: usize>(arm: &Arm<N>, torque_nm: &JointVector<N>) -> Result<(), Error> {
    check_finite_joints("torque_nm", torque_nm.as_slice())?;
    let limits = arm.limits();
    within(torque_nm, JointQuantity::Torque, |i| (-limits[i].torque_nm, limits[i].torque_nm))
}

fn within<const N: usize>(
    values: &JointVector<N>,
    quantity: JointQuantity,
    range: impl Fn(usize) -> (f64, f64),
) -> Result<(), Error> {
    for (i, &value) in values.iter().enumerate() {
        let (lower, upper) = range(i);
        if !(lower..=upper).contains(&value) {
            return Err(Error::JointLimit { joint: i + 1, quantity, value, lower, upper });
        }
    }
    Ok(())
}

/// `Ok`, with the smallest singular value of the tip Jacobian, if that is at least `threshold` (m and rad
/// weigh the same).
pub fn check_not_singular<const N: usize>(at: &Posture<'_, N>, threshold: f64) -> Result<f64, Error> {
    check("threshold", None, threshold, threshold >= 0.0, "zero or positive")?;
    let smallest_singular_value = at.singular_values().smallest();
    if smallest_singular_value >= threshold {
        Ok(smallest_singular_value)
    } else {
        Err(Error::Singular { smallest_singular_value, threshold })
    }
}

/// Requirements of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineConfig {
    /// Distance between checked points.
    pub spacing_m: f64,
    /// Smallest allowed singular value of the tip Jacobian; 0.02 leaves joint rates of at most 50 rad per
    /// metre of tip travel.
    pub min_singular_value: f64,
    /// Speed of the tip, for the joints' velocity limits.
    pub speed_mps: f64,
    /// Largest change of a joint angle from one point to the next.
    pub max_jump_rad: f64,
    /// Inverse kinematics at the first point; further points start from the previous one, without restarts.
    pub ik: IkConfig,
}

impl Default for LineConfig {
    fn default() -> Self {
        Self {
            spacing_m: 0.002,
            min_singular_value: 0.02,
            speed_mps: 0.0,
            max_jump_rad: 0.2,
            ik: IkConfig::default(),
        }
    }
}

/// A line that the tip can follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeasibleLine<const N: usize> {
    /// Joint angles at its start.
    pub start_rad: JointVector<N>,
    /// Joint angles at its end, reached without a jump.
    pub end_rad: JointVector<N>,
    /// Smallest singular value of the tip Jacobian along the line.
    pub min_singular_value: f64,
    /// Smallest distance of a joint from a limit along the line.
    pub min_margin_rad: f64,
}

/// Follows the straight line of the tip from `from` to the position `to_m` (base coordinates) with the
/// orientation of `from`. The error says where it fails first and why: [`Error::Line`] around
/// [`Error::Unreachable`], [`Error::Jump`], [`Error::Singular`] or [`Error::JointLimit`] (velocity).
pub fn follow_line<const N: usize>(
    arm: &Arm<N>,
    from: &Pose,
    to_m: &Vector3<f64>,
    near_rad: &JointVector<N>,
    config: &LineConfig,
) -> Result<FeasibleLine<N>, Error> {
    let LineConfig { spacing_m, speed_mps, .. } = *config;
    check("spacing_m", None, spacing_m, spacing_m > 0.0, "positive")?;
    check("speed_mps", None, speed_mps, speed_mps >= 0.0, "zero or positive")?;
    check("max_jump_rad", None, config.max_jump_rad, config.max_jump_rad > 0.0, "positive")?;
    config.ik.validate()?;
    from.validate("from", None)?;
    for &x in to_m {
        check("to_m", None, x, true, "")?;
    }
    let displacement_m = to_m - from.position_m;
    let length_m = displacement_m.norm();
    let pieces = libm::ceil(length_m / spacing_m);
    check("spacing_m", None, spacing_m, pieces <= 1e6, "at least a millionth of the line's length")?;
    let pieces = pieces as u32;

    let mut found: Option<FeasibleLine<N>> = None;
    for k in 0..=pieces {
        let fraction = if pieces == 0 { 0.0 } else { f64::from(k) / f64::from(pieces) };
        let target =
            Pose { rotation: from.rotation, position_m: from.position_m + displacement_m * fraction };
        let step = point(arm, &target, &displacement_m, near_rad, found.as_ref(), config);
        found = Some(step.map_err(|reason| Error::Line {
            distance_m: fraction * length_m,
            length_m,
            reason: Box::new(reason),
        })?);
    }
    found.ok_or(Error::not_finite("to_m", None, length_m))
}

/// One point of the line, continued from the point before.
fn point<const N: usize>(
    arm: &Arm<N>,
    target: &Pose,
    displacement_m: &Vector3<f64>,
    near_rad: &JointVector<N>,
    before: Option<&FeasibleLine<N>>,
    config: &LineConfig,
) -> Result<FeasibleLine<N>, Error> {
    let q = match before {
        None => arm.inverse_kinematics(target, near_rad, &config.ik)?,
        Some(line) => {
            arm.inverse_kinematics(target, &line.end_rad, &IkConfig { restarts: 0, ..config.ik })?
        }
    };
    if let Some(line) = before {
        let change = q - line.end_rad;
        let i = change.icamax();
        let (change_rad, allowed_rad) = (change[i], config.max_jump_rad);
        if change_rad.abs() > allowed_rad {
            return Err(Error::Jump { joint: i + 1, change_rad, allowed_rad });
        }
    }
    let at = arm.at(&q);
    let smallest = check_not_singular(&at, config.min_singular_value)?;
    if displacement_m.norm() > 0.0 {
        let v = displacement_m * (config.speed_mps / displacement_m.norm());
        check_joint_velocities(arm, &at.joint_rates(&Vector6::new(v.x, v.y, v.z, 0.0, 0.0, 0.0), 0.0))?;
    }
    let margin = arm
        .limits()
        .iter()
        .zip(q.iter())
        .fold(f64::INFINITY, |least, (l, q)| least.min(q - l.lower_rad).min(l.upper_rad - q));
    Ok(FeasibleLine {
        start_rad: before.map_or(q, |line| line.start_rad),
        end_rad: q,
        min_singular_value: before.map_or(smallest, |line| line.min_singular_value.min(smallest)),
        min_margin_rad: before.map_or(margin, |line| line.min_margin_rad.min(margin)),
    })
}
