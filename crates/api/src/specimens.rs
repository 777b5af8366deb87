//! Many specimens, each indented once and held: a data set with `split_by`.

use crate::error::Error;
use crate::inputs::Inputs;
use crate::output::Output;
use serde::Serialize;
use stylet_diagnose::Diagnosis;
use stylet_diagnose::set::Insertion;
use stylet_diagnose::set::dataset::{Dataset, DatasetError};
use stylet_diagnose::set::specimens::{Specimens, look};
use stylet_pages::specimens::page;

/// What a look at specimens gives.
pub struct Indented {
    /// Causes, numbers over the specimens, those that were not used.
    pub found: Specimens,
    /// The same as a diagnosis.
    pub diagnosis: Diagnosis,
}

/// `diagnosis.json`.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    specimens: &'a Specimens,
}

/// Fits every specimen of a data set by itself.
///
/// # Errors
/// [`Error::Dataset`] when no specimen is held long enough.
pub fn specimens(set: &Dataset, runs: &[Insertion]) -> Result<Indented, Error> {
    let found = look(&set.tissue, runs).ok_or_else(|| {
        DatasetError::TooLittle("no specimen is indented and held for 3 s with 50 samples or more".to_owned())
    })?;
    let diagnosis = found.diagnosis(runs);
    Ok(Indented { found, diagnosis })
}

impl Indented {
    /// All files that `stylet diagnose` writes for specimens.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output(&self, set: &Dataset, inputs: &Inputs) -> Result<Output, Error> {
        let Self { found, diagnosis } = self;
        let mut output = Output::default();
        let page = page(set, &inputs.scenario.display().to_string(), found, diagnosis);
        output.add("report.html", page.to_html());
        output.add_json("diagnosis.json", &Written { diagnosis, specimens: found })?;
        Ok(output)
    }
}
