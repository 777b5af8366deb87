//! The phantom: a scenario that is edited with the mouse.

use crate::look::MIN_THICKNESS_M;
use crate::messages::*;
use crate::phantom_view::{SCENARIOS, first, parse, title, tolerance};
use crate::sliders::{Scale, rounded};
use crate::studio::Studio;
use crate::workspace::PHANTOM;
use crate::{commands, look};
use serde_json::{Value, json};
use stylet_scenario::{Motion, Scenario, Segment};
use stylet_tissue::{
    AnyEffect, Effect as _, EffectInfo, Layer, effect_info, general_effects, per_layer_effects,
};

/// Distance from the surface at which the library's motions begin, in m.
const APPROACH_M: f64 = 5e-3;
/// Speed of the library's motions, in m/s.
const SPEED_MPS: f64 = 2.5e-3;
/// Depth below the last layer's start that is added to layers found in a recording, relative to the layer, and at least in m.
const BEYOND: (f64, f64) = (0.2, 5e-3);

/// Elastic force of the last layer at the deepest point, relative to the largest force, below which the tip has left the tissue.
const MIN_FORCE_SHARE: f64 = 0.01;

const MOTIONS: [(&str, &str); 3] = [
    ("constant", "one constant speed"),
    ("sinusoidal", "in and out, sinusoidal"),
    ("varied", "advance, hold, varying speed, retraction: shows most effects"),
];

/// Lists that never change.
pub fn library() -> Value {
    let entry = |e: &EffectInfo| json!({ "id": e.id, "title": title(e.id), "equation": e.equation, "signature": e.signature });
    json!({
        "scenarios": SCENARIOS.map(|(name, _)| name),
        "algorithms": look::ALGORITHMS.map(|(name, _)| name),
        "motions": MOTIONS,
        "effects": general_effects().chain(per_layer_effects()).map(entry).collect::<Value>(),
    })
}

/// The phantom after an edit.
///
/// # Errors
/// When the edit does not fit, or the result would be invalid.
pub fn edited(studio: &mut Studio, edit: &Edit) -> Result<Scenario, Problem> {
    let mut scenario = studio.now.phantom.clone();
    let layers = &mut scenario.tissue.layers;
    let gone = || Problem::new("the phantom has no such layer or effect any more");
    match edit {
        Edit::Face { face, depth_mm } => move_face(&mut scenario, *face, 1e-3 * depth_mm)?,
        Edit::Layer { layer, field, to } => {
            let scale = Scale::of_layer(field).ok_or_else(gone)?;
            let value = scale.value(to)?;
            let layer = layers.get_mut(*layer).ok_or_else(gone)?;
            match (field.as_str(), value) {
                ("puncture", value) => layer.puncture_n = value,
                ("thickness", Some(value)) => layer.thickness_m = value,
                ("stiffness", Some(value)) => layer.stiffness_n_per_m = value,
                ("friction", Some(value)) => layer.friction_ns_per_m2 = value,
                _ => return Err(gone()),
            }
        }
        Edit::LayerName { layer, name } => layers.get_mut(*layer).ok_or_else(gone)?.name.clone_from(name),
        Edit::SplitLayer { layer } => {
            let first = layers.get_mut(*layer).ok_or_else(gone)?;
            first.thickness_m = rounded(first.thickness_m / 2.0);
            let second = first.clone();
            layers.insert(layer + 1, second);
        }
        Edit::RemoveLayer { layer } => {
            if layers.len() < 2 || *layer >= layers.len() {
                return Err(Problem::new("a phantom needs at least one layer"));
            }
            layers.remove(*layer);
        }
        Edit::AddEffect { id } => {
            let info = effect_info(id).ok_or_else(gone)?;
            let typical: Vec<f64> =
                info.parameters.iter().map(|p| p.demonstration.unwrap_or(p.start)).collect();
            scenario.effects.push(AnyEffect::from_parameters(id, &typical).ok_or_else(gone)?);
        }
        Edit::Effect { effect, field, to } => {
            let effect = scenario.effects.get_mut(*effect).ok_or_else(gone)?;
            let mut values = effect.parameters();
            let info = effect.info();
            let index = info.parameters.iter().position(|p| p.path == field).ok_or_else(gone)?;
            values[index] = Scale::of_parameter(&info.parameters[index]).value(to)?.ok_or_else(gone)?;
            *effect = AnyEffect::from_parameters(info.id, &values).ok_or_else(gone)?;
        }
        Edit::RemoveEffect { effect } => {
            if *effect >= scenario.effects.len() {
                return Err(gone());
            }
            scenario.effects.remove(*effect);
        }
        Edit::Tolerance { field, to } => {
            let value = Scale::of_tolerance(field).ok_or_else(gone)?.value(to)?;
            *tolerance(&mut scenario, field).ok_or_else(gone)? = value.ok_or_else(gone)?;
        }
        Edit::Name { name } => scenario.name.clone_from(name),
        Edit::Motion { name } => scenario.motion = library_motion(&scenario, name).ok_or_else(gone)?,
        Edit::Scenario { name } => {
            let (file, text) = SCENARIOS.iter().find(|(known, _)| known == name).ok_or_else(gone)?;
            scenario = parse(file, text)?;
        }
        Edit::FromRecording { file, algorithm, corrections } => {
            scenario = from_recording(studio, file, algorithm, corrections)?;
        }
        Edit::FromDiagnosis => scenario = studio.explained.extended()?,
        Edit::FromPlan => scenario.motion = studio.explained.planned_motion()?,
        Edit::Ron { text } => scenario = parse(PHANTOM, text)?,
    }
    scenario.check()?;
    Ok(scenario)
}

/// Moves one face as far as its neighbours allow.
fn move_face(scenario: &mut Scenario, face: usize, to_m: f64) -> Result<(), Problem> {
    let tissue = &mut scenario.tissue;
    let count = tissue.layers.len();
    if face > count || !to_m.is_finite() {
        return Err(Problem::new("the phantom has no such face any more"));
    }
    let low = if face == 0 { f64::NEG_INFINITY } else { tissue.front_m(face - 1) + MIN_THICKNESS_M };
    let high = if face == count { f64::INFINITY } else { tissue.front_m(face + 1) - MIN_THICKNESS_M };
    // To 0.01 mm.
    let to_m = (1e5 * to_m.min(high).max(low)).round() / 1e5;
    let moved_m = to_m - tissue.front_m(face);
    if face == 0 {
        tissue.surface_m = to_m;
    } else {
        tissue.layers[face - 1].thickness_m = rounded(tissue.layers[face - 1].thickness_m + moved_m);
    }
    if face < count {
        tissue.layers[face].thickness_m = rounded(tissue.layers[face].thickness_m - moved_m);
    }
    Ok(())
}

/// A motion of the library through the whole phantom.
fn library_motion(scenario: &Scenario, name: &str) -> Option<Motion> {
    let start_m = scenario.tissue.surface_m - APPROACH_M;
    let travel_m = scenario.tissue.end_m() - start_m;
    let duration_s = rounded(travel_m / SPEED_MPS);
    Some(match name {
        "constant" => Motion::Constant { start_m, velocity_mps: SPEED_MPS, duration_s },
        "sinusoidal" => Motion::Sinusoidal {
            start_m,
            amplitude_m: rounded(travel_m / 2.0),
            frequency_hz: rounded(0.5 / duration_s),
            phase_rad: stylet_scenario::PHASE_FROM_REST_RAD,
            duration_s: 2.0 * duration_s,
        },
        "varied" => Motion::Program {
            start_m,
            segments: vec![
                Segment::Move { velocity_mps: SPEED_MPS, duration_s: rounded(duration_s / 2.0) },
                Segment::Hold { duration_s: 3.0 },
                Segment::Ripple {
                    velocity_mps: SPEED_MPS,
                    amplitude_mps: SPEED_MPS / 2.0,
                    frequency_hz: 0.5,
                    duration_s: rounded(duration_s / 2.0),
                },
                Segment::Move { velocity_mps: -2.0 * SPEED_MPS, duration_s: rounded(duration_s / 4.0) },
            ],
        },
        _ => return None,
    })
}

/// A layer with rounded numbers that a scenario admits.
fn layer(index: usize, thickness_m: f64, stiffness: f64, friction: f64, puncture_n: Option<f64>) -> Layer {
    Layer {
        name: format!("layer {}", index + 1),
        thickness_m: rounded(thickness_m.max(MIN_THICKNESS_M)),
        stiffness_n_per_m: rounded(stiffness.max(0.0)),
        friction_ns_per_m2: rounded(friction.max(0.0)),
        puncture_n: puncture_n.filter(|force_n| *force_n > 0.0),
    }
}

/// Layers from the online algorithm's estimates: faces where ruptures were located, the last layer to below the deepest point unless the tip
/// has left the tissue.
fn from_recording(
    studio: &mut Studio,
    file: &str,
    algorithm: &str,
    corrections: &Corrections,
) -> Result<Scenario, Problem> {
    let loaded = studio.recording(file)?;
    let run = look::run_algorithm(studio, file, algorithm, corrections.contact_mm)?;
    let (recording, trace) = (&loaded.recording, &run.trace);
    let ruptures = look::corrected_ruptures(algorithm, &run, corrections, recording);
    let surface_m = trace.contact_m.ok_or_else(|| {
        Problem::new("no contact was detected in this recording, so there are no layers to start from; see its findings")
    })?;
    let deepest =
        (0..recording.len()).max_by(|a, b| recording.position_m[*a].total_cmp(&recording.position_m[*b]));
    let deepest = deepest.unwrap_or(0);
    let mut layers: Vec<Layer> = Vec::new();
    let mut front_m = surface_m;
    for (k, (detection, moved)) in ruptures.iter().enumerate() {
        let estimate = |layer: usize| trace.estimates.iter().find(|e| e.layer == layer);
        let Some(e) = estimate(detection.layer) else { continue };
        // A layer that ruptures before its far face: the tip is free until the next one begins.
        let next_m = ruptures.get(k + 1).and_then(|(next, _)| Some(estimate(next.layer)?.start_m));
        // A rupture that was moved is the far face.
        let gap_m = next_m.filter(|next_m| !moved && *next_m > detection.located_m + MIN_THICKNESS_M);
        let puncture_n = gap_m.map(|_| rounded(e.stiffness_n_per_m * (detection.located_m - front_m)));
        let back_m = gap_m.unwrap_or(detection.located_m);
        layers.push(layer(layers.len(), back_m - front_m, e.stiffness_n_per_m, e.friction, puncture_n));
        front_m = back_m;
    }
    let last = |column: &[f64]| column.iter().take(deepest + 1).rev().copied().find(|v| v.is_finite());
    let end_m = recording.position_m[deepest];
    let beyond_m = (BEYOND.0 * (end_m - surface_m)).max(BEYOND.1);
    let [stiffness, friction] = [&trace.stiffness_n_per_m, &trace.friction].map(|c| last(c).unwrap_or(0.0));
    let peak_n = recording.force_n.iter().copied().fold(0.0, f64::max);
    if layers.is_empty() || stiffness * (end_m - front_m) > MIN_FORCE_SHARE * peak_n {
        layers.push(layer(layers.len(), end_m + beyond_m - front_m, stiffness, friction, None));
    }
    let start_m = recording.position_m.first().copied().unwrap_or(0.0);
    let duration_s = recording.time_s[deepest] - recording.time_s[0];
    let speed_mps = if duration_s > 0.0 { rounded((end_m - start_m) / duration_s) } else { SPEED_MPS };
    let mut scenario = first()?;
    scenario.name = file.rsplit_once('.').map_or(file, |(stem, _)| stem).to_owned();
    scenario.source = format!("layers found by stylet studio in {file}");
    scenario.tissue = stylet_tissue::Tissue { surface_m: rounded(surface_m), layers };
    scenario.motion = Motion::Constant {
        start_m: rounded(start_m),
        velocity_mps: speed_mps,
        duration_s: rounded(duration_s),
    };
    Ok(scenario)
}

/// Writes phantom and map.
pub fn save(studio: &mut Studio) -> Result<Value, Problem> {
    studio.keep()?;
    let command = commands::open_again(studio.folder());
    studio.workspace.record(command)?;
    studio.state()
}

/// `stylet run` of the phantom.
pub fn run(studio: &mut Studio) -> Result<Value, Problem> {
    studio.keep()?;
    let file = studio.workspace.path(PHANTOM);
    let name = file.display().to_string();
    // As the command reads it.
    let scenario = Scenario::load(&file)?;
    let run = stylet_api::simulate_from(&scenario, &name)?;
    let folder = studio.workspace.path("simulation");
    let output = run.output(&name)?;
    output.write(&folder)?;
    studio.workspace.record(commands::run(&file, &folder, &output))?;
    let first = run.algorithm_runs.first().and_then(|r| r.score.as_ref());
    let found = first.map_or(String::new(), |s| {
        format!(
            "{} of {} ruptures found, {} false",
            s.ruptures.len() - s.missed,
            s.ruptures.len(),
            s.false_alarms
        )
    });
    Ok(json!({ "summary": found, "folder": "simulation" }))
}
