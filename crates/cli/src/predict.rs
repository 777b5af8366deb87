//! `stylet predict`: a model against recordings that took no part in making it.

use crate::args::{Again, PredictArgs};
use crate::exit::Failure;
use crate::output::Output;
use crate::plan::{Inputs, read_all};
use crate::terminal::say;
use crate::{limits, predict_page};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stylet_api::{Diagnosis, Prediction, Refit};
use stylet_record::ReadOptions;
use stylet_report::significant;
use stylet_scenario::Scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn predict(args: &PredictArgs) -> Result<(), Failure> {
    let model = Scenario::load(&args.model)?;
    args.limits.allow(&args.model, &limits::of_predict(&args.data), args.results.quiet)?;
    let beside = args.model.parent().unwrap_or(Path::new("."));
    let diagnosis = diagnosis(&beside.join("diagnosis.json"))?;
    let believed = believed(args, beside)?;
    let columns = match &args.columns {
        Some(path) => Some(stylet_scenario::load(path)?),
        None => None,
    };
    let evidence = read_all(&args.data, &ReadOptions { columns, repair: args.repair })?;
    let refit: Vec<Refit> = args
        .refit
        .iter()
        .map(|a| match a {
            Again::Friction => Refit::Friction,
            Again::Surface => Refit::Surface,
        })
        .collect();
    let found = stylet_api::forecast(&model, diagnosis.as_ref(), believed.as_ref(), &refit, &evidence)?;
    let mut output = Output::default();
    output.add("report.html", predict_page::page(&model, args, &found).to_html());
    let mut json =
        serde_json::to_vec_pretty(&found.prediction).map_err(|e| Failure::Internal(e.to_string()))?;
    json.push(b'\n');
    output.add("predict.json", json);
    let folder = args.results.out.clone().unwrap_or_else(|| {
        let stem = args.model.file_stem().unwrap_or(args.model.as_os_str()).to_string_lossy().into_owned();
        PathBuf::from("stylet-out").join(format!("{stem}-prediction"))
    });
    output.write(&folder)?;
    if !args.results.quiet {
        say(&format!("{}\nReport: {}\n", summary(&found.prediction), folder.join("report.html").display()))?;
    }
    Ok(())
}

/// The diagnosis that a model came from, if it lies beside it.
fn diagnosis(path: &Path) -> Result<Option<Diagnosis>, Failure> {
    let Ok(text) = std::fs::read_to_string(path) else { return Ok(None) };
    serde_json::from_str(&text)
        .map(Some)
        .map_err(|e| Failure::Check(format!("{}: {e}; make the diagnosis anew", path.display())))
}

/// What was believed before: as said, or as the folder of the diagnosis says. A file that is gone since is nobody's error.
fn believed(args: &PredictArgs, beside: &Path) -> Result<Option<Scenario>, Failure> {
    if let Some(path) = &args.believed {
        return Ok(Some(Scenario::load(path)?));
    }
    let Ok(inputs) = Inputs::of_folder(beside) else { return Ok(None) };
    Ok(Scenario::load(&inputs.scenario).ok())
}

/// How good a prediction is, in a sentence.
pub fn sentence(p: &Prediction) -> String {
    let ratio = p.rmse_n / p.floor_n.max(1e-300);
    let within = format!(
        "{} N rms are left, {} times the noise; the 90 % band holds {:.0} %",
        significant(p.rmse_n, 3),
        significant(ratio, 2),
        100.0 * p.band_coverage
    );
    let how = if ratio < 1.2 && p.band_coverage >= 0.8 {
        "The model predicts these recordings to within the noise"
    } else if p.band_coverage >= 0.8 {
        "The model predicts these recordings as well as its own scatter allows"
    } else {
        "The model misses something of these recordings"
    };
    format!("{how}: {within}.")
}

fn summary(p: &Prediction) -> String {
    let mut out = format!("{}\n", sentence(p));
    let _ = writeln!(
        out,
        "\n  {:<24} {:>10} {:>10} {:>12} {:>12}",
        "recording", "left, N", "believed", "in the band", "peak off, N"
    );
    for r in &p.recordings {
        let before = r.believed_rmse_n.map_or("-".to_owned(), |x| significant(x, 3));
        let _ = writeln!(
            out,
            "  {:<24} {:>10} {:>10} {:>10.0} % {:>12}",
            r.name,
            significant(r.rmse_n, 3),
            before,
            100.0 * r.band_coverage,
            significant(r.peak_error_n, 2)
        );
        if let Some(m) = r.surface_shift_m {
            let _ = writeln!(out, "    surface {:+.2} mm", 1e3 * m);
        }
        if let Some(factor) = r.friction_factor {
            let _ = writeln!(out, "    friction x {}", significant(factor, 3));
        }
    }
    let _ = writeln!(
        out,
        "\n  noise {} N; the band holds {}",
        significant(p.floor_n, 3),
        p.band_holds.join(", ")
    );
    if !p.held_out {
        let _ = writeln!(
            out,
            "  re-fitted to the recording that is predicted: give two or more, and each is predicted by what the others say"
        );
    }
    out
}
