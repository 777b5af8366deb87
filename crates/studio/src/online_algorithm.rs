//! The online algorithm on a recording.

use crate::commands;
use crate::messages::*;
use crate::phantom_view::millimetres;
use crate::preview::{curves, selected};
use crate::studio::Studio;
use serde_json::{Value, json};
use std::sync::Arc;
use stylet_api::enhancement::{ResultSource, enhance_recording};
use stylet_api::{AlgorithmRun, EnhancerConfigFile, Recording, enhance};
use stylet_core::config::{Algorithm, Contact};
use stylet_core::{Detection, LayerEstimate};
use stylet_record::QualityNote;
use stylet_report::{plus_minus, significant};
use stylet_score::{Trace, found_layers};

/// Thinnest layer that a dragged face or rupture leaves, in m.
pub const MIN_THICKNESS_M: f64 = 5e-4;
/// Points of a curve.
const MAX_POINTS: usize = 6000;
/// Ruptures and layers that are listed.
const MAX_LISTED: usize = 60;

/// The online algorithms, the default first.
pub const ALGORITHMS: [(&str, Algorithm); 2] = [("Stylet", Algorithm::Stylet), ("Paper", Algorithm::Paper)];

/// Configuration for an algorithm, with a contact depth that the user gave.
fn config(algorithm: &str, contact_mm: Option<f64>) -> Result<EnhancerConfigFile, Problem> {
    let (_, chosen) = ALGORITHMS
        .iter()
        .find(|(name, _)| *name == algorithm)
        .ok_or_else(|| Problem::new(format!("there is no algorithm {algorithm:?}")))?;
    let mut config = EnhancerConfigFile::default();
    config.enhance.algorithm = *chosen;
    if let Some(contact_mm) = contact_mm {
        config.surface_m = 1e-3 * contact_mm;
        config.enhance.contact = Contact::Known;
    }
    Ok(config)
}

/// The outputs of an algorithm for a recording; the last ones are cached.
pub fn run_algorithm(
    studio: &mut Studio,
    file: &str,
    algorithm: &str,
    contact_mm: Option<f64>,
) -> Result<Arc<AlgorithmRun>, Problem> {
    let key = format!("{algorithm} {contact_mm:?} {file}");
    if let Some((_, run)) = studio.enhanced.iter().find(|(known, _)| *known == key) {
        return Ok(run.clone());
    }
    let loaded = studio.recording(file)?;
    let run = Arc::new(enhance(&loaded.recording, &config(algorithm, contact_mm)?));
    let surplus = (studio.enhanced.len() + 1).saturating_sub(ALGORITHMS.len());
    studio.enhanced.drain(..surplus);
    studio.enhanced.push((key, run.clone()));
    Ok(run)
}

pub fn finding(blocking: bool, message: &str) -> FindingView {
    FindingView { level: if blocking { "bad" } else { "warn" }, message: message.to_owned() }
}

pub fn findings(notes: &[QualityNote]) -> Vec<FindingView> {
    notes.iter().map(|n| finding(n.blocking, &n.message)).collect()
}

pub fn size_text(recording: &Recording) -> String {
    format!(
        "{} samples over {} s at {} Hz",
        recording.len(),
        significant(recording.duration_s(), 4),
        significant(recording.sample_hz(), 4)
    )
}

/// Samples of a window, with all columns.
fn window(recording: &Recording, window_s: Option<[f64; 2]>) -> std::ops::Range<usize> {
    let Some([from, to]) = window_s else { return 0..recording.len() };
    let first = recording.time_s.partition_point(|t| *t < from).saturating_sub(1);
    let last = recording.time_s.partition_point(|t| *t <= to) + 1;
    first..last.min(recording.len()).max(first)
}

pub fn recording_view(studio: &mut Studio, request: RecordingViewRequest) -> Result<RecordingView, Problem> {
    let loaded = studio.recording(&request.file)?;
    let recording = &loaded.recording;
    let mut runs = Vec::new();
    for algorithm in request.algorithms.iter().take(ALGORITHMS.len()) {
        runs.push((
            algorithm.as_str(),
            run_algorithm(studio, &request.file, algorithm, request.corrections.contact_mm)?,
        ));
    }
    let shown = window(recording, request.window_s);
    let part = |column: &[f64]| column.get(shown.clone()).unwrap_or_default().to_vec();
    let mut visible = selected(recording, part);
    let mut columns: Vec<(&'static str, &str, Vec<f64>)> =
        vec![("measured", "measured", std::mem::take(&mut visible.force_n))];
    for (algorithm, run) in &runs {
        columns.push(("enhanced", algorithm, part(&run.trace.enhanced_n)));
        if run.trace.low_n.iter().any(|v| v.is_finite()) {
            columns.push(("low", algorithm, part(&run.trace.low_n)));
            columns.push(("high", algorithm, part(&run.trace.high_n)));
        }
    }
    let forces: Vec<(&'static str, &str, &[f64])> =
        columns.iter().map(|(role, name, column)| (*role, *name, column.as_slice())).collect();
    let drawn = curves(&visible, &forces, MAX_POINTS);
    Ok(RecordingView {
        summary: size_text(recording),
        findings: findings(&loaded.notes),
        samples: [visible.time_s.len(), drawn.time_s.len()],
        curves: drawn,
        runs: runs
            .iter()
            .map(|(algorithm, run)| run_view(algorithm, run, &request.corrections, recording))
            .collect(),
        file: request.file,
    })
}

/// Ruptures of a run, each with a flag whether the user moved it. A moved rupture is limited by contact and neighbours, and dated at the
/// first passage of the tip.
pub fn corrected_ruptures(
    algorithm: &str,
    run: &AlgorithmRun,
    corrections: &Corrections,
    recording: &Recording,
) -> Vec<(Detection, bool)> {
    let mut ruptures: Vec<_> = run.trace.detections.iter().map(|found| (*found, false)).collect();
    for (_, number, depth_mm) in corrections.ruptures_mm.iter().filter(|(of, ..)| of == algorithm) {
        let located_m = |number: usize| ruptures.get(number).map(|(r, _)| r.located_m);
        let front_m = number.checked_sub(1).map_or(run.trace.contact_m, located_m);
        let low_m = front_m.map_or(f64::NEG_INFINITY, |front_m| front_m + MIN_THICKNESS_M);
        let high_m = located_m(number + 1).map_or(f64::INFINITY, |next_m| next_m - MIN_THICKNESS_M);
        let to_m = (1e-3 * depth_mm).min(high_m).max(low_m);
        let passage = recording.samples().find(|s| s.position_m >= to_m);
        if let (Some((rupture, moved)), Some(passage)) = (ruptures.get_mut(*number), passage) {
            (rupture.located_m, rupture.located_s, *moved) = (to_m, passage.time_s, true);
        }
    }
    ruptures
}

/// Layers found by the algorithm, with the corrections: a moved rupture is the far face of its layer, where the next one begins.
pub fn corrected_trace(
    algorithm: &str,
    run: &AlgorithmRun,
    corrections: &Corrections,
    recording: &Recording,
) -> Trace {
    let mut trace = run.trace.clone();
    let ruptures = corrected_ruptures(algorithm, run, corrections, recording);
    for pair in ruptures.windows(2) {
        let [(rupture, moved), (next, _)] = pair else { continue };
        if let Some(estimate) = trace.estimates.iter_mut().find(|e| *moved && e.layer == next.layer) {
            estimate.start_m = rupture.located_m;
        }
    }
    trace.detections = ruptures.into_iter().map(|(rupture, _)| rupture).collect();
    trace
}

fn run_view(algorithm: &str, run: &AlgorithmRun, corrections: &Corrections, recording: &Recording) -> Value {
    let trace = &run.trace;
    let contact = trace.contact_m.zip(trace.contact_s).map(|(z, time_s)| EventView {
        time_s,
        depth_mm: millimetres(z),
        label: "contact".to_owned(),
    });
    let ruptures: Vec<EventView> = corrected_ruptures(algorithm, run, corrections, recording)
        .iter()
        .take(MAX_LISTED)
        .map(|(rupture, moved)| EventView {
            time_s: rupture.located_s,
            depth_mm: millimetres(rupture.located_m),
            label: format!("rupture {}{}", rupture.layer, if *moved { ", moved" } else { "" }),
        })
        .collect();
    // A last layer that did not rupture ends at the deepest point.
    let found = found_layers(trace, recording).unwrap_or_default();
    let is_in_tissue = found.last().is_some_and(|layer| layer.rupture_m.is_none());
    let deepest = recording.samples().max_by(|a, b| a.position_m.total_cmp(&b.position_m));
    let end = deepest.filter(|_| is_in_tissue).map(|s| (millimetres(s.position_m), s.time_s));
    let faces: Vec<_> =
        contact.iter().chain(&ruptures).map(|face| (face.depth_mm, face.time_s)).chain(end).collect();
    let layers = faces.windows(2).enumerate().map(|(k, face)| {
        json!({
            "label": format!("layer {}", k + 1),
            "depth_mm": [face[0].0, face[1].0],
            "time_s": [face[0].1, face[1].1],
        })
    });
    json!({
        "algorithm": algorithm,
        "contact_text": match &contact {
            Some(c) => {
                format!("contact at {} mm, {} s", significant(c.depth_mm, 4), significant(c.time_s, 4))
            }
            None => "no contact detected: the force never exceeds its noise in air".to_owned(),
        },
        "contact": contact,
        "ruptures": ruptures,
        "layers": layers.collect::<Value>(),
        "table": {
            "head": ["layer", "from mm", "thickness mm", "K N/m", "b N s/m²", "drop N"],
            "rows": trace.estimates.iter().take(MAX_LISTED).map(layer_row).collect::<Value>(),
        },
    })
}

fn layer_row(e: &LayerEstimate) -> Vec<String> {
    let interval = |value: f64, sd: f64| plus_minus(value, (sd > 0.0).then_some(stylet_stats::Z95 * sd), 3);
    vec![
        e.layer.to_string(),
        significant(1e3 * e.start_m, 3),
        significant(1e3 * e.thickness_m, 3),
        interval(e.stiffness_n_per_m, e.stiffness_sd),
        interval(e.friction, e.friction_sd),
        interval(e.drop_n, e.drop_sd_n),
    ]
}

/// `stylet enhance` of a recording.
pub fn write_enhancement(studio: &mut Studio, request: RecordingViewRequest) -> Result<Value, Problem> {
    let algorithm = request.algorithms.first().map_or(ALGORITHMS[0].0, String::as_str);
    let contact_mm = request.corrections.contact_mm;
    let config = config(algorithm, contact_mm)?;
    studio.save_workspace()?;
    let workspace = &studio.workspace;
    let data = workspace.data(&request.file)?;
    let map = studio.map_file();
    let stem = request.file.rsplit_once('.').map_or(&*request.file, |(stem, _)| stem);
    let settings: Vec<String> = (algorithm != ALGORITHMS[0].0)
        .then(|| format!("algorithm: {algorithm}"))
        .into_iter()
        .chain(contact_mm.map(|mm| format!("contact: Known, surface_m: {}", 1e-3 * mm)))
        .collect();
    let config_file = (!settings.is_empty()).then(|| format!("enhance-{stem}.ron"));
    if let Some(name) = &config_file {
        workspace.write(name, format!("Enhance({})\n", settings.join(", ")).as_bytes())?;
    }
    let config_path = config_file.map(|name| workspace.path(&name));
    // As written by the command.
    let (recording, notes) = stylet_record::read_csv(&data, &studio.read_options())?;
    let folder_name = format!("enhanced-{stem}");
    let folder = studio.workspace.path(&folder_name);
    let regressor = config.enhance.model;
    let result = enhance_recording(recording, notes, config, &[regressor], None)?;
    let mut command = commands::enhance(&data, map.as_deref(), config_path.as_deref(), &folder);
    let source = ResultSource { data: &data, config: config_path.as_deref(), command: command.shell.clone() };
    let output = result.output_files(&source)?;
    output.write(&folder)?;
    command.files = commands::written(&folder, &output);
    studio.workspace.record(command)?;
    Ok(json!({ "summary": format!("written to {}", folder.display()), "folder": folder_name }))
}
