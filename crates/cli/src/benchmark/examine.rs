//! `stylet benchmark diagnose` in the referee's worlds.

use crate::args::{BenchmarkDiagnoseArgs, CaseArgs};
use crate::exit::Failure;
use crate::progress::Progress;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use stylet_api::benchmark::{CaseSelection, DiagnosisBenchmark};

impl CaseArgs {
    /// Which cases are asked for.
    pub fn selection(&self) -> CaseSelection<'_> {
        CaseSelection {
            world: &self.world,
            misspecification: &self.wrong,
            severity: &self.severity,
            hide: &self.hide,
            size: &self.size,
            cases: self.cases,
            seed: self.seed,
            effect: &self.effect,
        }
    }
}

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &BenchmarkDiagnoseArgs) -> Result<(), Failure> {
    let plan = args.cases.selection().plan()?;
    let folder = args.out.clone().unwrap_or_else(|| {
        PathBuf::from("stylet-out").join(format!("benchmark-diagnose-{}-{}", plan.world, plan.seed))
    });
    let examination = DiagnosisBenchmark::new(plan, &folder, args.from_journal)?;
    let bar = Progress::new(examination.cases.len() as u64, "cases", false);
    let before = AtomicUsize::new(0);
    let tell = |done: usize, of: usize| {
        let last = before.swap(done, Ordering::Relaxed);
        if last == 0 && done > 1 {
            bar.skip(done as u64);
        } else {
            bar.advance(done.saturating_sub(last) as u64);
        }
        if done.is_multiple_of(20) && done > 0 {
            crate::terminal::print_error(&format!("  {done} of {of} cases\n"));
        }
    };
    let text = examination.run(args.threads.unwrap_or(0), &tell)?;
    bar.finish();
    crate::terminal::print(&format!("{text}\nReport: {}\n", folder.join("report.html").display()))
}
