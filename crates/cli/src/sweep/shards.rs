//! `stylet sweep plan | run-shard | merge`: a sweep spread over machines.

use super::args::{MergeArgs, PlanArgs, RunShardArgs, Which};
use super::{conclude, folder, with_threads};
use crate::exit::Failure;
use std::fmt::Write as _;
use std::time::Instant;
use stylet_api::Claim;
use stylet_report::significant;
use stylet_sweep::shard::{self, ShardNumber};
use stylet_sweep::{Columns, Sweep, rows};

/// Trials that the plan runs to see how long one takes.
const PROBE: u64 = 32;

fn load(which: &Which) -> Result<(Sweep, Columns), Failure> {
    let sweep = Sweep::load(&which.sweep, which.draws.into())?;
    let columns = Columns::new(&sweep);
    Ok((sweep, columns))
}

/// `stylet sweep plan`.
pub fn plan(args: &PlanArgs) -> Result<(), Failure> {
    let (sweep, columns) = load(&args.which)?;
    let probe = PROBE.min(sweep.trials());
    let start = Instant::now();
    with_threads(1, || rows(&sweep, &columns, 0..probe, &|_| {}))??;
    let per_trial = start.elapsed().as_secs_f64() / probe as f64;
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
    let out = folder(args.out.as_ref(), &args.which.sweep);
    let _claim = Claim::shared(&out)?;
    let number = args.shard;
    if args.resume && shard::read(&sweep, &columns, number, &out).is_ok() {
        return Ok(());
    }
    let range = number.range(sweep.trials());
    let rows = with_threads(args.threads.unwrap_or(0), || rows(&sweep, &columns, range, &|_| {}))??;
    shard::write(&sweep, &columns, number, &rows, &out)?;
    Ok(())
}

/// `stylet sweep merge`.
pub fn merge(args: &MergeArgs) -> Result<(), Failure> {
    let (sweep, columns) = load(&args.which)?;
    let out = folder(args.results.out.as_ref(), &args.which.sweep);
    let claim = Claim::new(&out)?;
    let of = shard::split_of(&out)?;
    let mut all = Vec::new();
    for shard in 1..=of {
        all.extend(shard::read(&sweep, &columns, ShardNumber { shard, of }, &out)?);
    }
    conclude(&sweep, &columns, &all, (&claim, &out), args.results.quiet)
}
