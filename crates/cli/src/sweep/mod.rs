//! `stylet sweep`, `stylet replay` and `stylet gate`.

pub mod args;
mod gate;
mod map;
mod replay;
mod shards;

pub use gate::gate;
pub use replay::replay;

use crate::exit::Failure;
use crate::progress::Progress;
use args::{SweepArgs, SweepCommand};
use std::fmt::Write as _;
use std::path::Path;
use stylet_api::sweep_folder::{SHARD_TRIALS, check_unfinished, run_all_shards, write_results};
use stylet_api::{OutputLock, resource_estimate};
use stylet_report::pages::formatting::significant_or_dash;
use stylet_report::{percent, significant};
use stylet_sweep::{Columns, DiskTrialTable, Summary, Sweep};

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn sweep(args: &SweepArgs) -> Result<(), Failure> {
    match &args.command {
        Some(SweepCommand::Plan(plan)) => shards::plan(plan),
        Some(SweepCommand::RunShard(run)) => shards::run_shard(run),
        Some(SweepCommand::Merge(merge)) => shards::merge(merge),
        Some(SweepCommand::Map(map)) => map::map(map),
        None => whole(args),
    }
}

/// Runs `work` with a number of threads; 0 is one per core.
fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map(|pool| pool.install(work)).map_err(Failure::internal)
}

fn whole(args: &SweepArgs) -> Result<(), Failure> {
    let Some(file) = &args.sweep else {
        return Err(Failure::Check(
            "no sweep file is given; try stylet sweep scenarios/sweeps/noise.ron".into(),
        ));
    };
    let sweep = Sweep::load(file, args.overrides.into())?;
    let columns = Columns::new(&sweep);
    let threads = args.threads.unwrap_or(0);
    args.limits.check(file, &resource_estimate::estimate_sweep(&sweep, threads), args.results.quiet)?;
    let out = args.results.output_folder(file, "");
    let of = sweep.trials().div_ceil(SHARD_TRIALS);
    // Nobody else writes there until the set is whole: the shards, the tables and `sweep.ron` are of one draw.
    let claim = OutputLock::new(&out)?;
    check_unfinished(&sweep, &columns, &out, of, args.resume)?;
    let progress = Progress::new(sweep.trials(), "trials", args.results.quiet);
    let (there, done) = (|n| progress.skip(n), |n| progress.advance(n));
    let rows = with_threads(threads, || run_all_shards(&sweep, &columns, &out, of, &there, &done))??;
    progress.finish();
    written(&sweep, &columns, &rows, (&claim, &out), args.results.quiet)
}

/// Writes the results, removes the shards, prints the summary.
fn written(
    sweep: &Sweep,
    columns: &Columns,
    rows: &DiskTrialTable,
    (claim, out): (&OutputLock, &Path),
    quiet: bool,
) -> Result<(), Failure> {
    let summary = write_results(sweep, columns, rows, (claim, out))?;
    if quiet { Ok(()) } else { crate::terminal::print(&terminal(&summary, out)) }
}

fn terminal(s: &Summary, out: &Path) -> String {
    let mut text = format!("{}: {} trials of {}\n", s.sweep, s.trials, s.scenario);
    let mut rate = |name: &str, i: &stylet_stats::Interval| {
        let _ = writeln!(
            text,
            "  {name:<30} {:>8}   95 % interval {} to {}",
            percent(i.value),
            percent(i.low),
            percent(i.high)
        );
    };
    rate("insertions with an error", &s.failed);
    rate("ruptures missed", &s.missed);
    rate("insertions with a false alarm", &s.trials_with_false);
    let _ = writeln!(
        text,
        "  {:<30} {:>8}   in insertions with {} ruptures",
        "false alarms", s.false_alarms, s.ruptures
    );
    for name in ["enhancement.rms_relative", "reconstruction_rms_n"] {
        if let Some(x) = s.scores.iter().find(|x| x.score == name) {
            let show = |v: f64| if name.ends_with("relative") { percent(v) } else { significant(v, 3) };
            let _ = writeln!(
                text,
                "  {name:<30} {:>8}   median; p95 {}",
                show(x.median.value),
                show(x.p95.value)
            );
        }
    }
    if let Some(outcome) = s.explained.first() {
        let _ = writeln!(text, "  {} explained by (first-order index, rank correlation)", outcome.outcome);
        for e in outcome.by.iter().take(5) {
            let _ = writeln!(
                text,
                "    {:<44} {:>6}  {:>6}",
                e.quantity,
                significant_or_dash(e.first_order, 1.0, 2),
                significant_or_dash(e.rank_correlation, 1.0, 2)
            );
        }
    }
    let folder = out.display();
    if let Some(worst) = s.worst.first() {
        let _ = writeln!(text, "  worst trial: stylet replay {folder} {}", worst.trial);
    }
    let _ = writeln!(text, "\nReport: {}", out.join("report.html").display());
    text
}
