//! Files of `stylet predict`: a model against held-out recordings.

use crate::diagnosis_inputs::DiagnosisInputs;
use crate::error::Error;
use crate::output_files::OutputFiles;
use std::path::Path;
use stylet_diagnose::Diagnosis;
use stylet_diagnose::prediction::PredictionResult;
use stylet_scenario::Scenario;

/// Origin of a model, from the other files in its folder.
#[derive(Clone, Debug, Default)]
pub struct ModelOrigin {
    /// The diagnosis that produced it.
    pub diagnosis: Option<Diagnosis>,
    /// The scenario before the diagnosis.
    pub assumed: Option<Scenario>,
}

impl ModelOrigin {
    /// Reads the files next to a model; `assumed` is the scenario before the diagnosis, if the folder does not name it. If that scenario has
    /// been deleted since, it is left out without an error.
    ///
    /// # Errors
    /// [`Error::Request`] when `diagnosis.json` is of another version, [`Error::Input`] when `assumed` is wrong.
    pub fn of_model_file(model: &Path, assumed: Option<&Path>) -> Result<Self, Error> {
        let folder = model.parent().unwrap_or(Path::new("."));
        let diagnosis = diagnosis(&folder.join("diagnosis.json"))?;
        let assumed = match assumed {
            Some(path) => Some(Scenario::load(path)?),
            None => DiagnosisInputs::from_folder(folder).ok().and_then(|inputs| inputs.load_scenario().ok()),
        };
        Ok(Self { diagnosis, assumed })
    }
}

/// The diagnosis in the folder of a model, if there is one.
pub(crate) fn diagnosis(path: &Path) -> Result<Option<Diagnosis>, Error> {
    let Ok(text) = std::fs::read_to_string(path) else { return Ok(None) };
    serde_json::from_str(&text).map(Some).map_err(|e| {
        let cause = stylet_scenario::renamed_json_key(&text).unwrap_or_else(|| e.to_string());
        Error::Request(format!("{}: {cause}; repeat the diagnosis", path.display()))
    })
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
