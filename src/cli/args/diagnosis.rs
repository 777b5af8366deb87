//! Arguments of `stylet diagnose`, `predict`, `identifiability`, `plan` and `effects`.

use crate::cli::args::ReadingArgs;
use crate::cli::output_args::OutputArgs;
use crate::cli::resource_limits::ResourceLimits;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `stylet diagnose`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet diagnose scenario.ron --data a.csv b.csv c.csv --out out/diagnosis
  stylet diagnose scenario.ron --data log1.csv log2.csv --columns map.ron
  stylet diagnose scenario.ron --repeats --data run1.csv run2.csv run3.csv --columns map.ron
  stylet diagnose scenarios/measured/skin_on_muscle.ron
  stylet diagnose --data log1.csv log2.csv
  stylet diagnose --transfer out/monday --data tuesday1.csv tuesday2.csv
  stylet diagnose --transfer out/monday out/tuesday

Writes report.html, diagnosis.json and extended.ron: the scenario with re-fitted parameters and the
effects found, for `stylet run` (with --motion if the scenario says `Recorded`); with --transfer
report.html and transfer.json. The exit code is 0 whatever the verdict, 1 when the recordings as a whole are unusable, 2 when an input is wrong or a recording does not touch the tissue.")]
pub struct DiagnoseArgs {
    /// Assumed scenario, or a data set of repeated insertions (RON). Without one the layers are those that
    /// the recordings show, as `stylet identify` finds them. With --transfer a data set, or the folder of
    /// a diagnosis, whose recordings are the other group.
    pub scenario: Option<PathBuf>,
    /// Compare the recordings with those that made this model (folder of a diagnosis, or its extended.ron):
    /// which of surface, force, friction and puncture force differ, or whether they follow another law.
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["repeats", "effects", "force"])]
    pub transfer: Option<PathBuf>,
    /// Treat the recordings as repeats of one insertion: separate the variation between recordings from
    /// what the model lacks, and predict each recording by the others. A data set implies it.
    #[arg(long)]
    pub repeats: bool,
    /// Recordings (CSV with header). A data set names its own.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub data: Vec<PathBuf>,
    /// Custom effects as further candidates: lists of `Custom(...)` (RON).
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub effects: Vec<PathBuf>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Diagnose recordings that `stylet check` calls unusable.
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub results: OutputArgs,
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// Arguments of `stylet identify`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:
  stylet identify --data log1.csv log2.csv --out phantom.ron
  stylet identify --data log.csv --columns map.ron --layers 3

Writes phantom.ron (a scenario with the layers and effects found), report.html and diagnosis.json;
--out FILE.ron writes the phantom there and the rest into the default folder. At one constant speed
stiffness and friction cannot be separated: record different motions.")]
pub struct IdentifyArgs {
    /// Recordings (CSV with header).
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    pub data: Vec<PathBuf>,
    /// Number of layers [default: as many as the recordings show].
    #[arg(long, value_name = "N")]
    pub layers: Option<usize>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    #[command(flatten)]
    pub results: OutputArgs,
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// Arguments of `stylet predict`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet predict out/diagnosis/extended.ron --data next_day.csv
  stylet predict out/diagnosis/extended.ron --data d.csv e.csv --refit
  stylet predict out/diagnosis/extended.ron --data e.csv --refit-on d.csv --same tissue
  stylet predict phantom.ron --data a.csv --out out/phantom

Writes report.html and predict.json. Noise, scatter, intervals, misfit and the formerly assumed scenario
are taken from diagnosis.json and inputs.json in the model's folder. The band allows for another needle,
tissue and set-up; --same narrows it. The exit code is 0 however large the error is.")]
pub struct PredictArgs {
    /// Model: folder of a diagnosis, its extended.ron, or any scenario (RON).
    pub model: PathBuf,
    /// Held-out recordings (CSV with header).
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    pub data: Vec<PathBuf>,
    /// Formerly assumed scenario (RON), for comparison [default: the one in the model's inputs.json].
    #[arg(long, value_name = "FILE")]
    pub assumed: Option<PathBuf>,
    /// Fit the group of the new recordings first, from the model's own values, where that lowers the held-out
    /// error; of two or more recordings each is predicted by the values from the others [default: all].
    #[arg(long, value_name = "PARAMETERS", value_delimiter = ',', num_args = 0..=1,
          default_missing_values = ["surface", "force", "friction", "puncture"])]
    pub refit: Vec<RefitArg>,
    /// Recordings of the new group to fit it to, instead of those to predict.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub refit_on: Vec<PathBuf>,
    /// What is the same as when the model was made.
    #[arg(long, value_name = "FACTORS", value_delimiter = ',')]
    pub same: Vec<SameArg>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    #[command(flatten)]
    pub results: OutputArgs,
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// A parameter that another needle or another day may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum RefitArg {
    /// Position of the surface.
    Surface,
    /// One factor for all forces.
    Force,
    /// Friction: one factor for all layers, beyond that of all forces.
    Friction,
    /// Puncture force: one factor for all layers, beyond that of all forces.
    Puncture,
}

/// What may be the same as when a model was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum SameArg {
    /// Everything: a new recording of the same group.
    Group,
    /// The needle.
    Needle,
    /// The specimen or batch of the tissue.
    Tissue,
    /// The day and the set-up.
    Setup,
}

/// Arguments of `stylet check`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet check assumed.ron --data a.csv b.csv
  stylet check assumed.ron --data log.csv --columns map.ron --out out/check

Writes report.html and check.json. The exit code is 1 when an aspect is unusable.")]
pub struct CheckArgs {
    /// Assumed scenario (RON).
    pub assumed: PathBuf,
    /// Recordings (CSV with header).
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    pub data: Vec<PathBuf>,
    /// Custom effects as further candidates: lists of `Custom(...)` (RON).
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub effects: Vec<PathBuf>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    #[command(flatten)]
    pub results: OutputArgs,
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// Arguments of `stylet compare-models`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet compare-models out/monday out/tuesday

Writes report.html and consistency.json.")]
pub struct CompareModelsArgs {
    /// Folder of a diagnosis, or its diagnosis.json.
    pub first: PathBuf,
    /// Another one.
    pub second: PathBuf,
    #[command(flatten)]
    pub results: OutputArgs,
}

/// Arguments of `stylet identifiability`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet identifiability scenario.ron
  stylet identifiability scenario.ron --motion plan.ron --out out/with-plan
  stylet identifiability scenario.ron --data a.csv b.csv

Writes report.html, identifiability.json and matrix.svg. `stylet effects NAME` prints the typical sizes.")]
pub struct IdentifiabilityArgs {
    /// Scenario: assumed tissue, and the motion of the experiment (RON).
    pub scenario: PathBuf,
    /// Replace the scenario's motion by the one in this file (RON), such as `stylet plan` writes.
    #[arg(long, value_name = "FILE", conflicts_with = "data")]
    pub motion: Option<PathBuf>,
    /// Use motion and noise of these recordings (CSV with header) instead of a motion.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub data: Vec<PathBuf>,
    /// Custom effects as further candidates: lists of `Custom(...)` (RON).
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub effects: Vec<PathBuf>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    #[command(flatten)]
    pub results: OutputArgs,
    #[command(flatten)]
    pub resources: ResourceLimits,
}

/// Arguments of `stylet plan`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet plan out/diagnosis --limits limits.ron --out plan.ron
  stylet plan scenario.ron --data a.csv --limits limits.ron --out plan.ron
  stylet plan scenario.ron --limits limits.ron --quick
  stylet plan --transfer out/diagnosis --same tissue,setup

limits.ron: Limits(depth_m: 0.09, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 90.0, force_n: 6.0)

Writes plan.ron, plan.json and plan.html. `stylet run scenario.ron --motion plan.ron` simulates the motion;
after the experiment diagnose old and new recordings together. Without recordings the scenario's own motion
counts as done. The exit code is 2 when no motion keeps the limits. With --transfer it writes transfer_plan.json.")]
pub struct PlanArgs {
    /// Folder of a diagnosis, or a scenario (RON).
    #[arg(required_unless_present = "transfer")]
    pub from: Option<PathBuf>,
    /// Limits of depth, speed, acceleration, duration and force (RON).
    #[arg(long, value_name = "FILE", required_unless_present = "transfer")]
    pub limits: Option<PathBuf>,
    /// Plan insertions with another needle, in another specimen or with another set-up: how many, and at which
    /// of its speeds, let this model (folder of a diagnosis, or its extended.ron) predict as well as it can.
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["from", "limits", "data", "effects", "columns", "quick"])]
    pub transfer: Option<PathBuf>,
    /// With --transfer: what is the same as when the model was made.
    #[arg(long, value_name = "FACTORS", value_delimiter = ',', requires = "transfer")]
    pub same: Vec<SameArg>,
    /// File for the motion [default: stylet-out/<name>-plan/plan.ron], or with --transfer for the plan.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// With a scenario: recordings made so far (CSV with header).
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub data: Vec<PathBuf>,
    /// Custom effects as further candidates: lists of `Custom(...)` (RON).
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub effects: Vec<PathBuf>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Skip the simulated check of the planned insertion: seconds instead of minutes.
    #[arg(long)]
    pub quick: bool,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
    #[command(flatten)]
    pub resources: ResourceLimits,
}

/// Arguments of `stylet effects`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet effects
  stylet effects coulomb_friction
  stylet effects tip_rate_stiffening --effects effects/mine.ron")]
pub struct EffectsArgs {
    /// Effect to describe, by its id [default: list all].
    pub name: Option<String>,
    /// List or describe the custom effects of these files, too (RON).
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub effects: Vec<PathBuf>,
}
