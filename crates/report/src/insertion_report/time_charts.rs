//! Charts of force, detection and motion over time, and of force over depth.

use super::model::{Combination, RunReport};
use crate::chart_model::{
    Band, Chart, Lane, Level, LineStyle, MarkerSet, Scale, Series, Side, Span, finite_extent,
};
use crate::page_model::Section;
use crate::palette::Colour;
use stylet_stats::number_format::significant;

/// Group of the charts over time: they share zoom and cursor.
pub(super) const TIME: &str = "time";
pub(super) const TIME_LABEL: &str = "Time (s)";
/// State of the detection in which the tip is unloaded.
const FREE_TIP: &str = "FreeTip";
/// Name of the detector whose alarms are drawn on its statistic.
const CUSUM: &str = "CUSUM";

pub(super) fn force_section(report: &RunReport) -> Section {
    Section::new("Force").chart(force_chart(report))
}

/// Measured, reconstructed, enhanced and true tip force with layers, ruptures and detections.
pub(super) fn force_chart(report: &RunReport) -> Chart {
    let mut chart = Chart::new("Force at the needle", TIME_LABEL, "Force (N)").group(TIME).height(430);
    let single = report.combinations.len() <= 1;
    chart.series.extend(measured_series(report, &report.time_s, 3.0));
    for (index, combination) in report.combinations.iter().enumerate() {
        let force = combination.reconstructed_force_n.clone();
        let colour = if single { Colour::Orange } else { Colour::nth(index) };
        let name = report.label(combination, "reconstructed");
        let series = Series::line(name, colour, report.time_s.clone(), force).width(1.1).hidden(!single);
        chart = chart.with_series(if single { series } else { series.styled(LineStyle::Dashed) });
    }
    for (index, combination) in report.combinations.iter().enumerate() {
        let force = combination.enhanced_force_n.clone();
        let name = report.label(combination, "enhanced");
        let series = Series::line(name, Colour::nth(index), report.time_s.clone(), force).width(1.8);
        chart = chart.with_series(report.visible_below(series, index));
        if single {
            // 95 % interval of the tip force.
            for (name, edge_n) in
                [("2.5 %", &combination.tip_force_low_n), ("97.5 %", &combination.tip_force_high_n)]
            {
                let edge = Series::line(name, Colour::SkyBlue, report.time_s.clone(), edge_n.clone());
                chart = chart.with_series(edge.width(0.8).styled(LineStyle::Dashed));
            }
        }
    }
    if let Some(truth) = &report.truth {
        let tip =
            Series::line("true tip force", Colour::Ink, report.time_s.clone(), truth.tip_force_n.clone());
        chart = chart.with_series(tip.styled(LineStyle::Dashed).width(1.6));
    }
    chart.series.retain(|series| series.y.iter().any(|y| y.is_finite()));
    if report.truth.is_none() {
        chart.caption = "Shaded: detected layers.".to_owned();
    }
    with_events(chart.with_bands(layer_bands(report)), report, true)
}

/// The measured force of every sensor over the given abscissa.
fn measured_series(report: &RunReport, x: &[f64], width_px: f64) -> Vec<Series> {
    let several = report.forces.len() > 1;
    let series = report.forces.iter().enumerate().map(|(index, trace)| {
        let name = if several { format!("measured · {}", trace.sensor) } else { "measured".to_owned() };
        let colour = if index == 0 { Colour::Grey } else { Colour::SkyBlue };
        Series::line(name, colour, x.to_vec(), trace.force_n.clone()).width(width_px)
    });
    series.collect()
}

/// True ruptures, detections and compensations as vertical lines. With several combinations only the labelled chart
/// shows the detections, because the lines would hide the curves.
pub(super) fn with_events(chart: Chart, report: &RunReport, labels: bool) -> Chart {
    let text = |label: String| if labels { label } else { String::new() };
    let marks = report.truth.iter().flat_map(|truth| &truth.ruptures);
    let mut chart = chart.with_markers(MarkerSet {
        name: "true rupture".to_owned(),
        colour: Colour::Ink,
        style: LineStyle::Solid,
        side: Side::Left,
        marks: marks.map(|r| (r.time_s, text(format!("rupture {}: {}", r.layer, r.cause)))).collect(),
    });
    let many = report.combinations.len() > 1;
    if many && !labels {
        return chart;
    }
    for (index, combination) in report.combinations.iter().enumerate() {
        let colour = if many { Colour::nth(index) } else { Colour::Vermillion };
        let detections = combination.detections.iter();
        chart = chart.with_markers(MarkerSet {
            name: report.label(combination, "detected"),
            colour,
            style: LineStyle::Dashed,
            side: Side::Right,
            marks: detections.map(|d| (d.time_s, text(detection_label(report, combination, d)))).collect(),
        });
        if !many {
            chart = chart.with_markers(MarkerSet {
                name: "compensated".to_owned(),
                colour: Colour::Purple,
                style: LineStyle::Dotted,
                side: Side::Right,
                marks: combination.compensations_s.iter().map(|t| (*t, String::new())).collect(),
            });
        }
    }
    chart
}

fn detection_label(
    report: &RunReport,
    combination: &Combination,
    detection: &super::model::Detection,
) -> String {
    let delay = combination.score.as_ref().and_then(|score| {
        let rupture = score.ruptures.iter().find(|r| Some(r.layer) == detection.matched_layer)?;
        rupture.delay_s
    });
    match delay {
        Some(delay_s) => {
            let sign = if delay_s >= 0.0 { "+" } else { "−" };
            format!("found {sign}{} ms", significant(delay_s.abs() * 1e3, 2))
        }
        None if report.truth.is_some() => "false".to_owned(),
        None => format!("{} s", significant(detection.time_s, 4)),
    }
}

/// The layers over time: true ones, or the intervals between contact and detections of the first combination.
pub(super) fn layer_bands(report: &RunReport) -> Vec<Band> {
    let end = report.end_s();
    let band = |(index, (from, to, label)): (usize, (f64, f64, String))| Band {
        from,
        to,
        label,
        colour: Colour::area(index),
    };
    if let Some(truth) = &report.truth {
        let entered = truth.layers.iter().filter_map(|layer| {
            let from = layer.entered_s?;
            Some((from, layer.ruptured_s.unwrap_or(end), layer.name.clone()))
        });
        return entered.enumerate().map(band).collect();
    }
    let Some(combination) = report.combinations.first() else { return Vec::new() };
    let Some(contact) = combination.contact_s else { return Vec::new() };
    let mut faces = vec![contact];
    faces.extend(combination.detections.iter().map(|d| d.time_s));
    faces.push(end);
    // In a gap and beyond the last layer the tip is free.
    let free = |from: f64, to: f64| {
        combination.states.iter().find(move |s| s.state == FREE_TIP && s.from_s >= from && s.from_s < to)
    };
    let spans = faces.windows(2).enumerate().map(|(i, pair)| {
        let from = free(pair[0], pair[1]).map_or(pair[0], |s| s.to_s.min(pair[1]));
        (from, pair[1], format!("layer {}", i + 1))
    });
    spans.enumerate().map(band).filter(|b| b.to > b.from).collect()
}

/// Detection states, CUSUM statistic and force derivative. The algorithms differ in the unit of their statistic, so there may be a
/// chart for each.
pub(super) fn detection_section(report: &RunReport) -> Section {
    let has = |normalised: bool| report.combinations.iter().any(|c| c.cusum_is_normalised == normalised);
    let mut section = Section::new("Detection").chart(state_chart(report));
    if has(true) {
        let chart = Chart::new("CUSUM, largest statistic divided by its threshold", TIME_LABEL, "g")
            .caption("The statistic restarts with each alarm; an alarm is drawn at the threshold. Logarithmic above the threshold.");
        section = section.chart(cusum_chart(report, chart, true));
    }
    if has(false) || report.combinations.is_empty() {
        let chart = Chart::new("CUSUM of the reconstruction error", TIME_LABEL, "g (N²)").caption(
            "The statistic restarts with each alarm; an alarm is drawn at the value that raised it. Logarithmic above the threshold.",
        );
        let derivative = with_curves(
            Chart::new("Force derivative", TIME_LABEL, "df/dt (N/s)")
                .caption("Logarithmic above the threshold."),
            report,
            |c| c.force_derivative_n_per_s.clone(),
            |c| vec![(c.derivative_on_n_per_s, "on"), (c.derivative_off_n_per_s, "off")],
        );
        section = section.chart(cusum_chart(report, chart, false)).chart(with_events(
            asinh_above_threshold(derivative),
            report,
            false,
        ));
    }
    section
}

/// The statistic of the combinations that give it normalised, or of those that give it in N².
fn cusum_chart(report: &RunReport, chart: Chart, normalised: bool) -> Chart {
    let selected = |c: &Combination| c.cusum_is_normalised == normalised;
    let chart = with_curves(
        chart,
        report,
        |c| if selected(c) { cusum_with_alarms(report, c) } else { Vec::new() },
        |c| vec![(c.cusum_threshold_n2.filter(|_| selected(c)), "alarm")],
    );
    with_events(asinh_above_threshold(chart), report, false)
}

/// The recorded statistic with the value that raised each alarm. The algorithm restarts the sum within the sample of the alarm and
/// records the restarted value; here `g + e² - nu` is restored from the sample before, the reconstruction error and the drift.
fn cusum_with_alarms(report: &RunReport, combination: &Combination) -> Vec<f64> {
    let mut g = combination.cusum_n2.clone();
    let trace = report.forces.iter().find(|f| f.sensor == combination.sensor).or(report.forces.first());
    for detection in combination.detections.iter().filter(|d| d.trigger == CUSUM) {
        let index = report.time_s.partition_point(|t| *t < detection.time_s);
        if report.time_s.get(index) != Some(&detection.time_s) {
            continue; // A thinned report does not contain every sample.
        }
        let before = index.checked_sub(1).and_then(|i| g.get(i)).copied();
        let force_n = trace.and_then(|t| t.force_n.get(index));
        let alarm =
            match (before, force_n, combination.reconstructed_force_n.get(index), combination.cusum_drift_n2)
            {
                (Some(before), Some(f), Some(r), Some(drift_n2)) => before + (f - r) * (f - r) - drift_n2,
                _ => f64::NAN,
            };
        if let (Some(value), Some(threshold)) = (g.get_mut(index), combination.cusum_threshold_n2) {
            *value = value.max(alarm).max(threshold);
        }
    }
    g
}

/// Linear up to the smallest positive threshold, logarithmic above.
fn asinh_above_threshold(chart: Chart) -> Chart {
    let threshold = chart.levels.iter().map(|level| level.y).find(|y| *y > 0.0);
    Chart { scale: threshold.map_or(Scale::Linear, Scale::Asinh), ..chart }
}

/// One curve per combination and each distinct threshold once.
fn with_curves(
    chart: Chart,
    report: &RunReport,
    column: impl Fn(&Combination) -> Vec<f64>,
    levels: impl Fn(&Combination) -> Vec<(Option<f64>, &'static str)>,
) -> Chart {
    let mut chart = chart.group(TIME).height(210).with_bands(unlabelled(layer_bands(report)));
    for (index, combination) in report.combinations.iter().enumerate() {
        let name = chart.y_label.split(" (").next().unwrap_or_default().to_owned();
        let values = column(combination);
        if !values.is_empty() {
            let name = report.label(combination, &name);
            let series = Series::line(name, Colour::nth(index), report.time_s.clone(), values);
            chart = chart.with_series(report.visible_below(series, index));
        }
        for (level, label) in levels(combination) {
            let Some(y) = level else { continue };
            if chart.levels.iter().all(|known| known.y.to_bits() != y.to_bits()) {
                let label = format!("{label} {}", significant(y, 3));
                chart = chart.with_level(Level {
                    y,
                    label,
                    colour: Colour::Vermillion,
                    style: LineStyle::Dashed,
                });
            }
        }
    }
    chart
}

pub(super) fn unlabelled(bands: Vec<Band>) -> Vec<Band> {
    bands.into_iter().map(|band| Band { label: String::new(), ..band }).collect()
}

/// The states of the detection as coloured rows, one per combination.
pub(super) fn state_chart(report: &RunReport) -> Chart {
    let many = report.combinations.len() > 1;
    let lanes: Vec<Lane> = report
        .combinations
        .iter()
        .filter(|combination| !combination.states.is_empty())
        .map(|combination| Lane {
            name: if many { combination.name.clone() } else { String::new() },
            spans: combination
                .states
                .iter()
                .map(|s| Span {
                    from: s.from_s,
                    to: s.to_s,
                    label: s.state.clone(),
                    colour: state_colour(&s.state),
                })
                .collect(),
        })
        .collect();
    let row: u32 = if many { 52 } else { 34 };
    let height = 48 + row * u32::try_from(lanes.len()).unwrap_or(1);
    Chart { lanes, ..Chart::new("State of the detection", TIME_LABEL, "State").group(TIME).height(height) }
}

fn state_colour(state: &str) -> Colour {
    match state {
        "NoRupture" => Colour::Grey,
        "ExpectedRupture" => Colour::Yellow,
        "DetectedRupture" => Colour::Vermillion,
        "ForceDropMeasuring" => Colour::Orange,
        "ForceCompensation" => Colour::Purple,
        _ => Colour::SkyBlue,
    }
}

pub(super) fn motion_section(report: &RunReport) -> Section {
    let millimetres: Vec<f64> = report.position_m.iter().map(|z| z * 1e3).collect();
    let speeds: Vec<f64> = report.velocity_mps.iter().map(|v| v * 1e3).collect();
    let time = |title: &str, axis: &str, name: &str, values: Vec<f64>| {
        let chart = Chart::new(title, TIME_LABEL, axis).group(TIME).height(180);
        let chart = chart.with_bands(unlabelled(layer_bands(report)));
        chart.with_series(Series::line(name, Colour::Blue, report.time_s.clone(), values))
    };
    Section::new("Motion and depth")
        .chart(time("Position", "z (mm)", "tip position", millimetres.clone()))
        .chart(Chart { y_range: with_zero(&speeds), ..time("Velocity", "v (mm/s)", "tip velocity", speeds) })
        .chart(depth_chart(report, millimetres))
}

/// The range of the values including zero, so that noise on a constant does not fill the chart.
fn with_zero(values: &[f64]) -> Option<(f64, f64)> {
    finite_extent(values.iter().copied().chain([0.0])).filter(|(low, high)| low < high)
}

fn depth_chart(report: &RunReport, depth_mm: Vec<f64>) -> Chart {
    let mut chart = Chart::new("Force against depth", "Depth of the tip (mm)", "Force (N)").height(380);
    chart.parametric = true;
    chart.series.extend(measured_series(report, &depth_mm, 1.2));
    for (index, combination) in report.combinations.iter().enumerate() {
        let name = report.label(combination, "enhanced");
        let force = combination.enhanced_force_n.clone();
        let series = Series::line(name, Colour::nth(index), depth_mm.clone(), force).width(1.8);
        chart = chart.with_series(report.visible_below(series, index));
    }
    if let Some(truth) = &report.truth {
        let tip = Series::line("true tip force", Colour::Ink, depth_mm, truth.tip_force_n.clone());
        chart = chart.with_series(tip.styled(LineStyle::Dashed).width(1.6));
        chart.bands = truth
            .layers
            .iter()
            .enumerate()
            .map(|(index, layer)| Band {
                from: layer.front_m * 1e3,
                to: (layer.front_m + layer.thickness_m) * 1e3,
                label: layer.name.clone(),
                colour: Colour::area(index),
            })
            .collect();
        let marks =
            truth.ruptures.iter().map(|r| (r.depth_m * 1e3, format!("rupture {}", r.layer))).collect();
        chart = chart.with_markers(MarkerSet {
            name: "true rupture".to_owned(),
            colour: Colour::Ink,
            style: LineStyle::Solid,
            side: Side::Left,
            marks,
        });
    }
    for (index, combination) in report.combinations.iter().enumerate() {
        let colour = if report.combinations.len() > 1 { Colour::nth(index) } else { Colour::Vermillion };
        chart = chart.with_markers(MarkerSet {
            name: report.label(combination, "detected"),
            colour,
            style: LineStyle::Dashed,
            side: Side::Right,
            marks: combination.detections.iter().map(|d| (d.depth_m * 1e3, String::new())).collect(),
        });
    }
    chart.series.retain(|series| !series.y.is_empty());
    chart
}
