//! `stylet diagnose`: measured recordings compared with an assumed scenario.

use crate::cli::args::DiagnoseArgs;
use crate::cli::diagnosis_summary::{fitted_law, summary};
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::stage_printer;
use stylet_api::output_folder::{check_folder, recover_parent};
use stylet_api::{DiagnoseOptions, resource_estimate};

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &DiagnoseArgs) -> Result<(), Failure> {
    if let Some(model) = &args.transfer {
        return crate::cli::transfer::diagnose(args, model);
    }
    let Some(file) = &args.scenario else {
        if !args.effects.is_empty() {
            return Err(Failure::Check("--effects needs a scenario".to_owned()));
        }
        return match args.repeats {
            true => crate::cli::diagnose_repeats::diagnose_without_scenario(args),
            false => crate::cli::identify::diagnose(args),
        };
    };
    // The scenario may be the result of an interrupted diagnosis.
    recover_parent(file)?;
    if args.repeats || stylet_diagnose::repeated_insertions::dataset::is_dataset(file)? {
        if !args.effects.is_empty() {
            let what =
                "--effects has no meaning for repeats, which are compared with the effects of single layers";
            return Err(Failure::Check(what.to_owned()));
        }
        return crate::cli::diagnose_repeats::diagnose(args, file);
    }
    if args.data.is_empty() {
        return Err(Failure::Check(
            "no recordings: name them with --data A.csv B.csv, or give a data set in place of the scenario"
                .to_owned(),
        ));
    }
    let inputs = args.reading.inputs(file, &args.data, &args.effects);
    let scenario = inputs.load_scenario()?;
    args.limits.check(file, &resource_estimate::estimate_diagnose(&args.data), args.results.quiet)?;
    let folder = args.results.output_folder(file, "-diagnosis");
    let read = args.results.inputs(file, args.data.iter().chain(&args.reading.columns).chain(&args.effects));
    check_folder(&folder, "diagnosis.json", &read)?;
    let progress = stage_printer(args.results.quiet, " ...");
    let recordings = inputs.read_recordings()?;
    let samples: Vec<f64> = recordings.iter().map(|r| r.recording.len() as f64).collect();
    let estimate = resource_estimate::estimate_diagnose_samples(&samples);
    args.limits.check(file, &estimate, true)?;
    let limit = args.limits.start_time_limit(file);
    let options = DiagnoseOptions { force: args.force, ..DiagnoseOptions::default() };
    let found = stylet_api::diagnose(&scenario, &recordings, &options, progress)?;
    drop(limit);
    let output = found.output(&scenario, &inputs)?.with_inputs(read);
    args.results.write_and_print(&folder, &output, || {
        format!("{}\nFitted law: {}", summary(&found.diagnosis), fitted_law(&found.diagnosis))
    })
}
