//! The numbers behind the plots, one group of columns per combination.

use super::model::{Combination, LayerEstimate, RunReport, Score};
use super::scorecard::{delay_status, error_status, millimetres, milliseconds};
use crate::page_model::{Cell, Section, Status, Table};
use stylet_stats::number_format::{percent, plus_minus, significant};

pub(super) fn section(report: &RunReport) -> Section {
    Section::new("Numbers")
        .table(if report.truth.is_some() { rupture_table(report) } else { detection_table(report) })
        .table(layer_table(report))
        .table(overall_table(report))
}

fn dash() -> Cell {
    Cell::number("–")
}

fn number(value: Option<f64>, scale: f64) -> Cell {
    doubted(value, None, scale)
}

/// A number with what it may be off by with 95 % probability, where that is known.
fn doubted(value: Option<f64>, doubt: Option<f64>, scale: f64) -> Cell {
    value.map_or_else(dash, |v| Cell::number(plus_minus(v * scale, doubt.map(|d| d * scale), 4)))
}

fn error(value: Option<f64>) -> Cell {
    value.map_or_else(dash, |e| Cell::number(percent(e)).status(error_status(e)))
}

/// Empty heads over the shared columns, then one over each combination's; none when there is only one.
fn groups(report: &RunReport, shared: usize, each: usize) -> Vec<(String, usize)> {
    if report.combinations.len() < 2 {
        return Vec::new();
    }
    let names = report.combinations.iter().map(|combination| (combination.name.clone(), each));
    std::iter::once((String::new(), shared)).chain(names).collect()
}

fn headers(report: &RunReport, shared: &[&str], each: &[&str]) -> Vec<String> {
    let repeated = report.combinations.iter().flat_map(|_| each);
    shared.iter().chain(repeated).map(|header| (*header).to_owned()).collect()
}

fn rupture_table(report: &RunReport) -> Table {
    let shared = ["Rupture", "True (s)", "Depth (mm)", "Cause"];
    let each = ["Detected (s)", "Delay", "Travel", "Raised by"];
    let mut rows = Vec::new();
    for (index, rupture) in report.truth.iter().flat_map(|truth| &truth.ruptures).enumerate() {
        let mut row = vec![
            Cell::text(format!("layer {}", rupture.layer)),
            Cell::number(significant(rupture.time_s, 6)),
            Cell::number(significant(rupture.depth_m * 1e3, 4)),
            Cell::text(&rupture.cause),
        ];
        for combination in &report.combinations {
            let score = combination.score.as_ref().and_then(|score| score.ruptures.get(index));
            match score.and_then(|s| s.detected_s.map(|detected| (s, detected))) {
                Some((score, detected_s)) => {
                    row.push(Cell::number(significant(detected_s, 6)));
                    row.push(
                        score
                            .delay_s
                            .map_or_else(dash, |d| Cell::number(milliseconds(d)).status(delay_status(d))),
                    );
                    row.push(score.delay_m.map_or_else(dash, |d| Cell::number(millimetres(d))));
                    row.push(Cell::text(&score.trigger));
                }
                None => {
                    row.extend([Cell::text("missed").status(Status::Bad), dash(), dash(), Cell::text("")])
                }
            }
        }
        rows.push(row);
    }
    let (shared_count, each_count) = (shared.len(), each.len());
    Table {
        title: "Ruptures".to_owned(),
        column_groups: groups(report, shared_count, each_count),
        headers: headers(report, &shared, &each),
        rows,
    }
}

fn detection_table(report: &RunReport) -> Table {
    let mut rows = Vec::new();
    for combination in &report.combinations {
        for (index, detection) in combination.detections.iter().enumerate() {
            rows.push(vec![
                Cell::text(report.label(combination, &format!("detection {}", index + 1))),
                Cell::number(significant(detection.time_s, 6)),
                Cell::number(significant(detection.depth_m * 1e3, 4)),
                Cell::text(&detection.trigger),
            ]);
        }
    }
    let headers = ["Detection", "Time (s)", "Position (mm)", "Raised by"].map(str::to_owned).to_vec();
    Table { title: "Detected ruptures".to_owned(), column_groups: Vec::new(), headers, rows }
}

/// One row of the layer table: name, unit scale, truth, and where the estimates stand.
struct Row {
    name: &'static str,
    scale: f64,
    truth: fn(&super::model::TrueLayer) -> f64,
    estimate: fn(&LayerEstimate) -> Option<f64>,
    doubt: fn(&LayerEstimate) -> Option<f64>,
    offline: fn(&LayerEstimate) -> Option<f64>,
    error: fn(&LayerEstimate) -> Option<f64>,
}

const ROWS: [Row; 4] = [
    Row {
        name: "K (N/m)",
        scale: 1.0,
        truth: |l| l.stiffness_n_per_m,
        estimate: |l| l.stiffness_n_per_m,
        doubt: |l| l.stiffness_half_width,
        offline: |l| l.offline_stiffness_n_per_m,
        error: |l| l.stiffness_error,
    },
    Row {
        name: "b (N s/m²)",
        scale: 1.0,
        truth: |l| l.friction_ns_per_m2,
        estimate: |l| l.friction_ns_per_m2,
        doubt: |l| l.friction_half_width,
        offline: |l| l.offline_friction_ns_per_m2,
        error: |l| l.friction_error,
    },
    Row {
        name: "b d (N s/m)",
        scale: 1.0,
        truth: |l| l.friction_ns_per_m2 * l.thickness_m,
        estimate: |l| l.friction_ns_per_m,
        doubt: |_| None,
        offline: |l| l.offline_friction_ns_per_m,
        error: |l| l.friction_error,
    },
    Row {
        name: "thickness (mm)",
        scale: 1e3,
        truth: |l| l.thickness_m,
        estimate: |l| l.thickness_m,
        doubt: |_| None,
        offline: |_| None,
        error: |l| l.thickness_error,
    },
];

fn layer_table(report: &RunReport) -> Table {
    let known = report.truth.is_some();
    let shared: &[&str] = if known { &["Layer", "Quantity", "True"] } else { &["Layer", "Quantity"] };
    let each: &[&str] = if known { &["Online", "Error", "Offline LSQ"] } else { &["Online", "Offline LSQ"] };
    let true_layers = report.truth.as_ref().map(|truth| truth.layers.as_slice()).unwrap_or_default();
    let estimated = report.combinations.iter().flat_map(|c| &c.layers).map(|l| l.layer).max().unwrap_or(0);
    let mut rows = Vec::new();
    for layer in 1..=estimated {
        let truth = true_layers.get(layer - 1);
        for quantity in &ROWS {
            let estimates: Vec<Option<&LayerEstimate>> =
                report.combinations.iter().map(|c| c.layers.iter().find(|l| l.layer == layer)).collect();
            let has = |e: &Option<&LayerEstimate>| {
                e.is_some_and(|e| (quantity.estimate)(e).or((quantity.offline)(e)).is_some())
            };
            if !estimates.iter().any(has) {
                continue;
            }
            let name = truth.map_or_else(|| format!("layer {layer}"), |t| format!("{layer} · {}", t.name));
            let mut row = vec![Cell::text(name), Cell::text(quantity.name)];
            if known {
                row.push(number(truth.map(quantity.truth), quantity.scale));
            }
            for estimate in estimates {
                let value = estimate.and_then(quantity.estimate);
                row.push(doubted(value, estimate.and_then(quantity.doubt), quantity.scale));
                if known {
                    row.push(error(value.and(estimate.and_then(quantity.error))));
                }
                row.push(number(estimate.and_then(quantity.offline), quantity.scale));
            }
            rows.push(row);
        }
    }
    let (shared_count, each_count) = (shared.len(), each.len());
    Table {
        title: "Layers".to_owned(),
        column_groups: groups(report, shared_count, each_count),
        headers: headers(report, shared, each),
        rows,
    }
}

/// A line of the overall table: name, cell of a combination.
type Line = (&'static str, fn(&Combination, Option<&Score>) -> Cell);

const LINES: [Line; 6] = [
    ("cumulative friction D, true (N s/m)", |_, s| {
        number(s.and_then(|s| s.true_cumulative_friction_ns_per_m), 1.0)
    }),
    ("cumulative friction D, estimated (N s/m)", |c, s| {
        let last = c.cumulative_friction_ns_per_m.iter().rev().copied().find(|d| d.is_finite());
        number(s.and_then(|s| s.cumulative_friction_ns_per_m).or(last), 1.0)
    }),
    ("error of D", |_, s| error(s.and_then(|s| s.cumulative_friction_error))),
    ("enhancement error, RMS over RMS of the tip force", |_, s| {
        s.and_then(|s| s.enhancement_rms_relative).map_or_else(dash, |e| Cell::number(percent(e)))
    }),
    ("enhanced over measured force after the exit", |_, s| {
        s.and_then(|s| s.after_exit_relative).map_or_else(dash, |e| Cell::number(percent(e)))
    }),
    ("reconstruction error, RMS (N)", |c, _| number(c.reconstruction_rms_n, 1.0)),
];

fn overall_table(report: &RunReport) -> Table {
    let rows = LINES
        .iter()
        .map(|(name, cell)| {
            let cells = report.combinations.iter().map(|c| cell(c, c.score.as_ref()));
            std::iter::once(Cell::text(*name)).chain(cells).collect::<Vec<Cell>>()
        })
        .filter(|row| row.iter().skip(1).any(|cell| cell.text != "–"))
        .collect();
    let names: Vec<&str> = report.combinations.iter().map(|c| c.name.as_str()).collect();
    let headers = std::iter::once("Overall").chain(names).map(str::to_owned).collect();
    Table {
        title: "Cumulative friction and enhancement".to_owned(),
        column_groups: Vec::new(),
        headers,
        rows,
    }
}
