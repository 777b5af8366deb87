//! `stylet enhance`: the online core on a measured recording.

use crate::args::EnhanceArgs;
use crate::exit::Failure;
use crate::limits;
use crate::output::Output;
use crate::picture::{self, Ran};
use crate::run::default_folder;
use crate::{hash, terminal};
use serde::Serialize;
use std::fmt::Write;
use stylet_core::LayerEstimate;
use stylet_core::config::Model;
use stylet_record::{ColumnMap, QualityNote, ReadOptions, Recording, read_csv, write_csv};
use stylet_report::run::{ForceTrace, Provenance, RunReport};
use stylet_report::svg::FigureOptions;
use stylet_report::{plus_minus, significant};
use stylet_scenario::{EnhanceFile, ron_options};
use stylet_score::Trace;

/// A detection as `enhance.json` has it.
#[derive(Serialize)]
struct Found {
    time_s: f64,
    position_m: f64,
    located_s: f64,
    located_m: f64,
    cause: &'static str,
}

/// A layer as `enhance.json` has it.
#[derive(Serialize)]
struct Layer {
    layer: usize,
    start_m: f64,
    thickness_m: f64,
    stiffness_n_per_m: f64,
    friction: f64,
    friction_unit: &'static str,
    drop_n: f64,
    cumulative_friction_added_ns_per_m: f64,
    /// 95 % intervals, and friction along the shaft as the layer gave way; missing where the algorithm gives none.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    certain: Option<Certain>,
}

/// What an algorithm that knows its uncertainty says beside.
#[derive(Serialize)]
struct Certain {
    stiffness_interval: [f64; 2],
    friction_interval: [f64; 2],
    drop_interval: [f64; 2],
    cumulative_friction_ns_per_m: f64,
    cumulative_friction_interval: [f64; 2],
}

impl Certain {
    fn of(e: &LayerEstimate) -> Option<Self> {
        (e.stiffness_sd > 0.0).then(|| Self {
            stiffness_interval: around(e.stiffness_n_per_m, e.stiffness_sd),
            friction_interval: around(e.friction, e.friction_sd),
            drop_interval: around(e.drop_n, e.drop_sd_n),
            cumulative_friction_ns_per_m: e.cumulative_ns_per_m,
            cumulative_friction_interval: around(e.cumulative_ns_per_m, e.cumulative_sd),
        })
    }
}

/// The 95 % interval of a number with this standard deviation.
fn around(value: f64, sd: f64) -> [f64; 2] {
    [value - stylet_stats::Z95 * sd, value + stylet_stats::Z95 * sd]
}

/// What the core found, per model.
#[derive(Serialize)]
struct FoundBy {
    model: String,
    contact_m: Option<f64>,
    contact_s: Option<f64>,
    ruptures: Vec<Found>,
    layers: Vec<Layer>,
}

/// `enhance.json`.
#[derive(Serialize)]
struct EnhanceResult<'a> {
    recording: String,
    samples: usize,
    duration_s: f64,
    sample_hz: f64,
    hash: &'a str,
    version: &'a str,
    found: Vec<FoundBy>,
    data_quality: &'a [QualityNote],
}

/// A drop with its 95 % interval, in N; the interval is missing where the algorithm gives none.
#[derive(Serialize)]
struct DropSize {
    value: Option<f64>,
    low: Option<f64>,
    high: Option<f64>,
}

/// A rupture as `events.json` has it.
#[derive(Serialize)]
struct Event {
    time_s: f64,
    position_m: f64,
    drop_n: DropSize,
    /// Probability that it is no false alarm, 0 to 1; missing where the algorithm does not tell.
    confidence: Option<f64>,
}

fn events(trace: &Trace) -> Vec<Event> {
    let told = |x: f64| (x != 0.0).then_some(x);
    trace
        .detections
        .iter()
        .map(|d| {
            let estimate = trace.estimates.iter().find(|e| e.layer == d.layer);
            // What the samples around the drop say; without that, what the layer's estimate says.
            let (value, sd) = match (told(d.drop_sd_n), estimate) {
                (Some(sd), _) => (Some(d.drop_n), Some(sd)),
                (None, Some(e)) => (Some(e.drop_n), told(e.drop_sd_n)),
                (None, None) => (None, None),
            };
            let interval = value.zip(sd).map(|(value, sd)| around(value, sd));
            Event {
                time_s: d.time_s,
                position_m: d.position_m,
                drop_n: DropSize { value, low: interval.map(|i| i[0]), high: interval.map(|i| i[1]) },
                confidence: told(d.confidence),
            }
        })
        .collect()
}

/// The table with the state's name as its last column.
fn with_state(csv: &[u8], state: &[stylet_core::State]) -> Vec<u8> {
    let mut out = Vec::with_capacity(csv.len() + 24 * state.len());
    let mut state = state.iter();
    for (i, line) in csv.split(|b| *b == b'\n').filter(|line| !line.is_empty()).enumerate() {
        out.extend_from_slice(line.strip_suffix(b"\r").unwrap_or(line));
        out.push(b',');
        let name = if i == 0 { "state" } else { state.next().map_or("", |s| s.name()) };
        out.extend_from_slice(name.as_bytes());
        out.push(b'\n');
    }
    out
}

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn enhance(args: &EnhanceArgs) -> Result<(), Failure> {
    let config = args.config.as_deref().map(EnhanceFile::load).transpose()?.unwrap_or_default();
    let columns: Option<ColumnMap> = args.columns.as_deref().map(stylet_scenario::load).transpose()?;
    if let Some(need) = limits::of_enhance(&args.data, if args.compare { 2 } else { 1 }) {
        args.limits.allow(&args.data, &need, args.results.quiet)?;
    }
    let (recording, notes) = read_csv(&args.data, &ReadOptions { columns, repair: args.repair })?;
    let mut models = vec![config.enhance.model];
    if args.compare {
        models = vec![Model::MultiLayer, Model::KelvinVoigt];
    }
    let ran: Vec<Ran> = models.iter().map(|&model| stylet_api::listen(&recording, &config, model)).collect();
    let (output, hash) = results(args, &config, &recording, &notes, &ran)?;
    let folder = args.results.out.clone().unwrap_or_else(|| default_folder(&args.data));
    output.write(&folder)?;
    if !args.results.quiet {
        terminal::say(&format!(
            "{}\nReport: {}\n",
            summary(args, &recording, &notes, &ran, &hash),
            folder.join("report.html").display()
        ))?;
    }
    Ok(())
}

fn found_by(ran: &Ran) -> FoundBy {
    let friction_unit = match ran.config.model {
        Model::MultiLayer => "N s/m2",
        Model::KelvinVoigt => "N s/m",
    };
    let layer = |e: &LayerEstimate| Layer {
        layer: e.layer,
        start_m: e.start_m,
        thickness_m: e.thickness_m,
        stiffness_n_per_m: e.stiffness_n_per_m,
        friction: e.friction,
        friction_unit,
        drop_n: e.drop_n,
        cumulative_friction_added_ns_per_m: e.added_friction_ns_per_m,
        certain: Certain::of(e),
    };
    FoundBy {
        model: ran.name.clone(),
        contact_m: ran.trace.contact_m,
        contact_s: ran.trace.contact_s,
        ruptures: ran
            .trace
            .detections
            .iter()
            .map(|d| Found {
                time_s: d.time_s,
                position_m: d.position_m,
                located_s: d.located_s,
                located_m: d.located_m,
                cause: d.cause.name(),
            })
            .collect(),
        layers: ran.trace.estimates.iter().map(layer).collect(),
    }
}

fn results(
    args: &EnhanceArgs,
    config: &EnhanceFile,
    recording: &Recording,
    notes: &[QualityNote],
    ran: &[Ran],
) -> Result<(Output, String), Failure> {
    let internal = |e: &dyn std::fmt::Display| Failure::Internal(e.to_string());
    let file = args.data.display().to_string();
    let mut csv = Vec::new();
    if let Some(first) = ran.first() {
        let extra: [(&str, &[f64]); 5] = [
            ("enhanced_n", &first.trace.enhanced_n),
            ("low_n", &first.trace.low_n),
            ("high_n", &first.trace.high_n),
            ("reconstructed_n", &first.trace.reconstructed_n),
            ("estimated_cumulative_friction_ns_per_m", &first.trace.cumulative_friction_ns_per_m),
        ];
        write_csv(recording, None, &extra, &mut csv)?;
        csv = with_state(&csv, &first.trace.state);
    }
    let hash = hash::of_results(&csv, &ran.iter().map(|r| &r.trace).collect::<Vec<_>>());
    let result = EnhanceResult {
        recording: file.clone(),
        samples: recording.len(),
        duration_s: recording.duration_s(),
        sample_hz: recording.sample_hz(),
        hash: &hash,
        version: env!("CARGO_PKG_VERSION"),
        found: ran.iter().map(found_by).collect(),
        data_quality: notes,
    };
    let mut json = serde_json::to_vec_pretty(&result).map_err(|e| internal(&e))?;
    json.push(b'\n');
    let pretty = stylet_scenario_pretty(config).map_err(|e| internal(&e))?;
    let title = args.data.file_name().map_or(file.clone(), |n| n.to_string_lossy().into_owned());
    let report = RunReport {
        title,
        source: "measured recording; there is no ground truth to score against".to_owned(),
        provenance: Provenance {
            scenario_file: args.config.as_ref().map_or("defaults".to_owned(), |c| c.display().to_string()),
            scenario_text: pretty,
            command: command(args),
            seed: None,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            hash: hash.clone(),
        },
        notes: notes.iter().map(|n| n.message.clone()).chain(stylet_api::settings_note(ran)).collect(),
        ..picture::report(
            recording,
            vec![ForceTrace { sensor: "force_torque".to_owned(), force_n: recording.force_n.clone() }],
            ran,
        )
    };
    let mut output = Output::default();
    output.add("enhanced.csv", csv);
    output.add("enhance.json", json);
    let events: Vec<Event> = ran.first().map(|r| events(&r.trace)).unwrap_or_default();
    let mut json = serde_json::to_vec_pretty(&events).map_err(|e| internal(&e))?;
    json.push(b'\n');
    output.add("events.json", json);
    output.add("figure.svg", report.to_svg(&FigureOptions::default()));
    output.add("report.html", report.to_html());
    Ok((output, hash))
}

fn stylet_scenario_pretty(config: &EnhanceFile) -> Result<String, impl std::fmt::Display> {
    ron_options().to_string_pretty(config, Default::default()).map(|body| format!("Enhance{body}\n"))
}

fn command(args: &EnhanceArgs) -> String {
    let mut command = format!("stylet enhance {}", args.data.display());
    for (flag, path) in [("--columns", &args.columns), ("--config", &args.config)] {
        if let Some(path) = path {
            let _ = write!(command, " {flag} {}", path.display());
        }
    }
    for (flag, on) in [("--repair", args.repair), ("--compare", args.compare)] {
        if on {
            let _ = write!(command, " {flag}");
        }
    }
    command
}

fn summary(
    args: &EnhanceArgs,
    recording: &Recording,
    notes: &[QualityNote],
    ran: &[Ran],
    hash: &str,
) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{}\n{} samples over {} s, {} Hz, hash {hash}",
        args.data.display(),
        recording.len(),
        significant(recording.duration_s(), 4),
        significant(recording.sample_hz(), 3),
    );
    for note in notes {
        let _ = writeln!(out, "  note: {}", note.message);
    }
    if let Some(note) = stylet_api::settings_note(ran) {
        let _ = writeln!(out, "  note: {note}");
    }
    for r in ran {
        let unit = if r.config.model == Model::MultiLayer { "N s/m²" } else { "N s/m" };
        let _ = writeln!(out, "\n{}", r.name);
        match (r.trace.contact_m, r.trace.contact_s) {
            (Some(z), Some(t)) => {
                let _ = writeln!(out, "  first contact at {:.2} mm, {t:.3} s", z * 1e3);
            }
            _ => {
                // A finding about the recording says it better.
                let grave = notes.iter().any(|n| n.grave);
                let why =
                    if grave { "see the note" } else { "the force never stands out of its noise in air" };
                let _ = writeln!(out, "  no contact found: {why}");
            }
        }
        let _ = writeln!(out, "  {} rupture(s)", r.trace.detections.len());
        for d in &r.trace.detections {
            let _ = writeln!(
                out,
                "    at {:.3} s, {:.2} mm (traced back to {:.2} mm), by {}",
                d.time_s,
                d.position_m * 1e3,
                d.located_m * 1e3,
                d.cause.name()
            );
        }
        for e in &r.trace.estimates {
            let shown =
                |value: f64, sd: f64| plus_minus(value, (sd > 0.0).then_some(stylet_stats::Z95 * sd), 3);
            let _ = writeln!(
                out,
                "  layer {}: {:.2} mm, K {} N/m, b {} {unit}, drop {} N",
                e.layer,
                e.thickness_m * 1e3,
                shown(e.stiffness_n_per_m, e.stiffness_sd),
                shown(e.friction, e.friction_sd),
                shown(e.drop_n, e.drop_sd_n),
            );
        }
        if r.trace.estimates.iter().any(|e| e.stiffness_sd > 0.0) {
            let _ = writeln!(out, "  (± 95 %)");
        }
    }
    out
}
