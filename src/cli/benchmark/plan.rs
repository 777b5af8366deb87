//! `stylet benchmark plan`: planned second insertions where the first leaves the cause open.

use crate::cli::args::BenchmarkPlanArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::progress_bar::Progress;
use crate::cli::terminal_output::print;
use std::path::PathBuf;
use stylet_api::benchmark::{CaseSelection, PlanningBenchmark};

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn plan(args: &BenchmarkPlanArgs) -> Result<(), Failure> {
    let selection = CaseSelection {
        world: &args.world,
        misspecification: &args.misspecification,
        severity: std::slice::from_ref(&args.severity),
        hide: &["one".to_owned()],
        size: "strong",
        cases: 1,
        seed: args.seed,
        effect: &[],
        custom: false,
    }
    .plan()?;
    let folder = args.out.clone().unwrap_or_else(|| {
        PathBuf::from("stylet-out").join(format!("benchmark-plan-{}-{}", selection.world, args.seed))
    });
    let mut benchmark = PlanningBenchmark::new(&folder, args.threads.unwrap_or(0))?;
    for base in selection.cases() {
        let bar = Progress::new(args.cases, "open cases", false);
        benchmark.run_row(&base, args.cases, args.from_journal, &|open| bar.advance(open));
        bar.finish();
    }
    let text = benchmark.write()?;
    print(&format!("{text}\nCases: {}\n", folder.join("cases.jsonl").display()))
}
