//! Tables of ruptures, layers and totals, one group of columns per combination.

use super::model::{Combination, LayerEstimate, RunReport, Score, Truth};
use super::scorecard::{delay_status, error_status, millimetres, milliseconds};
use crate::page_model::{Cell, Section, Status, Table};
use stylet_stats::number_format::{percent, plus_minus, significant};

pub(super) fn section(report: &RunReport) -> Section {
    Section::new("Tables")
        .table(if report.truth.is_some() { rupture_table(report) } else { detection_table(report) })
        .texts(layer_notes(report))
        .table(layer_table(report))
        .table(overall_table(report))
}

fn dash() -> Cell {
    Cell::number("–")
}

fn number(value: Option<f64>, scale: f64) -> Cell {
    with_half_width(value, None, scale)
}

/// A number with the half width of its 95 % interval, if known.
fn with_half_width(value: Option<f64>, half_width: Option<f64>, scale: f64) -> Cell {
    value.map_or_else(dash, |v| Cell::number(plus_minus(v * scale, half_width.map(|d| d * scale), 4)))
}

fn error(value: Option<f64>) -> Cell {
    value.map_or_else(dash, |e| Cell::number(percent(e)).status(error_status(e)))
}

/// Column groups: an empty one over the shared columns, one per combination; none for a single combination.
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
    let each = ["Detected (s)", "Delay", "Travel", "Detected by"];
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
    let headers = ["Detection", "Time (s)", "Position (mm)", "Detected by"].map(str::to_owned).to_vec();
    Table { title: "Detected ruptures".to_owned(), column_groups: Vec::new(), headers, rows }
}

/// A quantity of the layer table: name, unit scale, and accessors for truth and estimates.
struct LayerQuantity {
    name: &'static str,
    is_thickness: bool,
    scale: f64,
    truth: fn(&super::model::TrueLayer) -> f64,
    estimate: fn(&LayerEstimate) -> Option<f64>,
    half_width: fn(&LayerEstimate) -> Option<f64>,
    offline: fn(&LayerEstimate) -> Option<f64>,
    error: fn(&LayerEstimate) -> Option<f64>,
}

const LAYER_QUANTITIES: [LayerQuantity; 4] = [
    LayerQuantity {
        name: "K (N/m)",
        is_thickness: false,
        scale: 1.0,
        truth: |l| l.stiffness_n_per_m,
        estimate: |l| l.stiffness_n_per_m,
        half_width: |l| l.stiffness_half_width,
        offline: |l| l.offline_stiffness_n_per_m,
        error: |l| l.stiffness_error,
    },
    LayerQuantity {
        name: "b (N s/m²)",
        is_thickness: false,
        scale: 1.0,
        truth: |l| l.friction_ns_per_m2,
        estimate: |l| l.friction_ns_per_m2,
        half_width: |l| l.friction_half_width,
        offline: |l| l.offline_friction_ns_per_m2,
        error: |l| l.friction_error,
    },
    LayerQuantity {
        name: "b d (N s/m)",
        is_thickness: false,
        scale: 1.0,
        truth: |l| l.friction_ns_per_m2 * l.thickness_m,
        estimate: |l| l.friction_ns_per_m,
        half_width: |_| None,
        offline: |l| l.offline_friction_ns_per_m,
        error: |l| l.friction_error,
    },
    LayerQuantity {
        name: "thickness (mm)",
        is_thickness: true,
        scale: 1e3,
        truth: |l| l.thickness_m,
        estimate: |l| l.thickness_m,
        half_width: |_| None,
        offline: |_| None,
        error: |l| l.thickness_error,
    },
];

/// The true thickness that the tip traverses: less than the layer's where it ruptured by force before its far face.
fn traversed_m(truth: &Truth, layer: usize) -> Option<f64> {
    let front_m = truth.layers.get(layer.checked_sub(1)?)?.front_m;
    let rupture = truth.ruptures.iter().find(|r| r.layer == layer && r.cause == "puncture force")?;
    Some(rupture.depth_m - front_m)
}

/// Explanations that the layer table needs.
fn layer_notes(report: &RunReport) -> Vec<String> {
    let mut notes = Vec::new();
    let layers = || report.combinations.iter().flat_map(|c| &c.layers);
    if layers().any(|l| l.offline_stiffness_n_per_m.is_some()) {
        notes.push(
            "Offline LSQ: unweighted least squares over all samples between the true boundaries of the layer. Where the motion within a \
             layer does not separate K from b (velocity nearly constant), the two values are marked and only their combined force is \
             determined."
                .to_owned(),
        );
    }
    let punctured = |truth: &Truth| (1..=truth.layers.len()).any(|layer| traversed_m(truth, layer).is_some());
    if report.truth.as_ref().is_some_and(punctured) {
        notes.push(
            "A layer that ruptures at its puncture force is left before its far face: the estimated thickness is compared with the \
             distance traversed up to the rupture."
                .to_owned(),
        );
    }
    notes
}

fn layer_table(report: &RunReport) -> Table {
    let known = report.truth.is_some();
    let shared: &[&str] = if known { &["Layer", "Quantity", "True"] } else { &["Layer", "Quantity"] };
    let each: &[&str] = if known { &["Online", "Error", "Offline LSQ"] } else { &["Online", "Offline LSQ"] };
    let true_layers = report.truth.as_ref().map(|truth| truth.layers.as_slice()).unwrap_or_default();
    let estimated = report.combinations.iter().flat_map(|c| &c.layers).map(|l| l.layer).max().unwrap_or(0);
    let mut rows = Vec::new();
    for layer in 1..=estimated {
        let truth = true_layers.get(layer - 1);
        for quantity in &LAYER_QUANTITIES {
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
            // Only the thickness is compared with the distance traversed.
            let traversed = if quantity.is_thickness {
                report.truth.as_ref().and_then(|truth| traversed_m(truth, layer))
            } else {
                None
            };
            if known {
                row.push(match (traversed, truth) {
                    (Some(part_m), Some(t)) => Cell::number(format!(
                        "{} of {}",
                        significant(1e3 * part_m, 4),
                        significant(1e3 * t.thickness_m, 4)
                    )),
                    _ => number(truth.map(quantity.truth), quantity.scale),
                });
            }
            for estimate in estimates {
                let value = estimate.and_then(quantity.estimate);
                row.push(with_half_width(value, estimate.and_then(quantity.half_width), quantity.scale));
                if known {
                    row.push(match traversed {
                        Some(part_m) => error(value.map(|v| (v - part_m) / part_m)),
                        None => error(value.and(estimate.and_then(quantity.error))),
                    });
                }
                let offline = number(estimate.and_then(quantity.offline), quantity.scale);
                let inseparable = estimate.is_some_and(|e| e.offline_separable == Some(false));
                row.push(if inseparable && offline.text != "–" {
                    offline.status(Status::Warn)
                } else {
                    offline
                });
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

/// A row of the table of totals: name, and the cell of a combination.
type TotalRow = (&'static str, fn(&Combination, Option<&Score>) -> Cell);

const TOTALS: [TotalRow; 6] = [
    ("cumulative friction D, true (N s/m)", |_, s| {
        number(s.and_then(|s| s.true_cumulative_friction_ns_per_m), 1.0)
    }),
    ("cumulative friction D, estimated (N s/m)", |c, s| {
        let last = c.cumulative_friction_ns_per_m.iter().rev().copied().find(|d| d.is_finite());
        number(s.and_then(|s| s.cumulative_friction_ns_per_m).or(last), 1.0)
    }),
    ("error of D", |_, s| error(s.and_then(|s| s.cumulative_friction_error))),
    ("enhancement error, RMS relative to the tip force", |_, s| {
        s.and_then(|s| s.enhancement_rms_relative).map_or_else(dash, |e| Cell::number(percent(e)))
    }),
    ("enhanced relative to measured force after the exit, RMS", |_, s| {
        s.and_then(|s| s.after_exit_relative).map_or_else(dash, |e| Cell::number(percent(e)))
    }),
    ("reconstruction error, RMS (N)", |c, _| number(c.reconstruction_rms_n, 1.0)),
];

fn overall_table(report: &RunReport) -> Table {
    let rows = TOTALS
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
