//! The mean insertion of a set as a scenario that can be simulated.

use crate::set::first::Insertion;
use crate::set::instrument::Instrument;
use stylet_identify::model::{Choice, Model};
use stylet_scenario::{ForceTorque, Motion, Robot, Scenario, Segment, Sensor};

/// Shortest hold of the scenario in s.
const LEAST_HOLD_S: f64 = 0.1;
/// Noise of the sensor in N where no recording in air tells it.
const UNTOLD_NOISE_N: f64 = 0.01;

/// The law with the mean of what varies, moved as the middle run was.
#[must_use]
pub fn extended(name: &str, model: &Model, runs: &[&Insertion], instrument: &Instrument) -> Scenario {
    let run = runs[runs.len() / 2];
    let r = &run.recording;
    let (start, deepest) = (r.position_m[0], r.position_m[run.phases.deepest]);
    let speed = run.speed_mps.max(1e-5);
    let t = |i: usize| r.time_s.get(i).copied().unwrap_or(r.time_s[r.len() - 1]);
    let hold = (t(run.phases.back) - t(run.phases.deepest)).max(LEAST_HOLD_S);
    let mut segments = vec![
        Segment::Move { velocity_mps: speed, duration_s: (deepest - start) / speed },
        Segment::Hold { duration_s: hold },
    ];
    if run.phases.back < r.len() {
        segments.push(Segment::Move { velocity_mps: -speed, duration_s: (deepest - start) / speed });
    }
    Scenario {
        name: format!("{name}, as measured: the mean insertion"),
        source: "fitted to measured insertions by stylet diagnose".to_owned(),
        tissue: model.tissue.clone(),
        effects: model.effects.iter().filter_map(Choice::effect).chain(instrument.effects()).collect(),
        motion: Motion::Program { start_m: start, segments },
        robot: Robot::Replay,
        sensor: Sensor::ForceTorque(ForceTorque {
            noise_n: instrument.noise_n.unwrap_or(UNTOLD_NOISE_N),
            ar1: instrument.ar1.unwrap_or(0.0).clamp(-0.99, 0.99),
            ..ForceTorque::default()
        }),
        enhance: Default::default(),
        enhance_virtual: None,
        compare: Vec::new(),
        sample_hz: 100.0,
        physics_hz: 1000.0,
        tolerance: 0.3,
        thickness_tolerance: 0.1,
        surface_tolerance_m: 0.002,
        seed: 1,
    }
}
