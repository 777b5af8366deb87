//! Charts of the online estimates against the truth: stiffness, friction, cumulative friction.

use super::model::{Combination, LayerEstimate, RunReport, TrueLayer};
use super::time_charts::{TIME, TIME_LABEL, layer_bands, unlabelled, with_events};
use crate::chart_model::{Chart, LineStyle, Series, finite_extent};
use crate::page_model::Section;
use crate::palette::Colour;

/// An estimated quantity: accessors for the online, final and true values.
struct Quantity {
    title: &'static str,
    caption: &'static str,
    axis: &'static str,
    symbol: &'static str,
    online: fn(&Combination) -> &Vec<f64>,
    at_end: fn(&LayerEstimate) -> Option<f64>,
    truth: fn(&TrueLayer) -> f64,
}

const STIFFNESS: Quantity = Quantity {
    title: "Stiffness K",
    caption: "Line: online estimate, restarted at every detection; the transient after a restart may exceed the axis. Points: final \
              estimate of the layer, re-weighted after its rupture, drawn at the middle of the layer. Where the velocity is constant, online \
              K and b are not separable: the line then contains the friction too, until the force drop at the rupture separates them.",
    axis: "K (N/m)",
    symbol: "K",
    online: |c| &c.stiffness_n_per_m,
    at_end: |l| l.stiffness_n_per_m,
    truth: |l| l.stiffness_n_per_m,
};
const FRICTION_ML: Quantity = Quantity {
    title: "Friction b, multi-layer model",
    caption: "Per metre of needle inside the layer. Where the velocity is constant it is not separable from K before the rupture.",
    axis: "b (N s/m²)",
    symbol: "b",
    online: |c| &c.friction_ns_per_m2,
    at_end: |l| l.friction_ns_per_m2,
    truth: |l| l.friction_ns_per_m2,
};
const FRICTION_KV: Quantity = Quantity {
    title: "Friction b, Kelvin-Voigt model",
    caption: "Of the whole layer; the truth shown is b times thickness.",
    axis: "b (N s/m)",
    symbol: "b",
    online: |c| &c.friction_ns_per_m,
    at_end: |l| l.friction_ns_per_m,
    truth: |l| l.friction_ns_per_m2 * l.thickness_m,
};

pub(super) fn section(report: &RunReport) -> Section {
    let charts = [STIFFNESS, FRICTION_ML, FRICTION_KV].map(|quantity| quantity_chart(report, &quantity));
    charts.into_iter().fold(Section::new("Estimates"), Section::chart).chart(cumulative_chart(report))
}

pub(super) fn stiffness_chart(report: &RunReport) -> Chart {
    quantity_chart(report, &STIFFNESS)
}

fn quantity_chart(report: &RunReport, quantity: &Quantity) -> Chart {
    let chart = Chart::new(quantity.title, TIME_LABEL, quantity.axis)
        .caption(quantity.caption)
        .group(TIME)
        .height(230);
    let mut chart = chart.with_bands(unlabelled(layer_bands(report)));
    for (index, combination) in report.combinations.iter().enumerate() {
        let values = (quantity.online)(combination);
        if !values.is_empty() {
            let name = report.label(combination, &format!("{} online", quantity.symbol));
            let series = Series::line(name, Colour::nth(index), report.time_s.clone(), values.clone());
            chart = chart.with_series(report.visible_below(series, index));
        }
    }
    if chart.series.is_empty() {
        return chart;
    }
    if let Some(truth) = &report.truth {
        let (x, y) = true_steps(&truth.layers, quantity.truth, report.end_s());
        chart = chart.with_series(Series::step("truth", Colour::Ink, x, y).width(1.8));
    }
    for (index, combination) in report.combinations.iter().enumerate() {
        let ready = combination
            .layers
            .iter()
            .filter_map(|l| (quantity.at_end)(l).map(|value| (middle_s(combination, l), value)));
        let (x, y): (Vec<f64>, Vec<f64>) = ready.unzip();
        if !x.is_empty() {
            let colour = if report.combinations.len() > 1 { Colour::nth(index) } else { Colour::Vermillion };
            let series = Series::points(report.label(combination, "re-weighted"), colour, x, y);
            chart = chart.with_series(report.visible_below(series, index));
        }
    }
    chart.y_range = robust_range(&chart);
    with_events(chart, report, false)
}

/// Middle of the interval in which the tip was in the layer, from contact and detections where known.
fn middle_s(combination: &Combination, layer: &LayerEstimate) -> f64 {
    let detected = |index: usize| combination.detections.get(index).map(|d| d.time_s);
    let from = if layer.layer < 2 { combination.contact_s } else { detected(layer.layer - 2) };
    match (from, detected(layer.layer.saturating_sub(1))) {
        (Some(from), Some(to)) => f64::midpoint(from, to),
        _ => layer.time_s,
    }
}

/// The true value of the active layer as steps, with gaps where no layer is active.
fn true_steps(layers: &[TrueLayer], value: fn(&TrueLayer) -> f64, end_s: f64) -> (Vec<f64>, Vec<f64>) {
    let mut x = Vec::new();
    let mut y = Vec::new();
    for layer in layers {
        let Some(from) = layer.entered_s else { continue };
        x.extend([from, layer.ruptured_s.unwrap_or(end_s)]);
        y.extend([value(layer), value(layer)]);
    }
    (x, y)
}

/// The vertical range without the transients after a restart: that of truth and final values, extended to the 5th to 95th
/// percentile of the curve and to zero.
fn robust_range(chart: &Chart) -> Option<(f64, f64)> {
    let settled =
        chart.series.iter().filter(|s| s.style != LineStyle::Solid).flat_map(|s| s.y.iter().copied());
    let settled = finite_extent(settled);
    let (mut low, mut high) = settled.unwrap_or((0.0, 0.0));
    for series in chart.series.iter().filter(|s| s.style == LineStyle::Solid) {
        let values = stylet_stats::sorted(series.y.iter().copied().filter(|v| v.is_finite()));
        // `min` and `max` ignore a NaN quantile.
        low = low.min(stylet_stats::quantile_of_sorted(&values, 0.05));
        high = high.max(stylet_stats::quantile_of_sorted(&values, 0.95));
    }
    if let Some((_, top)) = settled.filter(|(_, top)| *top > 0.0) {
        high = high.min(2.0 * top);
        low = low.max(-0.5 * top);
    }
    (high > low.min(0.0)).then_some((low.min(0.0), high))
}

fn cumulative_chart(report: &RunReport) -> Chart {
    let chart = Chart::new("Cumulative friction D", TIME_LABEL, "D (N s/m)");
    let chart = chart
        .caption("Friction of the ruptured layers, subtracted by the enhancement.")
        .group(TIME)
        .height(210);
    let mut chart = chart.with_bands(unlabelled(layer_bands(report)));
    for (index, combination) in report.combinations.iter().enumerate() {
        let values = combination.cumulative_friction_ns_per_m.clone();
        if !values.is_empty() {
            let name = report.label(combination, "D");
            let series = Series::step(name, Colour::nth(index), report.time_s.clone(), values);
            chart = chart.with_series(report.visible_below(series, index));
        }
    }
    if let Some(truth) = report.truth.as_ref().filter(|truth| !truth.cumulative_friction_ns_per_m.is_empty())
    {
        let values = truth.cumulative_friction_ns_per_m.clone();
        chart = chart.with_series(
            Series::step("truth", Colour::Ink, report.time_s.clone(), values).styled(LineStyle::Dashed),
        );
    }
    with_events(chart, report, false)
}
