//! Diagnosis of single recordings, and prediction of held-out ones, with the files that the commands write.

use crate::diagnosis_inputs::{DiagnosisInputs, INPUTS_FILE};
use crate::error::Error;
use crate::output_files::{OutputFiles, one_line, to_json_bytes};
use stylet_diagnose::prediction::{PredictionOptions, PredictionResult, training_summary};
use stylet_diagnose::{Diagnosis, DiagnosisResult, NamedRecording, Options};
use stylet_record::{QualityNote, Recording, assess, check_distinct, check_usable, downsample};
use stylet_scenario::Scenario;

/// Result of a diagnosis.
pub struct DiagnosisReport {
    /// Verdict, causes, intervals, gain.
    pub diagnosis: Diagnosis,
    /// The scenario with re-fitted parameters and identified effects.
    pub extended: Scenario,
    /// Intermediate results, for the report.
    pub details: DiagnosisResult,
}

impl DiagnosisReport {
    fn new(details: DiagnosisResult, recordings: &[NamedRecording]) -> Self {
        let (mut diagnosis, extended) = (details.diagnosis.clone(), details.extended_scenario.clone());
        diagnosis.training = training_summary(&extended, &diagnosis, recordings);
        Self { diagnosis, extended, details }
    }

    /// `diagnosis.json`.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn json(&self) -> Result<Vec<u8>, Error> {
        to_json_bytes(&self.diagnosis)
    }

    /// `extended.ron`; its first line names the assumed scenario.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn extended_ron(&self, assumed: &str) -> Result<String, Error> {
        let d = &self.diagnosis;
        let remarks: String = stylet_report::pages::diagnosis::lower_limits(d)
            .into_iter()
            .chain(stylet_report::pages::diagnosis::partial_model(d))
            .chain(stylet_report::pages::diagnosis::findings(d))
            .fold(String::new(), |text, remark| text + "// " + &remark.replace(['\n', '\r'], " ") + "\n");
        Ok(format!(
            "// {} with re-fitted parameters and the effects found by stylet diagnose {}.\n{remarks}{}",
            one_line(assumed),
            env!("CARGO_PKG_VERSION"),
            self.extended.to_ron().map_err(Error::internal)?
        ))
    }

    /// The report; `file` is the path of the assumed scenario, `command` repeats the diagnosis.
    #[must_use]
    pub fn html(&self, assumed: &Scenario, file: &str, command: String) -> String {
        stylet_report::pages::diagnosis::page(assumed, file, command, &self.details).to_html()
    }

    /// All files that `stylet diagnose` writes for single recordings; `assumed` is the inputs' scenario.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output(&self, assumed: &Scenario, inputs: &DiagnosisInputs) -> Result<OutputFiles, Error> {
        let file = inputs.scenario.display().to_string();
        let mut output = OutputFiles::default();
        output.add("report.html", self.html(assumed, &file, inputs.command_line()));
        output.add("diagnosis.json", self.json()?);
        if let Some(figure) = stylet_report::pages::diagnosis::figure_svg(&self.details) {
            output.add("figure.svg", figure);
        }
        output.add_json(INPUTS_FILE, &inputs.with_absolute_paths())?;
        output.add("extended.ron", self.extended_ron(&file)?);
        let proposed = &self.details.proposed_effects;
        if !proposed.is_empty() {
            let list = stylet_scenario::effects_to_ron(proposed).map_err(Error::internal)?;
            let head = format!(
                "// Formulas for what {} does not explain, to try with --effects.\n",
                one_line(&file)
            );
            output.add("proposed_effects.ron", head + &list + "\n");
        }
        Ok(output)
    }
}

/// Compares an assumed scenario with one or more recordings; `progress` is called with the name of each stage. With two or more recordings
/// the gain is measured on held-out recordings. Very long recordings are downsampled first, and the diagnosis notes it.
///
/// # Errors
/// Unless `options.force`: [`Error::Recording`] when a recording is unusable (a dead or reversed sensor, millimetres for metres, ...),
/// [`Error::Diagnose`] when the recordings do not fit the scenario.
pub fn diagnose(
    assumed: &Scenario,
    recordings: &[NamedRecording],
    options: &Options,
    progress: impl FnMut(&str),
) -> Result<DiagnosisReport, Error> {
    let recordings = if options.force {
        recordings.iter().map(downsampled).collect()
    } else {
        usable_recordings(recordings)?
    };
    let details = stylet_diagnose::diagnose(assumed, &recordings, options, progress)?;
    Ok(DiagnosisReport::new(details, &recordings))
}

/// Finds the layers in recordings (`layers` of them, if given) and diagnoses the residual. Returns the scenario that it started from, and
/// the diagnosis.
///
/// # Errors
/// As [`diagnose`].
pub fn identify(
    name: &str,
    recordings: &[NamedRecording],
    layers: Option<usize>,
    progress: impl FnMut(&str),
) -> Result<(Scenario, DiagnosisReport), Error> {
    let recordings = usable_recordings(recordings)?;
    let (scenario, details) =
        stylet_diagnose::identify(name, &recordings, layers, &Options::default(), progress)?;
    let mut report = DiagnosisReport::new(details, &recordings);
    // The number of samples is known now.
    let usual = Scenario::new(String::new(), scenario.tissue.clone(), scenario.motion.clone());
    report.extended.tolerance = usual.tolerance;
    report.extended.thickness_tolerance = usual.thickness_tolerance;
    Ok((scenario, report))
}

/// Predicts held-out recordings by a model. Noise, scatter and intervals come from the `diagnosis` that gave the model; `assumed` is the
/// scenario before that diagnosis, for comparison.
///
/// # Errors
/// As [`diagnose`].
pub fn predict_recordings(
    model: &Scenario,
    diagnosis: Option<&Diagnosis>,
    assumed: Option<&Scenario>,
    options: &PredictionOptions,
    recordings: &[NamedRecording],
) -> Result<PredictionResult, Error> {
    let recordings = usable_recordings(recordings)?;
    let options = PredictionOptions { refit_on: usable_recordings(&options.refit_on)?, ..options.clone() };
    Ok(stylet_diagnose::prediction::predict(model, diagnosis, assumed, &options, &recordings)?)
}

/// Checks the recordings and downsamples those that are too long.
pub(crate) fn usable_recordings(recordings: &[NamedRecording]) -> Result<Vec<NamedRecording>, Error> {
    let mut notes_by_name: Vec<(&str, Vec<QualityNote>)> = Vec::with_capacity(recordings.len());
    for e in recordings {
        // Samples that are not finite are cut out by the diagnosis itself.
        let notes = if e.recording.check().is_ok() { assess(&e.recording) } else { Vec::new() };
        notes_by_name.push((&e.name, notes));
    }
    check_usable(notes_by_name.iter().map(|(name, notes)| (*name, notes.as_slice())))?;
    let named: Vec<(&str, &Recording)> = recordings.iter().map(|e| (e.name.as_str(), &e.recording)).collect();
    check_distinct(&named)?;
    Ok(recordings.iter().map(downsampled).collect())
}

/// The recording, downsampled when it is too long for a diagnosis.
fn downsampled(named: &NamedRecording) -> NamedRecording {
    let Some((recording, note)) = downsample(&named.recording) else { return named.clone() };
    let mut notes = named.notes.clone();
    notes.push(note);
    NamedRecording { name: named.name.clone(), recording, notes }
}
