//! Command-line arguments.

mod benchmark;
mod diagnosis;
mod inspect;
mod manual;
mod recordings;
mod simulation;
#[cfg(feature = "studio")]
mod studio;
mod sweep;

pub use benchmark::{
    BenchmarkArgs, BenchmarkCommand, BenchmarkDiagnoseArgs, BenchmarkExportArgs, BenchmarkJudgeOnlineArgs,
    BenchmarkPlanArgs, BenchmarkReplayArgs, BenchmarkScoreArgs,
};
pub use diagnosis::{
    CheckArgs, CompareModelsArgs, DiagnoseArgs, EffectsArgs, IdentifiabilityArgs, IdentifyArgs, PlanArgs,
    PredictArgs, RefitArg, SameArg,
};
pub use inspect::InspectArgs;
pub use manual::{CompletionsArgs, ManArgs};
pub use recordings::{ConvertArgs, EnhanceArgs, ListenArgs, ReadingArgs};
pub use simulation::{AlgorithmArg, CompareArgs, ReproduceArgs, RunArgs};
#[cfg(feature = "studio")]
pub use studio::StudioArgs;
pub use sweep::{
    GateArgs, MapArgs, MergeArgs, PlanArgs as SweepPlanArgs, ReplayArgs, RunShardArgs, SweepArgs,
    SweepCommand, SweepSelection,
};

use clap::{Parser, Subcommand};

/// Robot-assisted needle insertion into layered tissue: simulation, online estimation, diagnosis of measured data.
///
/// Research software, not a medical device.
#[derive(Debug, Parser)]
#[command(name = "stylet", version, max_term_width = 100)]
pub struct Cli {
    /// Command.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate a scenario, run the online algorithm on it, score the result and write a report.
    Run(RunArgs),
    /// Run the online algorithm on a measured recording.
    Enhance(EnhanceArgs),
    /// Look at a recording of any format: layout, columns, units, sampling, problems; propose a column map.
    Inspect(InspectArgs),
    /// Convert a recording to CSV, Parquet or MCAP.
    Convert(ConvertArgs),
    /// Simulate thousands of insertions with randomised parameters: failure rates, intervals, sensitivity.
    Sweep(SweepArgs),
    /// Run one trial of a sweep again, with a full report.
    Replay(ReplayArgs),
    /// Check scores against bounds, for continuous integration.
    Gate(GateArgs),
    /// Compare the online algorithms on the same simulated insertions, over many noise seeds.
    Compare(CompareArgs),
    /// Check what recordings can show before a diagnosis: data, contact, motion, parameters, effects.
    Check(CheckArgs),
    /// Compare measured data with a scenario: which effects it lacks, and how much the fit improves.
    Diagnose(DiagnoseArgs),
    /// Find the layers of a phantom in recordings, without a scenario, and diagnose what is left.
    Identify(IdentifyArgs),
    /// Predict held-out recordings by the model of a diagnosis.
    Predict(PredictArgs),
    /// Compare two diagnoses: did two sessions find the same model?
    CompareModels(CompareModelsArgs),
    /// List which effects an experiment can identify, from which size on, and which it confuses.
    Identifiability(IdentifiabilityArgs),
    /// Plan the next insertion: the motion within limits that best separates the remaining candidate causes.
    Plan(PlanArgs),
    /// List the effects of the library, or describe one.
    Effects(EffectsArgs),
    /// Measure the accuracy of diagnosis and planning on many simulated cases.
    Benchmark(BenchmarkArgs),
    /// Run the online algorithm on a live stream: samples by UDP or standard input, results as JSON and on a live page.
    Listen(ListenArgs),
    /// Open recordings, draw phantoms, diagnose and plan on a local page.
    #[cfg(feature = "studio")]
    Studio(StudioArgs),
    /// Reproduce the paper's figures and test its claims, on one page.
    Reproduce(ReproduceArgs),
    /// Print the completions of all commands for a shell.
    Completions(CompletionsArgs),
    /// Print the manual page of a command in troff.
    Man(ManArgs),
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definitions_of_all_arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}
