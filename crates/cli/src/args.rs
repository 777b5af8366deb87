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
    /// Compare measured data with a scenario: what is wrong, why, and how much better it gets.
    Diagnose(DiagnoseArgs),
    /// List the effects by which reality departs from the base law, or show one.
    Effects(EffectsArgs),
    /// Examine a part of Stylet on many drawn cases.
    Benchmark(BenchmarkArgs),
    /// Re-make the paper's figures and judge its claims, on one page.
    Reproduce(ReproduceArgs),
}

/// Arguments of `stylet reproduce`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  stylet reproduce --out out/paper
  stylet reproduce --out out/again --first-seed 51     other noise, the same verdicts

The folder then holds index.html (open it beside the paper's supplement), claims.json and every figure
as SVG. The same seeds give the same bytes for any number of threads.")]
pub struct ReproduceArgs {
    #[command(flatten)]
    pub results: Results,
    /// Number of noise seeds; fewer than 50 are a quick look.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(2..=100_000))]
    pub seeds: u64,
    /// First noise seed.
    #[arg(long, value_name = "SEED", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=900_000))]
    pub first_seed: u64,
}

/// Where results go and what is said meanwhile: the same for every command that makes a folder.
#[derive(Clone, Debug, Default, Args)]
pub struct Results {
    /// Folder for the results [default: stylet-out/<name of the input>; for `replay` DIR/trial-<TRIAL>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
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
    /// Seed of the noise, in place of the scenario's.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Run both the multi-layer and the Kelvin-Voigt model on the same data.
    #[arg(long)]
    pub compare: bool,
    /// Where the results go.
    #[command(flatten)]
    pub results: Results,
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
    /// Where the results go.
    #[command(flatten)]
    pub results: Results,
}

/// Arguments of `stylet diagnose`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet diagnose scenario.ron --data a.csv b.csv c.csv --out out/diagnosis
  stylet diagnose scenario.ron --data log1.csv log2.csv --columns map.ron
  stylet diagnose scenario.ron --repeats --data run1.csv run2.csv run3.csv --columns map.ron
  stylet diagnose scenarios/measured/skin_on_muscle.ron

The folder then holds report.html, diagnosis.json and extended.ron: the scenario with re-fitted
parameters and the effects that were found, ready for `stylet run` (give it a motion if the scenario
says `Recorded`). The exit code is 0 whatever the verdict, 2 when the input is wrong.")]
pub struct DiagnoseArgs {
    /// Scenario: what the simulation believes; or a data set of repeated insertions (RON).
    pub scenario: PathBuf,
    /// The recordings are repeats of the same insertion: tell what varies from run to run from what
    /// the law lacks, and predict each run without it. A data set does so by itself.
    #[arg(long)]
    pub repeats: bool,
    /// Recordings (CSV with header); several motions tell more than one. A data set names its own.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub data: Vec<PathBuf>,
    /// Column map for foreign logs (RON).
    #[arg(long, value_name = "FILE")]
    pub columns: Option<PathBuf>,
    /// Drop rows with backward or repeated time stamps, and say which.
    #[arg(long)]
    pub repair: bool,
    /// Where the results go.
    #[command(flatten)]
    pub results: Results,
}

/// Arguments of `stylet effects`.
#[derive(Debug, Args)]
pub struct EffectsArgs {
    /// Effect to show, by its id; all are listed without it.
    pub name: Option<String>,
}

/// Arguments of `stylet benchmark`.
#[derive(Debug, Args)]
pub struct BenchmarkArgs {
    /// What to examine.
    #[command(subcommand)]
    pub what: BenchmarkWhat,
}

/// What can be examined.
#[derive(Debug, Subcommand)]
pub enum BenchmarkWhat {
    /// Hide effects in generated data, diagnose them, and write confusion matrix, power and calibration.
    Diagnose(BenchmarkDiagnoseArgs),
}

/// Arguments of `stylet benchmark diagnose`.
#[derive(Debug, Args)]
pub struct BenchmarkDiagnoseArgs {
    /// Number of cases. Of twenty, eight are clean, eight hide one effect, two hide two, two one outside the library.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    pub cases: u64,
    /// Seed of the drawing.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Folder: cases.jsonl (one line per case; cases in it are not run again) and summary.txt
    /// [default: stylet-out/benchmark-diagnose-<seed>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// No argument is there twice, no default is out of its range: what clap checks in debug builds only.
    #[test]
    fn the_arguments_of_all_commands_fit_together() {
        Cli::command().debug_assert();
    }
}
