//! `stylet check`: what recordings can identify, before a diagnosis.

use crate::cli::args::CheckArgs;
use crate::cli::exit_codes::Failure;
use std::fmt::Write as _;
use stylet_api::output_folder::check_folder;
use stylet_api::resource_estimate;
use stylet_diagnose::check_json::Rating;
use stylet_diagnose::experiment_check::ExperimentCheck;
use stylet_report::pages::experiment_check::summary_sentence;

/// `stylet check`.
///
/// # Errors [`Failure`] with its exit code; [`Failure::Unusable`] if the recordings are unusable for a diagnosis.
pub fn check(args: &CheckArgs) -> Result<(), Failure> {
    args.limits.check(
        &args.assumed,
        &resource_estimate::estimate_diagnose(&args.data),
        args.results.quiet,
    )?;
    let folder = args.results.output_folder(&args.assumed, "-check");
    let read = args
        .results
        .inputs(&args.assumed, args.data.iter().chain(&args.reading.columns).chain(&args.effects));
    check_folder(&folder, "check.json", &read)?;
    let inputs = args.reading.inputs(&args.assumed, &args.data, &args.effects);
    let scenario = inputs.load_scenario()?;
    let report = stylet_api::check(&scenario, &inputs.read_recordings()?)?;
    let output = report.output.with_inputs(read);
    args.results.write_and_print(&folder, &output, || text(&report.check))?;
    let unusable = report.check.items.iter().find(|item| item.light == Rating::Unusable);
    unusable.map_or(Ok(()), |item| Err(Failure::Unusable(item.message.clone())))
}

/// One line per aspect.
fn text(check: &ExperimentCheck) -> String {
    let mut out = format!("{}\n\n", summary_sentence(check));
    for item in &check.items {
        let word = item.light.name();
        let _ = writeln!(out, "  {word:<9} {:<11} {}", item.topic, item.message);
    }
    out
}
