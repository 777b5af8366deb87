//! The page of a comparison of the models found by two diagnoses.

use crate::page_model::{Cell, Page, Section, Status, Table};
use stylet_diagnose::model_consistency::Consistency;
use stylet_stats::number_format::{p_value, significant};

/// The comparison in one sentence.
#[must_use]
pub fn summary_sentence(c: &Consistency) -> String {
    let differ: Vec<&str> = c.parameters.iter().filter(|p| p.differs).map(|p| p.parameter.as_str()).collect();
    let mut reasons = Vec::new();
    for (which, causes) in ["first", "second"].iter().zip(&c.causes) {
        if !causes.is_empty() {
            reasons.push(format!("only the {which} has {}", causes.join(", ")));
        }
    }
    if !differ.is_empty() {
        reasons.push(format!("they differ in {}", differ.join(", ")));
    }
    if c.is_consistent {
        format!("Both are one model to within their intervals ({}).", p_value(c.p_value))
    } else if reasons.is_empty() {
        format!("The models differ, in no single parameter ({}).", p_value(c.p_value))
    } else {
        format!("The models differ: {}.", reasons.join("; "))
    }
}

/// The page of two models with these names.
#[must_use]
pub fn page(names: &[String; 2], c: &Consistency) -> Page {
    let number = |x: f64| significant(x, 4);
    let rows = c.parameters.iter().map(|p| {
        vec![
            Cell::text(p.parameter.clone()),
            Cell::number(number(p.values[0])),
            Cell::number(number(p.values[1])),
            Cell::number(format!(
                "{} ± {}",
                number(p.values[1] - p.values[0]),
                number(stylet_stats::normal::Z95 * p.sd)
            )),
            Cell::number(p_value(p.p_value)).status(if p.differs { Status::Warn } else { Status::Plain }),
        ]
    });
    Page::new("Two models")
        .subtitle(summary_sentence(c))
        .fact("first", names[0].clone())
        .fact("second", names[1].clone())
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(Section::new("Parameters").table(Table::new(
            "Parameters that both determine",
            &["parameter", "first", "second", "difference, 95 %", "p-value"],
            rows.collect(),
        )))
}
