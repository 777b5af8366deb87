//! Arguments of `stylet run`, `stylet compare` and `stylet reproduce`.

use crate::cli::output_args::OutputArgs;
use crate::cli::resource_limits::ResourceLimits;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `stylet run`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet run scenarios/three_layer_latex_constant.ron
  stylet run scenarios/three_layer_latex_sinusoidal.ron --compare --out out/latex
  stylet run my_phantom.ron --seed 7

Writes report.html (open it in a browser), recording.csv, score.json, figure.svg and scenario.ron
with every default written out.")]
pub struct RunArgs {
    /// Scenario file (RON).
    pub scenario: PathBuf,
    /// Seed of the sensor noise [default: the scenario's].
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Replace the scenario's motion by the one in this file (RON), such as `stylet plan` writes.
    #[arg(long, value_name = "FILE")]
    pub motion: Option<PathBuf>,
    /// Run both the multi-layer and the Kelvin-Voigt model on the same data.
    #[arg(long)]
    pub compare: bool,
    #[command(flatten)]
    pub results: OutputArgs,
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// Arguments of `stylet compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet compare scenarios/compare/*.ron --seeds 400
  stylet compare my_phantom.ron --algorithms Paper,Stylet --seeds 1400 --out out/compare
  stylet compare --world rich --seeds 200

Writes report.html and compare.json. With --world the insertions come from the independent simulator of
`stylet benchmark diagnose`, with correct assumptions.")]
pub struct CompareArgs {
    /// Scenario files (RON).
    #[arg(required_unless_present = "world")]
    pub scenarios: Vec<PathBuf>,
    /// Also simulate insertions with this tissue model of the independent simulator: plain or rich.
    #[arg(long, value_name = "WORLD")]
    pub world: Option<String>,
    /// With --world: seed of the cases.
    #[arg(long, default_value_t = 1, value_name = "SEED")]
    pub seed: u64,
    /// With --world: hidden departures from the base law, one row of the table each.
    #[arg(long, value_delimiter = ',', value_name = "WORDS", default_value = "clean,one,two,three")]
    pub hide: Vec<String>,
    /// Algorithms, separated by commas.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "Paper,Stylet", ignore_case = true)]
    pub algorithms: Vec<AlgorithmArg>,
    /// Noise seeds per scenario and algorithm; with --world simulated cases per row.
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub seeds: u64,
    #[command(flatten)]
    pub results: OutputArgs,
}

/// An online algorithm, by its name in scenarios.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum AlgorithmArg {
    /// The paper's algorithm.
    #[value(name = "Paper")]
    Paper,
    /// The paper's algorithm to the letter.
    #[value(name = "Literal")]
    Literal,
    /// This project's algorithm.
    #[value(name = "Stylet")]
    Stylet,
}

/// Arguments of `stylet reproduce`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet reproduce --out out/paper
  stylet reproduce --out out/second --first-seed 51     other noise, the same verdicts

Writes index.html (to be read with the paper's supplement), claims.json, switches.json and every figure as
SVG.")]
pub struct ReproduceArgs {
    #[command(flatten)]
    pub results: OutputArgs,
    /// Number of noise seeds; fewer than 50 give a preview.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(2..=100_000))]
    pub seeds: u64,
    /// First noise seed.
    #[arg(long, value_name = "SEED", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=900_000))]
    pub first_seed: u64,
}
