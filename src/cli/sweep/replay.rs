//! `stylet replay`: one trial of a sweep with a full report.

use crate::cli::args::ReplayArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::output_args::OutputArgs;
use crate::cli::run::run_scenario;
use stylet_api::output_folder::Inputs;
use stylet_api::sweep_folder::trial_scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn replay(args: &ReplayArgs) -> Result<(), Failure> {
    let scenario = trial_scenario(&args.dir, args.trial)?;
    let out = args.out.clone().unwrap_or_else(|| args.dir.join(format!("trial-{}", args.trial)));
    // The run writes the scenario into its folder, where its report names it.
    let file = out.join("scenario.ron");
    run_scenario(&scenario, &file, Inputs::default(), &OutputArgs { out: Some(out), quiet: args.quiet })
}
