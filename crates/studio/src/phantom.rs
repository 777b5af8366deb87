//! Edits of the phantom, a scenario that is changed with the mouse.

use crate::messages::*;
use crate::online_algorithm::MIN_THICKNESS_M;
use crate::phantom_view::{SCENARIOS, first, parse, title, tolerance};
use crate::sliders::{Scale, rounded};
use crate::studio::Studio;
use crate::workspace::PHANTOM;
use crate::{commands, online_algorithm};
use serde_json::{Value, json};
use stylet_scenario::{Motion, Scenario, Segment};
use stylet_score::{FoundLayer, found_layers};
use stylet_tissue::{
    AnyEffect, Effect as _, EffectInfo, Layer, effect_info, general_effects, per_layer_effects,
};

/// Distance from the surface at which the library's motions begin, in m.
const APPROACH_M: f64 = 5e-3;
/// Speed of the library's motions, in m/s.
const SPEED_MPS: f64 = 2.5e-3;
/// Depth below the last layer's start that is added to layers found in a recording, relative to the layer, and at least in m.
const DEPTH_BEYOND_LAST_LAYER: (f64, f64) = (0.2, 5e-3);

const MOTIONS: [(&str, &str); 3] = [
    ("constant", "one constant speed"),
    ("sinusoidal", "in and out, sinusoidal"),
    ("varied", "advance, hold, varying speed, retraction: shows most effects"),
];

/// Constant lists.
pub fn library() -> Value {
    let entry = |e: &EffectInfo| json!({ "id": e.id, "title": title(e.id), "equation": e.equation, "signature": e.signature });
    json!({
        "scenarios": SCENARIOS.map(|(name, _)| name),
        "algorithms": online_algorithm::ALGORITHMS.map(|(name, _)| name),
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
        Edit::FromDiagnosis => scenario = studio.results.extended()?,
        Edit::FromPlan => scenario.motion = studio.results.planned_motion()?,
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
fn layer((index, found): (usize, &FoundLayer)) -> Layer {
    let puncture_n = found.rupture_force_n().filter(|n| found.is_ruptured_by_force() && *n > 0.0);
    Layer {
        name: format!("layer {}", index + 1),
        thickness_m: rounded(found.thickness_m.max(MIN_THICKNESS_M)),
        stiffness_n_per_m: rounded(found.stiffness_n_per_m.max(0.0)),
        friction_ns_per_m2: rounded(found.friction_ns_per_m2.max(0.0)),
        puncture_n: puncture_n.map(rounded),
    }
}

/// Layers from the online algorithm's estimates; the last one to below the deepest point unless the tip has left the tissue.
fn from_recording(
    studio: &mut Studio,
    file: &str,
    algorithm: &str,
    corrections: &Corrections,
) -> Result<Scenario, Problem> {
    let loaded = studio.recording(file)?;
    let run = online_algorithm::run_algorithm(studio, file, algorithm, corrections.contact_mm)?;
    let recording = &loaded.recording;
    let trace = online_algorithm::corrected_trace(algorithm, &run, corrections, recording);
    let found = found_layers(&trace, recording);
    let found = found.filter(|found| !found.is_empty()).ok_or_else(|| {
        Problem::new(
            "no layer was found in this recording, so there is nothing to start from; see its findings",
        )
    })?;
    let mut layers: Vec<Layer> = found.iter().enumerate().map(layer).collect();
    let deepest = recording.samples().enumerate().max_by(|a, b| a.1.position_m.total_cmp(&b.1.position_m));
    let (deepest, end_m) = deepest.map_or((0, 0.0), |(index, s)| (index, s.position_m));
    let surface_m = found[0].front_m;
    if let Some(last) = layers.last_mut().filter(|_| found.last().is_some_and(|l| l.rupture_m.is_none())) {
        last.thickness_m = rounded(
            last.thickness_m
                + (DEPTH_BEYOND_LAST_LAYER.0 * (end_m - surface_m)).max(DEPTH_BEYOND_LAST_LAYER.1),
        );
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
    studio.save_workspace()?;
    let command = commands::open_again(studio.folder());
    studio.workspace.record(command)?;
    studio.state()
}

/// `stylet run` of the phantom.
pub fn run(studio: &mut Studio) -> Result<Value, Problem> {
    studio.save_workspace()?;
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
