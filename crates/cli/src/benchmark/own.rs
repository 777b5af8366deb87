//! `stylet benchmark diagnose --world own`: cases drawn with the diagnosis' own law, for comparison with older tables.

use crate::args::BenchmarkDiagnoseArgs;
use crate::exit::Failure;
use crate::terminal::{print, print_error};
use std::path::PathBuf;

/// The command in this world.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &BenchmarkDiagnoseArgs) -> Result<(), Failure> {
    let (seed, cases) = (args.cases.seed, args.cases.cases);
    if !args.cases.effect.is_empty() {
        return Err(stylet_api::Error::Request(
            "--effect: the world `own` draws its effects by itself".into(),
        )
        .into());
    }
    let folder = args
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from("stylet-out").join(format!("benchmark-diagnose-own-{seed}")));
    let text = stylet_api::benchmark::own(&folder, seed, cases, &|done| {
        if done.is_multiple_of(20) {
            print_error(&format!("  {done} of {cases} cases\n"));
        }
    })?;
    print(&format!("{text}\nCases: {}\n", folder.join("cases.jsonl").display()))
}
