//! Ranges of a scenario's values.

use crate::load_ron::FieldError;
use crate::range_checks::{CheckResult, check, finite, plausible, positive};
use crate::scenario::Scenario;
use crate::sensor_config::{ForceTorque, Sensor};
use crate::validate_arm;
use crate::validate_effects::effects;
use crate::validate_enhancer::enhance;
use crate::validate_motion::motion;

/// Largest stiffness in N/m and friction in N s/m² of a layer; a block of steel of a needle's size has 1e9 N/m.
const MAX_COEFFICIENT: f64 = 1e9;
/// Largest force in N, as for measured samples.
const MAX_FORCE_N: f64 = 1e6;

impl Scenario {
    /// Checks the range of every value.
    ///
    /// # Errors
    /// The first [`FieldError`], with the path of the field.
    pub fn check(&self) -> Result<(), FieldError> {
        scenario(self)
    }
}

fn scenario(s: &Scenario) -> CheckResult {
    if s.name.trim().is_empty() {
        return Err(FieldError::new("name", "is empty; say what the scenario is"));
    }
    tissue(s)?;
    effects(s)?;
    check("sample_hz", s.sample_hz, s.sample_hz > 0.0, "it must be positive, for example 200.0")?;
    check("physics_hz", s.physics_hz, s.physics_hz > 0.0, "it must be positive, for example 1000.0")?;
    check(
        "tolerance",
        s.tolerance,
        s.tolerance > 0.0 && s.tolerance <= 1.0,
        "it must be above 0 and at most 1",
    )?;
    let within = |x: f64| (0.0..1.0).contains(&x);
    check(
        "thickness_tolerance",
        s.thickness_tolerance,
        within(s.thickness_tolerance),
        "it must be zero or positive and below 1",
    )?;
    check(
        "surface_tolerance_m",
        s.surface_tolerance_m,
        within(s.surface_tolerance_m),
        "it must be zero or positive and below 1 m",
    )?;
    motion(s)?;
    sensors(&s.sensor, s.physics_hz)?;
    validate_arm::robot(s)?;
    if let Some(config) = &s.enhance_virtual {
        enhance("enhance_virtual", config)?;
    }
    enhance("enhance", &s.enhance)
}

fn tissue(s: &Scenario) -> CheckResult {
    finite("tissue.surface_m", s.tissue.surface_m, "metres")?;
    if s.tissue.layers.is_empty() {
        return Err(FieldError::new("tissue.layers", "has no layer; give at least one"));
    }
    for (i, layer) in s.tissue.layers.iter().enumerate() {
        let at = |field: &str| format!("tissue.layers[{i}].{field}");
        positive(at("thickness_m"), layer.thickness_m, "metres")?;
        check(
            at("thickness_m"),
            layer.thickness_m,
            layer.thickness_m <= 1.0,
            "a layer is at most 1 m thick; is this in millimetres?",
        )?;
        plausible(at("stiffness_n_per_m"), layer.stiffness_n_per_m, MAX_COEFFICIENT, "N/m")?;
        plausible(at("friction_ns_per_m2"), layer.friction_ns_per_m2, MAX_COEFFICIENT, "N s/m²")?;
        if let Some(force) = layer.puncture_n {
            positive(at("puncture_n"), force, "N")?;
            plausible(at("puncture_n"), force, MAX_FORCE_N, "N")?;
        }
    }
    Ok(())
}

fn sensors(sensor: &Sensor, physics_hz: f64) -> CheckResult {
    match sensor {
        Sensor::ForceTorque(config) => force_torque("sensor", config),
        Sensor::Virtual(config) => validate_arm::virtual_sensor("sensor", config, physics_hz),
        Sensor::Both { force_torque: config, virtual_sensor } => {
            force_torque("sensor.force_torque", config)?;
            validate_arm::virtual_sensor("sensor.virtual_sensor", virtual_sensor, physics_hz)
        }
    }
}

fn force_torque(at: &str, c: &ForceTorque) -> CheckResult {
    plausible(format!("{at}.noise_n"), c.noise_n, MAX_FORCE_N, "N")?;
    check(format!("{at}.ar1"), c.ar1, c.ar1 > -1.0 && c.ar1 < 1.0, "it must lie between -1 and 1")?;
    finite(format!("{at}.bias_n"), c.bias_n, "N")?;
    finite(format!("{at}.drift_n_per_s"), c.drift_n_per_s, "N/s")?;
    plausible(format!("{at}.quantisation_n"), c.quantisation_n, MAX_FORCE_N, "N")?;
    match c.range_n {
        Some(range) => positive(format!("{at}.range_n"), range, "N"),
        None => Ok(()),
    }
}
