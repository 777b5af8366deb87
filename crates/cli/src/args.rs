//! What can be typed.

use crate::limits::ResourceLimits;
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
    /// Write a recording in another format: CSV, Parquet, MCAP.
    Convert(ConvertArgs),
    /// Thousands of insertions with drawn quantities: rates, intervals, what explains the failures.
    Sweep(SweepArgs),
    /// Run one trial of a sweep again, with a full report.
    Replay(ReplayArgs),
    /// Hold scores against bounds, for CI.
    Gate(GateArgs),
    /// Run several algorithms on the same simulated insertions, over many seeds.
    Compare(CompareArgs),
    /// Compare measured data with a scenario: what is wrong, why, and how much better it gets.
    Diagnose(DiagnoseArgs),
    /// Predict recordings that took no part in a diagnosis by the model that it gave.
    Predict(PredictArgs),
    /// Tell what an experiment can show: which effects, from which size on, and which it cannot tell apart.
    Identifiability(IdentifiabilityArgs),
    /// Plan the next insertion: the motion within limits that tells the remaining causes apart.
    Plan(PlanArgs),
    /// List the effects by which reality departs from the base law, or show one.
    Effects(EffectsArgs),
    /// Examine a part of Stylet on many drawn cases.
    Benchmark(BenchmarkArgs),
    /// Run the online core on a stream of samples: UDP or lines in; JSON by UDP, lines and a live page out.
    Listen(ListenArgs),
    /// Re-make the paper's figures and judge its claims, on one page.
    Reproduce(ReproduceArgs),
}

/// Arguments of `stylet compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet compare scenarios/compare/*.ron --seeds 400
  stylet compare my_phantom.ron --algorithms Paper,Stylet --seeds 1400 --out out/compare
  stylet compare --world rich --seeds 200

With --world the insertions are those that `stylet benchmark diagnose` draws, with beliefs that are right: a tissue law of another
form than the one that the algorithms were made for. The folder then holds report.html and compare.json. Scenarios are replayed kinematically; the same seeds give the
same bytes for any number of threads.")]
pub struct CompareArgs {
    /// Scenario files (RON).
    #[arg(required_unless_present = "world")]
    pub scenarios: Vec<PathBuf>,
    /// Also the insertions of this world of the referee: plain or rich.
    #[arg(long, value_name = "WORLD")]
    pub world: Option<String>,
    /// With --world: seed that its cases are drawn with.
    #[arg(long, default_value_t = 1, value_name = "SEED")]
    pub seed: u64,
    /// With --world: what departs from the base law there; a row for each.
    #[arg(long, value_delimiter = ',', value_name = "WORDS", default_value = "clean,one,two,three")]
    pub hide: Vec<String>,
    /// Algorithms, separated by commas.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "Paper,Stylet", ignore_case = true)]
    pub algorithms: Vec<AlgorithmArg>,
    /// Noise seeds per scenario and algorithm; with --world drawn cases per row.
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub seeds: u64,
    /// Where the results go.
    #[command(flatten)]
    pub results: OutputArgs,
}

/// An algorithm of the online core, by its name in scenarios.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum AlgorithmArg {
    /// The paper's.
    #[value(name = "Paper")]
    Paper,
    /// The paper's to the letter.
    #[value(name = "Literal")]
    Literal,
    /// This project's.
    #[value(name = "Stylet")]
    Stylet,
}

/// Arguments of `stylet listen`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet listen --udp 5005 --page 8080 --forward 127.0.0.1:9870
  tail -f samples.csv | stylet listen --stdin --page 8080

A sample is a line `time_s,position_m,force_n[,velocity_mps]` or a JSON object with these names, several
to a datagram if need be. Lines of JSON go to standard output and to --forward (PlotJuggler: UDP server,
message protocol JSON). A slow reader loses its own oldest lines and never slows the core; how many were
lost is in every line and in the summary on standard error. The datagram `end` ends the session.")]
pub struct ListenArgs {
    /// Hear samples on this UDP port.
    #[arg(long, value_name = "PORT", conflicts_with = "stdin", required_unless_present = "stdin")]
    pub udp: Option<u16>,
    /// Read samples from standard input.
    #[arg(long)]
    pub stdin: bool,
    /// Address to hear and serve on; `0.0.0.0` opens it to the network.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    pub host: String,
    /// Serve a page with live curves on this port (0: any free one).
    #[arg(long, value_name = "PORT")]
    pub page: Option<u16>,
    /// Send every line as a datagram.
    #[arg(long, value_name = "HOST:PORT")]
    pub forward: Option<String>,
    /// How the core is set: an Enhance(...) or Scenario(...) file.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// End after so many seconds (with --udp).
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration_s: Option<f64>,
    /// Print no lines.
    #[arg(long, short)]
    pub quiet: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(s) if s > 0.0 && s < 1e9 => Ok(s),
        _ => Err("must be a positive number of seconds".to_owned()),
    }
}

/// Arguments of `stylet reproduce`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  stylet reproduce --out out/paper
  stylet reproduce --out out/again --first-seed 51     other noise, the same verdicts

The folder then holds index.html (open it beside the paper's supplement), claims.json, switches.json
and every figure as SVG. The same seeds give the same bytes for any number of threads.")]
pub struct ReproduceArgs {
    #[command(flatten)]
    pub results: OutputArgs,
    /// Number of noise seeds; fewer than 50 are a quick look.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(2..=100_000))]
    pub seeds: u64,
    /// First noise seed.
    #[arg(long, value_name = "SEED", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=900_000))]
    pub first_seed: u64,
}

/// Where results go and what is said meanwhile: the same for every command that makes a folder.
#[derive(Clone, Debug, Default, Args)]
pub struct OutputArgs {
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
    /// Another motion (RON), such as one that `stylet plan` wrote.
    #[arg(long, value_name = "FILE")]
    pub motion: Option<PathBuf>,
    /// Run both the multi-layer and the Kelvin-Voigt model on the same data.
    #[arg(long)]
    pub compare: bool,
    /// Where the results go.
    #[command(flatten)]
    pub results: OutputArgs,
    /// How much it may take.
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// Arguments of `stylet enhance`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet enhance recording.csv
  stylet enhance log.csv --columns map.ron --config tuned.ron --out out/log
  stylet enhance next_day.csv --model out/diagnosis/extended.ron

A column map for a log in microseconds and millimetres:
  Columns(time: (name: \"time\", scale: 1e-6), position: (name: \"pz\", scale: 1e-3),
          force: (name: \"fz\"))

A configuration: Enhance(cusum: (sigma_rupture_n: 0.1), model: MultiLayer).
A scenario file serves too: its `enhance` part and its surface are used.

With --model the friction along the shaft is what a law says of it that `stylet diagnose` fitted to
other insertions (single ones or a set of repeats). It is replayed sample by sample along the
recorded positions, with each layer punctured from where the core says so, and corrected on the way
back by what the force shows. Law and recording must have the same zero of the positions.")]
pub struct EnhanceArgs {
    /// Recording (CSV with header).
    pub data: PathBuf,
    /// Configuration of the core (RON); without it the algorithm `Stylet` with its defaults.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Take the friction along the shaft from this law: extended.ron of a diagnosis, or any scenario (RON).
    #[arg(long, value_name = "EXTENDED.RON")]
    pub model: Option<PathBuf>,
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
    pub results: OutputArgs,
    /// How much it may take.
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// Arguments of `stylet convert`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet convert bag.mcap insertion.csv --columns map.ron
  stylet convert out/recording.csv insertion.parquet

A column map for a log of a robot, force and position on topics of their own:
  Columns(time: (name: \"/ft_sensor/wrench.log_time\"), force: (name: \"/ft_sensor/wrench.wrench.force.z\"),
          position: (name: \"/tip.pose.position.z\"))

Every command reads CSV, and with the feature `formats` also MCAP (JSON, ROS 2 messages), MATLAB v7.3 and Parquet.")]
pub struct ConvertArgs {
    /// Recording.
    pub from: PathBuf,
    /// Where it goes; the ending .csv, .parquet or .mcap says how.
    pub to: PathBuf,
    /// Column map for a foreign log (RON).
    #[arg(long, value_name = "FILE")]
    pub columns: Option<PathBuf>,
    /// Drop rows with backward or repeated time stamps, and say which.
    #[arg(long)]
    pub repair: bool,
    /// Say nothing.
    #[arg(long, short)]
    pub quiet: bool,
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
    pub results: OutputArgs,
    /// How much it may take.
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// Arguments of `stylet predict`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet predict out/diagnosis/extended.ron --data next_day.csv
  stylet predict out/diagnosis/extended.ron --data d.csv e.csv --refit friction,surface
  stylet predict phantom.ron --data a.csv --out out/phantom

The folder then holds report.html and predict.json: what the model leaves of each recording beside the sensor's noise, and how
much of the force lies in the band that should hold 90 %. diagnosis.json and inputs.json beside the model tell noise, scatter,
intervals, and what was believed before. The exit code is 0 however bad the prediction is.")]
pub struct PredictArgs {
    /// The model: extended.ron of a diagnosis, or any scenario (RON).
    pub model: PathBuf,
    /// Recordings (CSV with header) that took no part in making the model.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    pub data: Vec<PathBuf>,
    /// What was believed before (RON), for comparison [default: what inputs.json beside the model names].
    #[arg(long, value_name = "FILE")]
    pub assumed: Option<PathBuf>,
    /// Numbers that may be fitted to the new recordings first; with two or more recordings each is predicted by what the
    /// others say.
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',')]
    pub refit: Vec<RefitArg>,
    /// Column map for foreign logs (RON).
    #[arg(long, value_name = "FILE")]
    pub columns: Option<PathBuf>,
    /// Drop rows with backward or repeated time stamps.
    #[arg(long)]
    pub repair: bool,
    /// Where the results go.
    #[command(flatten)]
    pub results: OutputArgs,
    /// How much it may take.
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// A number that another needle or another day may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum RefitArg {
    /// Friction: one factor for all layers.
    Friction,
    /// The position of the surface.
    Surface,
}

/// Arguments of `stylet identifiability`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet identifiability scenario.ron
  stylet identifiability scenario.ron --motion plan.ron --out out/with-plan
  stylet identifiability scenario.ron --data a.csv b.csv

The folder then holds report.html, identifiability.json and matrix.svg. Sizes are those that `stylet effects` calls typical.")]
pub struct IdentifiabilityArgs {
    /// Scenario: what the simulation believes, and the motion of the experiment.
    pub scenario: PathBuf,
    /// Another motion (RON), such as one that `stylet plan` wrote.
    #[arg(long, value_name = "FILE", conflicts_with = "data")]
    pub motion: Option<PathBuf>,
    /// Recordings (CSV with header) in place of a motion: their motions and their noise.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub data: Vec<PathBuf>,
    /// Column map for foreign logs (RON).
    #[arg(long, value_name = "FILE")]
    pub columns: Option<PathBuf>,
    /// Drop rows with backward or repeated time stamps.
    #[arg(long)]
    pub repair: bool,
    /// Where the results go.
    #[command(flatten)]
    pub results: OutputArgs,
    /// How much it may take.
    #[command(flatten)]
    pub resources: ResourceLimits,
}

/// Arguments of `stylet plan`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet plan out/diagnosis --limits limits.ron --out plan.ron
  stylet plan scenario.ron --data a.csv --limits limits.ron --out plan.ron
  stylet plan scenario.ron --limits limits.ron --quick

limits.ron: Limits(depth_m: 0.09, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 90.0, force_n: 6.0)

Beside plan.ron stand plan.json and plan.html. The plan is a motion: `stylet run scenario.ron --motion plan.ron` simulates it; when
it has been made, `stylet diagnose` takes the old and the new recordings together. Without recordings the scenario's own motion counts
as made. The exit code is 2 when no motion keeps the limits; the message says why.")]
pub struct PlanArgs {
    /// Folder of a diagnosis, or a scenario (RON).
    pub from: PathBuf,
    /// What the insertion may do (RON).
    #[arg(long, value_name = "FILE")]
    pub limits: PathBuf,
    /// Where the motion goes [default: stylet-out/<name>-plan/plan.ron].
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// With a scenario: recordings made so far (CSV with header).
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub data: Vec<PathBuf>,
    /// Column map for foreign logs (RON).
    #[arg(long, value_name = "FILE")]
    pub columns: Option<PathBuf>,
    /// Drop rows with backward or repeated time stamps.
    #[arg(long)]
    pub repair: bool,
    /// Do not simulate and diagnose the planned insertion: seconds instead of up to a minute.
    #[arg(long)]
    pub quick: bool,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
    /// How much it may take.
    #[command(flatten)]
    pub resources: ResourceLimits,
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
    pub command: BenchmarkCommand,
}

/// What can be examined.
#[derive(Debug, Subcommand)]
pub enum BenchmarkCommand {
    /// Diagnose cases of worlds that the diagnosis did not make, and write the table and a map of where it fails.
    Diagnose(BenchmarkDiagnoseArgs),
    /// Write such cases for others to diagnose: believed scenarios and recordings without the truth.
    Export(BenchmarkExportArgs),
    /// Judge anybody's answers to exported cases with the same table.
    Score(BenchmarkScoreArgs),
    /// Insert again, as planned, where one insertion at constant speed leaves the cause open: how often is it found then?
    Plan(BenchmarkPlanArgs),
}

/// Which cases: the same for every command about them.
#[derive(Clone, Debug, Args)]
pub struct CaseArgs {
    /// Which law the tissue follows: `plain` and `rich` are written independently of the diagnosis, `own` (for `diagnose`
    /// alone) shares law, clock and noise with it.
    #[arg(long, value_name = "WORLD", default_value = "plain")]
    pub world: String,
    /// What the believed simulation or the sensor has wrong, row by row; `all` for every word.
    #[arg(long, value_name = "WORDS", value_delimiter = ',', default_value = "nothing")]
    pub wrong: Vec<String>,
    /// How much of it: small, medium, large.
    #[arg(long, value_name = "WORDS", value_delimiter = ',', default_value = "small,medium,large")]
    pub severity: Vec<String>,
    /// What is hidden in the cases; those of a row and severity go round the list.
    #[arg(long, value_name = "WORDS", value_delimiter = ',', default_value = "one,one,clean")]
    pub hide: Vec<String>,
    /// How strong that is, in standard deviations of the noise after re-fitting: faint (0.15 to 0.5), medium (0.5 to 5),
    /// strong (5 to 15).
    #[arg(long, value_name = "WORD", default_value = "strong")]
    pub size: String,
    /// Number of cases per row and severity. World `own`: of all cases; of twenty, eight are clean, eight hide one effect, two
    /// hide two, two one outside the library.
    #[arg(long, value_name = "N", default_value_t = 60)]
    pub cases: u64,
    /// Seed of the drawing.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Of these cases those alone that hide one of these effects (names of `stylet effects`) or shapes outside the library.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub effect: Vec<String>,
}

/// Arguments of `stylet benchmark diagnose`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet benchmark diagnose --severity large
  stylet benchmark diagnose --wrong thickness,encoder --severity large --cases 60 --seed 7
  stylet benchmark diagnose --wrong all --cases 60 --out out/baseline
  stylet benchmark diagnose --hide outside --cases 48
  stylet benchmark diagnose --wrong all --severity large --effect time_delay --cases 60
  stylet benchmark diagnose --world rich --hide one --cases 60
  stylet benchmark diagnose --world own --cases 1000

Words for --wrong:
  nothing thickness surface surface_each coefficients encoder encoder_steps jitter dropped late growing tails ar1
  ar2 wander hum bits rate layers no_air recordings scatter_puncture scatter_friction scatter_surface five
  geometry
Words for --hide: clean one two three outside mixed instrument.

The folder then holds report.html with the map of where the diagnosis fails, the same as SVG, table.txt (rates with 95 %
Wilson intervals), table.json and cases.jsonl, one line per case: cases in it are not run again, so that a run that
was stopped goes on where it was.")]
pub struct BenchmarkDiagnoseArgs {
    #[command(flatten)]
    pub cases: CaseArgs,
    /// Cases run side by side [default: as many as there are cores].
    #[arg(long, value_name = "N", value_parser = crate::limits::parse_threads)]
    pub threads: Option<usize>,
    /// Run nothing: write table and page of the asked-for cases that the folder's cases.jsonl holds already.
    #[arg(long)]
    pub from_journal: bool,
    /// Folder for the results [default: stylet-out/benchmark-diagnose-<world>-<seed>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Arguments of `stylet benchmark export`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  stylet benchmark export --wrong thickness,encoder --severity large --cases 30 --seed 20261 --out out/challenge

The folder then holds README.md (the task), names.txt (admissible names) and cases/NNNN with assumed.ron and the
recordings as CSV. The key that says what was hidden goes beside the folder, to DIR.key.json: keep it, and choose a
seed that nobody would guess.")]
pub struct BenchmarkExportArgs {
    #[command(flatten)]
    pub cases: CaseArgs,
    /// Folder for the challenge; it must not be there yet.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Arguments of `stylet benchmark plan`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet benchmark plan --cases 60 --seed 7
  stylet benchmark plan --wrong thickness --severity medium --cases 30 --seed 7

A case hides one strong effect (never force_gain, which no motion shows). Its first insertion has one constant speed and no way
back; cases in which the diagnosis then has the effect in a class or lists it as invisible are left open. These get a second
insertion from the same reality: the planned one, and, for comparison, the paper's sinusoid. The folder then holds table.txt
(rates with 95 % Wilson intervals), cases.json and cases.jsonl: cases in it are not run again.")]
pub struct BenchmarkPlanArgs {
    /// Which law the tissue follows: plain or rich.
    #[arg(long, value_name = "WORLD", default_value = "plain")]
    pub world: String,
    /// What the believed simulation or the sensor has wrong, row by row (words of `stylet benchmark diagnose`).
    #[arg(long, value_name = "WORDS", value_delimiter = ',', default_value = "nothing")]
    pub wrong: Vec<String>,
    /// How much of it: small, medium, large.
    #[arg(long, value_name = "WORD", default_value = "medium")]
    pub severity: String,
    /// Open cases per row.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub cases: u64,
    /// Seed of the drawing.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Cases run side by side [default: as many as there are cores].
    #[arg(long, value_name = "N", value_parser = crate::limits::parse_threads)]
    pub threads: Option<usize>,
    /// Run nothing: write the table of the cases that the folder's cases.jsonl holds already.
    #[arg(long)]
    pub from_journal: bool,
    /// Folder for the results [default: stylet-out/benchmark-plan-<world>-<seed>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Arguments of `stylet benchmark score`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  stylet benchmark score out/challenge answers.json

answers.json: {\"0001\": {\"verdict\": \"named\", \"causes\": [{\"effect\": \"coulomb_friction\"}]}, \"0002\": {\"verdict\": \"none\"}};
each answer as in diagnosis.json, of which all but `verdict` and `effect` may be left out.")]
pub struct BenchmarkScoreArgs {
    /// Folder of the challenge, with its key beside it.
    pub folder: PathBuf,
    /// The answers (JSON).
    pub answers: PathBuf,
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
