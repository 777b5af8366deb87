//! Diagnosis of many specimens, each indented once and held: a data set with `split_by`.

use crate::diagnosis_inputs::DiagnosisInputs;
use crate::error::Error;
use crate::output_files::OutputFiles;
use serde::Serialize;
use stylet_diagnose::Diagnosis;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::dataset::{Dataset, DatasetError};
use stylet_diagnose::repeated_insertions::indentation_relaxation::{SpecimenReport, analyze_specimens};
use stylet_report::pages::indented_specimens::page;

/// Result for a set of specimens.
pub struct SpecimensReport {
    /// Causes, parameters over the specimens, unused specimens.
    pub specimens: SpecimenReport,
    /// The same result in the form of a diagnosis.
    pub diagnosis: Diagnosis,
}

/// `diagnosis.json`.
#[derive(Serialize)]
struct DiagnosisFile<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    specimens: &'a SpecimenReport,
}

/// Fits every specimen of a data set separately.
///
/// # Errors
/// [`Error::Dataset`] when no specimen is held long enough.
pub fn diagnose_specimens(set: &Dataset, runs: &[SegmentedRecording]) -> Result<SpecimensReport, Error> {
    let found = analyze_specimens(&set.tissue, runs).ok_or_else(|| {
        DatasetError::TooLittle("no specimen is indented and held for 3 s with 50 samples or more".to_owned())
    })?;
    let diagnosis = found.diagnosis(runs);
    Ok(SpecimensReport { specimens: found, diagnosis })
}

impl SpecimensReport {
    /// All files that `stylet diagnose` writes for specimens.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output(&self, set: &Dataset, inputs: &DiagnosisInputs) -> Result<OutputFiles, Error> {
        let Self { specimens: found, diagnosis } = self;
        let mut output = OutputFiles::default();
        let page = page(set, &inputs.scenario.display().to_string(), found, diagnosis);
        output.add("report.html", page.to_html());
        output.add_json("diagnosis.json", &DiagnosisFile { diagnosis, specimens: found })?;
        Ok(output)
    }
}
