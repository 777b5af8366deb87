//! Inputs and files of `stylet predict`: the origin of a model, and the report of a prediction.

use crate::diagnosis_inputs::DiagnosisInputs;
use crate::error::Error;
use crate::output_files::OutputFiles;
use std::path::Path;
use stylet_diagnose::Diagnosis;
use stylet_diagnose::prediction::PredictionResult;
use stylet_scenario::Scenario;

/// Origin of a model, read from its folder.
#[derive(Clone, Debug, Default)]
pub struct ModelOrigin {
    /// The diagnosis that gave the model.
    pub diagnosis: Option<Diagnosis>,
    /// The scenario assumed before the diagnosis.
    pub assumed: Option<Scenario>,
}

impl ModelOrigin {
    /// Reads the origin of a model from `diagnosis.json` and `inputs.json` in its folder; `assumed` replaces the scenario named there. A scenario
    /// that no longer exists is ignored.
    ///
    /// # Errors
    /// [`Error::Request`] when `diagnosis.json` is of another version, [`Error::Input`] when `assumed` is invalid.
    pub fn of_model_file(model: &Path, assumed: Option<&Path>) -> Result<Self, Error> {
        let folder = model.parent().unwrap_or(Path::new("."));
        let diagnosis = diagnosis(&folder.join("diagnosis.json"))?;
        let assumed = match assumed {
            Some(path) => Some(Scenario::load(path)?),
            None => DiagnosisInputs::from_folder(folder)
                .ok()
                .and_then(|inputs| Scenario::load(&inputs.scenario).ok()),
        };
        Ok(Self { diagnosis, assumed })
    }
}

/// Reads `diagnosis.json`, if it exists.
fn diagnosis(path: &Path) -> Result<Option<Diagnosis>, Error> {
    let Ok(text) = std::fs::read_to_string(path) else { return Ok(None) };
    serde_json::from_str(&text)
        .map(Some)
        .map_err(|e| Error::Request(format!("{}: {e}; repeat the diagnosis", path.display())))
}

/// All files that `stylet predict` writes; `model` was read from `file`.
///
/// # Errors
/// [`Error::Internal`] when a value cannot be written.
pub fn output_files(model: &Scenario, file: &Path, found: &PredictionResult) -> Result<OutputFiles, Error> {
    let mut output = OutputFiles::default();
    let page = stylet_report::pages::prediction::page(model, &file.display().to_string(), found);
    output.add("report.html", page.to_html());
    output.add_json("predict.json", &found.prediction)?;
    Ok(output)
}
