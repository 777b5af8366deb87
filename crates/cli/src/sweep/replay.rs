//! `stylet replay`: one trial of a sweep with a full report.

use super::args::ReplayArgs;
use crate::args::{Results, RunArgs};
use crate::exit::Failure;
use crate::output::Output;
use stylet_sweep::{Drawer, Overrides, Sweep};

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn replay(args: &ReplayArgs) -> Result<(), Failure> {
    let file = args.dir.join("sweep.ron");
    if !file.exists() {
        let what = format!("{}: is not the folder of a sweep (it holds no sweep.ron)", args.dir.display());
        return Err(Failure::Check(what));
    }
    stylet_api::folder::settle(&args.dir)?;
    stylet_api::folder::verify(&args.dir, &["scenario.ron", "sweep.ron", "trials.csv"])?;
    let sweep = Sweep::load(&file, Overrides::default())?;
    if args.trial >= sweep.trials() {
        let what = format!("trial {}: the sweep has trials 0 to {}", args.trial, sweep.trials() - 1);
        return Err(Failure::Check(what));
    }
    let drawn = Drawer::new(&sweep).draw(args.trial).map_err(|e| Failure::Check(e.to_string()))?;
    let out = args.results.out.clone().unwrap_or_else(|| args.dir.join(format!("trial-{}", args.trial)));
    let mut output = Output::default();
    let text = drawn.scenario.to_ron().map_err(|e| Failure::Internal(e.to_string()))?;
    output.add("scenario.ron", text);
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
