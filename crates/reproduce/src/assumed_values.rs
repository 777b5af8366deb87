//! All assumed values, with the verdicts that depend on them.

use crate::algorithm_variant::{Ablation, Sensor};
use crate::all_runs::Study;
use crate::assumed_value_changes::AssumedValue;
use crate::claims::{Claim, VISIBLE_RATIO};
use crate::effect_size::{Effect, ExperimentValues, MIN_SEED_SHARE, Measured, Scale};
use crate::paper_experiments::Case;
use crate::run_outcome::Outcome;
use crate::study_conditions::View;
use crate::value_source::{Class, SourcedTable, inputs};
use stylet_report::{Cell, Section, Status, Table};

/// Distinct values of an assumed value in the experiments that use it.
fn values(assumed: AssumedValue) -> (String, String) {
    let (mut values, mut classes): (Vec<String>, Vec<&str>) = (Vec::new(), Vec::new());
    for case in Case::ALL {
        let Ok(scenario) = case.scenario() else { continue };
        for input in inputs(case, &scenario).into_iter().filter(|i| i.assumed_value == Some(assumed)) {
            if !values.contains(&input.value) {
                values.push(input.value);
            }
            if !classes.contains(&input.class.words()) {
                classes.push(input.class.words());
            }
        }
    }
    if assumed == AssumedValue::GelContrast {
        values.push("0.5 and 1.33 between neighbours".to_owned());
        classes.push(Class::Ours.words());
    }
    (values.join("; "), classes.join(", "))
}

fn row(assumed: AssumedValue, claims: &[Claim]) -> Vec<Cell> {
    let (value, class) = values(assumed);
    let [halved, doubled] = assumed.changes();
    let claims_decided_by = |change| {
        let ids: Vec<String> = claims
            .iter()
            .filter(|c| c.trials.iter().any(|t| t.change == change && t.decides))
            .map(|c| c.id.clone())
            .collect();
        if ids.is_empty() { Cell::text("none") } else { Cell::text(ids.join(", ")).status(Status::Warn) }
    };
    let tried: Vec<&str> = claims
        .iter()
        .filter(|c| c.trials.iter().any(|t| t.change.value == assumed))
        .map(|c| c.id.as_str())
        .collect();
    vec![
        Cell::text(assumed.name()),
        Cell::text(value),
        Cell::text(class),
        claims_decided_by(halved),
        claims_decided_by(doubled),
        Cell::text(tried.join(", ")),
    ]
}

/// The effect with its interval: limits outside it give the same verdict.
fn interval_text(effect: &Effect) -> String {
    effect.interval.map_or("–".to_owned(), |_| effect.words())
}

/// A claim's effect with changed values, and whether its verdict depends on them.
fn effects_with_changes(claims: &[Claim], id: &str, tried: &[(&str, Effect)]) -> String {
    let Some(primary) = claims.iter().find(|c| c.id == id).and_then(|c| c.primary.as_ref()) else {
        return String::new();
    };
    let side = primary.bar.side(&primary.effect);
    let tried = tried.iter().map(|(with, effect)| {
        let decides = if primary.bar.side(effect) == side { "no other verdict" } else { "decides" };
        format!("{with}: {}, {decides}", effect.words())
    });
    format!("({id}) {}", tried.collect::<Vec<_>>().join("; "))
}

fn share(runs: &[&[Outcome]], holds: impl Fn(&Outcome) -> bool) -> Effect {
    let part = |runs: &&[Outcome]| {
        ExperimentValues::new("", runs.iter().map(|o| Some(f64::from(u8::from(holds(o))))))
    };
    Measured { scale: Scale::Share, parts: runs.iter().map(part).collect() }.effect()
}

/// Claim d with other thresholds of visibility.
fn other_visibility_thresholds(study: &Study, claims: &[Claim]) -> String {
    let runs = View::primary(study).kv(Case::Gel25Sinusoidal);
    let with = |times: f64| {
        let bar = 1.0 + times * (VISIBLE_RATIO - 1.0);
        share(&[runs], |o| o.cumulative_ratio.is_some_and(|r| r > bar))
    };
    effects_with_changes(claims, "d", &[("halved", with(0.5)), ("doubled", with(2.0))])
}

/// Claims e and f1 if a rupture must be found within 0.5 s.
fn shorter_detection_window(study: &Study, claims: &[Claim]) -> String {
    use Sensor::{ForceTorque, Virtual};
    let view = View::primary(study);
    let of = |list: &[(Case, Sensor)]| {
        let runs: Vec<&[Outcome]> =
            list.iter().map(|(case, sensor)| view.runs(*case, *sensor, false, Ablation::None)).collect();
        share(&runs, |o| {
            o.found_all() && o.score.ruptures.iter().all(|r| r.delay_s.is_some_and(|delay_s| delay_s <= 0.5))
        })
    };
    let stack = [(Case::LatexConstant, ForceTorque), (Case::LatexSinusoidal, ForceTorque)];
    let either = [
        (Case::Liver, ForceTorque),
        (Case::Abdomen, ForceTorque),
        (Case::LiverArm, Virtual),
        (Case::AbdomenArm, Virtual),
    ];
    let e = effects_with_changes(claims, "e", &[("halved", of(&stack))]);
    format!("{e}; {}", effects_with_changes(claims, "f1", &[("halved", of(&either))]))
}

/// The claims whose effect would exist, or not, with another required share of seeds.
fn other_seed_shares(claims: &[Claim]) -> String {
    let others = |share: f64| {
        let ids: Vec<&str> = claims
            .iter()
            .filter_map(|c| Some((c.id.as_str(), &c.primary.as_ref()?.effect)))
            .filter(|(_, e)| e.of > 0 && (e.seeds as f64 >= share * e.of as f64) != e.interval.is_some())
            .map(|(id, _)| id)
            .collect();
        if ids.is_empty() { "none".to_owned() } else { ids.join(", ") }
    };
    format!(
        "claims whose primary effect then exists or exists no longer: halved {}, all seeds asked for {}",
        others(MIN_SEED_SHARE / 2.0),
        others(1.0)
    )
}

/// The section of the page.
#[must_use]
pub fn section(study: &Study, claims: &[Claim]) -> Section {
    let numbers = AssumedValue::ALL.iter().map(|n| row(*n, claims)).collect();
    let bars = claims
        .iter()
        .filter_map(|c| {
            let primary = c.primary.as_ref()?;
            Some(vec![
                Cell::text(format!("({}) {}", c.id, c.claim)),
                Cell::text(primary.bar.words()),
                Cell::text(Class::Ours.words()),
                Cell::number(interval_text(&primary.effect)),
            ])
        })
        .collect();
    let fixed: [(&str, &str, String); 10] = [
        (
            "duration of the abdomen's motion",
            "15 s",
            "not tried: it ends in the kidney, before the last face; the durations of all others are in the table above".to_owned(),
        ),
        (
            "the 2 mm blind travel, guards, straight-line drops",
            "Algorithm: Paper",
            "completions: the switch Literal turns them off, section Switches and sensitivity condition of claim e".to_owned(),
        ),
        (
            "our detection for the virtual sensor",
            "s1 0.015 N",
            "outside the published range: sensitivity conditions of claim f1 alone, which decide nothing".to_owned(),
        ),
        (
            "arm",
            "Panda without joint friction",
            "not tried as a primary condition; sensitivity conditions of claim f1 have the friction".to_owned(),
        ),
        (
            "tuning grid and seeds",
            "s1 0.15, 0.1, 0.05, 0.03 N; beta 0.075, 0.05, 0.15 N/s; 10 seeds, 4 on the arm",
            "the published range; the sensitivity condition \"published default tuning\" does without".to_owned(),
        ),
        ("when a rupture counts as found", "declared within 1 s", shorter_detection_window(study, claims)),
        ("over-compensation that is visible", "5 %", other_visibility_thresholds(study, claims)),
        ("share of the seeds that must give a value", "0.8", other_seed_shares(claims)),
        ("halving and doubling", "a factor of two", "an assumed bound on the error of a chosen value".to_owned()),
        (
            "noise seeds",
            "50; 12 for halved and doubled numbers, 2 on the arm",
            "tests/reproduced_claims.rs: two disjoint sets of fifty give the same verdicts".to_owned(),
        ),
    ];
    let fixed = fixed.map(|(what, value, why)| {
        vec![Cell::text(what), Cell::text(value), Cell::text(Class::Ours.words()), Cell::text(why)]
    });
    Section::new("Assumed values, and the verdicts that depend on them")
        .text(
            "Every number that the paper does not give was halved and doubled, one at a time, and the primary conditions computed again. A claim's letter: its \
             effect then lies on the other side of the limit, or exists only with or only without the change; such a verdict is `assumed`.",
        )
        .table(
            SourcedTable::named(Table {
                title: "Halved and doubled".to_owned(),
                headers: ["number", "value", "whose", "halved: verdicts that change", "doubled: verdicts that change", "tried on"]
                    .map(String::from)
                    .to_vec(),
                rows: numbers,
                ..Table::default()
            })
            .into_table(),
        )
        .table(
            SourcedTable::named(Table {
                title: "Criteria: a verdict changes when its limit is moved across the interval".to_owned(),
                headers: ["claim (the paper's)", "criterion", "whose", "effect (computed)"].map(String::from).to_vec(),
                rows: bars,
                ..Table::default()
            })
            .into_table(),
        )
        .table(
            SourcedTable::named(Table {
                title: "Chosen, but not halved and doubled".to_owned(),
                headers: ["what", "value", "whose", "what depends on it (computed)"].map(String::from).to_vec(),
                rows: fixed.into(),
                ..Table::default()
            })
            .into_table(),
        )
}
