//! `stylet benchmark diagnose`: accuracy of the diagnosis on cases of the independent simulator.

use crate::cli::args::BenchmarkDiagnoseArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::progress_bar::Progress;
use crate::cli::terminal_output::{print, print_error};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use stylet_api::benchmark::{CaseSelection, DiagnosisBenchmark};
use stylet_scenario::load_candidates;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &BenchmarkDiagnoseArgs) -> Result<(), Failure> {
    let custom = load_candidates(&args.effects)?;
    let selection =
        CaseSelection { custom: !custom.is_empty() || args.from_journal, ..args.cases.selection() };
    let plan = selection.plan()?;
    let folder = args.out.clone().unwrap_or_else(|| {
        PathBuf::from("stylet-out").join(format!("benchmark-diagnose-{}-{}", plan.world, plan.seed))
    });
    let benchmark = DiagnosisBenchmark::new(plan, custom, &folder, args.from_journal)?;
    let bar = Progress::new(benchmark.cases.len() as u64, "cases", false);
    let previous = AtomicUsize::new(0);
    let progress = |done: usize, of: usize| {
        let last = previous.swap(done, Ordering::Relaxed);
        if last == 0 && done > 1 {
            bar.skip(done as u64);
        } else {
            bar.advance(done.saturating_sub(last) as u64);
        }
        if done.is_multiple_of(20) && done > 0 {
            print_error(&format!("  {done} of {of} cases\n"));
        }
    };
    let text = benchmark.run(args.threads.unwrap_or(0), &progress)?;
    bar.finish();
    print(&format!("{text}\nReport: {}\n", folder.join("report.html").display()))
}
