//! A whole scenario: motion, robot, tissue and sensors make a recording with its ground truth.

use crate::arm_insertion::{ArmRecording, ArmSetup, simulate_on_arm};
use crate::arm_simulation::ArmError;
use crate::force_sensor::ForceSensor;
use crate::slide_insertion::{InsertionSample, SampleRates, simulate_on_slide, simulate_replay};
use crate::virtual_sensor_accuracy::VirtualSensorAccuracy;
use stylet_record::{LayerTruth, Recording, TrueRupture, Truth};
use stylet_scenario::{FieldError, ForceTorque, MotionPoint, Robot, Scenario, Sensor};
use stylet_tissue::{AnyEffect, ChainStage, Effect, ForceLaw, Rupture, Slab, TooManyEffects};

/// Why a scenario cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// `motion: Recorded` brings no motion of its own.
    #[error(
        "the motion is `Recorded`: it comes with measured data; give the scenario a motion to simulate it"
    )]
    NoMotion,
    /// Too many effects at once.
    #[error(transparent)]
    Effects(#[from] TooManyEffects),
    /// The scenario's numbers do not fit; a checked scenario has none of these.
    #[error("{}: {}", .0.path, .0.message)]
    InvalidScenario(FieldError),
    /// The arm cannot carry the needle.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// A part of the scenario that this version cannot simulate.
    #[error("{what} cannot be simulated by this version; {remedy}")]
    NotSupported {
        /// What is not supported.
        what: &'static str,
        /// What can be written instead.
        remedy: &'static str,
    },
}

/// What a simulation gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// What the sensors recorded.
    pub recording: Recording,
    /// What really happened, one row per sample of the recording.
    pub truth: Truth,
    /// The layers as the law placed them.
    pub slabs: Vec<Slab>,
    /// The sensors that recorded, force/torque first.
    pub readings: Vec<SensorReadings>,
    /// How far the virtual sensor is off, and how late.
    pub virtual_sensor_accuracy: Option<VirtualSensorAccuracy>,
    /// How the needle really moved, one row per sample of the recording.
    pub motion: Vec<MotionPoint>,
    /// Effects, sensor and sampling rate (Hz) of the force/torque sensor.
    sensor: Option<(Vec<AnyEffect>, ForceTorque, f64)>,
}

impl Simulation {
    /// The layers as the law placed them, as the scores want them.
    #[must_use]
    pub fn true_layers(&self) -> Vec<LayerTruth> {
        true_layers(&self.slabs)
    }

    /// The same insertion as the force/torque sensor records it with the noise of another seed (N, one value per sample):
    /// its noise moves nothing, so that the motion need not be simulated again. `None` without such a sensor.
    #[must_use]
    pub fn measured_with_seed(&self, seed: u64) -> Option<Vec<f64>> {
        let (effects, sensor, sample_hz) = self.sensor.as_ref()?;
        Some(self.measured_by(effects, sensor, *sample_hz, seed))
    }

    /// The same insertion as another force/torque sensor records it (N, one value per sample).
    #[must_use]
    pub fn measured_by(
        &self,
        effects: &[AnyEffect],
        sensor: &ForceTorque,
        sample_hz: f64,
        seed: u64,
    ) -> Vec<f64> {
        let mut measuring = ForceSensor::new(effects, sensor, seed, sample_hz);
        let moments = self.recording.time_s.iter().zip(&self.motion).zip(&self.truth.tissue_force_n);
        moments.map(|((time_s, at), tissue_n)| measuring.measure_force(*time_s, at, *tissue_n)).collect()
    }
}

/// What is true of layers that the law placed.
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

/// The force of one sensor, as an online algorithm hears it.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorReadings {
    /// `force_torque` or `virtual`.
    pub sensor: &'static str,
    /// Axial force in N, one value per sample; not a number as long as the sensor is not zeroed.
    pub force_n: Vec<f64>,
}

/// How a scenario is sampled.
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
/// # Errors
/// [`SimulateError`] when the scenario has no motion of its own or asks for what cannot be simulated.
pub fn simulate(scenario: &Scenario, seed: u64) -> Result<Simulation, SimulateError> {
    let plan = scenario.motion.plan().ok_or(SimulateError::NoMotion)?;
    let law = ForceLaw::new(&scenario.tissue, &scenario.effects)?;
    let without = ForceTorque { noise_n: 0.0, ..ForceTorque::default() };
    let sensor = match scenario.sensor.force_torque() {
        Some(sensor) => sensor,
        None => {
            let beside = |e: &AnyEffect| {
                matches!(e.stage(), ChainStage::Tool | ChainStage::Sensor) && !e.is_inactive()
            };
            if scenario.effects.iter().any(beside) {
                return Err(SimulateError::NotSupported {
                    what: "an effect of tool or force/torque sensor with `sensor: Virtual`",
                    remedy: "use sensor: Both(...), or give the arm friction and model errors instead",
                });
            }
            &without
        }
    };
    let mut measuring = ForceSensor::new(&scenario.effects, sensor, seed, scenario.sample_hz);
    let rates = sample_rates(scenario, plan.duration_s());
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
    let sink = |s: &InsertionSample| columns.push(s, &mut measuring);
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
    // Where the needle was recorded at that instant: the law's own position is relative to the tissue.
    for rupture in &mut ruptures {
        rupture.position_m = columns.recorded_m(rupture.time_s).unwrap_or(rupture.position_m);
    }
    columns.truth.ruptures = ruptures;
    let mut recording = columns.recording;
    let zeroed_s = arm.as_ref().map_or(0.0, |arm| arm.zeroed_s);
    let readings = readings(&mut recording, arm, &scenario.sensor);
    let virtual_error = VirtualSensorAccuracy::compare(&recording, &columns.truth, zeroed_s);
    let slabs = law.slabs().to_vec();
    let sensor = scenario.sensor.force_torque().cloned();
    Ok(Simulation {
        recording,
        truth: columns.truth,
        slabs,
        readings,
        virtual_sensor_accuracy: virtual_error,
        motion: columns.motion,
        sensor: sensor.map(|sensor| (scenario.effects.clone(), sensor, scenario.sample_hz)),
    })
}

/// Puts what the arm recorded into the recording, and lists what the sensors say.
fn readings(recording: &mut Recording, arm: Option<ArmRecording>, sensor: &Sensor) -> Vec<SensorReadings> {
    let mut readings = Vec::new();
    if sensor.force_torque().is_some() {
        readings.push(SensorReadings { sensor: "force_torque", force_n: recording.force_n.clone() });
    }
    let Some(arm) = arm else { return readings };
    recording.joint_torque_nm = arm.joint_torque_nm;
    if sensor.virtual_sensor().is_some() {
        let heard = recording.time_s.iter().zip(&arm.virtual_force_n);
        let force_n = heard.map(|(t, f)| if *t < arm.zeroed_s - 1e-9 { f64::NAN } else { *f }).collect();
        readings.push(SensorReadings { sensor: "virtual", force_n });
        if sensor.force_torque().is_none() {
            recording.force_n.clone_from(&arm.virtual_force_n);
        }
        recording.force_virtual_n = Some(arm.virtual_force_n);
    }
    readings
}

/// Recording and truth as they grow.
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

    /// Recorded position at an instant, in m, interpolated between the samples around it.
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

    fn push(&mut self, s: &InsertionSample, measuring: &mut ForceSensor) {
        self.recording.time_s.push(s.time_s);
        self.recording.position_m.push(measuring.position(s.position_m));
        self.recording.velocity_mps.push(measuring.position(s.velocity_mps));
        self.recording.force_n.push(measuring.measure(s));
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
