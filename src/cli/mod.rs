//! The `stylet` command: arguments, terminal output, exit codes. The work is done by `stylet-api`.

mod args;
mod benchmark;
mod check;
mod compare;
mod compare_models;
mod convert;
mod diagnose;
mod diagnose_repeats;
mod diagnosis_summary;
mod effects;
mod enhance;
mod exit_codes;
mod identify;
mod inspect;
mod listen;
mod manual;
mod output_args;
mod plan;
mod predict;
mod progress_bar;
mod reproduce;
mod resource_limits;
mod run;
mod scorecard;
#[cfg(feature = "studio")]
mod studio;
mod sweep;
mod terminal_output;
mod text_plot;
mod transfer;

use args::{Cli, Command};
use clap::Parser;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use exit_codes::Failure;
use std::path::Path;
use std::process::ExitCode;

/// Extensions of files with recordings.
const RECORDING_EXTENSIONS: [&str; 11] =
    ["csv", "txt", "tsv", "xlsx", "ods", "mat", "h5", "hdf5", "parquet", "mcap", "db3"];

/// Parses the arguments and ends the process on wrong ones. Names of earlier versions are rejected with the new name.
fn arguments() -> Cli {
    Cli::try_parse().unwrap_or_else(|mut error| {
        let renamed = [ContextKind::InvalidArg, ContextKind::InvalidSubcommand].into_iter().find_map(
            |kind| match error.get(kind) {
                Some(ContextValue::String(name)) => stylet_scenario::renamed_flag(name),
                _ => None,
            },
        );
        match renamed {
            Some(message) => {
                terminal_output::print_error(&format!("error: {message}\n"));
                std::process::exit(i32::from(exit_codes::INPUT_WRONG));
            }
            None => {
                if is_recording_without_option(&error) {
                    let tip = "recordings follow the option `--data`".to_owned().into();
                    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip]));
                }
                error.exit()
            }
        }
    })
}

/// Whether an argument that no command takes is a file of the kinds that hold recordings.
fn is_recording_without_option(error: &clap::Error) -> bool {
    let Some(ContextValue::String(name)) = error.get(ContextKind::InvalidArg) else { return false };
    let extension = Path::new(name).extension().map(std::ffi::OsStr::to_ascii_lowercase);
    error.kind() == ErrorKind::UnknownArgument
        && extension.is_some_and(|e| RECORDING_EXTENSIONS.iter().any(|known| e == *known))
}

/// Limit on the memory for reading files, in bytes.
fn memory_limit(command: &Command) -> f64 {
    let limits = match command {
        Command::Run(args) => args.limits,
        Command::Enhance(args) => args.limits,
        Command::Check(args) => args.limits,
        Command::Diagnose(args) => args.limits,
        Command::Identify(args) => args.limits,
        Command::Predict(args) => args.limits,
        Command::Identifiability(args) => args.resources,
        Command::Plan(args) => args.resources,
        _ => resource_limits::ResourceLimits::default(),
    };
    limits.limit_memory
}

/// Runs the command line and returns the exit code (see [`exit_codes`]).
#[must_use]
pub fn main() -> ExitCode {
    let cli = arguments();
    stylet_record::memory_limit::set_memory_limit(memory_limit(&cli.command) as u64);
    // A panic is a bug and ends with the exit code of internal errors.
    let outcome = std::panic::catch_unwind(|| match &cli.command {
        Command::Run(args) => run::run(args),
        Command::Enhance(args) => enhance::enhance(args),
        Command::Inspect(args) => inspect::inspect(args),
        Command::Convert(args) => convert::convert(args),
        Command::Sweep(args) => sweep::sweep(args),
        Command::Replay(args) => sweep::replay(args),
        Command::Gate(args) => sweep::gate(args),
        Command::Compare(args) => compare::compare(args),
        Command::Check(args) => check::check(args),
        Command::CompareModels(args) => compare_models::run(args),
        Command::Completions(args) => manual::completions(args),
        Command::Man(args) => manual::man(args),
        Command::Diagnose(args) => diagnose::diagnose(args),
        Command::Identify(args) => identify::identify(args),
        Command::Predict(args) => predict::predict(args),
        Command::Identifiability(args) => plan::identifiability(args),
        Command::Plan(args) => plan::plan(args),
        Command::Effects(args) => effects::effects(args),
        Command::Benchmark(args) => benchmark::benchmark(args),
        Command::Listen(args) => listen::listen(args),
        #[cfg(feature = "studio")]
        Command::Studio(args) => studio::studio(args),
        Command::Reproduce(args) => reproduce::reproduce(args),
    })
    .unwrap_or_else(|_| Err(Failure::internal("the command stopped unexpectedly")));
    match outcome {
        Ok(()) => ExitCode::from(exit_codes::DONE),
        Err(failure) => {
            let code = failure.code();
            terminal_output::print_error(&error_text(failure));
            code
        }
    }
}

/// The error with an excerpt of the source where that can be rendered, else the message alone.
fn error_text(failure: Failure) -> String {
    let message = failure.to_string();
    // Lines are left whole, so that commands in messages can be copied.
    let _ =
        miette::set_hook(Box::new(|_| Box::new(miette::MietteHandlerOpts::new().wrap_lines(false).build())));
    let report = miette::Report::new(failure);
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| format!("{report:?}\n")))
        .unwrap_or_else(|_| format!("{message}\n"))
}
