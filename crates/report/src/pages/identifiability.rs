//! The page of what an experiment can show.

use crate::page_model::{Cell, Page, Section, Status, Table};
use crate::pages::formatting::{effect_label, strength_parameters};
use crate::svg::{FigureOptions, HeatMap, heat_map};
use stylet_plan::identifiability::Identifiability;
use stylet_scenario::Scenario;
use stylet_stats::number_format::significant;

/// The matrix of what an experiment can tell apart.
#[must_use]
pub fn correlation_map(scenario: &Scenario, shown: &Identifiability) -> String {
    let visible: Vec<usize> = (0..shown.effects.len()).filter(|k| shown.effects[*k].identifiable).collect();
    let names: Vec<String> = visible.iter().map(|k| effect_label(&shown.effects[*k].effect)).collect();
    let map = HeatMap {
        row_label: String::new(),
        column_label: "absolute correlation in per cent, the base law's numbers taken out".to_owned(),
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
        title: "What this experiment can tell apart".to_owned(),
        subtitle: format!("{}; effects that it shows at their typical size", scenario.name),
        width_px: 1200.0,
        ..FigureOptions::default()
    };
    heat_map(&map, &options)
}

/// The page of what an experiment can show.
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
        "Effect by effect",
        &["effect", "typical size", "nats at it", "seen from", "explained as well by", "nearest"],
        rows,
    );
    let mut summary = Section::new("What it shows").text(format!(
        "Every effect at its typical size beside the base law, everything that is fitted taken out, at a noise of {} N in blocks of 20 ms. \
         Ten nats are seen; effects within three nats of one another form a class.",
        significant(shown.noise_n, 2)
    ));
    if !shown.not_identifiable.is_empty() {
        let names: Vec<String> = shown.not_identifiable.iter().map(|n| effect_label(n)).collect();
        summary = summary.text(format!("Invisible: {}.", names.join(", ")));
    }
    for c in &shown.classes {
        let names: Vec<String> = c.iter().map(|n| effect_label(n)).collect();
        summary = summary.text(format!("Cannot be told apart: {}.", names.join(", ")));
    }
    Page::new(format!("What can be identified: {}", scenario.name))
        .subtitle("Which effects this experiment shows, from which size on, and which it cannot tell apart.")
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(summary.table(table))
        .section(Section::new("Which resemble one another").picture(
            "Absolute correlation of effects after projecting out the base law",
            correlation_map(scenario, shown),
        ))
}
