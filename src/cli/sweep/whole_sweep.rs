//! `stylet sweep`: all trials of a sweep on this machine.

use super::thread_pool::with_threads;
use crate::cli::args::SweepArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::progress_bar::Progress;
use crate::cli::terminal_output::print;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stylet_api::output_folder::{Inputs, check_folder};
use stylet_api::sweep_folder::{SHARD_TRIALS, check_unfinished, run_all_shards, write_results};
use stylet_api::{OutputLock, resource_estimate};
use stylet_report::pages::formatting::significant_or_dash;
use stylet_report::{percent, significant};
use stylet_sweep::{Columns, DiskTrialTable, Summary, Sweep};

/// Runs all trials and writes the results.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn run_all_trials(args: &SweepArgs) -> Result<(), Failure> {
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
    // Held until the results are complete, so that shards, tables and `sweep.ron` belong to one sweep.
    let lock = OutputLock::new(&out)?;
    let inputs = args.results.inputs(file, [&scenario_file(file, &sweep)]);
    check_folder(&out, "summary.json", &inputs)?;
    check_unfinished(&sweep, &columns, &out, of, args.resume)?;
    let progress = Progress::new(sweep.trials(), "trials", args.results.quiet);
    let (present, done) = (|n| progress.skip(n), |n| progress.advance(n));
    let rows = with_threads(threads, || run_all_shards(&sweep, &columns, &out, of, &present, &done))??;
    progress.finish();
    finish(&sweep, &columns, &rows, (&lock, &out), inputs, args.results.quiet)
}

/// The scenario that a sweep file names.
pub fn scenario_file(file: &Path, sweep: &Sweep) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(&sweep.file.scenario)
}

/// Writes the results, removes the shards, and prints the summary unless `quiet`.
///
/// # Errors
/// [`Failure`] when the results cannot be written.
pub fn finish(
    sweep: &Sweep,
    columns: &Columns,
    rows: &DiskTrialTable,
    (lock, out): (&OutputLock, &Path),
    inputs: Inputs,
    quiet: bool,
) -> Result<(), Failure> {
    let summary = write_results(sweep, columns, rows, (lock, out), inputs)?;
    if quiet { Ok(()) } else { print(&summary_text(&summary, out)) }
}

fn summary_text(s: &Summary, out: &Path) -> String {
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
