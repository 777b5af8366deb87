//! Diagnosis of repeated insertions: a data set, or a scenario and recordings of the same insertion.

use crate::diagnose::usable_recordings;
use crate::diagnosis_inputs::DiagnosisInputs;
use crate::error::Error;
use crate::output_files::{OutputFiles, one_line};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stylet_core::EnhanceConfig;
use stylet_core::Sample;
use stylet_diagnose::prediction::training_summary;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::dataset::{Dataset, DatasetError, find_files, is_dataset};
use stylet_diagnose::repeated_insertions::diagnose_set::{SetDiagnosis, diagnose_set};
use stylet_diagnose::repeated_insertions::instrument_faults::ReferenceRecordings;
use stylet_diagnose::repeated_insertions::layer_composition::compose_layers;
use stylet_diagnose::repeated_insertions::population_prediction::friction_model;
use stylet_diagnose::repeated_insertions::repeatability_report::{CompositionReport, RepeatabilityReport};
use stylet_diagnose::{Diagnosis, NamedRecording};
use stylet_record::{Recording, check_distinct, read_csv};
use stylet_report::pages::repeated_insertions::{ablation_figure, page};
use stylet_scenario::Scenario;
use stylet_score::{MeasuredRecording, MeasuredScore, Trace};

/// Fewest recordings from which the variation between recordings can be estimated.
const MIN_RECORDINGS: usize = 3;

/// Result for a set of repeated insertions.
pub struct RepeatsReport {
    /// Candidate models, verdict, variation between recordings, held-out predictions.
    pub study: SetDiagnosis,
    /// Outputs of the online algorithm per recording.
    pub online: Vec<MeasuredScore>,
}

/// `diagnosis.json`.
#[derive(Serialize)]
struct DiagnosisFile<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    repeats: &'a RepeatabilityReport,
    online: &'a [MeasuredScore],
}

/// Reads the data set of the inputs; a scenario becomes a data set with its tissue.
///
/// # Errors
/// [`Error::Input`] when a file is wrong.
pub fn load_data_set(inputs: &DiagnosisInputs) -> Result<Dataset, Error> {
    let mut set = if is_dataset(&inputs.scenario)? {
        Dataset::load(&inputs.scenario)?
    } else {
        data_set_of(Scenario::load(&inputs.scenario)?)
    };
    apply_read_options(&mut set, inputs)?;
    Ok(set)
}

/// A scenario with the layers that the recordings of the inputs show, and the data set with its tissue.
///
/// # Errors
/// As [`identify`](crate::identify).
pub fn data_set_of_recordings(name: &str, inputs: &DiagnosisInputs) -> Result<(Scenario, Dataset), Error> {
    let recordings = usable_recordings(&inputs.read_recordings()?)?;
    let scenario = stylet_diagnose::scenario_from_recordings(name, &recordings, None)?;
    // Its numbers come from the recordings: there is nothing to compare.
    let mut set = Dataset { scenario: None, ..data_set_of(scenario.clone()) };
    apply_read_options(&mut set, inputs)?;
    Ok((scenario, set))
}

fn data_set_of(scenario: Scenario) -> Dataset {
    Dataset {
        name: scenario.name.clone(),
        source: scenario.source.clone(),
        columns: None,
        tissue: scenario.tissue.clone(),
        recordings: Vec::new(),
        split_by: Vec::new(),
        air: None,
        load: None,
        parts: Vec::new(),
        repair: false,
        scenario: Some(scenario),
    }
}

fn apply_read_options(set: &mut Dataset, inputs: &DiagnosisInputs) -> Result<(), Error> {
    set.repair = inputs.repair;
    if let Some(path) = &inputs.columns {
        set.columns = Some(stylet_scenario::load(path)?);
    }
    Ok(())
}

/// The given recordings, or, if there are none, those of the data set.
///
/// # Errors
/// [`Error::Request`] when there are none, [`Error::Dataset`] when a file is missing.
pub fn recording_files(set: &Dataset, given: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    if !given.is_empty() {
        return Ok(given.to_vec());
    }
    if set.recordings.is_empty() {
        return Err(Error::Request(
            "no recordings: name them with --data A.csv B.csv, or in the data set's `recordings`".to_owned(),
        ));
    }
    let mut out = Vec::new();
    for pattern in &set.recordings {
        out.extend(find_files(pattern)?);
    }
    Ok(out)
}

/// Diagnoses the recordings of a data set; `progress` is called with the name of each stage. If recordings are `given` explicitly, the other
/// files of the set (in air, under a known load, single layers) may be missing.
///
/// # Errors
/// [`Error::Dataset`] when there are too few recordings, [`Error::Recording`] when a recording is wrong.
pub fn diagnose_repeats(
    set: &Dataset,
    runs: &[SegmentedRecording],
    given: bool,
    progress: &mut dyn FnMut(&str),
) -> Result<RepeatsReport, Error> {
    if runs.len() < MIN_RECORDINGS {
        return Err(DatasetError::TooLittle(format!(
            "{} recording(s): the variation between recordings needs {MIN_RECORDINGS} or more; without --repeats single recordings are diagnosed",
            runs.len()
        ))
        .into());
    }
    let named: Vec<(&str, &Recording)> = runs.iter().map(|r| (r.name.as_str(), &r.recording)).collect();
    check_distinct(&named)?;
    let air = read_optional_recording(set, set.air.as_deref(), given)?;
    let load = read_optional_recording(set, set.load.as_ref().map(|l| l.file.as_str()), given)?;
    let known = load.as_ref().zip(set.load.as_ref()).map(|(r, l)| (r, l.force_n));
    let refs: Vec<&SegmentedRecording> = runs.iter().collect();
    let checks = ReferenceRecordings { air: air.as_ref(), load: known };
    let mut study = diagnose_set(&set.name, &set.tissue, set.scenario.as_ref(), &refs, &checks, progress)
        .ok_or_else(|| Error::internal("no model could be fitted to these recordings"))?;
    if let Some(scenario) = &set.scenario {
        study.compare_with_scenario(scenario);
    }
    progress("model selection without parts of the set");
    study.run_nested_cross_validation();
    if !set.parts.is_empty() {
        progress("composition of layers measured separately");
        study.report.composition = parts(set, &study, given)?;
    }
    let named: Vec<NamedRecording> = runs
        .iter()
        .map(|r| NamedRecording { name: r.name.clone(), recording: r.recording.clone(), notes: Vec::new() })
        .collect();
    study.diagnosis.training = training_summary(&study.mean_scenario, &study.diagnosis, &named);
    let online = study.recordings.iter().enumerate().map(|(i, run)| run_online(run, &study, i)).collect();
    Ok(RepeatsReport { study, online })
}

impl RepeatsReport {
    /// All files that `stylet diagnose` writes for repeats.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output(&self, set: &Dataset, inputs: &DiagnosisInputs) -> Result<OutputFiles, Error> {
        let Self { study, online } = self;
        let file = inputs.scenario.display();
        let ron = format!(
            "// {}: the model that stylet diagnose {} fitted, with the means of the per-recording parameters.\n{}",
            one_line(&file.to_string()),
            env!("CARGO_PKG_VERSION"),
            study.mean_scenario.to_ron().map_err(Error::internal)?
        );
        let mut commands = format!("stylet diagnose {file}");
        if let Some(columns) = &inputs.columns {
            let _ = write!(commands, " --columns {}", columns.display());
        }
        // A data set implies it.
        if !is_dataset(&inputs.scenario).unwrap_or(false) {
            commands.push_str(" --repeats");
        }
        if !inputs.data.is_empty() {
            let _ = write!(commands, " --data ...  # {} recordings", study.recordings.len());
        }
        commands.push_str("\nstylet run extended.ron  # the mean insertion, simulated");
        let mut output = OutputFiles::default();
        output.add("report.html", page(set, &file.to_string(), commands, study, online).to_html());
        output.add_json(
            "diagnosis.json",
            &DiagnosisFile { diagnosis: &study.diagnosis, repeats: &study.report, online },
        )?;
        output.add("extended.ron", ron);
        output.add("gain.svg", ablation_figure(study));
        Ok(output)
    }
}

/// Outputs of the online algorithm on recording `i`, and its residual during retraction with the friction model of the other recordings.
fn run_online(run: &SegmentedRecording, study: &SetDiagnosis, i: usize) -> MeasuredScore {
    let r = &run.recording;
    let config = EnhanceConfig::default();
    let trace = Trace::run(r, &r.force_n, &config, 0.0, |_, _| {});
    let drops: Vec<usize> = run.drops().iter().map(|drop| drop.sample).collect();
    let measured = MeasuredRecording {
        name: &run.name,
        recording: r,
        drops: &drops,
        deepest: run.phases.deepest,
        retraction: run.phases.retraction,
        contact_m: run.contact_m,
    };
    let population = study.held_out.get(i).and_then(|o| o.population.as_ref());
    MeasuredScore::evaluate(&measured, &trace, &config, || {
        let mut shaft = friction_model(population?, r)?;
        Some(move |s: &Sample, ruptured| shaft.step(s.time_s, s.position_m, s.velocity_mps, ruptured))
    })
}

/// Reads a recording of the data set; it may be missing if recordings were given explicitly.
fn read_optional_recording(
    set: &Dataset,
    file: Option<&str>,
    given: bool,
) -> Result<Option<Recording>, Error> {
    let Some(file) = file else { return Ok(None) };
    let found = match find_files(file) {
        Ok(found) => found,
        Err(DatasetError::NoFile { .. }) if given => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let first: &Path = &found[0];
    Ok(Some(read_csv(first, &set.options())?.0))
}

/// Composition of models of layers that were measured separately.
fn parts(set: &Dataset, study: &SetDiagnosis, given: bool) -> Result<Option<CompositionReport>, Error> {
    let mut alone: Vec<(String, Vec<SegmentedRecording>)> = Vec::new();
    for layer in 1..=set.tissue.layers.len() {
        let Some(part) = set.parts.iter().find(|p| p.layer == layer) else { return Ok(None) };
        let mut files = Vec::new();
        for pattern in &part.recordings {
            match find_files(pattern) {
                Ok(found) => files.extend(found),
                Err(DatasetError::NoFile { .. }) if given => return Ok(None),
                Err(error) => return Err(error.into()),
            }
        }
        let runs = set.load_recordings(&files, 1)?;
        let undone = study.report.instrument.calibrate(&runs.iter().collect::<Vec<_>>());
        alone.push((part.name.clone(), undone.recordings));
    }
    let whole: Vec<&SegmentedRecording> = study.recordings.iter().collect();
    Ok(compose_layers(study.candidates.best.family, &set.tissue, &alone, &whole))
}
