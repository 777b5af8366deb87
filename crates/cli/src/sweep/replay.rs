//! `stylet replay`: one trial of a sweep with a full report.

use super::args::ReplayArgs;
use crate::args::{OutputArgs, RunArgs};
use crate::exit::Failure;
use stylet_api::OutputFiles;
use stylet_api::sweep_folder::trial_scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn replay(args: &ReplayArgs) -> Result<(), Failure> {
    let scenario = trial_scenario(&args.dir, args.trial)?;
    let out = args.results.out.clone().unwrap_or_else(|| args.dir.join(format!("trial-{}", args.trial)));
    let mut output = OutputFiles::default();
    output.add("scenario.ron", scenario.to_ron().map_err(Failure::internal)?);
    output.write(&out)?;
    crate::run::run(&RunArgs {
        motion: None,
        scenario: out.join("scenario.ron"),
        seed: None,
        compare: false,
        limits: crate::limits::ResourceLimits::default(),
        results: OutputArgs { out: Some(out), quiet: args.results.quiet },
    })
}
