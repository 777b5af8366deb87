//! `stylet sweep`, `stylet replay` and `stylet gate`.

pub mod args;
mod gate;
mod map;

mod replay;
mod shards;

pub use gate::gate;
pub use replay::replay;

use crate::exit::Failure;
use crate::limits;
use crate::progress::Progress;
use crate::run::default_folder;
use args::{SweepArgs, SweepCommand};
use std::path::{Path, PathBuf};
use stylet_api::Claim;
use stylet_api::sweep::results;
use stylet_report::{percent, significant};
use stylet_sweep::shard::{self, ShardError, ShardNumber};
use stylet_sweep::{Columns, Row, Summary, Sweep, rows};

/// Trials of a shard when `stylet sweep` splits the work itself: what a kill can cost at most.
const SHARD_TRIALS: u64 = 1024;

impl From<ShardError> for Failure {
    fn from(error: ShardError) -> Self {
        Failure::Check(error.to_string())
    }
}

impl From<stylet_sweep::TrialError> for Failure {
    fn from(error: stylet_sweep::TrialError) -> Self {
        Failure::Check(error.to_string())
    }
}

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
    pool.map(|pool| pool.install(work)).map_err(|e| Failure::Internal(e.to_string()))
}

fn whole(args: &SweepArgs) -> Result<(), Failure> {
    let Some(file) = &args.sweep else {
        return Err(Failure::Check(
            "no sweep file is given; try stylet sweep scenarios/sweeps/noise.ron".into(),
        ));
    };
    let sweep = Sweep::load(file, args.draws.into())?;
    let columns = Columns::new(&sweep);
    let need = limits::of_sweep(&sweep, &columns, args.threads.unwrap_or(0));
    args.limits.allow(file, &need, args.results.quiet)?;
    let out = args.results.out.clone().unwrap_or_else(|| default_folder(file));
    let of = sweep.trials().div_ceil(SHARD_TRIALS);
    // Nobody else writes there until the set is whole: the shards, the tables and `sweep.ron` are of one draw.
    let claim = Claim::new(&out)?;
    begin(&sweep, &columns, &out, of, args.resume)?;
    let progress = Progress::new(sweep.trials(), "trials", args.results.quiet);
    let rows =
        with_threads(args.threads.unwrap_or(0), || all_shards(&sweep, &columns, &out, of, &progress))??;
    progress.finish();
    conclude(&sweep, &columns, &rows, (&claim, &out), args.results.quiet)
}

/// Refuses to mix with what is unfinished in the folder.
fn begin(sweep: &Sweep, columns: &Columns, out: &Path, of: u64, resume: bool) -> Result<(), Failure> {
    let unfinished = shard::split_of(out);
    if let (Ok(split), false) = (&unfinished, resume) {
        let what = format!(
            "{}: holds an unfinished sweep in {split} shards; go on with --resume, or remove {}",
            out.display(),
            out.join(shard::FOLDER).display()
        );
        return Err(Failure::Check(what));
    }
    if let (Ok(split), true) = (&unfinished, resume)
        && *split != of
    {
        // A shard of another split is foreign, whatever it holds.
        shard::read(sweep, columns, ShardNumber { shard: 1, of: *split }, out)?;
        let what = format!(
            "{}: is split into {split} shards, not {of}; finish it with: stylet sweep merge",
            out.display()
        );
        return Err(Failure::Check(what));
    }
    Ok(())
}

fn all_shards(
    sweep: &Sweep,
    columns: &Columns,
    out: &Path,
    of: u64,
    progress: &Progress,
) -> Result<Vec<Row>, Failure> {
    let mut all = Vec::with_capacity(sweep.trials() as usize);
    for shard in 1..=of {
        let number = ShardNumber { shard, of };
        if number.path(out).exists() {
            let rows = shard::read(sweep, columns, number, out)?;
            progress.skip(rows.len() as u64);
            all.extend(rows);
            continue;
        }
        let rows = rows(sweep, columns, number.range(sweep.trials()), &|n| progress.advance(n))?;
        shard::write(sweep, columns, number, &rows, out)?;
        all.extend(rows);
    }
    Ok(all)
}

/// Writes the results, removes the shards, prints the summary.
fn conclude(
    sweep: &Sweep,
    columns: &Columns,
    rows: &[Row],
    (claim, out): (&Claim, &Path),
    quiet: bool,
) -> Result<(), Failure> {
    let (output, summary) = results(sweep, columns, rows)?;
    output.write_to(claim)?;
    let _ = std::fs::remove_dir_all(out.join(shard::FOLDER));
    if !quiet {
        crate::terminal::say(&terminal(&summary, out))?;
    }
    Ok(())
}

fn terminal(s: &Summary, out: &Path) -> String {
    use std::fmt::Write;
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
    let _ = writeln!(text, "  {:<30} {:>8}   beside {} ruptures", "false alarms", s.false_alarms, s.ruptures);
    for name in ["enhancement.rms_relative", "reconstruction_rms_n"] {
        if let Some(x) = s.scores.iter().find(|x| x.score == name) {
            let _ = writeln!(
                text,
                "  {name:<30} {:>8}   median; p95 {}",
                significant(x.median.value, 3),
                significant(x.p95.value, 3)
            );
        }
    }
    if let Some(outcome) = s.explained.first() {
        let _ = writeln!(text, "  {} explained by (first-order index, rank correlation)", outcome.outcome);
        for e in outcome.by.iter().take(5) {
            let or_dash = |x: Option<f64>| x.map_or("-".to_owned(), |x| significant(x, 2));
            let _ = writeln!(
                text,
                "    {:<44} {:>6}  {:>6}",
                e.quantity,
                or_dash(e.first_order),
                or_dash(e.rank_correlation)
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

/// Where the results of a command on shards go.
fn folder(out: Option<&PathBuf>, sweep: &Path) -> PathBuf {
    out.cloned().unwrap_or_else(|| default_folder(sweep))
}
