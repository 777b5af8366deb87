//! What the simulation lacks, which numbers moved, what is no cause, what cannot be seen.

use crate::page_model::{Cell, Section, Status, Table};
use crate::pages::formatting::BASE_LAW_EQUATIONS;
use std::fmt::Write as _;
use stylet_diagnose::diagnosis_json::{BaseParameter, Diagnosis, Verdict};
use stylet_scenario::Scenario;
use stylet_stats::number_format::significant;

/// What the simulation lacks, with the extended law in the notation of SPEC section 1.
pub(super) fn causes(d: &Diagnosis) -> Section {
    let section = Section::new("Causes");
    if d.causes.is_empty() {
        return section.text(if d.verdict == Verdict::Unknown {
            "None that could be named: what is left is more than an effect of the library explains."
        } else {
            "None: the base law, re-fitted, is as good as any extension of it that was tried."
        });
    }
    let mut text = String::from(BASE_LAW_EQUATIONS);
    let mut rows = Vec::new();
    for c in &d.causes {
        let info = stylet_tissue::effect_info(&c.effect);
        if let Some(info) = info {
            let _ = write!(text, "\n{}:\n    {}\n", c.effect, info.equation);
        }
        let unit = |path: &str| info.and_then(|i| i.parameter(path)).map_or("", |p| p.unit);
        for (k, (path, e)) in c.parameters.iter().enumerate() {
            let first = |text: String| Cell::text(if k == 0 { text } else { String::new() });
            rows.push(vec![
                first(c.effect.replace('_', " ")),
                first(c.equivalent.join(", ").replace('_', " ")),
                first(significant(c.confidence, 3)),
                first(if c.share > 0.0 { format!("{:.0} %", 100.0 * c.share) } else { "-".to_owned() }),
                Cell::text(path.clone()),
                Cell::number(format!("{} {}", number(e.value), unit(path))),
                Cell::number(format!("{} to {}", number(e.low), number(e.high))),
            ]);
        }
    }
    let g = &d.gain;
    let what =
        if g.held_out { "recordings left out of the fit" } else { "the recording, which was also fitted" };
    let title = format!(
        "What the simulation lacks; together it brings {what} down from {} N to {} N rms, the noise being {} N",
        significant(g.rmse_before_n, 3),
        significant(g.rmse_after_n, 3),
        significant(g.floor_n, 3)
    );
    let headers =
        ["cause", "as good", "confidence", "of what the base law leaves", "number", "value", "95 % interval"];
    section.table(Table::new(title, &headers, rows)).code("equation", text)
}

/// Base numbers, those that moved first.
pub(super) fn base_parameters(scenario: &Scenario, d: &Diagnosis) -> Section {
    let mut order: Vec<&BaseParameter> = d.base_parameters.iter().collect();
    order.sort_by_key(|b| (!b.changed, !b.at_bound));
    let count = order.iter().filter(|b| b.changed).count();
    let rows = order
        .iter()
        .map(|b| {
            let status = match (b.at_bound, b.changed) {
                (true, _) => Status::Warn,
                (false, true) => Status::Good,
                (false, false) => Status::Plain,
            };
            vec![
                Cell::text(if b.layer > 0 { format!("layer {}", b.layer) } else { "tissue".to_owned() }),
                Cell::text(b.name.clone()),
                Cell::number(number(b.assumed)),
                Cell::number(number(b.value)),
                Cell::number(format!("{} to {}", number(b.low), number(b.high))),
                Cell::number(change(b)).status(status),
            ]
        })
        .collect();
    let mut section = Section::new("Numbers of the base law that moved").table(Table::new(
        format!(
            "{count} of {} differ from what was assumed by more than their interval",
            d.base_parameters.len()
        ),
        &["", "parameter", "assumed", "fitted", "95 % interval", "change"],
        rows,
    ));
    let mut aloud = Vec::new();
    let bounds = order.iter().filter(|b| b.at_bound).count();
    if bounds > 0 {
        aloud.push(format!(
            "{bounds} number{} at the bound of what was believed: the tolerance is too narrow, or something else takes its work. Widen `tolerance` in the scenario and ask again.",
            if bounds == 1 { " stands" } else { "s stand" }
        ));
    }
    let tolerance = |b: &BaseParameter| match b.name.as_str() {
        "surface_m" => scenario.surface_tolerance_m,
        "thickness_m" => scenario.thickness_tolerance * b.assumed,
        _ => scenario.tolerance * b.assumed,
    };
    let blind: Vec<String> = order
        .iter()
        .filter(|b| b.high - b.low > BLIND * 2.0 * 1.96 * tolerance(b) && tolerance(b) > 0.0)
        .map(|b| format!("{} of layer {}", b.name, b.layer))
        .collect();
    if !blind.is_empty() {
        aloud.push(format!(
            "These recordings say next to nothing of {}: the interval is the belief's own.",
            blind.join(", ")
        ));
    }
    if !aloud.is_empty() {
        section = section.warnings(aloud);
    }
    section
}

/// An interval so large a share of what was believed before is the belief's own.
const BLIND: f64 = 0.8;

/// By how much a re-fitted number differs from the one assumed, and whether it may go no further.
fn change(b: &BaseParameter) -> String {
    let place = matches!(b.name.as_str(), "surface_m" | "thickness_m");
    // A rounded nothing has no sign.
    let rounded = |x: f64, to: f64| (x * to).round() / to + 0.0;
    let by = if place {
        format!("{:+.2} mm", rounded(1e3 * (b.value - b.assumed), 100.0))
    } else {
        format!("{:+.1} %", rounded(100.0 * (b.value / b.assumed - 1.0), 10.0))
    };
    if b.at_bound { format!("{by}, at its bound") } else { by }
}

/// What was found and is no cause.
pub(super) fn negligible_effects(d: &Diagnosis) -> Section {
    let section = Section::new("Traces");
    if d.negligible.is_empty() {
        return section
            .text("Nothing was found that is too small to matter or does not pay on recordings left out.");
    }
    let rows = d
        .negligible
        .iter()
        .map(|t| {
            let numbers = t.parameters.iter().map(|(p, e)| format!("{p} = {}", number(e.value)));
            vec![
                Cell::text(t.effect.replace('_', " ")),
                Cell::text(numbers.collect::<Vec<_>>().join(", ")),
                Cell::text(t.reason.clone()),
            ]
        })
        .collect();
    section.table(Table::new("Found, and no cause", &["effect", "numbers", "why it is no cause"], rows))
}

pub(super) fn not_identifiable(d: &Diagnosis) -> Section {
    let rows = d
        .not_identifiable
        .iter()
        .map(|id| {
            let info = stylet_tissue::effect_info(id);
            vec![
                Cell::text(id.clone()),
                Cell::text(info.map_or("", |i| i.equation)),
                Cell::text(info.map_or("", |i| i.signature)),
            ]
        })
        .collect();
    Section::new("What these recordings cannot show").table(Table::new(
        "Effects that other base parameters imitate to within the noise",
        &["effect", "equation", "how it would show"],
        rows,
    ))
}

fn number(x: f64) -> String {
    significant(x, 4)
}
