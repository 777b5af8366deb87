//! `stylet sweep plan | run-shard | merge`: a sweep spread over machines.

use super::thread_pool::with_threads;
use super::whole_sweep::{finish, scenario_file};
use crate::cli::args::{MergeArgs, RunShardArgs, SweepPlanArgs, SweepSelection};
use crate::cli::exit_codes::Failure;
use crate::cli::output_args::default_folder;
use std::fmt::Write as _;
use stylet_api::OutputLock;
use stylet_api::sweep_folder::{measure_trial_s, read_all_shards, run_shard as write_shard};
use stylet_report::significant;
use stylet_sweep::shard::ShardNumber;
use stylet_sweep::{Columns, Sweep};

fn load(selection: &SweepSelection) -> Result<(Sweep, Columns), Failure> {
    let sweep = Sweep::load(&selection.sweep, selection.overrides.into())?;
    let columns = Columns::new(&sweep);
    Ok((sweep, columns))
}

/// `stylet sweep plan`.
pub fn plan(args: &SweepPlanArgs) -> Result<(), Failure> {
    let (sweep, columns) = load(&args.selection)?;
    let per_trial = with_threads(1, || measure_trial_s(&sweep, &columns))??;
    let mut text = format!(
        "{}: {} trials in {} shards, identity {}\n",
        sweep.name,
        sweep.trials(),
        args.shards,
        sweep.identity()
    );
    for shard in 1..=args.shards {
        let range = ShardNumber { shard, of: args.shards }.range(sweep.trials());
        let _ = writeln!(text, "{shard}/{}\ttrials {} to {}", args.shards, range.start, range.end);
    }
    let seconds = per_trial * sweep.trials() as f64 / args.shards as f64;
    let _ = writeln!(
        text,
        "one thread here takes {} ms per trial: {} s per shard",
        significant(per_trial * 1e3, 2),
        significant(seconds, 2)
    );
    crate::cli::terminal_output::print(&text)
}

/// `stylet sweep run-shard`.
pub fn run_shard(args: &RunShardArgs) -> Result<(), Failure> {
    let (sweep, columns) = load(&args.selection)?;
    let out = args.out.clone().unwrap_or_else(|| default_folder(&args.selection.sweep, ""));
    let work = || write_shard(&sweep, &columns, args.shard, &out, args.resume);
    with_threads(args.threads.unwrap_or(0), work)??;
    if args.quiet {
        return Ok(());
    }
    let range = args.shard.range(sweep.trials());
    let path = args.shard.path(&out);
    crate::cli::terminal_output::print(&format!(
        "{}: trials {} to {}\n",
        path.display(),
        range.start,
        range.end
    ))
}

/// `stylet sweep merge`.
pub fn merge(args: &MergeArgs) -> Result<(), Failure> {
    let (sweep, columns) = load(&args.selection)?;
    let out = args.results.output_folder(&args.selection.sweep, "");
    let lock = OutputLock::new(&out)?;
    let rows = read_all_shards(&sweep, &columns, &out)?;
    let inputs = args.results.inputs(&args.selection.sweep, [&scenario_file(&args.selection.sweep, &sweep)]);
    finish(&sweep, &columns, &rows, (&lock, &out), inputs, args.results.quiet)
}
