//! `stylet diagnose`: measured recordings compared with an assumed scenario.

use crate::cli::args::DiagnoseArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::stage_printer;
use std::fmt::Write as _;
use stylet_api::output_folder::{check_folder, recover_parent};
use stylet_api::resource_estimate;
use stylet_diagnose::Diagnosis;
use stylet_report::pages::diagnosis::{
    findings, general_forms, lower_limits, partial_model, recording_differences, summary_sentence,
};
use stylet_report::significant;
use stylet_scenario::Scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &DiagnoseArgs) -> Result<(), Failure> {
    let Some(file) = &args.scenario else {
        if args.repeats {
            return Err(Failure::Check("--repeats needs a scenario or a data set".to_owned()));
        }
        return crate::cli::identify::diagnose(args);
    };
    // The scenario may be the result of an interrupted diagnosis.
    recover_parent(file)?;
    if args.repeats || stylet_diagnose::repeated_insertions::dataset::is_dataset(file)? {
        return crate::cli::diagnose_repeats::diagnose(args, file);
    }
    if args.data.is_empty() {
        return Err(Failure::Check(
            "no recordings: name them with --data A.csv B.csv, or give a data set in place of the scenario"
                .to_owned(),
        ));
    }
    let scenario = Scenario::load(file)?;
    args.limits.check(file, &resource_estimate::estimate_diagnose(&args.data), args.results.quiet)?;
    let inputs = args.inputs(file);
    let folder = args.results.output_folder(file, "-diagnosis");
    let read = args.results.inputs(file, args.data.iter().chain(&args.columns));
    check_folder(&folder, "diagnosis.json", &read)?;
    let progress = stage_printer(args.results.quiet, " ...");
    let recordings = inputs.read_recordings()?;
    let samples: Vec<f64> = recordings.iter().map(|r| r.recording.len() as f64).collect();
    let estimate = resource_estimate::estimate_diagnose_samples(&samples);
    args.limits.check(file, &estimate, true)?;
    let limit = args.limits.start_time_limit(file);
    let found = stylet_api::diagnose(&scenario, &recordings, progress)?;
    drop(limit);
    let output = found.output(&scenario, &inputs)?.with_inputs(read);
    args.results.write_and_print(&folder, &output, || summary(&found.diagnosis))
}

/// Verdict, causes, errors and findings in words.
pub(super) fn summary(d: &Diagnosis) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}", summary_sentence(d));
    for c in &d.causes {
        let _ = writeln!(out, "\n  {}, confidence {}", c.effect, significant(c.confidence, 3));
        if let Some(remark) = &c.remark {
            let _ = writeln!(out, "    {remark}");
        }
        for (path, e) in &c.parameters {
            let _ = writeln!(
                out,
                "    {path} = {} (95 %: {} to {}){}",
                significant(e.value, 4),
                significant(e.low, 4),
                significant(e.high, 4),
                if c.at_bound.contains(path) { ", at its bound" } else { "" }
            );
        }
        if !c.equivalent.is_empty() {
            let _ = writeln!(out, "    equivalent: {}", c.equivalent.join(", "));
        }
        if let Some(sentence) = general_forms(c) {
            let _ = writeln!(out, "    {sentence}");
        }
    }
    let g = &d.gain;
    let what = if g.held_out { "on held-out recordings" } else { "on the one recording, which was fitted" };
    let _ = writeln!(
        out,
        "\n  residual {what}: {} N before, {} N after{}, noise {} N",
        significant(g.rmse_before_n, 3),
        significant(g.rmse_after_n, 3),
        if g.rmse_given_scatter_n < 0.9 * g.rmse_after_n {
            format!(
                " ({} N with each recording's own ruptures, surface and friction)",
                significant(g.rmse_given_scatter_n, 3)
            )
        } else {
            String::new()
        },
        significant(g.floor_n, 3)
    );
    for sentence in findings(d) {
        let _ = writeln!(out, "  {sentence}");
    }
    if let Some(sentence) = partial_model(d) {
        let _ = writeln!(out, "  {sentence}");
    }
    for sentence in lower_limits(d) {
        let _ = writeln!(out, "  {sentence}");
    }
    if let Some(differ) = recording_differences(d) {
        let _ = writeln!(out, "  {differ}");
    }
    let imitated = d.negligible.iter().filter(|t| t.reason == stylet_diagnose::REASON_IMITATES_UNMODELLED);
    let imitated: Vec<&str> = imitated.map(|t| t.effect.as_str()).collect();
    if !imitated.is_empty() {
        let _ = writeln!(
            out,
            "  nearest effects of the library, which may only imitate the true one: {}",
            imitated.join(", ")
        );
    }
    if !d.not_identifiable.is_empty() {
        let _ = writeln!(out, "  not identifiable from these recordings: {}", d.not_identifiable.join(", "));
    }
    for q in &d.data_quality {
        let _ = writeln!(out, "  note: {}: {}", q.recording, q.note.message);
    }
    out
}
