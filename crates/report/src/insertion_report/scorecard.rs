//! The scores at the top of the report.

use super::model::{Combination, LayerEstimate, RunReport, Score};
use crate::page_model::{Cell, Section, Status, Table, Tile};
use stylet_stats::number_format::{percent, significant};

/// Relative errors up to 5 % are good, up to 15 % acceptable. The enhancement error has different bounds.
pub(super) fn error_status(error: f64) -> Status {
    Status::at_most(error.abs(), 0.05, 0.15)
}

/// Delays up to 10 ms (two samples at 200 Hz) are good, up to 50 ms acceptable.
pub(super) fn delay_status(delay_s: f64) -> Status {
    Status::at_most(delay_s.abs(), 0.010_5, 0.050_5)
}

pub(super) fn milliseconds(seconds: f64) -> String {
    format!("{} ms", significant(seconds * 1e3, 3))
}

pub(super) fn millimetres(metres: f64) -> String {
    format!("{} mm", significant(metres * 1e3, 3))
}

pub(super) fn section(report: &RunReport) -> Section {
    let is_scored = report.combinations.iter().any(|c| c.score.is_some());
    let mut section = Section::new(if is_scored { "Score" } else { "Detections and estimates" });
    if !report.notes.is_empty() {
        section = section.warnings(report.notes.clone());
    }
    section = section.texts(report.remarks.clone());
    let cards: Vec<Vec<Tile>> = report.combinations.iter().map(tiles).collect();
    if let [only] = cards.as_slice() {
        return section.tiles(only.clone());
    }
    section.table(comparison(report, &cards))
}

fn tiles(combination: &Combination) -> Vec<Tile> {
    let mut tiles = match &combination.score {
        Some(score) => scored(combination, score),
        None => unscored(combination),
    };
    if let Some(rms) = combination.reconstruction_rms_n {
        tiles.push(Tile::new(
            "Reconstruction error",
            format!("{} N", significant(rms, 3)),
            "RMS of the innovation e",
        ));
    }
    tiles
}

/// Several combinations: one row each, one column per score.
fn comparison(report: &RunReport, cards: &[Vec<Tile>]) -> Table {
    let mut labels: Vec<&str> = Vec::new();
    for tile in cards.iter().flatten() {
        if !labels.contains(&tile.label.as_str()) {
            labels.push(&tile.label);
        }
    }
    let row = |(combination, tiles): (&Combination, &Vec<Tile>)| {
        let cell = |label: &&str| {
            let tile = tiles.iter().find(|tile| tile.label == *label);
            tile.map_or_else(|| Cell::number("–"), |tile| Cell::number(&tile.value).status(tile.status))
        };
        std::iter::once(Cell::text(&combination.name)).chain(labels.iter().map(cell)).collect()
    };
    Table {
        title: "Combinations of algorithm, model and sensor".to_owned(),
        column_groups: Vec::new(),
        headers: std::iter::once("Combination").chain(labels.iter().copied()).map(str::to_owned).collect(),
        rows: report.combinations.iter().zip(cards).map(row).collect(),
    }
}

fn scored(combination: &Combination, score: &Score) -> Vec<Tile> {
    let total = score.ruptures.len();
    let found = total.saturating_sub(score.missed);
    let found_status = if score.missed == 0 { Status::Good } else { Status::Bad };
    let false_status = if score.false_detections == 0 { Status::Good } else { Status::Bad };
    let missed =
        if score.missed == 0 { "none missed".to_owned() } else { format!("{} missed", score.missed) };
    let mut tiles = vec![
        Tile::new("Ruptures found", format!("{found} of {total}"), missed).status(found_status),
        Tile::new("False detections", score.false_detections.to_string(), "").status(false_status),
    ];
    if let Some(delay_s) = score.median_delay_s {
        let travel =
            score.median_delay_m.map(|m| format!("{} of travel", millimetres(m))).unwrap_or_default();
        tiles.push(Tile::new("Median delay", milliseconds(delay_s), travel).status(delay_status(delay_s)));
    }
    tiles.extend(worst("Worst K error", &combination.layers, |l| l.stiffness_error));
    tiles.extend(worst("Worst b error", &combination.layers, |l| l.friction_error));
    if let Some(error) = score.cumulative_friction_error {
        let values = match (score.cumulative_friction_ns_per_m, score.true_cumulative_friction_ns_per_m) {
            (Some(estimate), Some(truth)) => {
                format!("{} for {} N s/m", significant(estimate, 4), significant(truth, 4))
            }
            _ => String::new(),
        };
        tiles.push(Tile::new("D error", percent(error), values).status(error_status(error)));
    }
    if let Some(error) = score.enhancement_rms_relative {
        let status = Status::at_most(error, 0.2, 0.4);
        tiles.push(
            Tile::new("Enhancement error", percent(error), "RMS, relative to the tip force").status(status),
        );
    }
    if let Some(error) = score.after_exit_relative {
        tiles.push(Tile::new("After the exit", percent(error), "of the measured force remains (RMS)"));
    }
    tiles
}

fn worst(
    label: &str,
    layers: &[LayerEstimate],
    error: impl Fn(&LayerEstimate) -> Option<f64>,
) -> Option<Tile> {
    let (layer, worst) = layers
        .iter()
        .filter_map(|l| error(l).filter(|e| e.is_finite()).map(|e| (l.layer, e)))
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    Some(Tile::new(label, percent(worst), format!("layer {layer}")).status(error_status(worst)))
}

fn unscored(combination: &Combination) -> Vec<Tile> {
    let times: Vec<String> =
        combination.detections.iter().map(|d| format!("{} s", significant(d.time_s, 4))).collect();
    let mut tiles =
        vec![Tile::new("Ruptures detected", combination.detections.len().to_string(), times.join(", "))];
    if let Some(contact_s) = combination.contact_s {
        let at = format!("{} s", significant(contact_s, 4));
        tiles.push(Tile::new("First contact", at, combination.contact.clone()));
    }
    let friction = combination.cumulative_friction_ns_per_m.iter().copied().filter(|d| d.is_finite());
    if let Some(largest) = friction.reduce(f64::max) {
        tiles.push(Tile::new("Cumulative friction D", significant(largest, 3), "N s/m, largest"));
    }
    for layer in &combination.layers {
        if let Some(stiffness) = layer.stiffness_n_per_m {
            let what = format!("K, layer {}", layer.layer);
            tiles.push(Tile::new(what, significant(stiffness, 3), "N/m"));
        }
    }
    tiles.push(Tile::new("Ground truth", "none", "measured data: no scores"));
    tiles
}
