//! `stylet identify`, and `stylet diagnose` without a scenario: the layers of a phantom from recordings alone.

use crate::cli::args::{DiagnoseArgs, IdentifyArgs};
use crate::cli::diagnosis_summary::{fitted_law, summary};
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::stage_printer;
use std::path::{Path, PathBuf};
use stylet_api::output_folder::{check_folder, write_file_atomically};
use stylet_api::resource_estimate;
use stylet_diagnose::Diagnosis;

/// File with the layers that the diagnosis started from.
pub(super) const FOUND_FILE: &str = "assumed.ron";
/// The found layers and effects as a scenario.
const PHANTOM_FILE: &str = "phantom.ron";
/// Begins the summary.
pub(super) const NO_SCENARIO: &str =
    "No scenario was given: the layers are those that the recordings show.\n";
/// First line of a written phantom, by which an earlier one is recognised.
const PHANTOM_COMMENT: &str = "// Phantom identified by stylet";

/// `stylet identify`.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn identify(args: &IdentifyArgs) -> Result<(), Failure> {
    let mut args = args.clone();
    let phantom = args.results.out.take_if(|out| out.extension().is_some_and(|e| e == "ron"));
    if let Some(phantom) = &phantom {
        check_phantom(phantom)?;
    }
    run(&args, phantom.as_deref(), |d| format!("{}\n{}", fitted_law(d), summary(d)))
}

/// `stylet diagnose` without a scenario.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &DiagnoseArgs) -> Result<(), Failure> {
    let args = IdentifyArgs {
        data: args.data.clone(),
        layers: None,
        reading: args.reading.clone(),
        results: args.results.clone(),
        limits: args.limits,
    };
    run(&args, None, |d| format!("{NO_SCENARIO}{}\n{}", fitted_law(d), summary(d)))
}

/// The first of the recordings.
///
/// # Errors
/// [`Failure::Check`] without recordings, or with a scenario among them.
pub(super) fn first_recording(data: &[PathBuf]) -> Result<&Path, Failure> {
    let Some(first) = data.first() else {
        return Err(Failure::Check("no recordings: name them with --data A.csv B.csv".to_owned()));
    };
    match data.iter().find(|path| path.extension().is_some_and(|e| e == "ron")) {
        None => Ok(first),
        Some(scenario) => Err(Failure::Check(format!(
            "{} is no recording; a scenario goes before --data: stylet diagnose {0} --data A.csv B.csv",
            scenario.display()
        ))),
    }
}

fn run(
    args: &IdentifyArgs,
    phantom: Option<&Path>,
    summary: impl FnOnce(&Diagnosis) -> String,
) -> Result<(), Failure> {
    let first = first_recording(&args.data)?;
    args.limits.check(first, &resource_estimate::estimate_diagnose(&args.data), args.results.quiet)?;
    let folder = args.results.output_folder(first, "-phantom");
    let inputs = args.reading.inputs(&folder.join(FOUND_FILE), &args.data, &[]);
    let read = args.results.inputs(first, args.data.iter().skip(1).chain(&args.reading.columns));
    for result in ["diagnosis.json", FOUND_FILE, PHANTOM_FILE] {
        check_folder(&folder, result, &read)?;
    }
    let recordings = inputs.read_recordings()?;
    let name = first.file_stem().map_or_else(|| "phantom".to_owned(), |s| s.to_string_lossy().into_owned());
    let limit = args.limits.start_time_limit(first);
    let (scenario, found) =
        stylet_api::identify(&name, &recordings, args.layers, stage_printer(args.results.quiet, " ..."))?;
    drop(limit);
    let mut output = found.output(&scenario, &inputs)?;
    output.add(FOUND_FILE, scenario.to_ron().map_err(stylet_api::Error::internal)?);
    let text = phantom_ron(&found, &args.data)?;
    output.add(PHANTOM_FILE, text.clone());
    let output = output.with_inputs(read);
    args.results.write_and_print(&folder, &output, || summary(&found.diagnosis))?;
    if let Some(phantom) = phantom {
        if let Some(folder) = phantom.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            let cannot = |why| Failure::Check(format!("{}: cannot be created: {why}", folder.display()));
            std::fs::create_dir_all(folder).map_err(cannot)?;
        }
        write_file_atomically(phantom, text.as_bytes())?;
        if !args.results.quiet {
            crate::cli::terminal_output::print(&format!("Phantom: {}\n", phantom.display()))?;
        }
    }
    Ok(())
}

/// The phantom with a comment on its origin.
fn phantom_ron(found: &stylet_api::DiagnosisReport, data: &[PathBuf]) -> Result<String, Failure> {
    let names: Vec<String> =
        data.iter().map(|p| p.display().to_string().replace(['\n', '\r'], " ")).collect();
    let ron = found.extended.to_ron().map_err(stylet_api::Error::internal)?;
    Ok(format!("{PHANTOM_COMMENT} {} in {}.\n{ron}", env!("CARGO_PKG_VERSION"), names.join(", ")))
}

/// Rejects replacing a file that is not an earlier phantom.
fn check_phantom(path: &Path) -> Result<(), Failure> {
    let earlier = match std::fs::read(path) {
        Ok(bytes) => bytes.starts_with(PHANTOM_COMMENT.as_bytes()),
        Err(_) => true,
    };
    if earlier {
        return Ok(());
    }
    Err(Failure::Check(format!(
        "{}: exists and was not written by stylet identify; name another file",
        path.display()
    )))
}
