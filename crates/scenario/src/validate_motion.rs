//! Ranges of a motion; it has to reach the tissue.

use crate::load_ron::FieldError;
use crate::motion::{Motion, Segment};
use crate::range_checks::{CheckResult, check, finite, number_text, positive};
use crate::scenario::Scenario;

/// Larger numbers of samples or physics steps are rejected as typing errors.
const MAX_SAMPLES: f64 = 5e7;
const MAX_PHYSICS_STEPS: f64 = 1e9;
/// Steps shorter than 10 us do not improve the simulation.
const MAX_PHYSICS_HZ: f64 = 1e5;

/// Larger speeds are assumed to be in mm/s and rejected.
const MAX_SPEED_MPS: f64 = 1.0;

pub(crate) fn motion(s: &Scenario) -> CheckResult {
    match &s.motion {
        Motion::Constant { start_m, velocity_mps, duration_s } => {
            finite("motion.start_m", *start_m, "metres")?;
            speed("motion.velocity_mps", *velocity_mps)?;
            positive("motion.duration_s", *duration_s, "seconds")?;
        }
        Motion::Sinusoidal { start_m, amplitude_m, frequency_hz, phase_rad, duration_s } => {
            finite("motion.start_m", *start_m, "metres")?;
            positive("motion.amplitude_m", *amplitude_m, "metres")?;
            frequency("motion.frequency_hz".to_owned(), *frequency_hz, s.sample_hz)?;
            finite("motion.phase_rad", *phase_rad, "radians")?;
            positive("motion.duration_s", *duration_s, "seconds")?;
            let fastest_mps = amplitude_m * frequency_hz * core::f64::consts::TAU;
            if fastest_mps > MAX_SPEED_MPS {
                let what = format!(
                    "is {amplitude_m}, which at {frequency_hz} Hz makes {fastest_mps:.3} m/s; speeds are at most \
                     {MAX_SPEED_MPS} m/s; is this in millimetres?"
                );
                return Err(FieldError::new("motion.amplitude_m", what));
            }
        }
        Motion::Program { start_m, segments } => {
            finite("motion.start_m", *start_m, "metres")?;
            if segments.is_empty() {
                let what =
                    "is empty; give at least one, for example `Move(velocity_mps: 0.0023, duration_s: 20.0)`";
                return Err(FieldError::new("motion.segments", what));
            }
            for (i, segment) in segments.iter().enumerate() {
                check_segment(&format!("motion.segments[{i}]"), segment, s.sample_hz)?;
            }
        }
        Motion::Recorded => {}
    }
    reaches_tissue(s)
}

fn check_segment(at: &str, segment: &Segment, sample_hz: f64) -> CheckResult {
    positive(format!("{at}.duration_s"), segment.duration_s(), "seconds")?;
    match *segment {
        Segment::Move { velocity_mps, .. } => speed(format!("{at}.velocity_mps"), velocity_mps),
        Segment::Hold { .. } => Ok(()),
        Segment::Ripple { velocity_mps, amplitude_mps, frequency_hz, .. } => {
            speed(format!("{at}.velocity_mps"), velocity_mps)?;
            speed(format!("{at}.amplitude_mps"), amplitude_mps)?;
            frequency(format!("{at}.frequency_hz"), frequency_hz, sample_hz)
        }
    }
}

fn speed(path: impl Into<String>, value: f64) -> CheckResult {
    let right = format!("speeds are at most {MAX_SPEED_MPS} m/s; is this in mm/s?");
    check(path, value, value.abs() <= MAX_SPEED_MPS, &right)
}

fn frequency(path: String, value: f64, sample_hz: f64) -> CheckResult {
    let right = format!("it must lie between 0 and half of sample_hz, {} Hz", sample_hz / 2.0);
    check(path, value, value > 0.0 && value < sample_hz / 2.0, &right)
}

/// The motion must fit into memory and reach the tissue.
fn reaches_tissue(s: &Scenario) -> CheckResult {
    let Some(plan) = s.motion.plan() else {
        return Ok(());
    };
    let (seconds, samples) = (plan.duration_s(), plan.duration_s() * s.sample_hz);
    if samples > MAX_SAMPLES {
        let what = format!(
            "makes {samples:.3e} samples in {} s at {} Hz; at most {MAX_SAMPLES:.0e} are simulated: \
             shorten it or lower sample_hz",
            number_text(seconds),
            number_text(s.sample_hz)
        );
        return Err(FieldError::new("motion", what));
    }
    if samples < 2.0 {
        let what = format!("lasts {seconds} s, less than two samples at {} Hz; make it longer", s.sample_hz);
        return Err(FieldError::new("motion", what));
    }
    if seconds * s.physics_hz > MAX_PHYSICS_STEPS {
        let what = format!(
            "is {}, which makes {:.3e} steps in {} s; at most {MAX_PHYSICS_STEPS:.0e} are simulated: lower it",
            number_text(s.physics_hz),
            seconds * s.physics_hz,
            number_text(seconds)
        );
        return Err(FieldError::new("physics_hz", what));
    }
    check(
        "physics_hz",
        s.physics_hz,
        s.physics_hz <= MAX_PHYSICS_HZ,
        &format!(
            "steps of less than 10 us do not improve the simulation: at most {MAX_PHYSICS_HZ:.0e} Hz, for example 1000.0"
        ),
    )?;
    let (furthest_m, surface_m) = (plan.deepest_m(), s.tissue.surface_m);
    if furthest_m > surface_m {
        return Ok(());
    }
    let missing_mm = (surface_m - furthest_m) * 1e3;
    let what = format!(
        "never reaches the tissue: the tip comes to {furthest_m:.4} m and the surface lies at {surface_m} m, \
         {missing_mm:.3} mm further; start nearer, move longer, or move the other way"
    );
    Err(FieldError::new("motion", what))
}
