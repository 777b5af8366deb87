//! Comparison of the models found by two diagnoses.

use crate::error::Error;
use crate::output_files::OutputFiles;
use crate::prediction_files::diagnosis;
use std::path::{Path, PathBuf};
use stylet_diagnose::Diagnosis;
use stylet_diagnose::model_consistency::{Consistency, compare_models as compare};
use stylet_report::pages::model_consistency as page;

/// The diagnosis in a folder, or in a `diagnosis.json`.
///
/// # Errors
/// [`Error::Request`] when there is none, or none of single recordings by this version.
fn load(path: &Path) -> Result<Diagnosis, Error> {
    let file = diagnosis_file(path);
    let found = diagnosis(&file)?;
    found.filter(|d| !d.parameters.is_empty()).ok_or_else(|| {
        Error::Request(format!(
            "{}: no diagnosis with a covariance; give the folder of a `stylet diagnose` of single recordings",
            path.display()
        ))
    })
}

/// The file of a diagnosis, from the path of the file or of its folder.
#[must_use]
pub fn diagnosis_file(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("diagnosis.json") } else { path.to_owned() }
}

/// Compares two diagnoses, given by their folders or files: the result, and the files that `stylet compare-models` writes.
///
/// # Errors [`Error::Request`] when one of them is not a diagnosis of single recordings by this version.
pub fn compare_models(a: &Path, b: &Path) -> Result<(Consistency, OutputFiles), Error> {
    let found = compare(&load(a)?, &load(b)?);
    let mut output = OutputFiles::default();
    let names = [a, b].map(|path| path.display().to_string());
    output.add("report.html", page::page(&names, &found).to_html());
    output.add_json("consistency.json", &found)?;
    Ok((found, output))
}
