//! Arguments of `stylet sweep`, `stylet replay` and `stylet gate`.

use crate::cli::output_args::OutputArgs;
use crate::cli::resource_limits::{ResourceLimits, parse_threads};
use clap::{Args, Subcommand};
use std::path::PathBuf;
use stylet_sweep::Overrides;
use stylet_sweep::shard::ShardNumber;

/// Number of trials and seed.
#[derive(Clone, Copy, Debug, Args)]
pub struct SweepOverrides {
    /// Number of trials [default: the file's].
    #[arg(long, value_name = "N")]
    pub trials: Option<u64>,
    /// Seed of all random draws [default: the file's].
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
}

impl From<SweepOverrides> for Overrides {
    fn from(overrides: SweepOverrides) -> Self {
        Self { trials: overrides.trials, seed: overrides.seed }
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

Writes report.html, trials.csv, summary.json, and sweep.ron and scenario.ron, which repeat the sweep.")]
pub struct SweepArgs {
    /// Step of a sweep that is spread over machines.
    #[command(subcommand)]
    pub command: Option<SweepCommand>,
    /// Sweep file (RON).
    pub sweep: Option<PathBuf>,
    #[command(flatten)]
    pub overrides: SweepOverrides,
    /// Threads [default: number of cores].
    #[arg(long, value_name = "T", value_parser = parse_threads)]
    pub threads: Option<usize>,
    /// Resume an interrupted sweep.
    #[arg(long)]
    pub resume: bool,
    #[command(flatten)]
    pub results: OutputArgs,
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// The steps of a sweep that is spread over machines.
#[derive(Debug, Subcommand)]
pub enum SweepCommand {
    /// Print the trials of each shard and the time that a shard takes on this machine.
    Plan(PlanArgs),
    /// Run one shard, for example 3/8.
    RunShard(RunShardArgs),
    /// Merge all shards: table, summary, report.
    Merge(MergeArgs),
    /// Draw the robustness map of several sweeps.
    Map(MapArgs),
}

/// A sweep file, with number of trials and seed.
#[derive(Debug, Args)]
pub struct SweepSelection {
    /// Sweep file (RON).
    pub sweep: PathBuf,
    #[command(flatten)]
    pub overrides: SweepOverrides,
}

/// Arguments of `stylet sweep plan`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  stylet sweep plan scenarios/sweeps/noise.ron --shards 64 --trials 1000000")]
pub struct PlanArgs {
    #[command(flatten)]
    pub selection: SweepSelection,
    /// Number of shards.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=999_999))]
    pub shards: u64,
}

/// Arguments of `stylet sweep run-shard`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  stylet sweep run-shard 3/64 scenarios/sweeps/noise.ron --trials 1000000 --out /shared/noise")]
pub struct RunShardArgs {
    /// Shard, counted from 1: I/N.
    #[arg(value_name = "I/N")]
    pub shard: ShardNumber,
    #[command(flatten)]
    pub selection: SweepSelection,
    /// Threads [default: number of cores].
    #[arg(long, value_name = "T", value_parser = parse_threads)]
    pub threads: Option<usize>,
    /// Folder for the results [default: stylet-out/<sweep>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Keep a complete shard of this sweep as it is.
    #[arg(long)]
    pub resume: bool,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Arguments of `stylet sweep merge`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  stylet sweep merge scenarios/sweeps/noise.ron --trials 1000000 --out /shared/noise")]
pub struct MergeArgs {
    #[command(flatten)]
    pub selection: SweepSelection,
    /// `--out` is the folder of the shards, and of the results.
    #[command(flatten)]
    pub results: OutputArgs,
}

/// Arguments of `stylet sweep map`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  stylet sweep map scenarios/sweeps/*.ron --trials 2000 --svg robustness.svg")]
pub struct MapArgs {
    /// Sweep files (RON).
    #[arg(required = true)]
    pub sweeps: Vec<PathBuf>,
    /// Number of trials of each sweep [default: the files'].
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

Writes the files of `stylet run`.")]
pub struct ReplayArgs {
    /// Folder of a sweep's results.
    pub dir: PathBuf,
    /// Number of the trial, from 0.
    pub trial: u64,
    /// Folder for the results [default: DIR/trial-<TRIAL>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Arguments of `stylet gate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet gate scenarios/gates/ci.ron
  stylet gate scenarios/gates/ci.ron --junit gates.xml --json gates.json
  stylet gate scenarios/gates/ci.ron --update      accept the current values as baseline

The exit code is 1 when a bound does not hold for the unfavourable end of its 95 % interval.")]
pub struct GateArgs {
    /// Gates file (RON).
    pub gates: PathBuf,
    /// Baseline to compare with [default: <GATES>.baseline.json next to the gates file].
    #[arg(long, value_name = "FILE")]
    pub baseline: Option<PathBuf>,
    /// Replace the baseline by the current values, and print what changed.
    #[arg(long)]
    pub update: bool,
    /// Seed of every gate [default: the files'].
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// Threads [default: number of cores].
    #[arg(long, value_name = "T", value_parser = parse_threads)]
    pub threads: Option<usize>,
    /// Write the results as JUnit XML.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Write the results as JSON.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Print only the bounds that do not hold, and no progress.
    #[arg(long, short)]
    pub quiet: bool,
}
