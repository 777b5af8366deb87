//! `stylet sweep plan | run-shard | merge`: a sweep spread over machines.

use super::args::{MergeArgs, PlanArgs, RunShardArgs, Which};
use super::{with_threads, written};
use crate::exit::Failure;
use crate::results::default_folder;
use std::fmt::Write as _;
use stylet_api::Claim;
use stylet_api::sweep_folder::{merged, one_shard, trial_s};
use stylet_report::significant;
use stylet_sweep::shard::ShardNumber;
use stylet_sweep::{Columns, Sweep};

fn load(which: &Which) -> Result<(Sweep, Columns), Failure> {
    let sweep = Sweep::load(&which.sweep, which.draws.into())?;
    let columns = Columns::new(&sweep);
    Ok((sweep, columns))
}

/// `stylet sweep plan`.
pub fn plan(args: &PlanArgs) -> Result<(), Failure> {
    let (sweep, columns) = load(&args.which)?;
    let per_trial = with_threads(1, || trial_s(&sweep, &columns))??;
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
    crate::terminal::say(&text)
}

/// `stylet sweep run-shard`.
pub fn run_shard(args: &RunShardArgs) -> Result<(), Failure> {
    let (sweep, columns) = load(&args.which)?;
    let out = args.out.clone().unwrap_or_else(|| default_folder(&args.which.sweep, ""));
    let work = || one_shard(&sweep, &columns, args.shard, &out, args.resume);
    Ok(with_threads(args.threads.unwrap_or(0), work)??)
}

/// `stylet sweep merge`.
pub fn merge(args: &MergeArgs) -> Result<(), Failure> {
    let (sweep, columns) = load(&args.which)?;
    let out = args.results.folder(&args.which.sweep, "");
    let claim = Claim::new(&out)?;
    let rows = merged(&sweep, &columns, &out)?;
    written(&sweep, &columns, &rows, (&claim, &out), args.results.quiet)
}
