//! `stylet predict`: a model against recordings that took no part in making it.

use crate::args::{Again, PredictArgs};
use crate::exit::Failure;
use std::fmt::Write as _;
use stylet_api::folder::settle_beside;
use stylet_api::prediction::{Origin, output};
use stylet_api::{Prediction, Refit, need, read_all, read_options};
use stylet_pages::prediction::sentence;
use stylet_pages::words::shown;
use stylet_report::significant;
use stylet_scenario::Scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn predict(args: &PredictArgs) -> Result<(), Failure> {
    settle_beside(&args.model)?;
    let model = Scenario::load(&args.model)?;
    args.limits.allow(&args.model, &need::of_predict(&args.data), args.results.quiet)?;
    let Origin { diagnosis, believed } = Origin::beside(&args.model, args.believed.as_deref())?;
    let evidence = read_all(&args.data, &read_options(args.columns.as_deref(), args.repair)?)?;
    let refit: Vec<Refit> = args
        .refit
        .iter()
        .map(|a| match a {
            Again::Friction => Refit::Friction,
            Again::Surface => Refit::Surface,
        })
        .collect();
    let found = stylet_api::forecast(&model, diagnosis.as_ref(), believed.as_ref(), &refit, &evidence)?;
    let folder = args.results.folder(&args.model, "-prediction");
    args.results.conclude(&folder, &output(&model, &args.model, &found)?, || summary(&found.prediction))
}

fn summary(p: &Prediction) -> String {
    let mut out = format!("{}\n", sentence(p));
    let _ = writeln!(
        out,
        "\n  {:<24} {:>10} {:>10} {:>12} {:>12}",
        "recording", "left, N", "believed", "in the band", "peak off, N"
    );
    for r in &p.recordings {
        let before = shown(r.believed_rmse_n, 1.0, 3);
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
