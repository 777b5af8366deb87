//! Promise: in a world that it did not make and in which nothing is wrong, the diagnosis accuses nobody, and finds most of what is
//! strong. A sample of `stylet benchmark diagnose`, which examines as many cases as you like.

use stylet_diagnose::{Evidence, Options};
use stylet_examine::{Answer, CaseId, Grade, Hide, Plan, Question, Size, World, Wrong, run, table};
use stylet_scenario::Scenario;

fn answer(question: &Question) -> Result<Answer, String> {
    let scenario = Scenario::parse("believed.ron", &question.believed_ron).map_err(|e| e.to_string())?;
    let evidence: Vec<Evidence> = question
        .recordings
        .iter()
        .map(|r| Evidence { name: r.name.clone(), recording: r.recording.clone(), notes: Vec::new() })
        .collect();
    let examined = stylet_diagnose::diagnose(&scenario, &evidence, &Options::default(), |_| {})
        .map_err(|e| e.to_string())?;
    let json = serde_json::to_string(&examined.diagnosis).map_err(|e| e.to_string())?;
    Answer::from_json(&json).map_err(|e| e.to_string())
}

#[test]
fn in_a_world_that_it_did_not_make_clean_data_are_not_accused_and_strong_effects_are_found() {
    let plan = Plan { hide: vec![Hide::Clean, Hide::One], cases: 8, seed: 1, ..Plan::default() };
    let outcomes = run(&plan.cases(), None, &answer, &|_, _| {}).expect("a run");
    let table = table::text(&outcomes);
    println!("{table}");
    let clean: Vec<_> = outcomes.iter().filter(|o| o.id.hide == Hide::Clean).collect();
    assert_eq!(clean.len(), 4);
    assert!(clean.iter().all(|o| o.worth.right), "{table}");
    let found = outcomes.iter().filter(|o| o.id.hide == Hide::One && o.worth.right).count();
    assert!(found >= 3, "{table}");
    // Something was hidden, and it mattered.
    assert!(outcomes.iter().any(|o| o.strength_sd > 5.0));
}

/// In these worlds it was taken for scatter between insertions once.
#[test]
fn a_puncture_force_that_depends_on_the_speed_is_found_where_it_was_missed_once() {
    let rows =
        [(Wrong::Growing, 11), (Wrong::Encoder, 17), (Wrong::SurfaceEach, 18), (Wrong::ScatterFriction, 13)];
    let of = |(wrong, index): (Wrong, u64)| {
        let id = |hide, index| CaseId {
            world: World::Plain,
            wrong,
            grade: Grade::Large,
            hide,
            size: Size::Strong,
            seed: 3,
            index,
        };
        [id(Hide::One, index), id(Hide::Clean, 0)]
    };
    let cases: Vec<CaseId> = rows.into_iter().flat_map(of).collect();
    let outcomes = run(&cases, None, &answer, &|_, _| {}).expect("a run");
    let table = table::text(&outcomes);
    let (clean, one): (Vec<_>, Vec<_>) = outcomes.iter().partition(|o| o.id.hide == Hide::Clean);
    assert_eq!((clean.len(), one.len()), (4, 4));
    assert!(clean.iter().all(|o| o.worth.right), "{table}");
    assert!(one.iter().all(|o| o.hidden == ["rate_dependent_puncture"] && o.worth.right), "{table}");
}
