//! Tables of the causes, the re-fitted base parameters, negligible effects and effects that cannot be identified.

use super::parameter_labels::label_cell;
use super::summary_sentence::lower_limit;
use crate::page_model::{Cell, Section, Status, Table};
use crate::pages::formatting::BASE_LAW_EQUATIONS;
use std::fmt::Write as _;
use stylet_diagnose::diagnosis_json::{BaseParameter, Diagnosis, Verdict};
use stylet_stats::number_format::significant;

/// The causes with their parameters, and the extended law in the notation of docs/reference/model.md.
pub(super) fn causes(d: &Diagnosis) -> Section {
    let section = Section::new("Causes");
    if d.causes.is_empty() {
        return section.text(if d.verdict == Verdict::Unknown {
            "None identified: the residual is not explained by any effect of the library."
        } else {
            "None: no effect of the library improves on the re-fitted base law."
        });
    }
    let mut text = String::from(BASE_LAW_EQUATIONS);
    let mut rows = Vec::new();
    for c in &d.causes {
        let info = stylet_tissue::known_effect_info(&c.effect);
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
                Cell::number(format!(
                    "{} {}{}",
                    number(e.value),
                    unit(path),
                    if c.at_bound.contains(path) { ", at its bound" } else { "" }
                )),
                Cell::number(format!("{} to {}", number(e.low), number(e.high))),
                label_cell(&d.parameters, 0, Some(&c.effect), path),
            ]);
        }
    }
    let g = &d.gain;
    let what = if g.held_out { "held-out recordings" } else { "the fitted recording" };
    let title = format!(
        "Together the causes reduce the RMS residual of {what} from {} N to {} N; noise {} N",
        significant(g.rmse_before_n, 3),
        significant(g.rmse_after_n, 3),
        significant(g.floor_n, 3)
    );
    let headers = [
        "cause",
        "not separable from",
        "confidence",
        "share of the residual",
        "parameter",
        "value",
        "95 % interval",
        "by these recordings",
    ];
    section.table(Table::new(title, &headers, rows)).code("equation", text)
}

/// Fitted base parameters, those that changed first.
pub(super) fn base_parameters(d: &Diagnosis) -> Section {
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
                Cell::number(if b.at_least { lower_limit(b) } else { number(b.value) }),
                Cell::number(if b.at_least {
                    "not reached".to_owned()
                } else {
                    format!("{} to {}", number(b.low), number(b.high))
                }),
                Cell::number(change(b)).status(status),
                label_cell(&d.parameters, b.layer, None, &b.name),
            ]
        })
        .collect();
    let mut section = Section::new("Base parameters").table(Table::new(
        format!(
            "{count} of {} differ from the assumed value by more than their interval",
            d.base_parameters.len()
        ),
        &["", "parameter", "assumed", "fitted", "95 % interval", "change", "by these recordings"],
        rows,
    ));
    let mut warnings = Vec::new();
    let bounds = order.iter().filter(|b| b.at_bound).count();
    if bounds > 0 {
        warnings.push(format!(
            "{bounds} parameter{} at the bound of the assumed range: the tolerance is too narrow, or the parameter compensates for another error. Widen `tolerance` in the scenario and repeat the diagnosis.",
            if bounds == 1 { " is" } else { "s are" }
        ));
    }
    if !warnings.is_empty() {
        section = section.warnings(warnings);
    }
    section
}

/// Change of a re-fitted parameter from its assumed value, and whether it is at a bound.
fn change(b: &BaseParameter) -> String {
    let place = matches!(b.name.as_str(), "surface_m" | "thickness_m");
    // Adding 0 turns a rounded -0 into 0.
    let rounded = |x: f64, to: f64| (x * to).round() / to + 0.0;
    let by = if place {
        format!("{:+.2} mm", rounded(1e3 * (b.value - b.assumed), 100.0))
    } else {
        format!("{:+.1} %", rounded(100.0 * (b.value / b.assumed - 1.0), 10.0))
    };
    match (b.at_least, b.at_bound) {
        (true, _) => "only a lower limit".to_owned(),
        (false, true) => format!("{by}, at its bound"),
        (false, false) => by,
    }
}

/// Effects that were detected but are negligible.
pub(super) fn negligible_effects(d: &Diagnosis) -> Section {
    let section = Section::new("Negligible effects");
    if d.negligible.is_empty() {
        return section.text(
            "None: no effect was detected that is negligible or does not improve held-out recordings.",
        );
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
    section.table(Table::new("Detected, but not causes", &["effect", "parameters", "reason"], rows))
}

/// Effects that cannot be identified from these recordings.
pub(super) fn not_identifiable(d: &Diagnosis) -> Section {
    let rows = d
        .not_identifiable
        .iter()
        .map(|id| {
            let info = stylet_tissue::known_effect_info(id);
            vec![
                Cell::text(id.clone()),
                Cell::text(info.map_or("", |i| i.equation)),
                Cell::text(info.map_or("", |i| i.signature)),
            ]
        })
        .collect();
    Section::new("Not identifiable").table(Table::new(
        "Effects that the base parameters absorb to within the noise",
        &["effect", "equation", "signature"],
        rows,
    ))
}

fn number(x: f64) -> String {
    significant(x, 4)
}
