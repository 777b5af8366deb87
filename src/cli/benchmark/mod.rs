//! `stylet benchmark`: accuracy of diagnosis, planning and online detection over many simulated cases.

mod diagnose;
mod export_and_score;
mod online;
mod plan;

use crate::cli::args::{BenchmarkArgs, BenchmarkCommand};
use crate::cli::exit_codes::Failure;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn benchmark(args: &BenchmarkArgs) -> Result<(), Failure> {
    match &args.command {
        BenchmarkCommand::Diagnose(args) => diagnose::diagnose(args),
        BenchmarkCommand::Export(args) => export_and_score::export(args),
        BenchmarkCommand::Score(args) => export_and_score::score(args),
        BenchmarkCommand::Replay(args) => online::replay(args),
        BenchmarkCommand::JudgeOnline(args) => online::judge(args),
        BenchmarkCommand::Plan(args) => plan::plan(args),
    }
}
