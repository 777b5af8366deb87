//! The page of a benchmark of the diagnosis: accuracy by misspecification and severity, as maps and a table.

use crate::page_model::{Cell, Page, Section, Status, Table};
use crate::svg::{FigureOptions, HeatMap, heat_map};
use std::collections::BTreeSet;
use stylet_examine::results_table::TableCell as Row;
use stylet_examine::{Hide, Plan, Severity, Wrong};

/// Columns of a map: no misspecification, then its severities.
const COLUMNS: [&str; 4] = ["none", "small", "medium", "large"];

/// Accuracy maps, one per hidden cause: rows are misspecifications, columns severities.
#[must_use]
pub fn accuracy_maps(plan: &Plan, cells: &[Row]) -> Vec<(Hide, String)> {
    let kinds: BTreeSet<Hide> = cells.iter().map(|c| c.id.hide).collect();
    kinds.into_iter().map(|hide| (hide, map(plan, cells, hide))).collect()
}

fn map(plan: &Plan, cells: &[Row], hide: Hide) -> String {
    let of: Vec<&Row> = cells.iter().filter(|c| c.id.hide == hide).collect();
    let rows: BTreeSet<Wrong> = of.iter().map(|c| c.id.wrong).collect();
    let value = |wrong: Wrong, column: usize| {
        let severity = Severity::ALL.get(column.wrapping_sub(1)).copied();
        of.iter()
            .find(|c| {
                c.id.wrong == wrong
                    && if wrong == Wrong::Nothing { column == 0 } else { Some(c.id.severity) == severity }
            })
            .map_or(f64::NAN, |c| c.right.share())
    };
    // Severities that were not run have no column.
    let columns: Vec<usize> =
        (0..COLUMNS.len()).filter(|k| rows.iter().any(|w| value(*w, *k).is_finite())).collect();
    let cases = of.iter().map(|c| c.right.of).max().unwrap_or(0);
    let title = match hide {
        Hide::Clean => "No effect hidden: none reported".to_owned(),
        hide => {
            let says = hide.description();
            let (first, rest) = says.split_at(1);
            format!("{}{rest}: correct, and nothing else", first.to_uppercase())
        }
    };
    let map = HeatMap {
        row_label: "misspecification".to_owned(),
        column_label: "severity".to_owned(),
        rows: rows.iter().map(|w| w.as_str().to_owned()).collect(),
        columns: columns.iter().map(|k| COLUMNS[*k].to_owned()).collect(),
        values: rows.iter().map(|w| columns.iter().map(|k| value(*w, *k)).collect()).collect(),
        values_are_fractions: true,
    };
    let options = FigureOptions {
        title,
        subtitle: format!(
            "simulator {}, {}, up to {cases} cases per cell, seed {}",
            plan.world,
            plan.size.description(),
            plan.seed
        ),
        width_px: 760.0,
    };
    heat_map(&map, &options)
}

/// The page of a benchmark; `text` is its table as printed on the terminal.
#[must_use]
pub fn page(plan: &Plan, cells: &[Row], text: &str) -> Page {
    let mut worlds = Section::new("Accuracy by misspecification");
    for (hide, markup) in accuracy_maps(plan, cells) {
        let description = format!("Share of correct diagnoses, {}: {}", hide, hide.description());
        worlds = worlds.picture(description, markup);
    }
    let mut table = Table::new(
        "Rates with 95 % Wilson intervals",
        &[
            "misspecification",
            "severity",
            "hidden",
            "correct, nothing else",
            "all found",
            "false attribution",
            "unknown",
            "median s",
            "p90 s",
        ],
        Vec::new(),
    );
    for c in cells {
        let good = Status::at_most(1.0 - c.right.share(), 0.05, 0.2);
        table.rows.push(vec![
            Cell::text(c.id.wrong.description()),
            Cell::text(if c.id.wrong == Wrong::Nothing { "" } else { c.id.severity.as_str() }),
            Cell::text(c.id.hide.as_str()),
            Cell::number(c.right.to_string()).status(good),
            Cell::number(c.all_found.to_string()),
            Cell::number(c.wrong_name.to_string()),
            Cell::number(format!("{}/{}", c.unknown.hits, c.unknown.of)),
            Cell::number(format!("{:.2}", c.median_s)),
            Cell::number(format!("{:.2}", c.p90_s)),
        ]);
    }
    Page::new("Benchmark of the diagnosis")
        .subtitle("Cases of an independent simulator; the correct answers were fixed beforehand")
        .fact("simulator", format!("{}: {}", plan.world, plan.world.description()))
        .fact("effect size", plan.size.description())
        .fact("seed", plan.seed.to_string())
        .section(worlds)
        .section(Section::new("Rates").table(table).folded("table.txt", text))
}
