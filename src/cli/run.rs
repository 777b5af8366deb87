//! `stylet run`: simulate a scenario, run the online algorithm, score, report.

use crate::cli::args::RunArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::output_args::OutputArgs;
use crate::cli::scorecard::scorecard;
use std::path::Path;
use stylet_api::output_folder::{Inputs, recover_parent};
use stylet_api::resource_estimate::estimate_run;
use stylet_core::config::Model;
use stylet_scenario::Scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn run(args: &RunArgs) -> Result<(), Failure> {
    recover_parent(&args.scenario)?;
    let mut scenario = Scenario::load(&args.scenario)?;
    if let Some(seed) = args.seed {
        scenario.seed = seed;
    }
    if let Some(path) = &args.motion {
        stylet_api::plan_insertion::replace_motion(&mut scenario, path)?;
    }
    if args.compare {
        scenario.compare = vec![Model::MultiLayer, Model::KelvinVoigt];
    }
    if let Some(estimate) = estimate_run(&scenario) {
        args.limits.check(&args.scenario, &estimate, args.results.quiet)?;
    }
    let inputs = args.results.inputs(&args.scenario, &args.motion);
    run_scenario(&scenario, &args.scenario, inputs, &args.results)
}

/// Runs a scenario that was read from `file`, writes and prints the results.
///
/// # Errors
/// [`Failure`] when it cannot be simulated or the results cannot be written.
pub fn run_scenario(
    scenario: &Scenario,
    file: &Path,
    inputs: Inputs,
    results: &OutputArgs,
) -> Result<(), Failure> {
    let name = file.display().to_string();
    let run = stylet_api::simulate_from(scenario, &name)?;
    let folder = results.output_folder(file, "");
    results.write_and_print(&folder, &run.output(&name)?.with_inputs(inputs), || scorecard(&run))
}
