//! A model against recordings that took no part in making it.

use crate::error::Error;
use crate::inputs::Inputs;
use crate::output::Output;
use std::path::Path;
use stylet_diagnose::Diagnosis;
use stylet_diagnose::predict::Foretold;
use stylet_scenario::Scenario;

/// Where a model came from, as the folder in which it lies tells.
#[derive(Clone, Debug, Default)]
pub struct Origin {
    /// The diagnosis that made it.
    pub diagnosis: Option<Diagnosis>,
    /// What was believed before.
    pub believed: Option<Scenario>,
}

impl Origin {
    /// What lies beside a model; `believed` is what was believed before, where the folder is not to tell. A scenario that is gone since
    /// the diagnosis is nobody's error.
    ///
    /// # Errors
    /// [`Error::Request`] when `diagnosis.json` is of another version, [`Error::Input`] when `believed` is wrong.
    pub fn beside(model: &Path, believed: Option<&Path>) -> Result<Self, Error> {
        let beside = model.parent().unwrap_or(Path::new("."));
        let diagnosis = diagnosis(&beside.join("diagnosis.json"))?;
        let believed = match believed {
            Some(path) => Some(Scenario::load(path)?),
            None => Inputs::of_folder(beside).ok().and_then(|inputs| Scenario::load(&inputs.scenario).ok()),
        };
        Ok(Self { diagnosis, believed })
    }
}

/// The diagnosis that a model came from, if it lies beside it.
fn diagnosis(path: &Path) -> Result<Option<Diagnosis>, Error> {
    let Ok(text) = std::fs::read_to_string(path) else { return Ok(None) };
    serde_json::from_str(&text)
        .map(Some)
        .map_err(|e| Error::Request(format!("{}: {e}; make the diagnosis anew", path.display())))
}

/// All files that `stylet predict` writes; `model` was read from `file`.
///
/// # Errors
/// [`Error::Internal`] when a value cannot be written.
pub fn output(model: &Scenario, file: &Path, found: &Foretold) -> Result<Output, Error> {
    let mut output = Output::default();
    let page = stylet_pages::prediction::page(model, &file.display().to_string(), found);
    output.add("report.html", page.to_html());
    output.add_json("predict.json", &found.prediction)?;
    Ok(output)
}
