//! A whole scenario: motion, robot, tissue and sensors make a recording with its ground truth.

use crate::insertion::{InsertionSample, Rates, on_slide, replayed};
use crate::sensor::Measuring;
use stylet_record::{Recording, TrueRupture, Truth};
use stylet_scenario::{Robot, Scenario, Sensor};
use stylet_tissue::{Law, Rupture, Slab, TooManyEffects};

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
}

/// How a scenario is sampled.
#[must_use]
pub fn rates(scenario: &Scenario, duration_s: f64) -> Rates {
    Rates {
        sample_hz: scenario.sample_hz,
        steps_per_sample: (scenario.physics_hz / scenario.sample_hz).round().max(1.0) as usize,
        samples: (duration_s * scenario.sample_hz).round().max(2.0) as usize,
    }
}

/// Simulates a scenario with the noise of `seed`. The same scenario and seed give the same bits.
///
/// # Errors
/// [`SimulateError`] when the scenario has no motion of its own or asks for what cannot be simulated.
pub fn simulate(scenario: &Scenario, seed: u64) -> Result<Simulation, SimulateError> {
    let plan = scenario.motion.plan().ok_or(SimulateError::NoMotion)?;
    let law = Law::new(&scenario.tissue, &scenario.effects)?;
    let Sensor::ForceTorque(sensor) = &scenario.sensor else {
        return Err(SimulateError::NotSupported {
            what: "a virtual sensor",
            remedy: "use sensor: ForceTorque(...)",
        });
    };
    let mut measuring = Measuring::new(&scenario.effects, sensor, scenario.sample_hz, seed);
    let rates = rates(scenario, plan.duration_s());
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
    let sink = |s: &InsertionSample| {
        let recorded_n = measuring.measure(s);
        columns.push(s, [measuring.position(s.position_m), measuring.position(s.velocity_mps), recorded_n]);
    };
    match scenario.robot {
        Robot::Slide => on_slide(&plan, &law, &rates, on_rupture, sink),
        Robot::Replay => replayed(&plan, &law, &rates, on_rupture, sink),
        Robot::Arm(_) => {
            return Err(SimulateError::NotSupported {
                what: "robot: Arm",
                remedy: "use robot: Slide or robot: Replay",
            });
        }
    }
    columns.truth.ruptures = ruptures;
    Ok(Simulation { recording: columns.recording, truth: columns.truth, slabs: law.slabs().to_vec() })
}

/// Recording and truth as they grow.
struct Columns {
    recording: Recording,
    truth: Truth,
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
        Self { recording, truth: Truth::default(), surface_m }
    }

    /// A sample, and the position (m), velocity (m/s) and force (N) recorded of it.
    fn push(&mut self, s: &InsertionSample, [position_m, velocity_mps, recorded_n]: [f64; 3]) {
        self.recording.time_s.push(s.time_s);
        self.recording.position_m.push(position_m);
        self.recording.velocity_mps.push(velocity_mps);
        self.recording.force_n.push(recorded_n);
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
