//! Arguments of `stylet sweep`, `stylet replay` and `stylet gate`.

use crate::args::OutputArgs;
use crate::limits::ResourceLimits;
use clap::{Args, Subcommand};
use std::path::PathBuf;
use stylet_sweep::Overrides;
use stylet_sweep::shard::ShardNumber;

/// How much is drawn, and from which seed.
#[derive(Clone, Copy, Debug, Args)]
pub struct SweepOverrides {
    /// Number of trials, in place of the file's.
    #[arg(long, value_name = "N")]
    pub trials: Option<u64>,
    /// Seed of all draws, in place of the file's.
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
}

impl From<SweepOverrides> for Overrides {
    fn from(draws: SweepOverrides) -> Self {
        Self { trials: draws.trials, seed: draws.seed }
    }
}

/// Arguments of `stylet sweep`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
#[command(after_help = "Examples:
  stylet sweep scenarios/sweeps/noise.ron
  stylet sweep scenarios/sweeps/noise.ron --trials 500 --seed 7 --out out/noise
  stylet sweep scenarios/sweeps/noise.ron --resume      after an interruption
  stylet replay out/noise 123                           one trial with a full report

The folder then holds report.html, trials.csv, summary.json and what repeats it: sweep.ron and
scenario.ron. The same sweep and seed give the same bytes for any number of threads.

On a cluster: `stylet sweep plan SWEEP --shards N`, then `run-shard I/N` anywhere, then `merge`.")]
pub struct SweepArgs {
    /// What to do instead of running a whole sweep.
    #[command(subcommand)]
    pub command: Option<SweepCommand>,
    /// Sweep file (RON).
    pub sweep: Option<PathBuf>,
    /// What is drawn.
    #[command(flatten)]
    pub overrides: SweepOverrides,
    /// Threads [default: one per core].
    #[arg(long, value_name = "T", value_parser = crate::limits::parse_threads)]
    pub threads: Option<usize>,
    /// Go on where an interrupted sweep stopped.
    #[arg(long)]
    pub resume: bool,
    /// Where the results go.
    #[command(flatten)]
    pub results: OutputArgs,
    /// How much it may take.
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// The parts of a sweep that is spread over machines.
#[derive(Debug, Subcommand)]
pub enum SweepCommand {
    /// Say which trials each shard holds and how long it takes here.
    Plan(PlanArgs),
    /// Run one shard, for example 3/8.
    RunShard(RunShardArgs),
    /// Put all shards together: table, summary, report.
    Merge(MergeArgs),
    /// Draw the robustness map of several sweeps.
    Map(MapArgs),
}

/// Which sweep.
#[derive(Debug, Args)]
pub struct SweepSelection {
    /// Sweep file (RON).
    pub sweep: PathBuf,
    /// What is drawn.
    #[command(flatten)]
    pub overrides: SweepOverrides,
}

/// Arguments of `stylet sweep plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Which sweep.
    #[command(flatten)]
    pub selection: SweepSelection,
    /// Number of shards.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=999_999))]
    pub shards: u64,
}

/// Arguments of `stylet sweep run-shard`.
#[derive(Debug, Args)]
pub struct RunShardArgs {
    /// Which shard, counted from 1: I/N.
    #[arg(value_name = "I/N")]
    pub shard: ShardNumber,
    /// Which sweep.
    #[command(flatten)]
    pub selection: SweepSelection,
    /// Threads [default: one per core].
    #[arg(long, value_name = "T", value_parser = crate::limits::parse_threads)]
    pub threads: Option<usize>,
    /// Folder for the results [default: stylet-out/<sweep>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Leave a whole shard of this sweep as it is.
    #[arg(long)]
    pub resume: bool,
}

/// Arguments of `stylet sweep merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Which sweep.
    #[command(flatten)]
    pub selection: SweepSelection,
    /// Where the shards are and the results go.
    #[command(flatten)]
    pub results: OutputArgs,
}

/// Arguments of `stylet sweep map`.
#[derive(Debug, Args)]
pub struct MapArgs {
    /// Sweep files (RON).
    #[arg(required = true)]
    pub sweeps: Vec<PathBuf>,
    /// Number of trials of each, in place of the files'.
    #[arg(long, value_name = "N")]
    pub trials: Option<u64>,
    /// Picture to write.
    #[arg(long, value_name = "FILE", default_value = "robustness.svg")]
    pub svg: PathBuf,
}

/// Arguments of `stylet replay`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  stylet replay stylet-out/noise 123

The trial's scenario is written to DIR/trial-123/scenario.ron and run with a full report; `stylet run` on
that file repeats it.")]
pub struct ReplayArgs {
    /// Folder of a sweep's results.
    pub dir: PathBuf,
    /// Number of the trial, from 0.
    pub trial: u64,
    /// Where the results go.
    #[command(flatten)]
    pub results: OutputArgs,
}

/// Arguments of `stylet gate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet gate scenarios/gates/ci.ron
  stylet gate scenarios/gates/ci.ron --junit gates.xml --json gates.json
  stylet gate scenarios/gates/ci.ron --update      accept the numbers of now as baseline

Ends with 1 when a bound does not hold for the unfavourable end of its 95 % interval.")]
pub struct GateArgs {
    /// Gates file (RON).
    pub gates: PathBuf,
    /// Baseline to compare with [default: <GATES>.baseline.json beside the gates].
    #[arg(long, value_name = "FILE")]
    pub baseline: Option<PathBuf>,
    /// Write the baseline anew and say what changed.
    #[arg(long)]
    pub update: bool,
    /// Seed of every gate, in place of the files'.
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// Threads [default: one per core].
    #[arg(long, value_name = "T", value_parser = crate::limits::parse_threads)]
    pub threads: Option<usize>,
    /// Write the results as JUnit XML.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Write the results as JSON.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Print the bounds that do not hold alone, and no progress.
    #[arg(long, short)]
    pub quiet: bool,
}
