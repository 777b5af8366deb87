//! `stylet predict`: held-out recordings predicted by a model.

use crate::cli::args::{PredictArgs, RefitArg, SameArg};
use crate::cli::exit_codes::Failure;
use std::fmt::Write as _;
use stylet_api::output_folder::{check_folder, recover_parent};
use stylet_api::prediction_files::{ModelOrigin, output_files};
use stylet_api::transfer::model_file;
use stylet_api::{
    Factor, Prediction, PredictionOptions, Refit, read_options, read_recordings, resource_estimate,
};
use stylet_report::pages::formatting::{significant_or_dash, zero_offset_sentences};
use stylet_report::pages::prediction::{
    group_sentence, refit_sentence, summary_sentence, training_sentence, worse_than_baseline,
};
use stylet_report::significant;
use stylet_scenario::Scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn predict(args: &PredictArgs) -> Result<(), Failure> {
    let file = model_file(&args.model);
    recover_parent(&file)?;
    let model = Scenario::load(&file)?;
    args.limits.check(&file, &resource_estimate::estimate_predict(&args.data), args.results.quiet)?;
    let folder = args.results.output_folder(&file, "-prediction");
    let read = args.results.inputs(
        &file,
        args.data.iter().chain(&args.refit_on).chain(&args.reading.columns).chain(&args.assumed),
    );
    check_folder(&folder, "predict.json", &read)?;
    let ModelOrigin { diagnosis, assumed } = ModelOrigin::of_model_file(&file, args.assumed.as_deref())?;
    let read_options = read_options(args.reading.columns.as_deref(), args.reading.repair)?;
    let recordings = read_recordings(&args.data, &read_options)?;
    let options = PredictionOptions {
        refit: refitted_parameters(args),
        refit_on: read_recordings(&args.refit_on, &read_options)?,
        varying: varying_factors(&args.same),
    };
    let found =
        stylet_api::predict_recordings(&model, diagnosis.as_ref(), assumed.as_ref(), &options, &recordings)?;
    let output = output_files(&model, &file, &found)?.with_inputs(read);
    args.results.write_and_print(&folder, &output, || summary(&found.prediction))
}

fn refitted_parameters(args: &PredictArgs) -> Vec<Refit> {
    if args.refit.is_empty() && !args.refit_on.is_empty() {
        return Refit::ALL.to_vec();
    }
    let parameter = |a: &RefitArg| match a {
        RefitArg::Surface => Refit::Surface,
        RefitArg::Force => Refit::Force,
        RefitArg::Friction => Refit::Friction,
        RefitArg::Puncture => Refit::Puncture,
    };
    args.refit.iter().map(parameter).collect()
}

/// Differences from the training recordings of the model; `None` without `--same`.
pub fn varying_factors(same: &[SameArg]) -> Option<Vec<Factor>> {
    let is_same = |f: &Factor| {
        same.iter().any(|s| match s {
            SameArg::Group => true,
            SameArg::Needle => *f == Factor::Needle,
            SameArg::Tissue => *f == Factor::Tissue,
            SameArg::Setup => *f == Factor::Setup,
        })
    };
    (!same.is_empty()).then(|| Factor::ALL.into_iter().filter(|f| !is_same(f)).collect())
}

fn summary(p: &Prediction) -> String {
    let mut out = format!("{}\n{}\n", summary_sentence(p), group_sentence(p));
    let lines = refit_sentence(p).into_iter().chain(training_sentence(p)).chain(worse_than_baseline(p));
    let zeros = zero_offset_sentences(p.recordings.iter().map(|r| (r.name.as_str(), r.zero_offset_n)));
    for line in lines.chain(zeros) {
        let _ = writeln!(out, "{line}");
    }
    let _ = writeln!(
        out,
        "\n  {:<24} {:>10} {:>10} {:>12} {:>12}",
        "recording", "rms, N", "assumed", "in the band", "peak err, N"
    );
    for r in &p.recordings {
        let before = significant_or_dash(r.assumed_rmse_n, 1.0, 3);
        let _ = writeln!(
            out,
            "  {:<24} {:>10} {:>10} {:>10.0} % {:>12}",
            r.name,
            significant(r.rmse_n, 3),
            before,
            100.0 * r.band_coverage,
            significant(r.peak_error_n, 2)
        );
        let factors =
            [("force", r.force_factor), ("friction", r.friction_factor), ("puncture", r.puncture_factor)];
        let factors =
            factors.iter().filter_map(|(what, x)| Some(format!("{what} x {}", significant((*x)?, 3))));
        let surface = r.surface_shift_m.map(|m| format!("surface {:+.2} mm", 1e3 * m));
        let fitted: Vec<String> = surface.into_iter().chain(factors).collect();
        if !fitted.is_empty() {
            let _ = writeln!(out, "    {}", fitted.join(", "));
        }
    }
    let _ = writeln!(
        out,
        "\n  noise {} N; the band includes {}",
        significant(p.floor_n, 3),
        p.band_includes.join(", ")
    );
    for b in &p.baselines {
        let what = match b.name.as_str() {
            "mean_curve" => "mean curve of the recordings that made the model, at this speed",
            _ => "mean of the recordings that made the model at other speeds, stretched",
        };
        let _ = writeln!(out, "  {what}: {} N rms", significant(b.rmse_n, 3));
    }
    if !p.held_out {
        let _ = writeln!(
            out,
            "  re-fitted to the predicted recording itself; with two or more each is predicted by the values from the others"
        );
    }
    out
}
