//! The page of an identifiability analysis: which effects an experiment can identify, and which it cannot separate.

use crate::page_model::{Cell, Page, Section, Status, Table};
use crate::pages::formatting::{effect_label, strength_parameters};
use crate::svg::{FigureOptions, HeatMap, heat_map};
use stylet_plan::identifiability::Identifiability;
use stylet_scenario::Scenario;
use stylet_stats::number_format::significant;

/// Heat map of the correlation between effects after projecting out the base law.
#[must_use]
pub fn correlation_map(scenario: &Scenario, shown: &Identifiability) -> String {
    let visible: Vec<usize> = (0..shown.effects.len()).filter(|k| shown.effects[*k].identifiable).collect();
    let names: Vec<String> = visible.iter().map(|k| effect_label(&shown.effects[*k].effect)).collect();
    let map = HeatMap {
        row_label: String::new(),
        column_label: "absolute correlation in per cent after projecting out the base law's parameters"
            .to_owned(),
        rows: names.clone(),
        columns: names,
        values: visible
            .iter()
            .map(|i| {
                visible
                    .iter()
                    .map(|j| if i == j { f64::NAN } else { shown.correlation[*i][*j].abs() })
                    .collect()
            })
            .collect(),
        values_are_fractions: true,
    };
    let options = FigureOptions {
        title: "Which effects resemble one another".to_owned(),
        subtitle: format!("{}; effects identifiable at their typical size", scenario.name),
        width_px: 1200.0,
    };
    heat_map(&map, &options)
}

/// The page of an identifiability analysis.
#[must_use]
pub fn page(scenario: &Scenario, shown: &Identifiability) -> Page {
    let rows = shown
        .effects
        .iter()
        .map(|e| {
            let status = if e.identifiable { Status::Good } else { Status::Warn };
            vec![
                Cell::text(effect_label(&e.effect)),
                Cell::text(strength_parameters(&e.effect, &e.typical)),
                Cell::number(significant(e.nats, 3)).status(status),
                Cell::text(
                    e.smallest_detectable.as_ref().map_or_else(
                        || "no plausible size".to_owned(),
                        |s| strength_parameters(&e.effect, s),
                    ),
                ),
                Cell::text(
                    e.indistinguishable_from.iter().map(|l| effect_label(l)).collect::<Vec<_>>().join(", "),
                ),
                Cell::text(e.nearest.as_ref().map_or_else(String::new, |(n, nats)| {
                    format!("{} ({} nats)", effect_label(n), significant(*nats, 2))
                })),
            ]
        })
        .collect();
    let table = Table::new(
        "Effects",
        &[
            "effect",
            "typical size",
            "evidence, nats",
            "detectable from",
            "not separable from",
            "most similar (difference in evidence)",
        ],
        rows,
    );
    let mut summary = Section::new("Identifiable effects").text(format!(
        "Expected log evidence of each effect at its typical size against the base law with all parameters re-fitted, at a noise of {} N \
         in blocks of 20 ms. An effect counts as identifiable from 10 nats on; effects within 3 nats of one another cannot be separated.",
        significant(shown.noise_n, 2)
    ));
    if !shown.not_identifiable.is_empty() {
        let names: Vec<String> = shown.not_identifiable.iter().map(|n| effect_label(n)).collect();
        summary = summary.text(format!("Not identifiable: {}.", names.join(", ")));
    }
    for c in &shown.classes {
        let names: Vec<String> = c.iter().map(|n| effect_label(n)).collect();
        summary = summary.text(format!("Not separable: {}.", names.join(", ")));
    }
    Page::new(format!("What can be identified: {}", scenario.name))
        .subtitle(
            "Which effects this experiment can identify, from which size on, and which it cannot separate.",
        )
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(summary.table(table))
        .section(Section::new("Similarity of effects").picture(
            "Absolute correlation of effects after projecting out the base law",
            correlation_map(scenario, shown),
        ))
}
