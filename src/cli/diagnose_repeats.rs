//! `stylet diagnose` on repeated insertions and on indented specimens: a data set, or a scenario with `--repeats`.

use crate::cli::args::DiagnoseArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::identify::{FOUND_FILE, NO_SCENARIO, first_recording};
use crate::cli::terminal_output::stage_printer;
use std::fmt::Write as _;
use std::path::Path;
use stylet_api::DiagnosisInputs;
use stylet_api::diagnose_repeats::{
    data_set_of_recordings, diagnose_repeats, load_data_set, recording_files,
};
use stylet_api::diagnose_specimens::{SpecimensReport, diagnose_specimens};
use stylet_api::output_folder::check_folder;
use stylet_api::resource_estimate;
use stylet_diagnose::diagnosis_json::{Finding, FindingKind, Verdict};
use stylet_diagnose::repeated_insertions::dataset::Dataset;
use stylet_diagnose::repeated_insertions::diagnose_set::SetDiagnosis;
use stylet_record::QualityKind;
use stylet_report::pages::formatting::three_decimals;
use stylet_report::pages::repeated_insertions::{online_enhancement, summary_sentence};
use stylet_report::significant;
use stylet_scenario::Scenario;

/// The command with a scenario or a data set.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &DiagnoseArgs, file: &Path) -> Result<(), Failure> {
    let inputs = args.reading.inputs(file, &args.data, &args.effects);
    let set = load_data_set(&inputs)?;
    run(args, file, &inputs, &set, None)
}

/// The command without a scenario: the layers are those that the recordings show.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose_without_scenario(args: &DiagnoseArgs) -> Result<(), Failure> {
    let first = first_recording(&args.data)?;
    let folder = args.results.output_folder(first, "-diagnosis");
    args.limits.check(first, &resource_estimate::estimate_diagnose_repeats(&args.data), true)?;
    let read = args.results.inputs(first, args.data.iter().chain(&args.reading.columns));
    check_folder(&folder, "diagnosis.json", &read)?;
    check_folder(&folder, FOUND_FILE, &read)?;
    let inputs = args.reading.inputs(&folder.join(FOUND_FILE), &args.data, &[]);
    let name = first.file_stem().map_or_else(|| "phantom".to_owned(), |s| s.to_string_lossy().into_owned());
    let (scenario, set) = data_set_of_recordings(&name, &inputs)?;
    run(args, first, &inputs, &set, Some(&scenario))
}

/// Diagnoses; `found_scenario` is the one from the recordings, if none was given.
fn run(
    args: &DiagnoseArgs,
    file: &Path,
    inputs: &DiagnosisInputs,
    set: &Dataset,
    found_scenario: Option<&Scenario>,
) -> Result<(), Failure> {
    let results = &args.results;
    let files = recording_files(set, &args.data)?;
    let estimate = if set.split_by.is_empty() {
        resource_estimate::estimate_diagnose_repeats(&files)
    } else {
        resource_estimate::estimate_diagnose(&files)
    };
    args.limits.check(file, &estimate, results.quiet)?;
    let folder = results.output_folder(file, "-diagnosis");
    let read = results.inputs(file, files.iter().chain(&args.reading.columns));
    check_folder(&folder, "diagnosis.json", &read)?;
    let limit = args.limits.start_time_limit(file);
    let runs = set.load_recordings(&files, set.tissue.layers.len())?;
    if !set.split_by.is_empty() {
        let found = diagnose_specimens(set, &runs)?;
        drop(limit);
        let output = found.output(set, inputs)?.with_inputs(read);
        return results.write_and_print(&folder, &output, || specimens_summary(&found));
    }
    let mut progress = stage_printer(results.quiet, "");
    let found = diagnose_repeats(set, &runs, !args.data.is_empty(), &mut progress)?;
    drop(limit);
    let mut output = found.output(set, inputs)?;
    let mut text = format!("{}{}", summary(&found.study), online_enhancement::summary(&found.online));
    if let Some(scenario) = found_scenario {
        output.add(FOUND_FILE, scenario.to_ron().map_err(stylet_api::Error::internal)?);
        text.insert_str(0, NO_SCENARIO);
    }
    results.write_and_print(&folder, &output.with_inputs(read), || text)
}

fn summary(study: &SetDiagnosis) -> String {
    let mut out = String::new();
    let (d, r) = (&study.diagnosis, &study.report);
    let _ = writeln!(out, "{}\n", summary_sentence(study));
    if let Some(grade) = &d.grade {
        let _ = writeln!(out, "  {}", grade.sentence());
    }
    // Otherwise they are in the first sentence.
    let is_listed = |f: &&Finding| f.kind == FindingKind::OutOfTolerance && d.verdict != Verdict::Parameters;
    for finding in d.findings.iter().filter(is_listed) {
        let _ = writeln!(out, "  {}", finding.message);
    }
    let _ = writeln!(
        out,
        "  candidate models and components of the selected one (N rms on held-out parts of the set)\n    {:<40} {:.3}",
        "base law",
        study.candidates.base.held_out_n()
    );
    for b in &r.ablation {
        let line = match b.without_n {
            None => format!("{:<40} {:.3}", b.step, b.held_out_n),
            Some(e) => format!(
                "{:<40}       {e:.3} without it{}",
                format!("  {}", b.step),
                if b.kept { "" } else { ", so it was not selected" }
            ),
        };
        let _ = writeln!(out, "    {line}");
    }
    for c in &d.causes {
        let _ = writeln!(out, "\n  {}, confidence {}", c.effect, significant(c.confidence, 3));
        for (path, e) in &c.parameters {
            let (value, low, high) = (significant(e.value, 4), significant(e.low, 3), significant(e.high, 3));
            let bound = if c.at_bound.contains(path) { ", at its bound" } else { "" };
            let _ = writeln!(out, "    {path} = {value} (95 %: {low} to {high}){bound}");
        }
    }
    let _ = writeln!(
        out,
        "\n  each recording predicted by the others (N rms)\n    {:>10} {:>5} {:>8} {:>8} {:>9} {:>9} {:>9} {:>16}",
        "mm/s", "runs", "floor", "base", "extended", "discrep.", "in band", "held-out speed"
    );
    let mut line = |name: String, runs: usize, floor, errors: [f64; 3], covered: f64, speed| {
        let [base, model, with_discrepancy] = errors;
        let _ = writeln!(
            out,
            "    {name:>10} {runs:>5} {:>8} {base:>8.3} {model:>9.3} {with_discrepancy:>9.3} {:>8.1}% {:>16}",
            three_decimals(floor),
            100.0 * covered,
            three_decimals(speed)
        );
    };
    for s in &r.speeds {
        line(
            format!("{:.2}", 1e3 * s.speed_mps),
            s.recordings,
            s.floor_n,
            [s.base_n, s.model_n, s.with_discrepancy_n],
            s.coverage,
            s.held_out_speed_n,
        );
    }
    let m = &r.mean;
    line(
        "mean".to_owned(),
        r.recordings.len(),
        m.floor_n,
        [m.base_n, m.model_n, m.with_discrepancy_n],
        m.coverage,
        m.held_out_speed_n,
    );
    let _ = writeln!(
        out,
        "  discrep.: extended model plus the mean residual of the other recordings at the same speed, which names no cause"
    );
    if let Some(nested) = &r.nested {
        let _ = writeln!(
            out,
            "  held-out parts of the set: {:.3} N by the selected model, {:.3} N by models selected without them",
            nested.selected_with_n, nested.selected_without_n
        );
    }
    let _ = writeln!(
        out,
        "  base law with a whole speed held out: {} N",
        three_decimals(m.base_held_out_speed_n)
    );
    let _ = writeln!(
        out,
        "  the floor is the error of the mean of the others, which scatters itself; without that: {} N",
        three_decimals(m.floor_unbiased_n)
    );
    if let Some(coverage) = m.held_out_speed_coverage {
        let _ = writeln!(out, "  inside the band of a held-out speed: {:.1} %", 100.0 * coverage);
    }
    for p in &r.phases {
        let _ = writeln!(
            out,
            "  {:<28} model {:.3} N, with discrepancy {:.3} N, floor {}",
            p.phase,
            p.model_n,
            p.with_discrepancy_n,
            three_decimals(p.floor_n)
        );
    }
    if r.starts.0 > 1 {
        let _ = writeln!(out, "  {} of {} starts of the fit agree", r.starts.1, r.starts.0);
    }
    for advice in &d.advice {
        let _ = writeln!(out, "  {advice}");
    }
    if let Some(parts) = &r.composition {
        for (name, floor, error) in &parts.single_layers {
            let _ = writeln!(
                out,
                "  {name}: {error:.3} N on held-out recordings, floor {}",
                three_decimals(*floor)
            );
        }
        let _ = writeln!(out, "  composed, on the whole stack: {:.3} N", parts.mean_n);
    }
    for e in &r.instrument.detected {
        let _ = writeln!(out, "  detected in the instrument checks: {}: {}", e.effect, e.evidence);
    }
    for e in &r.instrument.excluded {
        let _ = writeln!(out, "  excluded: {}: {}", e.effect, e.evidence);
    }
    for q in d.data_quality.iter().filter(|q| q.recording.starts_with("all at")) {
        let _ = writeln!(out, "  data: {}", q.note.message);
    }
    for q in d.data_quality.iter().filter(|q| q.note.kind == QualityKind::OutlierRecording) {
        let _ = writeln!(out, "  note: {}: {}", q.recording, q.note.message);
    }
    out
}

fn specimens_summary(SpecimensReport { specimens: found, diagnosis: d }: &SpecimensReport) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}\n", stylet_report::pages::indented_specimens::summary_sentence(found));
    let _ = writeln!(
        out,
        "    {:<36} {:>10} {:>16} {:>8}",
        "median error, mN", "fitted", "rest of hold", "better"
    );
    for r in &found.candidates {
        let _ = writeln!(
            out,
            "    {:<36} {:>10.2} {:>16.2} {:>7.0} % {}",
            r.step,
            1e3 * r.fitted_n,
            1e3 * r.held_out_n,
            100.0 * r.improved_share,
            if r.kept { "" } else { "not kept" }
        );
    }
    for n in &found.parameters {
        let _ = writeln!(
            out,
            "    {} = {} (95 %: {} to {}; 90 % of specimens {} to {})",
            n.name,
            significant(n.mean, 3),
            significant(n.low, 3),
            significant(n.high, 3),
            significant(n.range_90.0, 2),
            significant(n.range_90.1, 2)
        );
    }
    let _ = writeln!(
        out,
        "    noise {} mN; punctures {}",
        significant(1e3 * d.noise.sd_n, 2),
        found.punctured.len()
    );
    for (name, why) in &found.unused {
        let _ = writeln!(out, "  not used: {name}: {why}");
    }
    out
}
