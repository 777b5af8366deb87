//! The panels of an insertion: force above, coefficients below, over one time axis.

use super::figure::FigureRecording;
use crate::algorithm_variant::Variant;
use crate::simulated_insertion::Insertion;
use stylet_core::State;
use stylet_report::svg::{FigureOptions, figure};
use stylet_report::{Chart, Colour, LineStyle, MarkerSet, Series, Side};
use stylet_score::Trace;

const TIME: &str = "Time (s)";

/// A run with the colour that its model has in the paper.
pub(super) struct Run {
    pub variant: Variant,
    pub trace: Trace,
    pub colour: Colour,
}

impl Run {
    pub(super) fn of(recording: &FigureRecording, variant: Variant) -> Self {
        let colour = if variant.kelvin_voigt { Colour::Blue } else { Colour::Vermillion };
        let trace =
            recording.insertion.trace(&recording.force_n, recording.sensor, variant, &recording.tuning);
        Self { variant, trace, colour }
    }

    fn name(&self) -> &'static str {
        self.variant.model_name()
    }
}

fn time(insertion: &Insertion) -> Vec<f64> {
    insertion.simulation.recording.time_s.clone()
}

/// Continuous black lines: ruptures detected; dashed: compensated.
fn event_markers(run: &Run, labels: bool) -> [MarkerSet; 2] {
    let label = |text: String| if labels { text } else { String::new() };
    [
        MarkerSet {
            name: "rupture detected, t_r".to_owned(),
            colour: Colour::Ink,
            style: LineStyle::Solid,
            side: Side::Left,
            marks: run
                .trace
                .detections
                .iter()
                .map(|d| (d.time_s, label(format!("rupture {}", d.layer))))
                .collect(),
        },
        MarkerSet {
            name: "compensated, t_r + T_drop".to_owned(),
            colour: Colour::Ink,
            style: LineStyle::Dashed,
            side: Side::Right,
            marks: run.trace.estimates.iter().map(|e| (e.time_s, String::new())).collect(),
        },
    ]
}

fn with_event_markers(chart: Chart, run: &Run, labels: bool) -> Chart {
    let [detected, compensated] = event_markers(run, labels);
    chart.with_markers(detected).with_markers(compensated)
}

/// Measured (green), predicted, and the force enhanced by every run; markers of the last run.
pub(super) fn force(recording: &FigureRecording, runs: &[Run], enhanced: bool) -> Chart {
    let insertion = &recording.insertion;
    let t = time(insertion);
    let mut chart = Chart::new("(a) Force", TIME, "Force (N)").height(330);
    if let Some(run) = runs.last() {
        let predicted = run.trace.reconstructed_n.iter().zip(&run.trace.stiffness_n_per_m);
        let predicted = predicted.map(|(f, k)| if k.is_finite() { *f } else { f64::NAN }).collect();
        chart = chart
            .with_series(Series::line("predicted (ML)", Colour::Orange, t.clone(), predicted).width(2.6));
    }
    for run in runs.iter().filter(|_| enhanced) {
        let name = format!("enhanced, {}", run.name());
        chart = chart
            .with_series(Series::line(name, run.colour, t.clone(), run.trace.enhanced_n.clone()).width(1.3));
    }
    // Drawn last: the enhanced force equals the measured one until friction is compensated.
    let measured = recording.force_n.clone();
    chart = chart.with_series(Series::line("measured", Colour::Green, t.clone(), measured).width(1.0));
    if enhanced {
        let truth = insertion.simulation.truth.tip_force_n.clone();
        chart = chart.with_series(
            Series::line("true tip force", Colour::Ink, t, truth).styled(LineStyle::Dashed).width(1.2),
        );
    }
    match runs.last() {
        Some(run) => with_event_markers(chart, run, true),
        None => chart,
    }
}

/// Time spans of the layers: from contact or rupture to the next rupture.
fn spans(insertion: &Insertion) -> Vec<(f64, f64, usize)> {
    let truth = &insertion.simulation.truth;
    let end = insertion.simulation.recording.time_s.last().copied().unwrap_or(0.0);
    let mut from = truth.surface_contact_s.unwrap_or(end);
    let mut spans = Vec::new();
    for layer in 0..insertion.layers.len() {
        let until = truth.ruptures.get(layer).map_or(end, |r| r.time_s);
        spans.push((from, until, layer));
        from = until;
    }
    spans
}

/// A value per span, constant over it and followed by a gap.
fn piecewise_constant(spans: impl Iterator<Item = (f64, f64, f64)>) -> (Vec<f64>, Vec<f64>) {
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for (from, to, value) in spans {
        x.extend([from, to, to]);
        y.extend([value, value, f64::NAN]);
    }
    (x, y)
}

/// The a posteriori estimates of a run, each over the time in which its layer was traversed.
fn a_posteriori(
    insertion: &Insertion,
    run: &Run,
    value: impl Fn(&stylet_core::LayerEstimate) -> f64,
) -> (Vec<f64>, Vec<f64>) {
    let contact = run.trace.contact_s.or(insertion.simulation.truth.surface_contact_s).unwrap_or(0.0);
    let ends: Vec<f64> = run.trace.detections.iter().map(|d| d.time_s).collect();
    piecewise_constant(run.trace.estimates.iter().filter_map(|e| {
        let end = *ends.get(e.layer.checked_sub(1)?)?;
        let start = if e.layer == 1 { contact } else { ends.get(e.layer - 2).copied().unwrap_or(contact) };
        Some((start, end, value(e)))
    }))
}

fn truth_line(insertion: &Insertion, value: impl Fn(&stylet_score::LayerTruth) -> f64) -> Series {
    let (x, y) = piecewise_constant(
        spans(insertion).into_iter().map(|(from, to, i)| (from, to, value(&insertion.layers[i]))),
    );
    Series::line("true", Colour::Ink, x, y).styled(LineStyle::Dashed).width(1.6)
}

/// Axis range of truth and a posteriori estimates; the online estimate is clipped to it, except in runs without a posteriori
/// estimates.
fn range(series: &[Series], online: &Series, estimated: bool) -> (f64, f64) {
    let high = series.iter().flat_map(|s| &s.y).copied().filter(|y| y.is_finite()).fold(0.0, f64::max);
    let typical = stylet_stats::quantile_of(online.y.iter().copied().filter(|y| y.is_finite()), 0.9);
    let typical = if typical.is_nan() { 0.0 } else { typical };
    let beyond = if estimated { typical.min(4.0 * high) } else { 1.15 * typical };
    (0.0, (1.15 * high).max(beyond).max(1e-9))
}

fn coefficient(
    insertion: &Insertion,
    runs: &[Run],
    label: &str,
    column: impl Fn(&Trace) -> &Vec<f64>,
    estimate: impl Fn(&stylet_core::LayerEstimate) -> f64,
    truth: Option<Series>,
) -> Chart {
    let mut chart = Chart::new("", TIME, label).height(130);
    let mut kept: Vec<Series> = truth.into_iter().collect();
    let mut high = 0.0f64;
    for run in runs {
        let online = Series::line(
            format!("{} online", run.name()),
            run.colour,
            time(insertion),
            column(&run.trace).clone(),
        )
        .width(0.8);
        let (x, y) = a_posteriori(insertion, run, &estimate);
        kept.push(Series::line(format!("{} a posteriori", run.name()), run.colour, x, y).width(3.2));
        high = high.max(range(&kept, &online, !run.trace.estimates.is_empty()).1);
        chart = chart.with_series(online);
    }
    for series in kept {
        chart = chart.with_series(series);
    }
    chart.y_range = Some((0.0, high));
    match runs.last() {
        Some(run) => with_event_markers(chart, run, false),
        None => chart,
    }
}

/// Elastic, local and cumulative friction coefficients.
pub(super) fn coefficients(insertion: &Insertion, runs: &[Run], cumulative: bool) -> Vec<Chart> {
    let of = |kelvin_voigt: bool| -> Vec<Run> {
        runs.iter()
            .filter(|r| r.variant.kelvin_voigt == kelvin_voigt)
            .map(|r| Run { variant: r.variant, trace: r.trace.clone(), colour: r.colour })
            .collect()
    };
    let mut charts = vec![coefficient(
        insertion,
        runs,
        "K (N/m)",
        |t| &t.stiffness_n_per_m,
        |e| e.stiffness_n_per_m,
        Some(truth_line(insertion, |l| l.stiffness_n_per_m)),
    )];
    if let Some(first) = charts.first_mut() {
        first.title = "(b) Coefficients".to_owned();
    }
    for (kelvin_voigt, label) in [(false, "b, ML (N s/m²)"), (true, "b, KV (N s/m)")] {
        let runs = of(kelvin_voigt);
        if runs.is_empty() {
            continue;
        }
        let truth = match kelvin_voigt {
            false => truth_line(insertion, |l| l.friction_ns_per_m2),
            true => truth_line(insertion, |l| l.friction_ns_per_m2 * l.thickness_m),
        };
        charts.push(coefficient(insertion, &runs, label, |t| &t.friction, |e| e.friction, Some(truth)));
    }
    if cumulative {
        let t = time(insertion);
        let mut chart = Chart::new("", TIME, "D (N s/m)").height(130);
        for run in runs {
            let d = run.trace.cumulative_friction_ns_per_m.clone();
            chart = chart.with_series(
                Series::line(format!("{} a posteriori", run.name()), run.colour, t.clone(), d).width(2.4),
            );
        }
        let truth = insertion.simulation.truth.cumulative_friction_ns_per_m.clone();
        chart = chart
            .with_series(Series::line("true", Colour::Ink, t, truth).styled(LineStyle::Dashed).width(1.6));
        charts.push(match runs.last() {
            Some(run) => with_event_markers(chart, run, false),
            None => chart,
        });
    }
    charts
}

/// The panels as a picture.
pub(super) fn picture(charts: &[Chart], title: &str, subtitle: &str) -> String {
    figure(
        charts,
        &FigureOptions { title: title.to_owned(), subtitle: subtitle.to_owned(), width_px: 1120.0 },
    )
}

/// The states in the order in which they were visited, for the caption.
pub(super) fn reached_compensation(run: &Run) -> bool {
    run.trace.state.contains(&State::ForceCompensation)
}
