//! `stylet benchmark export` and `judge`: a challenge that others can enter.

use crate::args::{BenchmarkExportArgs, BenchmarkScoreArgs};
use crate::exit::Failure;
use stylet_examine::{challenge_export, results_table};

/// Writes a challenge.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn export(args: &BenchmarkExportArgs) -> Result<(), Failure> {
    let plan = args.cases.selection().plan()?;
    let written = challenge_export::export(&plan, &args.out).map_err(|e| Failure::Check(e.to_string()))?;
    crate::terminal::print(&format!(
        "{written} cases in {}\nThe key, for the judge alone: {}\n",
        args.out.display(),
        challenge_export::key_path(&args.out).display()
    ))
}

/// Judges answers.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn score(args: &BenchmarkScoreArgs) -> Result<(), Failure> {
    let outcomes = challenge_export::score_answers(&args.folder, &args.answers)
        .map_err(|e| Failure::Check(e.to_string()))?;
    crate::terminal::print(&results_table::results_text(&outcomes))
}
