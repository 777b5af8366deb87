//! The page of a check: what recordings can identify, before a search for effects.

use crate::page_model::{Cell, Page, Section, Status, Table};
use crate::pages::formatting::{effect_label, strength_parameters};
use std::collections::BTreeMap;
use stylet_diagnose::check_json::{CheckItem, EffectVisibility, Rating};
use stylet_diagnose::claims::parameter_name;
use stylet_diagnose::experiment_check::ExperimentCheck;
use stylet_scenario::Scenario;
use stylet_stats::number_format::significant;

/// Whether the recordings suffice, in one sentence.
#[must_use]
pub fn summary_sentence(check: &ExperimentCheck) -> &'static str {
    if !check.is_usable() {
        "A diagnosis of these recordings would mean nothing."
    } else if check.items.iter().all(|item| item.light == Rating::Good) {
        "The recordings suffice for a diagnosis."
    } else {
        "A diagnosis is possible, within the limits below."
    }
}

/// The aspects of a check as a table.
pub(crate) fn items_table(items: &[CheckItem]) -> Table {
    let row = |item: &CheckItem| {
        let status = match item.light {
            Rating::Good => Status::Good,
            Rating::Limited => Status::Warn,
            Rating::Unusable => Status::Bad,
        };
        vec![
            Cell::text(item.topic.clone()),
            Cell::text(item.light.name()).status(status),
            Cell::text(item.message.clone()),
        ]
    };
    Table::new("What these recordings allow", &["aspect", "", "reason"], items.iter().map(row).collect())
}

/// The sizes from which each effect would be seen and below which it would be missed, as a table.
pub(crate) fn effects_table(effects: &[EffectVisibility]) -> Table {
    let size = |e: &EffectVisibility, parameters: &Option<BTreeMap<String, f64>>, none: &str| {
        parameters.as_ref().map_or_else(|| none.to_owned(), |s| strength_parameters(&e.effect, s))
    };
    let row = |e: &EffectVisibility| {
        let status = if e.visible { Status::Plain } else { Status::Warn };
        vec![
            Cell::text(effect_label(&e.effect)),
            Cell::text(size(e, &e.smallest, "no plausible size")).status(status),
            Cell::text(size(e, &e.hidden_below, "every plausible size")),
        ]
    };
    Table::new(
        "Sizes of each effect that would be seen, and that would be missed",
        &["effect", "seen from", "missed below"],
        effects.iter().map(row).collect(),
    )
}

/// The page of a check of recordings against `scenario`.
#[must_use]
pub fn page(scenario: &Scenario, recordings: &[String], check: &ExperimentCheck) -> Page {
    let number = |x: f64| significant(x, 4);
    let parameters = check.base_parameters.iter().map(|b| {
        vec![
            Cell::text(parameter_name(b)),
            Cell::number(number(b.assumed)),
            Cell::number(format!("{} to {}", number(b.low), number(b.high))),
            crate::pages::diagnosis::label_cell(&check.parameters, b.layer, None, &b.name),
        ]
    });
    Page::new(format!("Check: {}", scenario.name))
        .subtitle(summary_sentence(check))
        .fact("recordings", recordings.join(", "))
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(Section::new("Before the fit").table(items_table(&check.items)))
        .section(Section::new("Parameters of the layers").table(Table::new(
            "As the recordings determine them when no effect is missing",
            &["parameter", "assumed", "95 % interval", "by these recordings"],
            parameters.collect(),
        )))
        .section(Section::new("Effects").table(effects_table(&check.effects)))
}
