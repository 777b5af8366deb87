//! `stylet benchmark plan`: realities whose first insertion leaves the cause open, inserted into again as planned.

use crate::args::BenchmarkPlanArgs;
use crate::exit::Failure;
use crate::progress::Progress;
use std::path::PathBuf;
use stylet_api::benchmark::{CaseSelection, PlanningBenchmark};

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn plan(args: &BenchmarkPlanArgs) -> Result<(), Failure> {
    let asked = CaseSelection {
        world: &args.world,
        misspecification: &args.wrong,
        severity: std::slice::from_ref(&args.severity),
        hide: &["one".to_owned()],
        size: "strong",
        cases: 1,
        seed: args.seed,
        effect: &[],
    }
    .plan()?;
    let folder = args.out.clone().unwrap_or_else(|| {
        PathBuf::from("stylet-out").join(format!("benchmark-plan-{}-{}", asked.world, args.seed))
    });
    let mut planning = PlanningBenchmark::new(&folder, args.threads.unwrap_or(0))?;
    for base in asked.cases() {
        let bar = Progress::new(args.cases, "open cases", false);
        planning.run_row(&base, args.cases, args.from_journal, &|open| bar.advance(open));
        bar.finish();
    }
    let text = planning.write()?;
    crate::terminal::print(&format!("{text}\nCases: {}\n", folder.join("cases.jsonl").display()))
}
