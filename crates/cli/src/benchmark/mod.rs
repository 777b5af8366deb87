//! `stylet benchmark`: examinations at scale.

mod challenge;
mod examine;
mod own;
mod plan;

use crate::args::{BenchmarkArgs, BenchmarkWhat};
use crate::exit::Failure;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn benchmark(args: &BenchmarkArgs) -> Result<(), Failure> {
    match &args.what {
        BenchmarkWhat::Diagnose(args) if args.cases.world == "own" => own::diagnose(args),
        BenchmarkWhat::Diagnose(args) => examine::diagnose(args),
        BenchmarkWhat::Export(args) => challenge::export(args),
        BenchmarkWhat::Judge(args) => challenge::judge(args),
        BenchmarkWhat::Plan(args) => plan::plan(args),
    }
}
