//! `stylet plan` and `stylet identifiability`: experiment design.

use crate::cli::args::{IdentifiabilityArgs, PlanArgs};
use crate::cli::exit_codes::Failure;
use crate::cli::output_args::default_folder;
use crate::cli::terminal_output::stage_printer;
use std::fmt::Write as _;
use std::path::PathBuf;
use stylet_api::output_folder::check_folder;
use stylet_api::plan_insertion::check_plan_files;
use stylet_api::{DiagnosisInputs, resource_estimate};
use stylet_plan::Plan;
use stylet_plan::identifiability::Identifiability;
use stylet_report::pages::formatting;
use stylet_report::significant;
use stylet_scenario::Motion;

/// `stylet plan`.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn plan(args: &PlanArgs) -> Result<(), Failure> {
    if let Some(model) = &args.transfer {
        return crate::cli::transfer::plan(args, model);
    }
    let (Some(from), Some(limits_file)) = (&args.from, &args.limits) else {
        return Err(Failure::Check(
            "a plan needs a scenario or the folder of a diagnosis, and --limits".to_owned(),
        ));
    };
    let limits = stylet_api::plan_insertion::load_limits(limits_file)?;
    let inputs = if from.is_dir() {
        let mut inputs = DiagnosisInputs::from_folder(from)?;
        inputs.effects.extend(args.effects.iter().cloned());
        inputs
    } else {
        args.reading.inputs(from, &args.data, &args.effects)
    };
    args.resources.check(
        &inputs.scenario,
        &resource_estimate::estimate_diagnose(&inputs.data),
        args.quiet,
    )?;
    let out = args.out.clone().unwrap_or_else(|| default_folder(from, "-plan").join("plan.ron"));
    let mut read = vec![inputs.scenario.as_path(), limits_file.as_path()];
    read.extend(inputs.data.iter().chain(&inputs.columns).chain(&inputs.effects).map(PathBuf::as_path));
    check_plan_files(&out, &read)?;
    let limit = args.resources.start_time_limit(&inputs.scenario);
    let progress = stage_printer(args.quiet, " ...");
    let report = stylet_api::plan_insertion::plan(&inputs, (limits_file, &limits), !args.quick, &progress)?;
    drop(limit);
    check_plan_files(&out, &read)?;
    report.write(&out)?;
    if args.quiet {
        return Ok(());
    }
    crate::cli::terminal_output::print(&format!(
        "{}\nMotion: {}\nReport: {}\n",
        summary(&report.plan),
        out.display(),
        out.with_extension("html").display()
    ))
}

fn summary(plan: &Plan) -> String {
    let mut out = String::new();
    let pairs: Vec<_> = plan.pairs.iter().filter(|p| p.distinguishable).collect();
    let percent = |p: f64| format!("{:.0} %", 100.0 * p);
    let Motion::Program { start_m, segments } = &plan.motion else { return out };
    let _ = writeln!(
        out,
        "The next insertion: {} segments from {:.1} mm, {} s, to {:.1} mm, at most {} N expected",
        segments.len(),
        1e3 * start_m,
        significant(plan.duration_s, 3),
        1e3 * plan.depth_m,
        significant(plan.force_n, 3)
    );
    if !plan.already_named.is_empty() {
        let _ =
            writeln!(out, "  already named, and part of every candidate: {}", plan.already_named.join(", "));
    }
    if pairs.is_empty() {
        let _ = writeln!(
            out,
            "  no remaining pair of candidates can be distinguished within these limits; intervals become narrower:"
        );
        for i in plan.intervals.iter().filter(|i| i.half_width_after < 0.98 * i.half_width_before) {
            let _ = writeln!(
                out,
                "    {:<32} +-{} -> +-{}",
                i.name,
                significant(i.half_width_before, 2),
                significant(i.half_width_after, 2)
            );
        }
    } else {
        let _ = writeln!(
            out,
            "  the next diagnosis decides which {}cause there is, if any, with probability {} (now {}), by {}",
            if plan.already_named.is_empty() { "" } else { "further " },
            percent(plan.probability_decided),
            percent(plan.probability_now),
            if plan.probability_source == "simulated" {
                "simulated insertions and expected gaps"
            } else {
                "expected gaps"
            }
        );
        for t in &plan.simulated {
            let _ = writeln!(
                out,
                "    simulated with {:<26} identified alone in {} of {}",
                t.candidate, t.correct, t.trials
            );
        }
        let mut worst = pairs.clone();
        worst.sort_by(|a, b| a.nats_after.total_cmp(&b.nats_after));
        let _ =
            writeln!(out, "  hardest pairs                                              nats now    then");
        for p in worst.iter().take(6) {
            let _ = writeln!(
                out,
                "    {:<54} {:>8} {:>7}",
                format!("{} | {}", p.a, p.b),
                significant(p.nats_before, 2),
                significant(p.nats_after, 3)
            );
        }
        let _ = writeln!(out, "  {NAT_EXPLANATION}");
    }
    if !plan.never_detectable.is_empty() {
        let _ = writeln!(
            out,
            "  not detectable by any motion within these limits: {}",
            plan.never_detectable.join(", ")
        );
    }
    if let Some(r) = &plan.repeats {
        let _ = writeln!(
            out,
            "  forces at rupture scatter by {:.1} %: {} insertions, half at {} and half at {} mm/s, give their mean to {:.1} %",
            100.0 * r.scatter,
            r.insertions,
            significant(1e3 * r.speeds_mps[0], 2),
            significant(1e3 * r.speeds_mps[1], 2),
            100.0 * r.mean_half_width
        );
    }
    out
}

/// `stylet identifiability`.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn identifiability(args: &IdentifiabilityArgs) -> Result<(), Failure> {
    let inputs = args.reading.inputs(&args.scenario, &args.data, &args.effects);
    args.resources.check(
        &inputs.scenario,
        &resource_estimate::estimate_diagnose(&inputs.data),
        args.results.quiet,
    )?;
    let limit = args.resources.start_time_limit(&inputs.scenario);
    let progress = stage_printer(args.results.quiet, " ...");
    let folder = args.results.output_folder(&args.scenario, "-identifiability");
    let others = args.data.iter().chain(&args.reading.columns).chain(&args.motion).chain(&args.effects);
    let read = args.results.inputs(&args.scenario, others);
    check_folder(&folder, "identifiability.json", &read)?;
    let found = stylet_api::plan_insertion::identifiability(&inputs, args.motion.as_deref(), &progress)?;
    drop(limit);
    let output = found.output()?.with_inputs(read);
    args.results.write_and_print(&folder, &output, || identifiability_table(&found.identifiability))
}

/// Explanation of the unit nat.
const NAT_EXPLANATION: &str = "(a nat is a factor of 2.7 in how likely the data are: 3 are odds of 20 to 1)";

fn identifiability_table(result: &Identifiability) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{:<26} {:>10}  {:<44} confused with", "effect", "nats", "detectable from");
    for e in &result.effects {
        let from = match &e.smallest_detectable {
            Some(values) => formatting::strength_parameters(&e.effect, values),
            None => "at no plausible size".to_owned(),
        };
        let line = format!(
            "{:<26} {:>10}  {from:<44} {}",
            e.effect,
            significant(e.nats, 3),
            e.indistinguishable_from.join(", ")
        );
        let _ = writeln!(out, "{}", line.trim_end());
    }
    if !result.not_identifiable.is_empty() {
        let _ =
            writeln!(out, "\nnot identifiable at their typical size: {}", result.not_identifiable.join(", "));
    }
    if !result.effects.is_empty() {
        let _ = writeln!(out, "\n{NAT_EXPLANATION}");
    }
    for c in &result.classes {
        let _ = writeln!(out, "not distinguishable: {}", c.join(", "));
    }
    out
}
