//! `stylet check`: what recordings can identify, before a diagnosis.

use crate::error::Error;
use crate::output_files::OutputFiles;
use stylet_diagnose::NamedRecording;
use stylet_diagnose::experiment_check::{ExperimentCheck, check_experiment};
use stylet_report::pages::experiment_check as check_page;
use stylet_scenario::Scenario;

/// A check of recordings, and the files that `stylet check` writes.
pub struct CheckReport {
    /// The result.
    pub check: ExperimentCheck,
    /// `report.html` and `check.json`.
    pub output: OutputFiles,
}

/// Checks which parameters and effects of a scenario recordings can identify, and their data, contact and motion.
///
/// # Errors
/// [`Error`] when the scenario cannot be replayed along the recordings.
pub fn check(scenario: &Scenario, recordings: &[NamedRecording]) -> Result<CheckReport, Error> {
    let check = check_experiment(scenario, recordings)?;
    let names: Vec<String> = recordings.iter().map(|r| r.name.clone()).collect();
    let mut output = OutputFiles::default();
    output.add("report.html", check_page::page(scenario, &names, &check).to_html());
    output.add_json("check.json", &check)?;
    Ok(CheckReport { check, output })
}
