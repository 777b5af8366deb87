//! `stylet enhance`: the online core on a measured recording.

use crate::cli::args::EnhanceArgs;
use crate::cli::exit_codes::Failure;
use std::fmt::Write as _;
use stylet_api::enhancement::{
    EnhancementResult, ResultSource, enhance_long_recording, enhance_recording, impossible_estimates,
    unused_note,
};
use stylet_api::output_folder::check_folder;
use stylet_api::{IdentifiedModel, OutputLock, read_options, resource_estimate};
use stylet_core::config::Model;
use stylet_record::{QualityKind, QualityNote, read_csv, read_long_csv};
use stylet_report::{plus_minus, significant};
use stylet_scenario::EnhancerConfigFile;

/// Ruptures and layers of a long recording that are printed.
const MAX_LISTED: usize = 100;

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn enhance(args: &EnhanceArgs) -> Result<(), Failure> {
    let mut config = args.config.as_deref().map(EnhancerConfigFile::load).transpose()?.unwrap_or_default();
    if let Some(contact) = args.contact {
        config.enhance.contact = contact.setting();
    }
    let model = args.model.as_deref().map(IdentifiedModel::load).transpose()?;
    if let Some(model) = &model {
        model.check_algorithm(&config.enhance)?;
    }
    let options = read_options(args.reading.columns.as_deref(), args.reading.repair)?;
    let regressors = match args.compare {
        true => vec![Model::MultiLayer, Model::KelvinVoigt],
        false => vec![config.enhance.model],
    };
    let source = ResultSource { data: &args.data, config: args.config.as_deref(), command: command(args) };
    let folder = args.results.output_folder(&args.data, "");
    let inputs = args
        .results
        .inputs(&args.data, [&args.config, &args.reading.columns, &args.model].into_iter().flatten());
    check_folder(&folder, "enhance.json", &inputs)?;
    if let Some(estimate) = resource_estimate::estimate_long_enhance(&args.data, regressors.len()) {
        args.limits.check(&args.data, &estimate, args.results.quiet)?;
        let lock = OutputLock::new(&folder)?;
        if let Some((recording, notes)) = read_long_csv(&args.data, &options, &folder)? {
            refuse_unusable_recording(args, &notes)?;
            let result =
                enhance_long_recording(&recording, notes, config, &regressors, model.as_ref(), &lock)?;
            let summary = summary(args, &result);
            let files = result.output_files(&source)?.with_inputs(inputs);
            return args.results.write_locked_and_print(&lock, &files, || summary);
        }
    }
    if let Some(estimate) = resource_estimate::estimate_enhance(&args.data, regressors.len()) {
        args.limits.check(&args.data, &estimate, args.results.quiet)?;
    }
    let (recording, notes) = read_csv(&args.data, &options)?;
    let estimate = resource_estimate::estimate_enhance_samples(recording.len() as f64, regressors.len());
    args.limits.check(&args.data, &estimate, true)?;
    refuse_unusable_recording(args, &notes)?;
    let result = enhance_recording(recording, notes, config, &regressors, model.as_ref())?;
    let summary = summary(args, &result);
    args.results.write_and_print(&folder, &result.output_files(&source)?.with_inputs(inputs), || summary)
}

/// Recordings with the wrong sign or unit would give wrong results.
fn refuse_unusable_recording(args: &EnhanceArgs, notes: &[QualityNote]) -> Result<(), Failure> {
    let grave =
        |kind| matches!(kind, QualityKind::Reversed | QualityKind::ReversedPosition | QualityKind::UnitMixUp);
    let found: Vec<&str> = notes
        .iter()
        .filter(|note| note.blocking && grave(note.kind))
        .map(|note| note.message.as_str())
        .collect();
    if found.is_empty() {
        return Ok(());
    }
    let file = args.data.display();
    let found = found.join("; ");
    Err(Failure::Check(format!(
        "{file}: {found}\nlook at the file with: stylet inspect {file} --write-map map.ron"
    )))
}

fn command(args: &EnhanceArgs) -> String {
    let mut command = format!("stylet enhance {}", args.data.display());
    for (flag, path) in
        [("--columns", &args.reading.columns), ("--config", &args.config), ("--model", &args.model)]
    {
        if let Some(path) = path {
            let _ = write!(command, " {flag} {}", path.display());
        }
    }
    if let Some(contact) = args.contact {
        let _ = write!(command, " --contact {}", contact.setting().name());
    }
    for (flag, on) in [("--repair", args.reading.repair), ("--compare", args.compare)] {
        if on {
            let _ = write!(command, " {flag}");
        }
    }
    command
}

fn summary(args: &EnhanceArgs, result: &EnhancementResult) -> String {
    let EnhancementResult { extent, notes, algorithm_runs: runs, hash, model, .. } = result;
    let listed = if result.is_long() { MAX_LISTED } else { usize::MAX };
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{}\n{} samples over {} s, {} Hz, hash {hash}",
        args.data.display(),
        extent.samples,
        significant(extent.duration_s, 4),
        significant(extent.sample_hz, 3),
    );
    for note in notes {
        let _ = writeln!(out, "  note: {}", note.message);
    }
    for note in stylet_api::settings_note(runs).into_iter().chain(unused_note(runs)) {
        let _ = writeln!(out, "  note: {note}");
    }
    if let Some(model) = model {
        let _ = writeln!(out, "  model: {}", model.summary());
        for note in &model.notes {
            let _ = writeln!(out, "  note: {note}");
        }
    }
    for r in runs {
        let unit = if r.config.model == Model::MultiLayer { "N s/m²" } else { "N s/m" };
        let _ = writeln!(out, "\n{}", r.name);
        let _ = writeln!(out, "  {}", r.trace.contact.sentence());
        match (r.trace.contact_m, r.trace.contact_s) {
            (Some(z), Some(t)) => {
                let _ = writeln!(out, "  first contact at {:.2} mm, {t:.3} s", z * 1e3);
            }
            _ if r.trace.contact.is_loaded_unexpectedly() => {}
            _ => {
                let blocking = notes.iter().any(|n| n.blocking);
                let why = if blocking { "see the note" } else { "the force never exceeds its noise in air" };
                let _ = writeln!(out, "  no contact detected: {why}");
            }
        }
        for s in r.trace.zero_steps.iter().take(listed) {
            let _ = writeln!(
                out,
                "  step of the zero of {} N at {:.3} s, {:.2} mm ({})",
                plus_minus(s.size_n, Some(stylet_stats::Z95 * s.sd_n), 2),
                s.time_s,
                s.position_m * 1e3,
                if s.in_tissue { "in tissue; no layer" } else { "in air" },
            );
        }
        let _ = writeln!(out, "  {} rupture(s)", r.trace.detections.len());
        for d in r.trace.detections.iter().take(listed) {
            let _ = writeln!(
                out,
                "    at {:.3} s, {:.2} mm (located at {:.2} mm), by {}",
                d.time_s,
                d.position_m * 1e3,
                d.located_m * 1e3,
                d.cause.name()
            );
        }
        for e in r.trace.estimates.iter().take(listed) {
            let interval =
                |value: f64, sd: f64| plus_minus(value, (sd > 0.0).then_some(stylet_stats::Z95 * sd), 3);
            let _ = writeln!(
                out,
                "  layer {}: {:.2} mm, K {} N/m, b {} {unit}, drop {} N",
                e.layer,
                e.thickness_m * 1e3,
                interval(e.stiffness_n_per_m, e.stiffness_sd),
                interval(e.friction, e.friction_sd),
                interval(e.drop_n, e.drop_sd_n),
            );
            for what in impossible_estimates(e) {
                let _ = writeln!(out, "    impossible: {what}");
            }
        }
        if r.trace.detections.len().max(r.trace.estimates.len()) > listed {
            let _ = writeln!(out, "  the first {listed} of each; events.json and enhance.json have all");
        }
        if r.trace.estimates.iter().any(|e| e.stiffness_sd > 0.0) {
            let _ = writeln!(out, "  (± 95 %)");
        }
    }
    out
}
