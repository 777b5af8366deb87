//! `stylet benchmark export` and `score`: cases for other programs, and the score of their answers.

use crate::cli::args::{BenchmarkExportArgs, BenchmarkScoreArgs};
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::print;
use stylet_examine::{challenge_export, results_table};

/// Writes cases without the truth, and their key.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn export(args: &BenchmarkExportArgs) -> Result<(), Failure> {
    if args.online {
        return super::online::export(args);
    }
    let plan = args.cases.selection().plan()?;
    let written = challenge_export::export(&plan, &args.out).map_err(|e| Failure::Check(e.to_string()))?;
    print(&format!(
        "{written} cases in {}\nKey, to be kept secret: {}\n",
        args.out.display(),
        challenge_export::key_path(&args.out).display()
    ))
}

/// Scores answers to exported cases.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn score(args: &BenchmarkScoreArgs) -> Result<(), Failure> {
    let outcomes = challenge_export::score_answers(&args.folder, &args.answers)
        .map_err(|e| Failure::Check(e.to_string()))?;
    print(&results_table::results_text(&outcomes))
}
