//! S Fig. 1: the state machine, drawn from the core's own table of transitions.

use super::figure::Figure;
use super::supplement_comparison;
use crate::value_source::{Class, SourcedTable};
use stylet_core::config::DerivativeSense;
use stylet_core::{EnhanceConfig, State, TRANSITIONS};
use stylet_report::svg::{Arrow, Diagram, FigureOptions, Node, state_machine};
use stylet_report::{Cell, Table, significant};

/// Position of a state in the drawing; everything else is read from the core.
const fn place(state: State) -> (f64, f64) {
    match state {
        State::NoRupture => (170.0, 160.0),
        State::ExpectedRupture => (560.0, 160.0),
        State::DetectedRupture => (950.0, 160.0),
        State::ForceDropMeasuring => (950.0, 360.0),
        State::ForceCompensation => (170.0, 360.0),
        // Not a state of the paper; not drawn.
        State::FreeTip => (0.0, 0.0),
    }
}

/// Curvature of an arrow that avoids boxes and the reverse arrow.
const fn bend(from: State, to: State) -> f64 {
    match (from, to) {
        (State::NoRupture, State::ExpectedRupture) => 26.0,
        (State::ExpectedRupture, State::NoRupture) => 26.0,
        (State::NoRupture, State::DetectedRupture) => 108.0,
        (State::DetectedRupture, State::ForceCompensation) => -24.0,
        _ => 0.0,
    }
}

/// The name in words: `ForceDropMeasuring` in two lines.
fn lines(state: State) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for letter in state.name().chars() {
        match words.last_mut() {
            Some(word) if letter.is_lowercase() => word.push(letter),
            Some(_) => words.push(letter.to_lowercase().to_string()),
            None => words.push(letter.to_string()),
        }
    }
    match words.len() {
        3 => vec![words[..2].join(" "), words[2].clone()],
        _ => words,
    }
}

/// Comparison of sec. I of the supplement with this implementation.
fn statements() -> Vec<[String; 3]> {
    let derivative = EnhanceConfig::paper().derivative;
    let completions = TRANSITIONS.iter().filter(|t| !t.in_supplement).count();
    [
        (
            "a rupture is detected when the CUSUM raises, or expected when the force derivative does, and then detected by the CUSUM or \
             the derivative's trailing edge",
            format!("{} transitions, {completions} of them not in the supplement", TRANSITIONS.len()),
            "a needle that turns back or rests is no rupture; a known far face ends a layer in Stylet",
        ),
        (
            "eq. (1): the force of one sample less that of the one before, above beta; the text speaks of force drops",
            format!(
                "the low-passed derivative in N/s, acting on the {} force",
                if derivative.sense == DerivativeSense::Rise { "rising" } else { "falling" }
            ),
            "as in the laboratory's tuning; the falling force is the switch Drop, see Switches",
        ),
        (
            "the machine waits for a time T_drop,i",
            format!("{} mm of travel", significant(1e3 * EnhanceConfig::paper().drop.travel_m, 3)),
            "the laboratory waits for a travel; at constant velocity the two are the same",
        ),
    ]
    .map(|(says, here, why)| [says.to_owned(), here, why.to_owned()])
    .into()
}

pub(super) fn figure() -> Figure {
    let index = |state: State| State::ALL.iter().position(|s| *s == state).unwrap_or_default();
    let diagram = Diagram {
        nodes: State::ALL.iter().map(|s| Node { lines: lines(*s), at: place(*s) }).collect(),
        arrows: TRANSITIONS
            .iter()
            .map(|t| Arrow {
                from: index(t.from),
                to: index(t.to),
                lines: t.triggers.iter().map(|trigger| trigger.description().to_owned()).collect(),
                bend_px: bend(t.from, t.to),
                dashed: !t.in_supplement,
            })
            .collect(),
        height_px: 410.0,
    };
    let options = FigureOptions { width_px: 1120.0, ..FigureOptions::default() };
    let svg = state_machine(&diagram, &options);
    let rows = TRANSITIONS
        .iter()
        .map(|t| {
            let words: Vec<&str> = t.triggers.iter().map(|trigger| trigger.description()).collect();
            vec![
                Cell::text(t.from.name()),
                Cell::text(t.to.name()),
                Cell::text(words.join(" · ")),
                Cell::text(if t.in_supplement { Class::Paper } else { Class::Ours }.words()),
            ]
        })
        .collect();
    Figure {
        number: "S Fig. 1",
        title: "Finite state machine of the rupture detection".to_owned(),
        caption: "Corresponds to the supplement's Fig. 1. Drawn from the table of transitions of the online core, which a test holds \
                  against the transitions that runs make. Dashed: not in the supplement."
            .to_owned(),
        force: None,
        pictures: vec![svg.clone()],
        files: vec![("figure_s01.svg", svg)],
        tables: vec![
            supplement_comparison::statement_table(statements()),
            SourcedTable::named(Table {
                headers: ["from", "to", "when", "whose"].map(String::from).to_vec(),
                rows,
                ..Table::default()
            }),
        ],
    }
}
