//! All chosen numbers, with the verdicts that hang on them.

use crate::case::Case;
use crate::change::Number;
use crate::claims::Claim;
use crate::effect::Effect;
use crate::source::{Class, Sourced, inputs};
use stylet_report::{Cell, Section, Status, Table};

/// Values of a number in the experiments that it enters, each once.
fn values(number: Number) -> (String, String) {
    let (mut values, mut classes): (Vec<String>, Vec<&str>) = (Vec::new(), Vec::new());
    for case in Case::ALL {
        let Ok(scenario) = case.scenario() else { continue };
        for input in inputs(case, &scenario).into_iter().filter(|i| i.number == Some(number)) {
            if !values.contains(&input.value) {
                values.push(input.value);
            }
            if !classes.contains(&input.class.words()) {
                classes.push(input.class.words());
            }
        }
    }
    if number == Number::GelContrast {
        values.push("0.5 and 1.33 between neighbours".to_owned());
        classes.push(Class::Ours.words());
    }
    (values.join("; "), classes.join(", "))
}

fn row(number: Number, claims: &[Claim]) -> Vec<Cell> {
    let (value, class) = values(number);
    let [halved, doubled] = number.changes();
    let hang = |change| {
        let ids: Vec<String> = claims
            .iter()
            .filter(|c| c.trials.iter().any(|t| t.change == change && t.decides))
            .map(|c| c.id.clone())
            .collect();
        if ids.is_empty() { Cell::text("none") } else { Cell::text(ids.join(", ")).status(Status::Warn) }
    };
    let tried: Vec<&str> = claims
        .iter()
        .filter(|c| c.trials.iter().any(|t| t.change.number == number))
        .map(|c| c.id.as_str())
        .collect();
    vec![
        Cell::text(number.name()),
        Cell::text(value),
        Cell::text(class),
        hang(halved),
        hang(doubled),
        Cell::text(tried.join(", ")),
    ]
}

/// How far the interval is from the bar: what the bar could be without another verdict.
fn room(effect: &Effect) -> String {
    effect.interval.map_or("–".to_owned(), |_| effect.words())
}

/// The section of the page.
#[must_use]
pub fn section(claims: &[Claim]) -> Section {
    let numbers = Number::ALL.iter().map(|n| row(*n, claims)).collect();
    let bars = claims
        .iter()
        .filter_map(|c| {
            let primary = c.primary.as_ref()?;
            Some(vec![
                Cell::text(format!("({}) {}", c.id, c.claim)),
                Cell::text(primary.bar.words()),
                Cell::text(Class::Ours.words()),
                Cell::number(room(&primary.effect)),
            ])
        })
        .collect();
    let fixed = [
        ("duration of the motions", "10 to 50 s", "air behind the target; nothing is asked of it"),
        (
            "the 2 mm blind travel, guards, straight-line drops",
            "Algorithm: Paper",
            "completions: the switch Literal turns them off, section Switches",
        ),
        (
            "our detection for the virtual sensor",
            "s1 0.015 N",
            "outside the published range: sensitivity conditions of claim f1 alone",
        ),
        ("arm", "Panda without joint friction", "sensitivity conditions of claim f1 have the friction"),
        (
            "tuning grid and seeds",
            "s1 0.15, 0.1, 0.05, 0.03 N; beta 0.075, 0.05, 0.15 N/s; 10 seeds",
            "the published range; the condition \"published default tuning\" does without",
        ),
        ("share of seeds that must give a value", "0.8", "below it there is no effect"),
        ("halving and doubling", "a factor of two", "a guess at how wrong a chosen number can be"),
    ]
    .map(|(what, value, why)| {
        vec![Cell::text(what), Cell::text(value), Cell::text(Class::Ours.words()), Cell::text(why)]
    });
    Section::new("Numbers of ours, and the verdicts that hang on them")
        .text(
            "Every number that the paper does not give was halved and doubled, one at a time, and the primary conditions computed anew. A claim's letter: its \
             effect then lies on the other side of the bar, or exists only with or only without the change; such a verdict is `assumed`.",
        )
        .table(
            Sourced::named(Table {
                title: "Halved and doubled".to_owned(),
                headers: ["number", "value", "whose", "halved: hang on it", "doubled: hang on it", "tried on"]
                    .map(String::from)
                    .to_vec(),
                rows: numbers,
                ..Table::default()
            })
            .into_table(),
        )
        .table(
            Sourced::named(Table {
                title: "Bars: a verdict changes when its bar is moved across the interval".to_owned(),
                headers: ["claim", "bar", "whose", "effect (computed)"].map(String::from).to_vec(),
                rows: bars,
                ..Table::default()
            })
            .into_table(),
        )
        .table(
            Sourced::named(Table {
                title: "Chosen, but not halved and doubled".to_owned(),
                headers: ["what", "value", "whose", "what hangs on it"].map(String::from).to_vec(),
                rows: fixed.into(),
                ..Table::default()
            })
            .into_table(),
        )
}
