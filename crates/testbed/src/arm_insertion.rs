//! An insertion by the arm: approach, zeroing of the virtual sensor, recording.

use crate::arm_simulation::{ArmError, ArmSimulation};
use crate::slide_insertion::{InsertionSample, SampleRates, VelocityAtStepEnd};
use stylet_dynamics::{Error, JointVector};
use stylet_scenario::{ArmConfig, ArmInsertionLine, MotionPlan, VirtualSensor};
use stylet_tissue::{ForceLaw, ForceLawState, Rupture};

/// Arm, line and virtual sensor of an insertion.
#[derive(Clone, Copy, Debug)]
pub struct ArmSetup<'a> {
    /// The arm.
    pub config: &'a ArmConfig,
    /// Its checked line.
    pub line: &'a ArmInsertionLine,
    /// The virtual sensor, if it records.
    pub sensor: Option<&'a VirtualSensor>,
    /// Seed of the torque noise.
    pub seed: u64,
}

/// Recorded columns of the arm, one value per sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ArmRecording {
    /// Measured joint torques, N m.
    pub joint_torque_nm: Vec<[f64; 7]>,
    /// Axial force of the virtual sensor, N; empty without one.
    pub virtual_force_n: Vec<f64>,
    /// Time from which the virtual sensor is zeroed, s; online algorithms start there.
    pub zeroed_s: f64,
    /// Largest distance of the tip from the line, m.
    pub lateral_deviation_m: f64,
}

/// Insertion by the arm. The force law is evaluated at every physics step at the tip's actual position and velocity; its force acts on the tip. The
/// observer of the virtual sensor runs at the physics rate from the start of the approach.
///
/// # Errors
/// [`ArmError`] when the arm leaves its limits.
pub fn simulate_on_arm(
    plan: &MotionPlan,
    law: &ForceLaw,
    rates: &SampleRates,
    setup: &ArmSetup<'_>,
    mut on_rupture: impl FnMut(Rupture),
    mut sink: impl FnMut(&InsertionSample),
) -> Result<ArmRecording, ArmError> {
    let ArmSetup { config, line, sensor, seed } = *setup;
    let steps = rates.steps_per_sample.max(1) as i64;
    let physics_hz = rates.sample_hz * steps as f64;
    let before = (line.approach.duration_s * physics_hz).ceil() as i64;
    let start_m = plan.at(0.0).position_m;
    let first = line.commanded_at(plan, -(before as f64) / physics_hz);
    let mut simulation: ArmSimulation =
        ArmSimulation::new(config, sensor, line, &first, start_m, 1.0 / physics_hz, seed)?;

    let mut zero = Zeroing::new(line.zero_window_s, physics_hz);
    let mut record = ArmRecording { zeroed_s: zero.until_s(physics_hz), ..ArmRecording::default() };
    let mut state = ForceLawState::default();
    let mut motion = VelocityAtStepEnd::new(first, 1.0 / physics_hz);
    for k in -before..rates.samples as i64 * steps {
        let time_s = k as f64 / physics_hz;
        let during_motion = |reason: Error| ArmError::DuringMotion { time_s, reason };
        let sampled = k >= 0 && k % steps == 0;
        let mut force = None;
        let (mut velocity_mps, mut acceleration_mps2) = (0.0, 0.0);
        let arm_step = simulation
            .step(&line.commanded_at(plan, time_s), sampled, |position_m, body_mps| {
                (velocity_mps, acceleration_mps2) = motion.at_step_end(body_mps);
                if k < 0 {
                    return 0.0;
                }
                let tissue = law.step(&mut state, time_s, position_m, velocity_mps, &mut on_rupture);
                force = Some(tissue);
                tissue.total_n
            })
            .map_err(during_motion)?;
        if let (true, Some(force)) = (sampled, force) {
            record.joint_torque_nm.push(arm_step.joint_torque_nm.into());
            record.virtual_force_n.extend(arm_step.virtual_force_n);
            record.lateral_deviation_m = record.lateral_deviation_m.max(arm_step.lateral_deviation_m);
            zero.keep(&arm_step.q_rad);
            sink(&InsertionSample {
                time_s: (k / steps) as f64 / rates.sample_hz,
                position_m: arm_step.position_m,
                velocity_mps,
                acceleration_mps2,
                force,
            });
        }
        motion.advance(line.commanded_at(plan, (k + 1) as f64 / physics_hz));
        zero.step(k, &mut simulation, &mut record.virtual_force_n).map_err(during_motion)?;
    }
    Ok(record)
}

/// Averages the residual over a window and subtracts it from all samples, those recorded before included.
struct Zeroing {
    /// First and last step of the window.
    window: Option<(i64, i64)>,
    /// Joint angles of the samples recorded before the end of the window.
    pending: Vec<JointVector<7>>,
}

impl Zeroing {
    fn new(zero_s: Option<(f64, f64)>, physics_hz: f64) -> Self {
        let step = |t: f64| (t * physics_hz).round() as i64;
        let window = zero_s.map(|(from, until)| (step(from), step(until).max(step(from) + 1)));
        Self { window, pending: Vec::new() }
    }

    fn until_s(&self, physics_hz: f64) -> f64 {
        self.window.map_or(0.0, |(_, until)| (until as f64 / physics_hz).max(0.0))
    }

    fn keep(&mut self, q_rad: &JointVector<7>) {
        if self.window.is_some() {
            self.pending.push(*q_rad);
        }
    }

    /// Updates the window after step `k`.
    fn step(&mut self, k: i64, simulation: &mut ArmSimulation, recorded_n: &mut [f64]) -> Result<(), Error> {
        let Some((from, until)) = self.window else { return Ok(()) };
        if k == from
            && let Some(observer) = simulation.observer_mut()
        {
            observer.begin_zeroing();
        }
        if k == until {
            self.window = None;
            let zero = simulation.observer_mut().map(|observer| observer.finish_zeroing()).transpose()?;
            for (value, q) in recorded_n.iter_mut().zip(self.pending.drain(..)) {
                *value -= zero.map_or(0.0, |zero| simulation.axial_force_n(&q, &zero));
            }
        }
        Ok(())
    }
}
