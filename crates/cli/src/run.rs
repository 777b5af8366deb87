//! `stylet run`: simulate, enhance, score, report.

use crate::args::RunArgs;
use crate::exit::Failure;
use crate::output::Output;
use crate::picture::{self, Ran};
use crate::{hash, terminal};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stylet_core::config::Model;
use stylet_record::{Recording, write_csv};
use stylet_report::run::{ForceTrace, Provenance, RunReport};
use stylet_report::svg::FigureOptions;
use stylet_scenario::Scenario;
use stylet_score::{LayerTruth, Score, model_name, score_run};
use stylet_testbed::{Reading, Simulation, VirtualError, simulate};

/// `score.json` of a run.
#[derive(Serialize)]
struct ScoreFile<'a> {
    scenario: &'a str,
    seed: u64,
    hash: &'a str,
    version: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    virtual_sensor: Option<VirtualScore>,
    #[serde(flatten)]
    one: Option<&'a Score>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    runs: BTreeMap<&'a str, &'a Score>,
}

/// The virtual sensor against the true force.
#[derive(Serialize)]
struct VirtualScore {
    lag_s: f64,
    rms_n: f64,
    beside_lag_rms_n: f64,
}

impl From<VirtualError> for VirtualScore {
    fn from(error: VirtualError) -> Self {
        let VirtualError { lag_s, rms_n, beside_lag_rms_n } = error;
        Self { lag_s, rms_n, beside_lag_rms_n }
    }
}

/// Everything that one run made.
pub struct Finished {
    /// What was simulated.
    pub simulation: Simulation,
    /// What the core made of it, per model and sensor.
    pub ran: Vec<Ran>,
    /// The layers as the law has them.
    pub layers: Vec<LayerTruth>,
}

/// Simulates a scenario and runs the core on it, once per model and sensor.
///
/// # Errors
/// [`Failure::Simulate`] when the scenario cannot be simulated.
pub fn finish(scenario: &Scenario, file: &str, models: &[Model]) -> Result<Finished, Failure> {
    let simulation =
        simulate(scenario, scenario.seed).map_err(|why| Failure::Simulate { file: file.to_owned(), why })?;
    let layers = simulation.layers();
    let listen = |model: Model, reading: &Reading| {
        let mut config = match reading.sensor {
            "virtual" => scenario.enhance_for_virtual().clone(),
            _ => scenario.enhance.clone(),
        };
        config.model = model;
        let (trace, score) =
            score_run(&simulation.recording, &reading.force_n, &simulation.truth, &layers, &config);
        Ran {
            name: format!("paper/{}/{}", model_name(model), reading.sensor),
            sensor: reading.sensor,
            config,
            trace,
            score: Some(score),
        }
    };
    let pairs = models.iter().flat_map(|model| simulation.readings.iter().map(|r| (*model, r)));
    let ran = pairs.map(|(model, reading)| listen(model, reading)).collect();
    Ok(Finished { simulation, ran, layers })
}

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn run(args: &RunArgs) -> Result<(), Failure> {
    let file = args.scenario.display().to_string();
    let mut scenario = Scenario::load(&args.scenario)?;
    if let Some(seed) = args.seed {
        scenario.seed = seed;
    }
    if args.compare {
        scenario.compare = vec![Model::MultiLayer, Model::KelvinVoigt];
    }
    let finished = finish(&scenario, &file, &scenario.models())?;
    let folder = args.results.out.clone().unwrap_or_else(|| default_folder(&args.scenario));
    let (output, report) = results(&scenario, &file, &finished)?;
    output.write(&folder)?;
    if !args.results.quiet {
        terminal::say(&format!(
            "{}\nReport: {}\n",
            terminal::scorecard(&scenario, &finished, &report.provenance.hash),
            folder.join("report.html").display()
        ))?;
    }
    Ok(())
}

/// Where results go when nothing is said: `stylet-out/` and the input's name.
pub fn default_folder(input: &Path) -> PathBuf {
    Path::new("stylet-out").join(input.file_stem().unwrap_or(input.as_os_str()))
}

fn results(scenario: &Scenario, file: &str, finished: &Finished) -> Result<(Output, RunReport), Failure> {
    let internal = |e: &dyn std::fmt::Display| Failure::Internal(e.to_string());
    let Finished { simulation, ran, layers } = finished;
    let csv = recording_csv(&simulation.recording, simulation, ran)?;
    let hash = hash::of_results(&csv, &ran.iter().map(|r| &r.trace).collect::<Vec<_>>());
    let resolved = format!(
        "// Every default written out by stylet {}. Repeat: stylet run scenario.ron\n{}",
        env!("CARGO_PKG_VERSION"),
        scenario.to_ron().map_err(|e| internal(&e))?
    );
    let forces = simulation.readings.iter().map(|reading| force_trace(reading, &simulation.recording));
    let forces = forces.collect();
    let report = RunReport {
        title: scenario.name.clone(),
        source: scenario.source.clone(),
        provenance: Provenance {
            scenario_file: file.to_owned(),
            scenario_text: resolved.clone(),
            command: format!("stylet run {file} --seed {}", scenario.seed),
            seed: Some(scenario.seed),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            hash: hash.clone(),
        },
        notes: terminal::virtual_note(simulation).into_iter().collect(),
        truth: Some(picture::truth(&simulation.truth, scenario, layers)),
        ..picture::report(&simulation.recording, forces, ran)
    };
    let several = ran.len() > 1;
    let score = ScoreFile {
        scenario: &scenario.name,
        seed: scenario.seed,
        hash: &hash,
        version: env!("CARGO_PKG_VERSION"),
        virtual_sensor: simulation.virtual_error.map(VirtualScore::from),
        one: ran.first().filter(|_| !several).and_then(|r| r.score.as_ref()),
        runs: ran
            .iter()
            .filter(|_| several)
            .filter_map(|r| r.score.as_ref().map(|s| (r.name.as_str(), s)))
            .collect(),
    };
    let mut json = serde_json::to_vec_pretty(&score).map_err(|e| internal(&e))?;
    json.push(b'\n');
    let mut output = Output::default();
    output.add("recording.csv", csv);
    output.add("score.json", json);
    output.add("scenario.ron", resolved);
    output.add("figure.svg", report.to_svg(&FigureOptions::default()));
    output.add("report.html", report.to_html());
    Ok((output, report))
}

/// What a sensor recorded; in the picture also before it was zeroed.
fn force_trace(reading: &Reading, recording: &Recording) -> ForceTrace {
    let recorded = match (reading.sensor, &recording.force_virtual_n) {
        ("virtual", Some(force_n)) => force_n,
        _ => &reading.force_n,
    };
    ForceTrace { sensor: reading.sensor.to_owned(), force_n: recorded.clone() }
}

fn recording_csv(recording: &Recording, simulation: &Simulation, ran: &[Ran]) -> Result<Vec<u8>, Failure> {
    let Some(first) = ran.first() else { return Ok(Vec::new()) };
    let extra: [(&str, &[f64]); 3] = [
        ("enhanced_n", &first.trace.enhanced_n),
        ("reconstructed_n", &first.trace.reconstructed_n),
        ("estimated_cumulative_friction_ns_per_m", &first.trace.cumulative_friction_ns_per_m),
    ];
    let mut csv = Vec::new();
    write_csv(recording, Some(&simulation.truth), &extra, &mut csv)?;
    Ok(csv)
}
