//! Insertion line of the arm: start pose, direction, approach and zeroing window of the virtual sensor, checked before a simulation.

use crate::load_ron::FieldError;
use crate::motion::MotionPoint;
use crate::motion_plan::MotionPlan;
use crate::robot_config::ArmConfig;
use crate::sensor_config::{VirtualSensor, ZeroWindow};
use nalgebra::{Matrix3, Vector3};
use stylet_dynamics::feasibility::{self, LineConfig};
use stylet_dynamics::{Arm, Error, JointVector, Pose};

/// Time constants of the slowest observer after which a residual counts as settled.
const SETTLING_TIME_CONSTANTS: f64 = 6.0;
/// Shortest approach, s: the disturbance observer of the arm's control settles in it.
const MIN_APPROACH_S: f64 = 0.5;

/// Line along which the arm inserts the needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmInsertionLine {
    /// Joint angles with the tip at the motion's start, rad.
    pub start_rad: JointVector<7>,
    /// Pose of the tip at the motion's start, base frame; its z is the needle's axis.
    pub start: Pose,
    /// Insertion direction, base frame, unit vector.
    pub direction: Vector3<f64>,
    /// Motion before time zero.
    pub approach: Approach,
    /// Start and end of the window in which the residual is averaged, s; negative times lie in the approach.
    pub zero_window_s: Option<(f64, f64)>,
}

/// Motion of the arm in air, before time zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Duration in s.
    pub duration_s: f64,
    /// Speed along the insertion axis in m/s.
    pub velocity_mps: f64,
}

impl ArmInsertionLine {
    /// Commanded point at `time_s`, which may be negative.
    #[inline]
    #[must_use]
    pub fn commanded_at(&self, plan: &MotionPlan, time_s: f64) -> MotionPoint {
        if time_s >= 0.0 {
            return plan.at(time_s);
        }
        let velocity_mps = self.approach.velocity_mps;
        let position_m = plan.at(0.0).position_m + velocity_mps * time_s;
        MotionPoint { position_m, velocity_mps, acceleration_mps2: 0.0 }
    }
}

impl ArmConfig {
    /// Line for a motion. Start pose and line are within the joint limits, without jumps and away from singular poses. The tissue starts at
    /// `surface_m`; the motion is sampled at `sample_hz`.
    ///
    /// # Errors
    /// A [`FieldError`] with the path of the field to change.
    pub fn insertion_line(
        &self,
        plan: &MotionPlan,
        surface_m: f64,
        sample_hz: f64,
        sensor: Option<&VirtualSensor>,
    ) -> Result<ArmInsertionLine, FieldError> {
        let arm = Arm::new(&self.model()).map_err(|e| FieldError::new("robot", e.to_string()))?;
        let near = JointVector::<7>::from(self.start_rad);
        let (mut start, mut direction) = self.start_pose(&arm)?;
        let first = plan.at(0.0);
        let contact_s = contact_s(plan, surface_m, sample_hz);
        let (approach, zero_s) = approach(&first, contact_s, sensor);

        let (mut low, mut high, mut speed) =
            (first.position_m, first.position_m, approach.velocity_mps.abs());
        low -= approach.velocity_mps * approach.duration_s;
        let samples = (plan.duration_s() * sample_hz).round().max(1.0) as usize;
        for k in 0..=samples {
            let point = plan.at(k as f64 / sample_hz);
            (low, high) = (low.min(point.position_m), high.max(point.position_m));
            speed = speed.max(point.velocity_mps.abs());
        }
        let config = LineConfig { speed_mps: speed, ..LineConfig::default() };
        let at = |z: f64| start.position_m + direction * (z - first.position_m);
        let follow = |to_m: f64, near: &JointVector<7>, part: &str| {
            feasibility::follow_line(&arm, &start, &at(to_m), near, &config).map_err(|error| {
                let remedy = match root_cause(&error) {
                    Error::Singular { .. } | Error::Jump { .. } => "start from other joint angles",
                    Error::JointLimit { .. } => "move more slowly or start from other joint angles",
                    _ => "start nearer to the middle of the arm's reach, or move less far",
                };
                FieldError::new(
                    self.field_to_change(),
                    format!("the arm cannot carry the needle {part}: {error}; {remedy}"),
                )
            })
        };
        let forward = follow(high, &near, "to the end of the motion")?;
        follow(low, &forward.start_rad, "along the approach")?;
        // The pose of these joint angles, so that the simulation starts without an error.
        start = arm.at(&forward.start_rad).tip();
        direction = start.rotation.column(2).into_owned();
        Ok(ArmInsertionLine {
            start_rad: forward.start_rad,
            start,
            direction,
            approach,
            zero_window_s: zero_s,
        })
    }

    /// Requested pose of the tip at the start of the motion, and insertion direction.
    fn start_pose(&self, arm: &Arm<7>) -> Result<(Pose, Vector3<f64>), FieldError> {
        let near = JointVector::<7>::from(self.start_rad);
        feasibility::check_joint_positions(arm, &near).map_err(|error| match &error {
            Error::JointLimit { joint, .. } => {
                FieldError::new(format!("robot.start_rad[{}]", joint - 1), error.to_string())
            }
            _ => FieldError::new("robot.start_rad", error.to_string()),
        })?;
        let mut pose = arm.at(&near).tip();
        if let Some(tip_m) = self.tip_m {
            pose.position_m = Vector3::from(tip_m);
        }
        let axis: Vector3<f64> = pose.rotation.column(2).into_owned();
        let direction = match self.direction {
            None => axis,
            Some(way) => {
                let way = Vector3::from(way);
                let length = way.norm();
                if !length.is_finite() || length < 1e-9 {
                    return Err(FieldError::new(
                        "robot.direction",
                        "is not a direction; give three numbers that are not all zero, for example (0.0, 0.0, -1.0)",
                    ));
                }
                way / length
            }
        };
        pose.rotation = rotation_between(&axis, &direction) * pose.rotation;
        Ok((pose, direction))
    }

    /// The field that most likely has to be changed when the line is not feasible.
    fn field_to_change(&self) -> &'static str {
        match (self.tip_m, self.direction) {
            (Some(_), _) => "robot.tip_m",
            (None, Some(_)) => "robot.direction",
            _ => "robot.start_rad",
        }
    }
}

fn root_cause(error: &Error) -> &Error {
    match error {
        Error::Line { reason, .. } => root_cause(reason),
        other => other,
    }
}

/// Time at which the commanded motion reaches the surface, s.
fn contact_s(plan: &MotionPlan, surface_m: f64, sample_hz: f64) -> f64 {
    let samples = (plan.duration_s() * sample_hz).round() as usize;
    (0..=samples)
        .map(|k| k as f64 / sample_hz)
        .find(|t| plan.at(*t).position_m >= surface_m)
        .unwrap_or_else(|| plan.duration_s())
}

/// Approach and zeroing window of the virtual sensor.
fn approach(
    first: &MotionPoint,
    contact_s: f64,
    sensor: Option<&VirtualSensor>,
) -> (Approach, Option<(f64, f64)>) {
    let moving = first.velocity_mps.max(0.0);
    let still = Approach { duration_s: MIN_APPROACH_S, velocity_mps: moving };
    let Some(sensor) = sensor else { return (still, None) };
    let settle_s = SETTLING_TIME_CONSTANTS / sensor.gain_per_s.smallest();
    match sensor.zero {
        ZeroWindow::BeforeContact { lead_s, average_s } => {
            let until_s = contact_s - lead_s;
            let from_s = until_s - average_s;
            let duration_s = MIN_APPROACH_S.max(settle_s - from_s);
            (Approach { duration_s, ..still }, Some((from_s, until_s)))
        }
        ZeroWindow::AtRest { average_s } => {
            let duration_s = MIN_APPROACH_S.max(settle_s + average_s);
            (Approach { duration_s, velocity_mps: 0.0 }, Some((-average_s, 0.0)))
        }
        ZeroWindow::Never => (Approach { duration_s: MIN_APPROACH_S.max(settle_s), ..still }, None),
    }
}

/// The smallest rotation that maps the unit vector `from` to `to`.
fn rotation_between(from: &Vector3<f64>, to: &Vector3<f64>) -> Matrix3<f64> {
    let (axis, cosine) = (from.cross(to), from.dot(to));
    if cosine < -1.0 + 1e-12 {
        // Half a turn about any perpendicular axis.
        let perpendicular = if from.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
        let n = (perpendicular - from * from.dot(&perpendicular)).normalize();
        return n * n.transpose() * 2.0 - Matrix3::identity();
    }
    let k = axis.cross_matrix();
    Matrix3::identity() + k + k * k / (1.0 + cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rotation_maps_one_axis_to_the_other() {
        let z = Vector3::new(0.0, 0.0, -1.0);
        for to in [z, -z, Vector3::x(), Vector3::new(0.3, -0.5, 0.2).normalize()] {
            let r = rotation_between(&z, &to);
            assert!((r * z - to).norm() < 1e-12);
            assert!((r.transpose() * r - Matrix3::identity()).amax() < 1e-12);
            assert!((r.determinant() - 1.0).abs() < 1e-12);
        }
    }
}
