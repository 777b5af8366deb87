//! Arguments of `stylet benchmark`.

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

An unknown word for --wrong or --hide is answered by the list of words.

Writes report.html with the map of where the diagnosis fails, the same as SVG, table.txt (rates with 95 %
Wilson intervals), table.json and cases.jsonl, one line per case. Cases in it are not run again, so an
interrupted run resumes where it stopped.")]
pub struct BenchmarkDiagnoseArgs {
    #[command(flatten)]
    pub cases: CaseArgs,
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
#[command(after_help = "Example:
  stylet benchmark export --wrong thickness,encoder --severity large --cases 30 --seed 20261 --out out/challenge

Writes README.md (the task), names.txt (admissible names) and cases/NNNN with assumed.ron and the
recordings as CSV. The key with the hidden effects goes to DIR.key.json next to the folder; keep it, and
choose a seed that nobody would guess.")]
pub struct BenchmarkExportArgs {
    #[command(flatten)]
    pub cases: CaseArgs,
    /// Folder for the challenge; it must not exist yet.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Arguments of `stylet benchmark plan`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet benchmark plan --cases 60 --seed 7
  stylet benchmark plan --wrong thickness --severity medium --cases 30 --seed 7

A case hides one strong effect (never force_gain, which no motion can show). Its first insertion has one
constant speed and no retraction; a case is open when the diagnosis then has the effect in a class of
equivalent causes or lists it as not identifiable. Open cases get a second insertion of the same tissue: the
planned one and, for comparison, the paper's sinusoid. Writes table.txt (rates with 95 % Wilson intervals),
cases.json and cases.jsonl; cases in it are not run again.")]
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
