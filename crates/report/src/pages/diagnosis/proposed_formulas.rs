//! Formulas for an unmodelled force: the residual over the variable that carries it, and effects to try.

use crate::chart_model::{Chart, Level, LineStyle, Series};
use crate::page_model::{Cell, Section, Table};
use crate::palette::Colour;
use stylet_diagnose::DiagnosisResult;
use stylet_diagnose::diagnosis_json::{ProposedFormula, ResidualCurve};
use stylet_scenario::effects_to_ron;
use stylet_stats::number_format::significant;

/// The section; empty where no formulas are proposed.
pub(super) fn proposed_formulas(examined: &DiagnosisResult) -> Section {
    let section = Section::new("Proposed formulas");
    let Some(formulas) = &examined.diagnosis.formulas else { return section };
    let carriers = formulas.variables.iter().map(|v| {
        vec![
            Cell::text(v.variable.clone()),
            Cell::text(v.factor.clone()),
            Cell::number(significant(v.gain_nats, 3)),
        ]
    });
    let mut section = section
        .text(
            "What the residual is a function of, and formulas to try as custom effects. They describe these recordings and are no verdict: \
             ask which mechanism gives such a force, and search for it with --effects proposed_effects.ron.",
        )
        .table(Table::new(
            "Variables (path: length of the whole path)",
            &["variable", "force", "gain on recordings left out (nats)"],
            carriers.collect(),
        ))
        .chart(curve_chart(&formulas.curve));
    if formulas.proposals.is_empty() {
        return section.text(
            "No formula of at most two terms predicts held-out recordings better than the model without it.",
        );
    }
    let without_n = examined.diagnosis.gain.rmse_after_n;
    section = section.table(Table::new(
        format!("Formulas; without one, the held-out RMS error is {} N", significant(without_n, 3)),
        &["name", "force (N)", "parameters (SI)", "number of parameters", "held-out RMS (N)"],
        formulas.proposals.iter().map(row).collect(),
    ));
    section.folded("proposed_effects.ron", effects_to_ron(&examined.proposed_effects).unwrap_or_default())
}

fn row(p: &ProposedFormula) -> Vec<Cell> {
    let parameters: Vec<String> =
        p.parameters.iter().map(|(name, value)| format!("{name} = {}", significant(*value, 3))).collect();
    vec![
        Cell::text(p.name.clone()),
        Cell::text(p.formula.clone()),
        Cell::text(parameters.join(", ")),
        Cell::number(p.complexity.to_string()),
        Cell::number(significant(p.held_out_n, 3)),
    ]
}

fn curve_chart(c: &ResidualCurve) -> Chart {
    let edge = |name: &str, y: &Vec<f64>| {
        Series::line(name, Colour::Grey, c.x.clone(), y.clone()).styled(LineStyle::Dotted).width(1.0)
    };
    Chart::new(
        format!("Residual as {}, over {}", c.factor, c.variable),
        format!("{} ({})", c.variable, c.unit),
        "f (SI)",
    )
    .caption("Piecewise linear; dotted: 95 % interval from the differences between the recordings.")
    .height(260)
    .with_level(Level::zero())
    .with_series(edge("low", &c.low))
    .with_series(edge("high", &c.high))
    .with_series(Series::line("f", Colour::Blue, c.x.clone(), c.value.clone()))
}
