//! What a scenario gets wrong about measured recordings. The only file here that knows the engine.

use crate::diagnosis_inputs::{DiagnosisInputs, INPUTS_FILE};
use crate::error::Error;
use crate::output_files::{OutputFiles, to_json_bytes};
use stylet_diagnose::prediction::{PredictionResult, Refit};
use stylet_diagnose::{Diagnosis, DiagnosisResult, NamedRecording, Options};
use stylet_record::{QualityNote, assess, check_usable, downsample};
use stylet_scenario::Scenario;

/// What a diagnosis gives.
pub struct DiagnosisReport {
    /// Verdict, causes, intervals, gain.
    pub diagnosis: Diagnosis,
    /// The scenario with re-fitted parameters and the effects found.
    pub extended: Scenario,
    /// All that the engine knows, for the report.
    pub details: DiagnosisResult,
}

impl DiagnosisReport {
    /// `diagnosis.json`.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn json(&self) -> Result<Vec<u8>, Error> {
        to_json_bytes(&self.diagnosis)
    }

    /// `extended.ron`; `believed` names the scenario in its first line.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn extended_ron(&self, believed: &str) -> Result<String, Error> {
        Ok(format!(
            "// {believed} with re-fitted parameters and the effects found by stylet diagnose {}.\n{}",
            env!("CARGO_PKG_VERSION"),
            self.extended.to_ron().map_err(Error::internal)?
        ))
    }

    /// The report: `believed` was read from `file`, `command` repeats it.
    #[must_use]
    pub fn html(&self, believed: &Scenario, file: &str, command: String) -> String {
        stylet_report::pages::diagnosis::page(believed, file, command, &self.details).to_html()
    }

    /// All files that `stylet diagnose` writes for single recordings; `believed` was read from the inputs' scenario.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output(&self, believed: &Scenario, inputs: &DiagnosisInputs) -> Result<OutputFiles, Error> {
        let file = inputs.scenario.display().to_string();
        let mut output = OutputFiles::default();
        output.add("report.html", self.html(believed, &file, inputs.command_line()));
        output.add("diagnosis.json", self.json()?);
        output.add_json(INPUTS_FILE, &inputs.with_absolute_paths())?;
        output.add("extended.ron", self.extended_ron(&file)?);
        Ok(output)
    }
}

/// Compares what a scenario believes with what was measured; `progress` is told what is being done. At least one recording;
/// with two or more the gain is measured on recordings left out of the fit.
///
/// Recordings that are too long are thinned first, and the diagnosis says so.
///
/// # Errors
/// [`Error::Recording`] when a recording allows no conclusion (a dead or reversed sensor, millimetres for metres, ...),
/// [`Error::Diagnose`] when the recordings do not fit the scenario.
pub fn diagnose(
    believed: &Scenario,
    evidence: &[NamedRecording],
    progress: impl FnMut(&str),
) -> Result<DiagnosisReport, Error> {
    let thinned = within_reach_all(evidence)?;
    let examined = stylet_diagnose::diagnose(believed, &thinned, &Options::default(), progress)?;
    Ok(DiagnosisReport {
        diagnosis: examined.diagnosis.clone(),
        extended: examined.extended_scenario.clone(),
        details: examined,
    })
}

/// How well a scenario predicts recordings that took no part in making it. `diagnosis` is the one it came from, for noise,
/// scatter and intervals; `believed` is what was believed before; what is in `refit` is fitted to the recordings first, and
/// with two or more each is predicted by what the others say.
///
/// # Errors
/// As [`diagnose`].
pub fn predict_recordings(
    model: &Scenario,
    diagnosis: Option<&Diagnosis>,
    believed: Option<&Scenario>,
    refit: &[Refit],
    evidence: &[NamedRecording],
) -> Result<PredictionResult, Error> {
    let thinned = within_reach_all(evidence)?;
    Ok(stylet_diagnose::prediction::predict(model, diagnosis, believed, refit, &thinned)?)
}

/// The recordings as long as the engine can use them, if it can.
fn within_reach_all(evidence: &[NamedRecording]) -> Result<Vec<NamedRecording>, Error> {
    let mut judged: Vec<(&str, Vec<QualityNote>)> = Vec::with_capacity(evidence.len());
    for e in evidence {
        // Samples that are no numbers are the engine's to cut out.
        let notes = if e.recording.check().is_ok() { assess(&e.recording) } else { Vec::new() };
        judged.push((&e.name, notes));
    }
    check_usable(judged.iter().map(|(name, notes)| (*name, notes.as_slice())))?;
    Ok(evidence.iter().map(within_reach).collect())
}

/// The recording as long as a diagnosis can use it.
fn within_reach(evidence: &NamedRecording) -> NamedRecording {
    let Some((recording, note)) = downsample(&evidence.recording) else { return evidence.clone() };
    let mut notes = evidence.notes.clone();
    notes.push(note);
    NamedRecording { name: evidence.name.clone(), recording, notes }
}
