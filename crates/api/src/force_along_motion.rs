//! Force of a scenario along a recorded motion.

use crate::error::Error;
use stylet_record::Recording;
use stylet_scenario::{ForceTorque, MotionPoint, Scenario};
use stylet_testbed::{ForceSensor, SimulateError};
use stylet_tissue::{ForceLaw, ForceLawState, MeasurementChain};

/// Force (N, one value per sample) of a scenario's tissue, effects and noise-free sensor along the motion of a recording. The force law is
/// stepped once per sample on the recorded position and velocity. The scenario's motion, robot and noise are not used, nor is the recorded
/// force.
///
/// # Errors
/// [`Error::Simulate`] when the scenario has more effects than the force law supports.
pub fn force_along_motion(scenario: &Scenario, motion: &Recording) -> Result<Vec<f64>, Error> {
    let law = ForceLaw::new(&scenario.tissue, &scenario.effects)
        .map_err(|why| Error::Simulate { file: scenario.name.clone(), why: SimulateError::Effects(why) })?;
    let noise_free =
        ForceTorque { noise_n: 0.0, ..scenario.sensor.force_torque().cloned().unwrap_or_default() };
    let mut measuring = ForceSensor::new(&scenario.effects, &noise_free, 0, motion.sample_hz());
    let chain = MeasurementChain::new(&scenario.effects);
    let mut state = ForceLawState::default();
    let mut before: Option<(f64, f64)> = None;
    let mut force_n = Vec::with_capacity(motion.len());
    for s in motion.samples() {
        let (position_m, velocity_mps) =
            (chain.true_position(s.position_m), chain.true_position(s.velocity_mps));
        let acceleration_mps2 = before.map_or(0.0, |(t, v)| (velocity_mps - v) / (s.time_s - t));
        before = Some((s.time_s, velocity_mps));
        let force = law.step(&mut state, s.time_s, position_m, velocity_mps, &mut |_| {});
        let at = MotionPoint { position_m, velocity_mps, acceleration_mps2 };
        force_n.push(measuring.measure_force(s.time_s, &at, force.total_n));
    }
    Ok(force_n)
}
