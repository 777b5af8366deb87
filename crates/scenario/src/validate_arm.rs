//! Ranges of arm and virtual sensor; feasibility of the insertion line.

use crate::arm_joint_friction::ArmFriction;
use crate::load_ron::FieldError;
use crate::range_checks::{CheckResult, check, finite, not_negative, positive};
use crate::robot_config::{ArmConfig, Robot};
use crate::scenario::Scenario;
use crate::sensor_config::{VirtualSensor, ZeroWindow};

/// Smallest observer gain in 1/s: it settles within a minute.
const MIN_OBSERVER_GAIN_PER_S: f64 = 0.1;

/// Checks robot and virtual sensor; tissue and motion were checked before.
pub(crate) fn robot(s: &Scenario) -> CheckResult {
    let sensor = s.sensor.virtual_sensor();
    let Robot::Arm(arm) = &s.robot else {
        return match sensor {
            None => Ok(()),
            Some(_) => Err(FieldError::new(
                "sensor",
                "is a virtual sensor, which requires joint torques, and the robot has no joints; \
                 write robot: Arm(), or sensor: ForceTorque(...)",
            )),
        };
    };
    ranges(arm, s.physics_hz)?;
    if let Some(plan) = s.motion.plan() {
        arm.insertion_line(&plan, s.tissue.surface_m, s.sample_hz, sensor)?;
    }
    Ok(())
}

fn ranges(arm: &ArmConfig, physics_hz: f64) -> CheckResult {
    for (i, q) in arm.start_rad.iter().enumerate() {
        finite(format!("robot.start_rad[{i}]"), *q, "radians")?;
    }
    for (i, x) in arm.tip_m.iter().flatten().enumerate() {
        finite(format!("robot.tip_m[{i}]"), *x, "metres")?;
    }
    for (i, x) in arm.direction.iter().flatten().enumerate() {
        finite(format!("robot.direction[{i}]"), *x, "any unit")?;
    }
    let c = &arm.controller;
    let fastest = 0.5 * physics_hz;
    let per_step = |field: &str, value: f64, least: bool| {
        check(
            format!("robot.controller.{field}"),
            value,
            (value > 0.0 || (least && value == 0.0)) && value <= fastest,
            &format!("it must be positive and at most half of physics_hz, {fastest} /s, to be stable"),
        )
    };
    per_step("natural_frequency_radps", c.natural_frequency_radps, false)?;
    per_step("elbow_damping_per_s", c.elbow_damping_per_s, true)?;
    per_step("disturbance_gain_per_s", c.disturbance_gain_per_s, true)?;
    friction(&arm.joint_friction)?;
    not_negative("robot.friction_scale", arm.friction_scale, "times the friction")?;
    let payload_kg = arm.model().tool.payload.mass_kg;
    check(
        "robot.payload_error_kg",
        arm.payload_error_kg,
        arm.payload_error_kg > -payload_kg,
        &format!("it must be above -{payload_kg} kg, the payload itself"),
    )?;
    check(
        "robot.link_mass_error",
        arm.link_mass_error,
        arm.link_mass_error.abs() <= 0.5,
        "it must lie between -0.5 and 0.5 (it is relative: 0.03 is three per cent)",
    )
}

fn friction(friction: &ArmFriction) -> CheckResult {
    let at = |i: usize, field: &str| format!("robot.joint_friction.joints[{i}].{field}");
    let opposing = |path: String, value: f64, unit: &str| {
        check(
            path,
            value,
            value >= 0.0,
            &format!("it must be zero or a positive number of {unit}: friction opposes the motion"),
        )
    };
    match friction {
        ArmFriction::None | ArmFriction::Measured | ArmFriction::MeasuredDirectional => {}
        ArmFriction::PerJoint { joints } => {
            for (i, j) in joints.iter().enumerate() {
                opposing(at(i, "coulomb_nm"), j.coulomb_nm, "N m")?;
                opposing(at(i, "viscous_nms_per_rad"), j.viscous_nms_per_rad, "N m s/rad")?;
            }
        }
        ArmFriction::Sigmoid { joints } => {
            for (i, j) in joints.iter().enumerate() {
                opposing(at(i, "amplitude_nm"), j.amplitude_nm, "N m")?;
                positive(at(i, "steepness_s_per_rad"), j.steepness_s_per_rad, "s/rad")?;
                finite(at(i, "shift_radps"), j.shift_radps, "rad/s")?;
            }
        }
    }
    friction
        .friction_models(1.0)
        .validate()
        .map_err(|error| FieldError::new("robot.joint_friction", error.to_string()))
}

/// Checks a virtual sensor with the path `at`.
pub(crate) fn virtual_sensor(at: &str, c: &VirtualSensor, physics_hz: f64) -> CheckResult {
    let same = matches!(c.gain_per_s, crate::ObserverGain::Uniform(_));
    for (i, gain) in c.gain_per_s.per_joint().into_iter().enumerate() {
        let path = if same { format!("{at}.gain_per_s") } else { format!("{at}.gain_per_s[{i}]") };
        check(
            path,
            gain,
            gain >= MIN_OBSERVER_GAIN_PER_S,
            &format!("it must be at least {MIN_OBSERVER_GAIN_PER_S} /s; 5.0 is a lag of 0.2 s"),
        )?;
    }
    not_negative(format!("{at}.torque_noise_nm"), c.torque_noise_nm, "N m")?;
    let average = |average_s: f64| {
        check(
            format!("{at}.zero.average_s"),
            average_s,
            average_s * physics_hz >= 1.0 && average_s <= 60.0,
            "it must be positive, at least one physics step, and at most 60 s",
        )
    };
    match c.zero {
        ZeroWindow::BeforeContact { lead_s, average_s } => {
            not_negative(format!("{at}.zero.lead_s"), lead_s, "seconds")?;
            check(format!("{at}.zero.lead_s"), lead_s, lead_s <= 60.0, "it must be at most 60 s")?;
            average(average_s)
        }
        ZeroWindow::AtRest { average_s } => average(average_s),
        ZeroWindow::Never => Ok(()),
    }
}
