//! The predicted force of the phantom, along its own motion or along a recorded one.

use crate::messages::{Curves, EventView, ForceCurve, PreviewView, Problem};
use crate::phantom_view::millimetres;
use crate::studio::Studio;
use stylet_api::{Recording, Scenario, force_along_motion};
use stylet_report::significant;
use stylet_report::{kept_indices, values_at};
use stylet_scenario::{ForceTorque, Robot, Sensor};
use stylet_tissue::{ForceLaw, Rupture, replay};

/// Samples that are simulated at most of the phantom's own motion, and of a recorded one while the mouse moves.
const MAX_SIMULATED: usize = 20_000;
/// Points of a curve that is redrawn while the mouse moves.
const MAX_POINTS: usize = 1600;

/// The force of the phantom along its own motion, or along a recording. While the mouse moves, `transient`, long recordings are thinned.
pub fn preview(studio: &mut Studio, along: Option<&str>, transient: bool) -> Result<PreviewView, Problem> {
    let scenario = studio.now.phantom.clone();
    match along {
        Some(file) => {
            let loaded = studio.recording(file)?;
            let step = if transient { loaded.recording.len().div_ceil(MAX_SIMULATED) } else { 1 };
            let thinned =
                selected(&loaded.recording, |column| column.iter().step_by(step.max(1)).copied().collect());
            along_recording(&scenario, &thinned, file)
        }
        None => along_own_motion(scenario),
    }
}

fn along_own_motion(mut scenario: Scenario) -> Result<PreviewView, Problem> {
    let Some(plan) = scenario.motion.plan() else {
        return Err(Problem::new("the phantom has no motion of its own; choose one, or a recording"));
    };
    // Without noise, rigid bodies and arm: milliseconds.
    scenario.robot = Robot::Replay;
    let sensor = scenario.sensor.force_torque().cloned().unwrap_or_default();
    scenario.sensor = Sensor::ForceTorque(ForceTorque { noise_n: 0.0, ..sensor });
    scenario.sample_hz = scenario.sample_hz.min(MAX_SIMULATED as f64 / plan.duration_s().max(1e-3));
    scenario.physics_hz = scenario.sample_hz;
    let found = stylet_testbed::simulate(&scenario, scenario.seed)?;
    let forces = [
        ("predicted", "force", found.recording.force_n.as_slice()),
        ("tip", "force at the tip", found.truth.tip_force_n.as_slice()),
    ];
    let ruptures: Vec<EventView> =
        found.truth.ruptures.iter().map(|r| event(r.layer, r.time_s, r.position_m)).collect();
    let peak = found.recording.force_n.iter().copied().fold(0.0, f64::max);
    Ok(PreviewView {
        summary: format!("{} ruptures, largest force {} N", ruptures.len(), significant(peak, 3)),
        curves: curves(&found.recording, &forces, MAX_POINTS),
        ruptures,
    })
}

/// Some of the samples: `part` selects them from a column.
pub fn selected(recording: &Recording, part: impl Fn(&[f64]) -> Vec<f64>) -> Recording {
    Recording {
        time_s: part(&recording.time_s),
        position_m: part(&recording.position_m),
        velocity_mps: part(&recording.velocity_mps),
        force_n: part(&recording.force_n),
        ..Recording::default()
    }
}

fn along_recording(scenario: &Scenario, recording: &Recording, file: &str) -> Result<PreviewView, Problem> {
    let predicted = force_along_motion(scenario, recording)?;
    let law = ForceLaw::new(&scenario.tissue, &scenario.effects)?;
    let mut ruptures = Vec::new();
    let mut tip_n = Vec::with_capacity(recording.len());
    let motion = recording.samples().map(|s| (s.time_s, s.position_m, s.velocity_mps));
    let on_rupture = |r: Rupture| ruptures.push(event(r.layer, r.time_s, r.position_m));
    replay(&law, motion, on_rupture, |force| tip_n.push(force.tip_n));
    let forces = [
        ("measured", "measured", recording.force_n.as_slice()),
        ("predicted", "predicted", &predicted),
        ("tip", "predicted at the tip", &tip_n),
    ];
    Ok(PreviewView {
        summary: format!("along {file}: error {}", rms_text(&recording.force_n, &predicted)),
        curves: curves(recording, &forces, MAX_POINTS),
        ruptures,
    })
}

/// RMS of the difference, as text with its unit.
pub fn rms_text(measured: &[f64], predicted: &[f64]) -> String {
    let difference: Vec<f64> = measured.iter().zip(predicted).map(|(a, b)| a - b).collect();
    format!("{} N RMS", significant(stylet_stats::rms(&difference), 3))
}

fn event(layer: usize, time_s: f64, position_m: f64) -> EventView {
    EventView { time_s, depth_mm: millimetres(position_m), label: format!("rupture of layer {layer}") }
}

/// Forces over time and depth, thinned to about `points` samples; extremes stay.
pub fn curves(recording: &Recording, forces: &[(&'static str, &str, &[f64])], points: usize) -> Curves {
    let columns: Vec<&[f64]> = forces.iter().map(|(_, _, force_n)| *force_n).collect();
    let all = || (0..recording.len()).collect();
    let kept = kept_indices(&columns, recording.len(), points).unwrap_or_else(all);
    let small = |column: &[f64], factor: f64| -> Vec<f32> {
        values_at(column, &kept).into_iter().map(|v| (v * factor) as f32).collect()
    };
    Curves {
        time_s: values_at(&recording.time_s, &kept),
        depth_mm: small(&recording.position_m, 1e3),
        velocity_mm_per_s: small(&recording.velocity_mps, 1e3),
        forces: forces
            .iter()
            .map(|(role, name, force_n)| ForceCurve {
                role,
                name: (*name).to_owned(),
                force_n: small(force_n, 1.0),
            })
            .collect(),
    }
}
