//! `stylet run`: simulate, enhance, score, report.

use crate::args::RunArgs;
use crate::exit::Failure;
use crate::limits;
use crate::terminal;
use std::path::{Path, PathBuf};
use stylet_core::config::Model;
use stylet_scenario::Scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn run(args: &RunArgs) -> Result<(), Failure> {
    let file = args.scenario.display().to_string();
    let mut scenario = Scenario::load(&args.scenario)?;
    if let Some(seed) = args.seed {
        scenario.seed = seed;
    }
    if let Some(path) = &args.motion {
        scenario.motion = crate::plan::load_motion(path)?;
        scenario.check().map_err(|p| Failure::Check(format!("{}: {p}", path.display())))?;
    }
    if args.compare {
        scenario.compare = vec![Model::MultiLayer, Model::KelvinVoigt];
    }
    if let Some(need) = limits::of_run(&scenario) {
        args.limits.allow(&args.scenario, &need, args.results.quiet)?;
    }
    let run = stylet_api::simulate_from(&scenario, &file)?;
    let folder = args.results.out.clone().unwrap_or_else(|| default_folder(&args.scenario));
    run.output(&file)?.write(&folder)?;
    if !args.results.quiet {
        terminal::say(&format!(
            "{}\nReport: {}\n",
            terminal::scorecard(&run),
            folder.join("report.html").display()
        ))?;
    }
    Ok(())
}

/// Where results go when nothing is said: `stylet-out/` and the input's name.
pub fn default_folder(input: &Path) -> PathBuf {
    Path::new("stylet-out").join(input.file_stem().unwrap_or(input.as_os_str()))
}
