//! `stylet run`: simulate, enhance, score, report.

use crate::args::RunArgs;
use crate::exit::Failure;
use crate::terminal::scorecard;
use stylet_api::folder::settle_beside;
use stylet_api::need;
use stylet_core::config::Model;
use stylet_scenario::Scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn run(args: &RunArgs) -> Result<(), Failure> {
    let file = args.scenario.display().to_string();
    settle_beside(&args.scenario)?;
    let mut scenario = Scenario::load(&args.scenario)?;
    if let Some(seed) = args.seed {
        scenario.seed = seed;
    }
    if let Some(path) = &args.motion {
        stylet_api::plan::move_as(&mut scenario, path)?;
    }
    if args.compare {
        scenario.compare = vec![Model::MultiLayer, Model::KelvinVoigt];
    }
    if let Some(need) = need::of_run(&scenario) {
        args.limits.allow(&args.scenario, &need, args.results.quiet)?;
    }
    let run = stylet_api::simulate_from(&scenario, &file)?;
    let folder = args.results.folder(&args.scenario, "");
    args.results.conclude(&folder, &run.output(&file)?, || scorecard(&run))
}
