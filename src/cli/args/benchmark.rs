//! Arguments of `stylet benchmark`.

use crate::cli::args::AlgorithmArg;
use crate::cli::output_args::OutputArgs;
use crate::cli::resource_limits::parse_threads;
use clap::{Args, Subcommand};
use std::path::PathBuf;
use stylet_api::benchmark::CaseSelection;

/// Arguments of `stylet benchmark`.
#[derive(Debug, Args)]
pub struct BenchmarkArgs {
    /// Benchmark.
    #[command(subcommand)]
    pub command: BenchmarkCommand,
}

/// The benchmarks.
#[derive(Debug, Subcommand)]
pub enum BenchmarkCommand {
    /// Diagnose cases of the independent simulator; write the table of results and a map of where the diagnosis fails.
    Diagnose(BenchmarkDiagnoseArgs),
    /// Write such cases for other programs: assumed scenarios and recordings, without the truth.
    Export(BenchmarkExportArgs),
    /// Score answers to exported cases with the same table.
    Score(BenchmarkScoreArgs),
    /// Give exported streams to an online detector, sample by sample, and keep its answers.
    Replay(BenchmarkReplayArgs),
    /// Judge answers of online detectors to exported streams.
    JudgeOnline(BenchmarkJudgeOnlineArgs),
    /// Plan and simulate a second insertion where the first leaves the cause open: how often is it then identified?
    Plan(BenchmarkPlanArgs),
}

/// Selection of cases, common to the benchmarks.
#[derive(Clone, Debug, Args)]
pub struct CaseArgs {
    /// Tissue model of the independent simulator: plain or rich.
    #[arg(long, value_name = "WORLD", default_value = "plain")]
    pub world: String,
    /// Wrong assumptions about tissue or sensor, one row each; `all` for every word.
    #[arg(long = "wrong", value_name = "WORDS", value_delimiter = ',', default_value = "nothing")]
    pub misspecification: Vec<String>,
    /// Severity of the wrong assumption: small, medium, large.
    #[arg(long, value_name = "WORDS", value_delimiter = ',', default_value = "small,medium,large")]
    pub severity: Vec<String>,
    /// What the cases hide; those of a row and severity cycle through the list.
    #[arg(long, value_name = "WORDS", value_delimiter = ',', default_value = "one,one,clean")]
    pub hide: Vec<String>,
    /// Size of the hidden effect in standard deviations of the noise after re-fitting: faint (0.15 to 0.5),
    /// medium (0.5 to 5), strong (5 to 15).
    #[arg(long, value_name = "WORD", default_value = "strong")]
    pub size: String,
    /// Number of cases per row and severity.
    #[arg(long, value_name = "N", default_value_t = 60)]
    pub cases: u64,
    /// Seed of the cases.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Only the cases that hide one of these effects (names of `stylet effects`) or shapes outside the library.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub effect: Vec<String>,
}

impl CaseArgs {
    /// The selection for the benchmark.
    pub fn selection(&self) -> CaseSelection<'_> {
        CaseSelection {
            world: &self.world,
            misspecification: &self.misspecification,
            severity: &self.severity,
            hide: &self.hide,
            size: &self.size,
            cases: self.cases,
            seed: self.seed,
            effect: &self.effect,
            custom: false,
        }
    }
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
  stylet benchmark diagnose --hide custom,clean --effects effects/mine.ron --cases 24

The error about an unknown word of --wrong or --hide lists all words.

Writes report.html, the map of where the diagnosis fails (SVG), table.txt (rates with 95 % Wilson
intervals), table.json and cases.jsonl, one line per case. An interrupted run resumes from cases.jsonl.")]
pub struct BenchmarkDiagnoseArgs {
    #[command(flatten)]
    pub cases: CaseArgs,
    /// Custom effects as further candidates, and for `--hide custom`: lists of `Custom(...)` (RON). Rows without a scenario
    /// are left out.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub effects: Vec<PathBuf>,
    /// Cases run in parallel [default: number of cores].
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    pub threads: Option<usize>,
    /// Run no case: write table and page of the selected cases that the folder's cases.jsonl already holds.
    #[arg(long)]
    pub from_journal: bool,
    /// Folder for the results [default: stylet-out/benchmark-diagnose-<world>-<seed>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Arguments of `stylet benchmark export`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet benchmark export --wrong thickness,encoder --severity large --cases 30 --seed 20261 --out out/challenge
  stylet benchmark export --online --rows all --cases 100 --seed 20261 --out out/streams
  stylet benchmark export --online --rows hand_held,hold --split make --cases 30 --out out/make
  stylet benchmark export --online --cases 0 --measured scenarios/measured/skin_on_muscle.ron --out out/measured

Writes README.md (the task), names.txt (admissible names) and cases/NNNN with assumed.ron and the
recordings as CSV. The hidden effects are in DIR.key.json next to the folder. Keep this key and the seed
secret.

With --online: streams/NNNN.csv for online detection of punctures (with --parquet also .parquet), their rates
in streams.csv, and the key; for `--split make` also truth.csv. Different splits and seeds give independent
streams. --measured adds the insertions of a data set as the row `measured` (with `--cases 0` nothing else):
their reference is falls of the force, defined in README.md and listed in the key.")]
pub struct BenchmarkExportArgs {
    #[command(flatten)]
    pub cases: CaseArgs,
    /// Export streams for online detection of punctures instead of cases for the diagnosis.
    #[arg(long, conflicts_with_all = ["misspecification", "severity", "hide", "size", "effect"])]
    pub online: bool,
    /// With --online: rows of the table, `all` for every one; the error about an unknown word lists them.
    #[arg(long, value_name = "WORDS", value_delimiter = ',', default_value = "all", requires = "online")]
    pub rows: Vec<String>,
    /// With --online: `make` for choosing a detector's settings, `judge` for judging it.
    #[arg(long, value_name = "WORD", default_value = "judge", requires = "online")]
    pub split: String,
    /// With --online: also write the streams as Parquet, with the same numbers.
    #[arg(long, requires = "online")]
    pub parquet: bool,
    /// With --online: data set (RON) whose insertions form the row `measured`.
    #[arg(long, value_name = "DATASET", requires = "online")]
    pub measured: Option<PathBuf>,
    /// Folder for the challenge; it must not exist yet.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Arguments of `stylet benchmark replay`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet benchmark replay out/streams --out out/answers/mine -- python3 mine.py --window 0.1
  stylet benchmark replay out/streams --out out/answers/stylet --algorithm Stylet

The program reads `start RATE_HZ` at the beginning of a stream and then one line `TIME_S,POSITION_M,FORCE_N`
per sample; it replies to each sample with one line, `EVENT,DROP_N,CONFIDENCE,TIP_FORCE_N`, where fields may
be empty. README.md of the streams has the details.

Writes events.csv, entrant.json (name, time per sample) and enhanced/NNNN.csv where a tip force was given.")]
pub struct BenchmarkReplayArgs {
    /// Folder of the exported streams.
    #[arg(value_name = "STREAMS")]
    pub folder: PathBuf,
    /// Folder for the answers; it must not exist yet.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Name in the table [default: name of the answers' folder].
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// Run this algorithm of Stylet instead of a program.
    #[arg(long, value_name = "NAME", conflicts_with = "program", required_unless_present = "program")]
    pub algorithm: Option<AlgorithmArg>,
    /// Streams replayed in parallel, each to a process of its own [default: number of cores].
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    pub threads: Option<usize>,
    /// Program and its arguments.
    #[arg(last = true, value_name = "PROGRAM")]
    pub program: Vec<String>,
}

/// Arguments of `stylet benchmark judge-online`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  stylet benchmark judge-online out/streams out/answers/* --out out/table

Needs the key STREAMS.key.json. Prints F1 within 0.5 mm by row, and over all rows missed, false, delay and the
recall at one false alarm per hour. Writes report.html and online.json.")]
pub struct BenchmarkJudgeOnlineArgs {
    /// Folder of the exported streams.
    #[arg(value_name = "STREAMS")]
    pub folder: PathBuf,
    /// Folders of answers.
    #[arg(value_name = "ANSWERS", required = true)]
    pub answers: Vec<PathBuf>,
    /// Also write the scores to this JSON file.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    #[command(flatten)]
    pub results: OutputArgs,
}

/// Arguments of `stylet benchmark plan`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet benchmark plan --cases 60 --seed 7
  stylet benchmark plan --wrong thickness --severity medium --cases 30 --seed 7

A case hides one strong effect. Its first insertion has one constant speed and no retraction. Where the
diagnosis then leaves the effect open, a second insertion into the same tissue follows: the planned one and,
for comparison, the paper's sinusoid. Writes table.txt (rates
with 95 % Wilson intervals), cases.json and cases.jsonl, from which an interrupted run resumes.")]
pub struct BenchmarkPlanArgs {
    /// Tissue model of the independent simulator: plain or rich.
    #[arg(long, value_name = "WORLD", default_value = "plain")]
    pub world: String,
    /// Wrong assumptions about tissue or sensor, one row each (words of `stylet benchmark diagnose`).
    #[arg(long = "wrong", value_name = "WORDS", value_delimiter = ',', default_value = "nothing")]
    pub misspecification: Vec<String>,
    /// Severity of the wrong assumption: small, medium, large.
    #[arg(long, value_name = "WORD", default_value = "medium")]
    pub severity: String,
    /// Open cases per row.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub cases: u64,
    /// Seed of the cases.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Cases run in parallel [default: number of cores].
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    pub threads: Option<usize>,
    /// Run no case: write the table of the cases that the folder's cases.jsonl already holds.
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
each answer as in diagnosis.json, of which only `verdict` and `effect` are required.")]
pub struct BenchmarkScoreArgs {
    /// Folder of the challenge; its key is DIR.key.json.
    pub folder: PathBuf,
    /// Answers (JSON).
    pub answers: PathBuf,
}
