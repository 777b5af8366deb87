//! `stylet benchmark`: examinations at scale.

mod challenge;
mod examine;
mod own;
mod plan;

use crate::args::{BenchmarkArgs, BenchmarkCommand};
use crate::exit::Failure;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn benchmark(args: &BenchmarkArgs) -> Result<(), Failure> {
    match &args.command {
        BenchmarkCommand::Diagnose(args) if args.cases.world == "own" => own::diagnose(args),
        BenchmarkCommand::Diagnose(args) => examine::diagnose(args),
        BenchmarkCommand::Export(args) => challenge::export(args),
        BenchmarkCommand::Score(args) => challenge::score(args),
        BenchmarkCommand::Plan(args) => plan::plan(args),
    }
}
