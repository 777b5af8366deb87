//! A simulated scenario: recording, outputs of the online algorithm, scores.

use crate::error::Error;
use crate::output_files::{OutputFiles, to_json_bytes};
use crate::result_hash;
use crate::run_report::{self, AlgorithmRun};
use serde::Serialize;
use std::collections::BTreeMap;
use stylet_core::config::{Algorithm, Model};
use stylet_record::{LayerTruth, Recording, write_csv};
use stylet_report::insertion_report::{ForceTrace, Provenance, RunReport};
use stylet_report::significant;
use stylet_report::svg::FigureOptions;
use stylet_scenario::{Scenario, unused_settings};
use stylet_score::{Score, algorithm_name, model_name, score_run};
use stylet_testbed::{SensorReadings, Simulation, VirtualSensorAccuracy};

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
    lag_corrected_rms_n: f64,
}

impl From<VirtualSensorAccuracy> for VirtualScore {
    fn from(error: VirtualSensorAccuracy) -> Self {
        let VirtualSensorAccuracy { lag_s, rms_n, lag_corrected_rms_n } = error;
        Self { lag_s, rms_n, lag_corrected_rms_n }
    }
}

/// Result of a run.
pub struct Run {
    /// Scenario.
    pub scenario: Scenario,
    /// Recording, truth, sensor readings.
    pub simulation: Simulation,
    /// Outputs of the online algorithm, per model and sensor.
    pub algorithm_runs: Vec<AlgorithmRun>,
    /// True layers.
    pub layers: Vec<LayerTruth>,
    /// Hash over all results: the same scenario and seed give the same.
    pub hash: String,
    /// The recording with truth and enhanced force, as CSV.
    csv: Vec<u8>,
}

/// Simulates a scenario with its own seed and runs the online algorithm on it, once per model and sensor.
///
/// # Errors
/// [`Error::Simulate`] when the scenario cannot be simulated.
pub fn simulate(scenario: &Scenario) -> Result<Run, Error> {
    simulate_from(scenario, &scenario.name)
}

/// As [`simulate`]; `file` is named in errors.
///
/// # Errors
/// [`Error::Simulate`] when the scenario cannot be simulated.
pub fn simulate_from(scenario: &Scenario, file: &str) -> Result<Run, Error> {
    let simulation = stylet_testbed::simulate(scenario, scenario.seed)
        .map_err(|why| Error::Simulate { file: file.to_owned(), why })?;
    let layers = simulation.true_layers();
    let run_algorithm = |model: Model, reading: &SensorReadings| {
        let mut config = match reading.sensor {
            "virtual" => scenario.enhance_for_virtual().clone(),
            _ => scenario.enhance.clone(),
        };
        config.model = model;
        let (trace, score) =
            score_run(&simulation.recording, &reading.force_n, &simulation.truth, &layers, &config);
        AlgorithmRun {
            name: format!(
                "{}/{}/{}",
                algorithm_name(config.active_algorithm()),
                model_name(model),
                reading.sensor
            ),
            sensor: reading.sensor,
            config,
            trace,
            score: Some(score),
        }
    };
    let models = scenario.models();
    let pairs = models.iter().flat_map(|model| simulation.readings.iter().map(|r| (*model, r)));
    let ran: Vec<AlgorithmRun> = pairs.map(|(model, reading)| run_algorithm(model, reading)).collect();
    let csv = recording_csv(&simulation.recording, &simulation, &ran)?;
    let hash = result_hash::hash_results(&csv, &ran.iter().map(|r| &r.trace).collect::<Vec<_>>());
    Ok(Run { scenario: scenario.clone(), simulation, algorithm_runs: ran, layers, hash, csv })
}

impl Run {
    /// `recording.csv`: the recording with truth and enhanced force.
    #[must_use]
    pub fn recording_csv(&self) -> &[u8] {
        &self.csv
    }

    /// `score.json`.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn score_json(&self) -> Result<Vec<u8>, Error> {
        let Self { scenario, simulation, algorithm_runs: ran, hash, .. } = self;
        let several = ran.len() > 1;
        let score = ScoreFile {
            scenario: &scenario.name,
            seed: scenario.seed,
            hash,
            version: env!("CARGO_PKG_VERSION"),
            virtual_sensor: simulation.virtual_sensor_accuracy.map(VirtualScore::from),
            one: ran.first().filter(|_| !several).and_then(|r| r.score.as_ref()),
            runs: ran
                .iter()
                .filter(|_| several)
                .filter_map(|r| r.score.as_ref().map(|s| (r.name.as_str(), s)))
                .collect(),
        };
        to_json_bytes(&score)
    }

    /// `scenario.ron`: every default written out.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn scenario_ron(&self) -> Result<String, Error> {
        Ok(format!(
            "// Every default written out by stylet {}. Repeat: stylet run scenario.ron\n{}",
            env!("CARGO_PKG_VERSION"),
            self.scenario.to_ron().map_err(Error::internal)?
        ))
    }

    /// The report; `file` is the scenario in the command that repeats the run.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn report(&self, file: &str) -> Result<RunReport, Error> {
        let Self { scenario, simulation, algorithm_runs: ran, layers, hash, .. } = self;
        let forces = simulation.readings.iter().map(|reading| force_trace(reading, &simulation.recording));
        Ok(RunReport {
            title: scenario.name.clone(),
            source: scenario.source.clone(),
            provenance: Provenance {
                scenario_file: file.to_owned(),
                scenario_text: self.scenario_ron()?,
                command: format!("stylet run {file} --seed {}", scenario.seed),
                seed: Some(scenario.seed),
                version: env!("CARGO_PKG_VERSION").to_owned(),
                hash: hash.clone(),
            },
            notes: virtual_note(simulation).into_iter().chain(settings_note(ran)).collect(),
            truth: Some(run_report::report_truth(&simulation.truth, scenario, layers)),
            ..run_report::run_report(&simulation.recording, forces.collect(), ran)
        })
    }

    /// All files that `stylet run` writes.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output(&self, file: &str) -> Result<OutputFiles, Error> {
        let report = self.report(file)?;
        let mut output = OutputFiles::default();
        output.add("recording.csv", self.csv.clone());
        output.add("score.json", self.score_json()?);
        output.add("scenario.ron", report.provenance.scenario_text.clone());
        output.add("figure.svg", report.to_svg(&FigureOptions::default()));
        output.add("report.html", report.to_html());
        Ok(output)
    }
}

/// Lag and error of the virtual sensor, as a sentence.
#[must_use]
pub fn virtual_note(simulation: &Simulation) -> Option<String> {
    simulation.virtual_sensor_accuracy.map(|error| {
        format!(
            "The virtual sensor lags by {} s; its error is {} N (rms), {} N after correction of the lag.",
            significant(error.lag_s, 3),
            significant(error.rms_n, 3),
            significant(error.lag_corrected_rms_n, 3)
        )
    })
}

/// Settings that differ from their defaults and have no effect on the algorithms that ran, as a sentence.
#[must_use]
pub fn settings_note(ran: &[AlgorithmRun]) -> Option<String> {
    let mut unused: Vec<&str> = ran.iter().flat_map(|r| unused_settings(&r.config)).collect();
    unused.sort_unstable();
    unused.dedup();
    // A setting that one of several runs uses has an effect.
    unused.retain(|name| ran.iter().all(|r| unused_settings(&r.config).contains(name)));
    let first = ran.first()?;
    let other = match first.config.active_algorithm() {
        Algorithm::Stylet => "Paper",
        Algorithm::Paper | Algorithm::Literal => "Stylet",
    };
    (!unused.is_empty()).then(|| {
        format!(
            "Set, but without effect: {}. The algorithm that ran, {}, has no such setting; write algorithm: {other} to use it.",
            unused.join(", "),
            algorithm_name(first.config.active_algorithm()),
        )
    })
}

/// The force trace of a sensor, including the samples before zeroing.
fn force_trace(reading: &SensorReadings, recording: &Recording) -> ForceTrace {
    let recorded = match (reading.sensor, &recording.force_virtual_n) {
        ("virtual", Some(force_n)) => force_n,
        _ => &reading.force_n,
    };
    ForceTrace { sensor: reading.sensor.to_owned(), force_n: recorded.clone() }
}

fn recording_csv(
    recording: &Recording,
    simulation: &Simulation,
    ran: &[AlgorithmRun],
) -> Result<Vec<u8>, Error> {
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
