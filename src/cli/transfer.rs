//! `stylet diagnose --transfer` and `stylet plan --transfer`: another group of recordings than that which made a model.

use crate::cli::args::{DiagnoseArgs, PlanArgs};
use crate::cli::exit_codes::Failure;
use crate::cli::output_args::default_folder;
use crate::cli::predict::varying_factors;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stylet_api::output_folder::{check_folder, check_own_file};
use stylet_api::transfer::{DiagnosedModel, GroupFiles, model_file};
use stylet_api::{Factor, resource_estimate};
use stylet_diagnose::prediction::{Transfer, TransferPlan};
use stylet_report::pages::transfer::{difference, summary_sentence, warnings};
use stylet_report::significant;

/// A key by which the file of an earlier plan is recognised.
const OWN_KEY: &[u8] = b"\"median_ratio\"";

/// `stylet diagnose --transfer MODEL`.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &DiagnoseArgs, model: &Path) -> Result<(), Failure> {
    let file = model_file(model);
    let group = GroupFiles::new(
        args.scenario.as_deref(),
        &args.data,
        args.reading.columns.as_deref(),
        args.reading.repair,
    )?;
    args.limits.check(&file, &resource_estimate::estimate_predict(&group.data), args.results.quiet)?;
    let folder = args.results.output_folder(&file, "-transfer");
    let is_file = |p: &&PathBuf| p.is_file();
    let others = group.data.iter().chain(&args.reading.columns).chain(args.scenario.iter().filter(is_file));
    let read = args.results.inputs(&file, others);
    check_folder(&folder, "transfer.json", &read)?;
    let limit = args.limits.start_time_limit(&file);
    let (found, output) = DiagnosedModel::load(model)?.compare_groups(&group.read()?)?;
    drop(limit);
    args.results.write_and_print(&folder, &output.with_inputs(read), || text(&found.transfer))
}

fn text(t: &Transfer) -> String {
    let mut out = format!("{}\n\n", summary_sentence(t));
    for p in &t.parameters {
        let _ = writeln!(
            out,
            "  {:<44} differs with probability {}",
            difference(p.parameter, p.value, p.low, p.high),
            significant(p.probability, 2)
        );
    }
    let _ = writeln!(
        out,
        "  rms error {} N, {} N with all parameters updated; {} N on the {} recordings that made the model",
        significant(t.before_n, 3),
        significant(t.after_n, 3),
        significant(t.model_n, 3),
        t.model_recordings
    );
    for warning in warnings(t) {
        let _ = writeln!(out, "  {warning}");
    }
    out
}

/// `stylet plan --transfer MODEL`.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn plan(args: &PlanArgs, model: &Path) -> Result<(), Failure> {
    let file = model_file(model);
    let out = args.out.clone().unwrap_or_else(|| default_folder(&file, "-plan").join("transfer_plan.json"));
    let is_own = |bytes: &[u8]| bytes.windows(OWN_KEY.len()).any(|window| window == OWN_KEY);
    check_own_file(&out, &[&file], None, is_own)?;
    let limit = args.resources.start_time_limit(&file);
    let varying = varying_factors(&args.same).unwrap_or_else(|| Factor::ALL.to_vec());
    let found = DiagnosedModel::load(model)?.plan_transfer(&varying)?;
    drop(limit);
    stylet_api::transfer::write_plan(&found, &out)?;
    if args.quiet {
        return Ok(());
    }
    crate::cli::terminal_output::print(&format!("{}\nPlan: {}\n", plan_text(&found), out.display()))
}

fn plan_text(plan: &TransferPlan) -> String {
    let what: Vec<&str> = plan.varying.iter().map(|f| f.name()).collect();
    let mut out = match &plan.recommended {
        Some(c) => format!(
            "{} insertion(s) at {} mm/s bring the prediction within 10 % of its floor with probability {}",
            c.insertions,
            speeds(&c.speeds_mps),
            significant(c.probability, 2)
        ),
        None => "No number of insertions brings the prediction within 10 % of its floor with probability 0.9"
            .to_owned(),
    };
    let _ = writeln!(
        out,
        "\n  floor {} N rms; the new group differs in {}\n\n  {:>10} {:>16} {:>14} {:>20}",
        significant(plan.floor_n, 3),
        if what.is_empty() { "nothing".to_owned() } else { what.join(", ") },
        "insertions",
        "mm/s",
        "within 10 %",
        "median error / floor"
    );
    for c in &plan.choices {
        let _ = writeln!(
            out,
            "  {:>10} {:>16} {:>12.1} % {:>20.2}",
            c.insertions,
            speeds(&c.speeds_mps),
            100.0 * c.probability,
            c.median_ratio
        );
    }
    out
}

fn speeds(speeds_mps: &[f64]) -> String {
    let each: Vec<String> = speeds_mps.iter().map(|v| significant(1e3 * v, 3)).collect();
    each.join(", ")
}
