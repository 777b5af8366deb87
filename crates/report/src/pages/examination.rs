//! The page of an examination: a map of where the engine fails, and the table.

use crate::page_model::{Cell, Page, Section, Status, Table};
use crate::svg::{FigureOptions, HeatMap, heat_map};
use std::collections::BTreeSet;
use stylet_examine::table::Cell as Row;
use stylet_examine::{Grade, Hide, Plan, Wrong};

/// Columns of a map: nothing wrong, then the grades.
const COLUMNS: [&str; 4] = ["none", "small", "medium", "large"];

/// Shares right, one map per kind of case: rows what is wrong, columns how much of it.
#[must_use]
pub fn accuracy_maps(plan: &Plan, cells: &[Row]) -> Vec<(Hide, String)> {
    let kinds: BTreeSet<Hide> = cells.iter().map(|c| c.id.hide).collect();
    kinds.into_iter().map(|hide| (hide, map(plan, cells, hide))).collect()
}

fn map(plan: &Plan, cells: &[Row], hide: Hide) -> String {
    let of: Vec<&Row> = cells.iter().filter(|c| c.id.hide == hide).collect();
    let rows: BTreeSet<Wrong> = of.iter().map(|c| c.id.wrong).collect();
    let value = |wrong: Wrong, column: usize| {
        let grade = Grade::ALL.get(column.wrapping_sub(1)).copied();
        of.iter()
            .find(|c| {
                c.id.wrong == wrong
                    && if wrong == Wrong::Nothing { column == 0 } else { Some(c.id.grade) == grade }
            })
            .map_or(f64::NAN, |c| c.right.share())
    };
    // Only what was asked for has a column.
    let columns: Vec<usize> =
        (0..COLUMNS.len()).filter(|k| rows.iter().any(|w| value(*w, *k).is_finite())).collect();
    let cases = of.iter().map(|c| c.right.of).max().unwrap_or(0);
    let title = match hide {
        Hide::Clean => "Clean data called clean".to_owned(),
        hide => {
            let says = hide.says();
            let (first, rest) = says.split_at(1);
            format!("{}{rest}: right, and alone", first.to_uppercase())
        }
    };
    let map = HeatMap {
        row_label: "what the believed simulation or the sensor has wrong".to_owned(),
        column_label: "how much of it".to_owned(),
        rows: rows.iter().map(|w| w.word().to_owned()).collect(),
        columns: columns.iter().map(|k| COLUMNS[*k].to_owned()).collect(),
        values: rows.iter().map(|w| columns.iter().map(|k| value(*w, *k)).collect()).collect(),
        values_are_fractions: true,
    };
    let options = FigureOptions {
        title,
        subtitle: format!(
            "world {}, {}, up to {cases} cases per cell, seed {}",
            plan.world,
            plan.size.says(),
            plan.seed
        ),
        width_px: 760.0,
        ..FigureOptions::default()
    };
    heat_map(&map, &options)
}

/// The page of an examination; `text` is its table in words.
#[must_use]
pub fn page(plan: &Plan, cells: &[Row], text: &str) -> Page {
    let mut worlds = Section::new("In which world it fails");
    for (hide, markup) in accuracy_maps(plan, cells) {
        let description = format!("Share of right answers, {}: {}", hide, hide.says());
        worlds = worlds.picture(description, markup);
    }
    let mut table = Table::new(
        "Rates with 95 % Wilson intervals",
        &[
            "wrong",
            "how much",
            "hidden",
            "right, and alone",
            "all found",
            "a wrong name",
            "unknown",
            "median s",
            "p90 s",
        ],
        Vec::new(),
    );
    for c in cells {
        let good = Status::at_most(1.0 - c.right.share(), 0.05, 0.2);
        table.rows.push(vec![
            Cell::text(c.id.wrong.says()),
            Cell::text(if c.id.wrong == Wrong::Nothing { "" } else { c.id.grade.word() }),
            Cell::text(c.id.hide.word()),
            Cell::number(c.right.to_string()).status(good),
            Cell::number(c.all_found.to_string()),
            Cell::number(c.wrong_name.to_string()),
            Cell::number(format!("{}/{}", c.unknown.hits, c.unknown.of)),
            Cell::number(format!("{:.2}", c.median_s)),
            Cell::number(format!("{:.2}", c.p90_s)),
        ]);
    }
    Page::new("The diagnosis examined")
        .subtitle("by cases of an independent generator; which answers are right was written down before")
        .fact("world", format!("{}: {}", plan.world, plan.world.says()))
        .fact("strength", plan.size.says())
        .fact("seed", plan.seed.to_string())
        .section(worlds)
        .section(Section::new("The table").table(table).folded("table.txt", text))
}
