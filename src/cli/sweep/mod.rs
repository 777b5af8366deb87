//! `stylet sweep`, `stylet replay` and `stylet gate`.

mod gate;
mod replay;
mod robustness_map;
mod shards;
mod thread_pool;
mod whole_sweep;

pub use gate::gate;
pub use replay::replay;

use crate::cli::args::{SweepArgs, SweepCommand};
use crate::cli::exit_codes::Failure;

/// `stylet sweep` and its subcommands.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn sweep(args: &SweepArgs) -> Result<(), Failure> {
    match &args.command {
        Some(SweepCommand::Plan(plan)) => shards::plan(plan),
        Some(SweepCommand::RunShard(run)) => shards::run_shard(run),
        Some(SweepCommand::Merge(merge)) => shards::merge(merge),
        Some(SweepCommand::Map(map)) => robustness_map::map(map),
        None => whole_sweep::run_all_trials(args),
    }
}
