//! A measured recording, heard by the online core: what it found, as files.

use crate::enhance::listen;
use crate::error::Error;
use crate::hash;
use crate::output::Output;
use crate::picture::{self, Ran};
use crate::run::settings_note;
use serde::Serialize;
use std::path::Path;
use stylet_core::LayerEstimate;
use stylet_core::config::Model;
use stylet_record::{QualityNote, Recording, write_csv};
use stylet_report::run::{ForceTrace, Provenance, RunReport};
use stylet_report::svg::FigureOptions;
use stylet_scenario::{EnhanceFile, ron_options};
use stylet_score::Trace;

/// A measured recording and what the core made of it.
pub struct Heard {
    /// What was recorded.
    pub recording: Recording,
    /// What is remarkable about it.
    pub notes: Vec<QualityNote>,
    /// What the core made of it, per model.
    pub ran: Vec<Ran>,
    /// Hash over all results: the same recording and configuration give the same.
    pub hash: String,
    config: EnhanceFile,
    csv: Vec<u8>,
}

/// Where a recording and a configuration came from.
pub struct Source<'a> {
    /// The recording's file.
    pub data: &'a Path,
    /// The configuration's, if it is not the default.
    pub config: Option<&'a Path>,
    /// The command that repeats it.
    pub command: String,
}

/// Runs the core over a recording, once per model.
///
/// # Errors
/// [`Error::Recording`] when the table cannot be written.
pub fn hear(
    recording: Recording,
    notes: Vec<QualityNote>,
    config: EnhanceFile,
    models: &[Model],
) -> Result<Heard, Error> {
    let ran: Vec<Ran> = models.iter().map(|&model| listen(&recording, &config, model)).collect();
    let csv = table(&recording, &ran)?;
    let hash = hash::of_results(&csv, &ran.iter().map(|r| &r.trace).collect::<Vec<_>>());
    Ok(Heard { recording, notes, ran, hash, config, csv })
}

impl Heard {
    /// All files that `stylet enhance` writes.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output(&self, source: &Source) -> Result<Output, Error> {
        let Self { recording, notes, ran, hash, config, csv } = self;
        let file = source.data.display().to_string();
        let result = EnhanceResult {
            recording: file.clone(),
            samples: recording.len(),
            duration_s: recording.duration_s(),
            sample_hz: recording.sample_hz(),
            hash,
            version: env!("CARGO_PKG_VERSION"),
            found: ran.iter().map(found_by).collect(),
            data_quality: notes,
        };
        let body = ron_options().to_string_pretty(config, Default::default()).map_err(Error::internal)?;
        let report = RunReport {
            title: source.data.file_name().map_or(file, |n| n.to_string_lossy().into_owned()),
            source: "measured recording; there is no ground truth to score against".to_owned(),
            provenance: Provenance {
                scenario_file: source.config.map_or("defaults".to_owned(), |c| c.display().to_string()),
                scenario_text: format!("Enhance{body}\n"),
                command: source.command.clone(),
                seed: None,
                version: env!("CARGO_PKG_VERSION").to_owned(),
                hash: hash.clone(),
            },
            notes: notes.iter().map(|n| n.message.clone()).chain(settings_note(ran)).collect(),
            ..picture::report(
                recording,
                vec![ForceTrace { sensor: "force_torque".to_owned(), force_n: recording.force_n.clone() }],
                ran,
            )
        };
        let events: Vec<Event> = ran.first().map(|r| events(&r.trace)).unwrap_or_default();
        let mut output = Output::default();
        output.add("enhanced.csv", csv.clone());
        output.add_json("enhance.json", &result)?;
        output.add_json("events.json", &events)?;
        output.add("figure.svg", report.to_svg(&FigureOptions::default()));
        output.add("report.html", report.to_html());
        Ok(output)
    }
}

/// `enhanced.csv`: the recording beside what the first model made of it.
fn table(recording: &Recording, ran: &[Ran]) -> Result<Vec<u8>, Error> {
    let Some(first) = ran.first() else { return Ok(Vec::new()) };
    let extra: [(&str, &[f64]); 5] = [
        ("enhanced_n", &first.trace.enhanced_n),
        ("low_n", &first.trace.low_n),
        ("high_n", &first.trace.high_n),
        ("reconstructed_n", &first.trace.reconstructed_n),
        ("estimated_cumulative_friction_ns_per_m", &first.trace.cumulative_friction_ns_per_m),
    ];
    let mut csv = Vec::new();
    write_csv(recording, None, &extra, &mut csv)?;
    Ok(with_state(&csv, &first.trace.state))
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

/// What the core found, per model.
#[derive(Serialize)]
struct FoundBy {
    model: String,
    contact_m: Option<f64>,
    contact_s: Option<f64>,
    ruptures: Vec<Found>,
    layers: Vec<Layer>,
}

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

/// A rupture as `events.json` has it.
#[derive(Serialize)]
struct Event {
    time_s: f64,
    position_m: f64,
    drop_n: DropSize,
    /// Probability that it is no false alarm, 0 to 1; missing where the algorithm does not tell.
    confidence: Option<f64>,
}

/// A drop with its 95 % interval, in N; the interval is missing where the algorithm gives none.
#[derive(Serialize)]
struct DropSize {
    value: Option<f64>,
    low: Option<f64>,
    high: Option<f64>,
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
