//! The `stylet` command line: arguments, terminal output, exit codes.
#![forbid(unsafe_code)]

mod args;
mod benchmark;
mod compare;
mod convert;
mod diagnose;
mod effects;
mod enhance;
pub mod exit;
mod limits;
mod listen;
mod plan;
mod predict;
mod progress;
mod repeats;
mod reproduce;
mod results;
mod run;
mod sweep;
mod terminal;

use args::{Cli, Command};
use clap::Parser;
use exit::Failure;
use std::process::ExitCode;

/// Runs the command line and returns the exit code (see [`exit`]).
#[must_use]
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    // A panic is a bug: it ends with the code for internal errors, not with an abort of its own.
    let outcome = std::panic::catch_unwind(|| match &cli.command {
        Command::Run(args) => run::run(args),
        Command::Enhance(args) => enhance::enhance(args),
        Command::Convert(args) => convert::convert(args),
        Command::Sweep(args) => sweep::sweep(args),
        Command::Replay(args) => sweep::replay(args),
        Command::Gate(args) => sweep::gate(args),
        Command::Compare(args) => compare::compare(args),
        Command::Diagnose(args) => diagnose::diagnose(args),
        Command::Predict(args) => predict::predict(args),
        Command::Identifiability(args) => plan::identifiability(args),
        Command::Plan(args) => plan::plan(args),
        Command::Effects(args) => effects::effects(args),
        Command::Benchmark(args) => benchmark::benchmark(args),
        Command::Listen(args) => listen::listen(args),
        Command::Reproduce(args) => reproduce::reproduce(args),
    })
    .unwrap_or_else(|_| Err(Failure::internal("the command stopped unexpectedly")));
    match outcome {
        Ok(()) => ExitCode::from(exit::DONE),
        Err(failure) => {
            let code = failure.code();
            terminal::print_error(&rendered(failure));
            code
        }
    }
}

/// The error as it is shown: with its place in the source where that can be drawn, else the sentence alone.
fn rendered(failure: Failure) -> String {
    let sentence = failure.to_string();
    let report = miette::Report::new(failure);
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| format!("{report:?}\n")))
        .unwrap_or_else(|_| format!("{sentence}\n"))
}
