//! Simulates a whole scenario: motion, robot, tissue and sensors.

use crate::arm_insertion::{ArmRecording, ArmSetup, simulate_on_arm};
use crate::arm_simulation::ArmError;
use crate::force_sensor::ForceSensor;
use crate::slide_insertion::{InsertionSample, SampleRates, simulate_on_slide, simulate_replay};
use crate::virtual_sensor_accuracy::VirtualSensorAccuracy;
use stylet_record::{LayerTruth, Recording, TrueRupture, Truth};
use stylet_scenario::{FieldError, ForceTorque, MotionPlan, MotionPoint, Robot, Scenario, Sensor};
use stylet_tissue::{AnyEffect, ChainStage, Effect, ForceLaw, Rupture, Slab, TooManyEffects};

/// Error of a simulation.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// `motion: Recorded` does not define a motion.
    #[error(
        "the motion is `Recorded`: it comes with measured data; give the scenario a motion to simulate it"
    )]
    NoMotion,
    /// More effects act on the tissue than a force law supports.
    #[error(transparent)]
    Effects(#[from] TooManyEffects),
    /// A value is out of range; scenarios that were checked have none.
    #[error("{}: {}", .0.path, .0.message)]
    InvalidScenario(FieldError),
    /// A custom effect gives a value that is not finite or too large.
    #[error(
        "the force is {force_n} N at {time_s} s with {effects}: the equation has no value there, or grows without limit; change its parameters, or the \
         equation"
    )]
    NotFinite {
        /// The force in N.
        force_n: f64,
        /// When, in s.
        time_s: f64,
        /// Ids of the effects that are not in the library.
        effects: String,
    },
    /// The arm cannot execute the motion.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// A combination that cannot be simulated.
    #[error("{what} cannot be simulated by this version; {remedy}")]
    NotSupported {
        /// What is not supported.
        what: &'static str,
        /// What can be written instead.
        remedy: &'static str,
    },
}

/// Result of a simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// The recording of the sensors.
    pub recording: Recording,
    /// Ground truth, one value per sample.
    pub truth: Truth,
    /// The layers, after geometric effects.
    pub slabs: Vec<Slab>,
    /// Force of each sensor, force/torque first.
    pub readings: Vec<SensorReadings>,
    /// Error and lag of the virtual sensor.
    pub virtual_sensor_accuracy: Option<VirtualSensorAccuracy>,
    /// True motion of the needle, one value per sample.
    pub motion: Vec<MotionPoint>,
    /// Effects, sensor and sampling rate (Hz) of the force/torque sensor.
    sensor: Option<(Vec<AnyEffect>, ForceTorque, f64)>,
}

impl Simulation {
    /// Ground truth of the layers, for the scores.
    #[must_use]
    pub fn true_layers(&self) -> Vec<LayerTruth> {
        true_layers(&self.slabs)
    }

    /// Recorded force (N, one value per sample) of the same insertion with the noise of another seed. Noise does not act on the motion, which is not
    /// simulated again. `None` without a force/torque sensor.
    #[must_use]
    pub fn measured_with_seed(&self, seed: u64) -> Option<Vec<f64>> {
        let (effects, sensor, sample_hz) = self.sensor.as_ref()?;
        Some(self.measured_by(effects, sensor, *sample_hz, seed))
    }

    /// Recorded force (N, one value per sample) of the same insertion with another force/torque sensor.
    #[must_use]
    pub fn measured_by(
        &self,
        effects: &[AnyEffect],
        sensor: &ForceTorque,
        sample_hz: f64,
        seed: u64,
    ) -> Vec<f64> {
        let mut force_sensor = ForceSensor::new(effects, sensor, seed, sample_hz);
        let samples = self.recording.time_s.iter().zip(&self.motion).zip(&self.truth.tissue_force_n);
        samples.map(|((time_s, at), tissue_n)| force_sensor.measure_force(*time_s, at, *tissue_n)).collect()
    }
}

/// Ground truth of placed layers.
#[must_use]
pub fn true_layers(slabs: &[Slab]) -> Vec<LayerTruth> {
    let truth = |slab: &Slab| LayerTruth {
        front_m: slab.front_m,
        thickness_m: slab.thickness_m,
        stiffness_n_per_m: slab.stiffness_n_per_m,
        friction_ns_per_m2: slab.friction_ns_per_m2,
    };
    slabs.iter().map(truth).collect()
}

/// Recorded force of one sensor, the input of an online algorithm.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorReadings {
    /// `force_torque` or `virtual`.
    pub sensor: &'static str,
    /// Axial force in N, one value per sample; NaN until the sensor is zeroed.
    pub force_n: Vec<f64>,
}

/// Sampling of a scenario.
#[must_use]
pub fn sample_rates(scenario: &Scenario, duration_s: f64) -> SampleRates {
    SampleRates {
        sample_hz: scenario.sample_hz,
        steps_per_sample: (scenario.physics_hz / scenario.sample_hz - 1e-9).ceil().max(1.0) as usize,
        samples: (duration_s * scenario.sample_hz).round().max(2.0) as usize,
    }
}

/// Simulates a scenario with the noise of `seed`. The same scenario and seed give the same bits.
///
/// # Errors [`SimulateError`] when the scenario does not define a motion or cannot be simulated.
pub fn simulate(scenario: &Scenario, seed: u64) -> Result<Simulation, SimulateError> {
    let plan = scenario.motion.plan().ok_or(SimulateError::NoMotion)?;
    let law = ForceLaw::new(&scenario.tissue, &scenario.effects)?;
    let ideal = ForceTorque { noise_n: 0.0, ..ForceTorque::default() };
    let sensor = match scenario.sensor.force_torque() {
        Some(sensor) => sensor,
        None => {
            let in_chain = |e: &AnyEffect| {
                matches!(e.stage(), ChainStage::Tool | ChainStage::Sensor) && !e.is_inactive()
            };
            if scenario.effects.iter().any(in_chain) {
                return Err(SimulateError::NotSupported {
                    what: "an effect of tool or force/torque sensor with `sensor: Virtual`",
                    remedy: "use sensor: Both(...), or give the arm friction and model errors instead",
                });
            }
            &ideal
        }
    };
    let mut force_sensor = ForceSensor::new(&scenario.effects, sensor, seed, scenario.sample_hz);
    let rates = sample_rates(scenario, plan.duration_s());
    check_custom_effects(scenario, &plan, &law, &rates)?;
    let mut ruptures = Vec::new();
    let mut columns = Columns::with_capacity(rates.samples, scenario.tissue.surface_m);
    let on_rupture = |r: Rupture| {
        ruptures.push(TrueRupture {
            layer: r.layer,
            time_s: r.time_s,
            position_m: r.position_m,
            by_force: r.by_force,
        });
    };
    let sink = |s: &InsertionSample| columns.push(s, &mut force_sensor);
    let mut arm = None;
    match &scenario.robot {
        Robot::Arm(config) => {
            let sensor = scenario.sensor.virtual_sensor();
            let line = config
                .insertion_line(&plan, scenario.tissue.surface_m, scenario.sample_hz, sensor)
                .map_err(SimulateError::InvalidScenario)?;
            let setup = ArmSetup { config, line: &line, sensor, seed };
            arm = Some(simulate_on_arm(&plan, &law, &rates, &setup, on_rupture, sink)?);
        }
        _ if scenario.sensor.virtual_sensor().is_some() => {
            return Err(SimulateError::NotSupported {
                what: "a virtual sensor without an arm",
                remedy: "use robot: Arm()",
            });
        }
        Robot::Slide => simulate_on_slide(&plan, &law, &rates, on_rupture, sink),
        Robot::Replay => simulate_replay(&plan, &law, &rates, on_rupture, sink),
    }
    // The force law reports positions relative to the tissue; the recorded position is the truth.
    for rupture in &mut ruptures {
        rupture.position_m = columns.recorded_m(rupture.time_s).unwrap_or(rupture.position_m);
    }
    columns.truth.ruptures = ruptures;
    let mut recording = columns.recording;
    let zeroed_s = arm.as_ref().map_or(0.0, |arm| arm.zeroed_s);
    let readings = readings(&mut recording, arm, &scenario.sensor);
    let virtual_sensor_accuracy = VirtualSensorAccuracy::compare(&recording, &columns.truth, zeroed_s);
    let slabs = law.slabs().to_vec();
    let sensor = scenario.sensor.force_torque().cloned();
    Ok(Simulation {
        recording,
        truth: columns.truth,
        slabs,
        readings,
        virtual_sensor_accuracy,
        motion: columns.motion,
        sensor: sensor.map(|sensor| (scenario.effects.clone(), sensor, scenario.sample_hz)),
    })
}

/// Largest force in N of a simulation with custom effects; beyond it the physics engine loses precision.
const MAX_FORCE_N: f64 = 1e6;

/// Replays the motion with custom effects, to check that their forces are finite.
fn check_custom_effects(
    scenario: &Scenario,
    plan: &MotionPlan,
    law: &ForceLaw,
    rates: &SampleRates,
) -> Result<(), SimulateError> {
    let custom: Vec<&str> = scenario
        .effects
        .iter()
        .filter(|e| e.info().custom.is_some() && !e.is_inactive())
        .map(Effect::id)
        .collect();
    if custom.is_empty() {
        return Ok(());
    }
    let mut sensor = ForceSensor::new(&scenario.effects, &ForceTorque::default(), 0, rates.sample_hz);
    let mut wrong = None;
    let check = |s: &InsertionSample| {
        let forces = [s.force.total_n, s.force.elastic_n, sensor.measure(s)];
        if let Some(force_n) = forces.into_iter().find(|f| f.is_nan() || f.abs() > MAX_FORCE_N) {
            wrong.get_or_insert((s.time_s, force_n));
        }
    };
    simulate_replay(plan, law, rates, |_| {}, check);
    match wrong {
        None => Ok(()),
        Some((time_s, force_n)) => {
            Err(SimulateError::NotFinite { force_n, time_s, effects: custom.join(", ") })
        }
    }
}

/// Moves the columns of the arm into the recording and returns the force of each sensor.
fn readings(recording: &mut Recording, arm: Option<ArmRecording>, sensor: &Sensor) -> Vec<SensorReadings> {
    let mut readings = Vec::new();
    if sensor.force_torque().is_some() {
        readings.push(SensorReadings { sensor: "force_torque", force_n: recording.force_n.clone() });
    }
    let Some(arm) = arm else { return readings };
    recording.joint_torque_nm = arm.joint_torque_nm;
    if sensor.virtual_sensor().is_some() {
        let samples = recording.time_s.iter().zip(&arm.virtual_force_n);
        let force_n = samples.map(|(t, f)| if *t < arm.zeroed_s - 1e-9 { f64::NAN } else { *f }).collect();
        readings.push(SensorReadings { sensor: "virtual", force_n });
        if sensor.force_torque().is_none() {
            recording.force_n.clone_from(&arm.virtual_force_n);
        }
        recording.force_virtual_n = Some(arm.virtual_force_n);
    }
    readings
}

/// Recording and truth, extended sample by sample.
struct Columns {
    recording: Recording,
    truth: Truth,
    motion: Vec<MotionPoint>,
    surface_m: f64,
}

impl Columns {
    fn with_capacity(samples: usize, surface_m: f64) -> Self {
        let mut recording = Recording { velocity_measured: true, ..Recording::default() };
        for column in [
            &mut recording.time_s,
            &mut recording.position_m,
            &mut recording.velocity_mps,
            &mut recording.force_n,
        ] {
            column.reserve_exact(samples);
        }
        Self { recording, truth: Truth::default(), motion: Vec::with_capacity(samples), surface_m }
    }

    /// Recorded position (m) at a time, interpolated between samples.
    fn recorded_m(&self, time_s: f64) -> Option<f64> {
        let (times, positions) = (&self.recording.time_s, &self.recording.position_m);
        let after = times.partition_point(|t| *t < time_s);
        let (Some(t1), Some(z1)) = (times.get(after), positions.get(after)) else {
            return positions.last().copied();
        };
        let before = after.checked_sub(1)?;
        let (t0, z0) = (times[before], positions[before]);
        Some(z0 + (z1 - z0) * (time_s - t0) / (t1 - t0))
    }

    fn push(&mut self, s: &InsertionSample, force_sensor: &mut ForceSensor) {
        self.recording.time_s.push(s.time_s);
        self.recording.position_m.push(force_sensor.position(s.position_m));
        self.recording.velocity_mps.push(force_sensor.position(s.velocity_mps));
        self.recording.force_n.push(force_sensor.measure(s));
        self.motion.push(MotionPoint {
            position_m: s.position_m,
            velocity_mps: s.velocity_mps,
            acceleration_mps2: s.acceleration_mps2,
        });
        let truth = &mut self.truth;
        truth.tip_force_n.push(s.force.tip_n);
        truth.elastic_n.push(s.force.elastic_n);
        truth.friction_n.push(s.force.friction_n);
        truth.tissue_force_n.push(s.force.total_n);
        truth.cumulative_friction_ns_per_m.push(s.force.cumulative_friction_ns_per_m);
        truth.active_layer.push(s.force.active_layer);
        if truth.surface_contact_s.is_none() && s.position_m >= self.surface_m {
            truth.surface_contact_s = Some(s.time_s);
        }
    }
}
