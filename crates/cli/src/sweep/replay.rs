//! `stylet replay`: one trial of a sweep with a full report.

use super::args::ReplayArgs;
use crate::args::{Results, RunArgs};
use crate::exit::Failure;
use stylet_api::Output;
use stylet_api::sweep_folder::trial_of;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn replay(args: &ReplayArgs) -> Result<(), Failure> {
    let scenario = trial_of(&args.dir, args.trial)?;
    let out = args.results.out.clone().unwrap_or_else(|| args.dir.join(format!("trial-{}", args.trial)));
    let mut output = Output::default();
    output.add("scenario.ron", scenario.to_ron().map_err(Failure::internal)?);
    output.write(&out)?;
    crate::run::run(&RunArgs {
        motion: None,
        scenario: out.join("scenario.ron"),
        seed: None,
        compare: false,
        limits: crate::limits::Limits::default(),
        results: Results { out: Some(out), quiet: args.results.quiet },
    })
}
