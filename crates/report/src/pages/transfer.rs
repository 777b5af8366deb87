//! The page of a comparison of two groups of recordings, and its sentences for the terminal.

use crate::chart_model::{Chart, LineStyle, Series};
use crate::page_model::{Cell, Page, Section, Status, Table, Tile};
use crate::pages::formatting::zero_offset_sentences;
use crate::palette::Colour;
use stylet_diagnose::prediction::{
    MAX_MISFIT_RATIO, ParameterTransfer, PredictionCurves, Refit, Transfer, TransferResult, TransferVerdict,
};
use stylet_scenario::Scenario;
use stylet_stats::number_format::significant;

/// Largest number of recordings with individual charts.
const MAX_CHARTED: usize = 6;
/// Distance (m) from the deepest position within which the needle is in its hold.
const HOLD_M: f64 = 1e-4;

/// The page of the comparison of recordings with `model`, which was read from `file`.
#[must_use]
pub fn page(model: &Scenario, file: &str, found: &TransferResult) -> Page {
    let t = &found.transfer;
    let mut charts = Section::new("Force over depth");
    for (r, (before, after)) in
        t.recordings.iter().zip(found.before.iter().zip(&found.after)).take(MAX_CHARTED)
    {
        for (phase, range) in phases(&after.position_m) {
            charts = charts.chart(force(&r.name, phase, before, after, range));
        }
    }
    if t.recordings.len() > MAX_CHARTED {
        charts = charts.text(format!(
            "The other {} recordings are listed in the table only.",
            t.recordings.len() - MAX_CHARTED
        ));
    }
    Page::new(format!("Comparison with {}", model.name))
        .subtitle(summary_sentence(t))
        .fact("model", file)
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(overview(t))
        .section(charts)
}

/// The comparison in one sentence.
#[must_use]
pub fn summary_sentence(t: &Transfer) -> String {
    let named = |differs: bool, text: &dyn Fn(&ParameterTransfer) -> String| -> Option<String> {
        let each: Vec<String> = t.parameters.iter().filter(|p| p.differs == differs).map(text).collect();
        (!each.is_empty()).then(|| each.join(", "))
    };
    let different = named(true, &|p| difference(p.parameter, p.value, p.low, p.high));
    let equal = named(false, &|p| name(p.parameter).to_owned());
    match t.verdict {
        TransferVerdict::AnotherModel => format!(
            "Another law: with all parameters of every recording updated the model is off by {} N rms, {} times its error on its own \
             recordings.",
            significant(t.own_n, 3),
            significant(t.misfit_ratio, 2)
        ),
        TransferVerdict::Ambiguous => format!(
            "The groups differ (probability {}), but the recordings do not show in which parameter.",
            significant(1.0 - t.probability_same, 2)
        ),
        TransferVerdict::Same => {
            format!(
                "No difference from the model's group found (probability that there is none: {}).",
                significant(t.probability_same, 2)
            )
        }
        TransferVerdict::Differs => {
            let equal = equal.map_or_else(String::new, |e| format!("; {e}: no difference found"));
            format!("The group differs from the model's: {}{equal}.", different.unwrap_or_default())
        }
    }
}

/// Limits of the comparison.
#[must_use]
pub fn warnings(t: &Transfer) -> Vec<String> {
    let mut out = Vec::new();
    out.extend(zero_offset_sentences(t.recordings.iter().map(|r| (r.name.as_str(), r.zero_offset_n))));
    let made: Vec<&str> =
        t.recordings.iter().filter(|r| r.is_training_recording).map(|r| r.name.as_str()).collect();
    if !made.is_empty() {
        out.push(format!("The model was fitted to {}, which hides differences.", made.join(", ")));
    }
    if t.is_unseen_speed {
        out.push(
            "The model has no recordings at this speed: a different force can also be a wrong dependence on speed."
                .to_owned(),
        );
    }
    out
}

/// Name of a parameter.
#[must_use]
pub const fn name(parameter: Refit) -> &'static str {
    match parameter {
        Refit::Surface => "surface",
        Refit::Force => "force",
        Refit::Friction => "friction",
        Refit::Puncture => "puncture force",
    }
}

/// A parameter relative to the model's, with its 95 % interval: the shift of the surface in m, else a factor.
#[must_use]
pub fn difference(parameter: Refit, value: f64, low: f64, high: f64) -> String {
    let name = name(parameter);
    if parameter == Refit::Surface {
        return format!("{name} {:+.2} mm ({:+.2} to {:+.2})", 1e3 * value, 1e3 * low, 1e3 * high);
    }
    let number = |x: f64| significant(x, 3);
    format!("{name} x {} ({} to {})", number(value), number(low), number(high))
}

fn overview(t: &Transfer) -> Section {
    let tiles = vec![
        Tile::new(
            "Model",
            format!("{} N", significant(t.before_n, 3)),
            "RMS error (means over 20 ms) on these recordings".to_owned(),
        ),
        Tile::new(
            "Updated model",
            format!("{} N", significant(t.after_n, 3)),
            "the same with all parameters updated".to_owned(),
        ),
        Tile::new(
            "Misfit",
            format!("{} N", significant(t.own_n, 3)),
            "the same with all parameters of every recording updated: misfit without scatter".to_owned(),
        )
        .status(Status::at_most(t.misfit_ratio, MAX_MISFIT_RATIO, MAX_MISFIT_RATIO)),
        Tile::new(
            "Own recordings",
            format!("{} N", significant(t.model_n, 3)),
            format!("RMS error of the model on the {} recordings that made it", t.model_recordings),
        ),
    ];
    let rows = t.parameters.iter().map(|p| {
        vec![
            Cell::text(name(p.parameter)),
            Cell::text(if p.differs { "differs" } else { "no difference found" }).status(if p.differs {
                Status::Warn
            } else {
                Status::Plain
            }),
            Cell::text(
                difference(p.parameter, p.value, p.low, p.high).split_off(name(p.parameter).len() + 1),
            ),
            Cell::number(significant(p.probability, 2)),
        ]
    });
    let recordings = t.recordings.iter().map(|r| {
        vec![
            Cell::text(r.name.clone()),
            Cell::number(significant(r.before_n, 3)),
            Cell::number(significant(r.after_n, 3)),
        ]
    });
    let mut section = Section::new("Differences")
        .tiles(tiles)
        .table(Table::new(
            "Relative to the model; friction and puncture force beyond the factor of all forces",
            &["parameter", "", "difference, 95 %", "probability of a difference"],
            rows.collect(),
        ))
        .table(Table::new("RMS error, N", &["recording", "model", "updated model"], recordings.collect()));
    let warnings = warnings(t);
    if !warnings.is_empty() {
        section = section.warnings(warnings);
    }
    section
}

/// Ranges of the blocks of advance and retraction.
fn phases(position_m: &[f64]) -> Vec<(&'static str, std::ops::Range<usize>)> {
    let deepest_m = position_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let in_hold = |z: &f64| *z > deepest_m - HOLD_M;
    let (Some(first), Some(last)) =
        (position_m.iter().position(in_hold), position_m.iter().rposition(in_hold))
    else {
        return Vec::new();
    };
    [("advance", 0..first + 1), ("retraction", last..position_m.len())]
        .into_iter()
        .filter(|(_, range)| range.len() > 1)
        .collect()
}

fn force(
    name: &str,
    phase: &str,
    before: &PredictionCurves,
    after: &PredictionCurves,
    range: std::ops::Range<usize>,
) -> Chart {
    let of = |y: &[f64]| y.get(range.clone()).unwrap_or(&[]).to_vec();
    let depth_mm: Vec<f64> = of(&after.position_m).iter().map(|z| 1e3 * z).collect();
    let line = |name: &str, colour, y: &[f64]| Series::line(name, colour, depth_mm.clone(), of(y));
    let mut chart = Chart::new(format!("{name}: {phase}"), "Position (mm)", "Force (N)")
        .caption("Dashed: 90 % bands, of the model for an unseen group and of the updated model.")
        .group(name.to_owned())
        .height(300)
        .with_series(line("measured", Colour::Grey, &after.measured_n).width(3.0));
    for (which, colour, edge_colour, curves) in [
        ("model", Colour::Vermillion, Colour::Orange, before),
        ("updated model", Colour::Blue, Colour::SkyBlue, after),
    ] {
        chart = chart.with_series(line(which, colour, &curves.predicted_n).width(1.4));
        for (share, edge) in [("5 %", &curves.low_n), ("95 %", &curves.high_n)] {
            let series = line(&format!("{which}, {share}"), edge_colour, edge);
            chart = chart.with_series(series.width(0.8).styled(LineStyle::Dashed));
        }
    }
    chart
}
