//! `stylet run`: simulate, enhance, score, report.

use crate::args::RunArgs;
use crate::exit::Failure;
use crate::terminal::scorecard;
use stylet_api::output_folder::recover_parent;
use stylet_api::resource_estimate;
use stylet_core::config::Model;
use stylet_scenario::Scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn run(args: &RunArgs) -> Result<(), Failure> {
    let file = args.scenario.display().to_string();
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
    if let Some(need) = resource_estimate::estimate_run(&scenario) {
        args.limits.check(&args.scenario, &need, args.results.quiet)?;
    }
    let run = stylet_api::simulate_from(&scenario, &file)?;
    let folder = args.results.output_folder(&args.scenario, "");
    args.results.write_and_print(&folder, &run.output(&file)?, || scorecard(&run))
}
