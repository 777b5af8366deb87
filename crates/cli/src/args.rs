//! What can be typed.

use crate::sweep::args::{GateArgs, ReplayArgs, SweepArgs};
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Needle insertion into layered tissue: simulated, enhanced online, scored against the truth.
///
/// Research software, not a medical device.
#[derive(Debug, Parser)]
#[command(name = "stylet", version, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate a scenario, enhance it online, score it, and draw the report.
    Run(RunArgs),
    /// Run the online algorithm on a measured recording.
    Enhance(EnhanceArgs),
    /// Thousands of insertions with drawn quantities: rates, intervals, what explains the failures.
    Sweep(SweepArgs),
    /// Run one trial of a sweep again, with a full report.
    Replay(ReplayArgs),
    /// Hold scores against bounds, for CI.
    Gate(GateArgs),
}

/// Arguments of `stylet run`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet run scenarios/three_layer_latex_constant.ron
  stylet run scenarios/three_layer_latex_sinusoidal.ron --compare --out out/latex
  stylet run my_phantom.ron --seed 7

The folder then holds report.html (open it in a browser), recording.csv, score.json, figure.svg
and scenario.ron with every default written out.")]
pub struct RunArgs {
    /// Scenario file (RON).
    pub scenario: PathBuf,
    /// Folder for the results [default: stylet-out/<scenario>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Seed of the noise, in place of the scenario's.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Run both the multi-layer and the Kelvin-Voigt model on the same data.
    #[arg(long)]
    pub compare: bool,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Arguments of `stylet enhance`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet enhance recording.csv
  stylet enhance log.csv --columns map.ron --config tuned.ron --out out/log

A column map for a log in microseconds and millimetres:
  Columns(time: (name: \"time\", scale: 1e-6), position: (name: \"pz\", scale: 1e-3),
          force: (name: \"fz\"))

A configuration: Enhance(cusum: (sigma_rupture_n: 0.1), model: MultiLayer).
A scenario file serves too: its `enhance` part and its surface are used.")]
pub struct EnhanceArgs {
    /// Recording (CSV with header).
    pub data: PathBuf,
    /// Configuration of the core (RON); the paper's values without it.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Column map for a foreign log (RON).
    #[arg(long, value_name = "FILE")]
    pub columns: Option<PathBuf>,
    /// Drop rows with backward or repeated time stamps, and say which.
    #[arg(long)]
    pub repair: bool,
    /// Run both the multi-layer and the Kelvin-Voigt model.
    #[arg(long)]
    pub compare: bool,
    /// Folder for the results [default: stylet-out/<recording>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
}
