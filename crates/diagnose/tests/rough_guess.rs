//! Scenarios whose numbers are a rough guess, and none at all: the right numbers are found, and what the simulation lacks is named
//! as from the right ones.

use stylet_diagnose::{Diagnosis, NamedRecording, Options, Verdict, diagnose, scenario_from_recordings};
use stylet_examine::{Case, CaseId, Hide, NamedFile, Severity, Size, World, Wrong, make_case};
use stylet_scenario::Scenario;

fn case(seed: u64, severity: Severity, hide: Hide, index: u64) -> (Case, Scenario, Vec<NamedRecording>) {
    let id =
        CaseId { world: World::Plain, wrong: Wrong::Guess, severity, hide, size: Size::Strong, seed, index };
    let case = make_case(&id).expect("a case of the simulator");
    let scenario = Scenario::parse("guess", case.question.assumed_ron.as_deref().expect("a scenario"))
        .expect("its scenario");
    let named = |r: &NamedFile| NamedRecording {
        name: r.name.clone(),
        recording: r.recording.clone(),
        notes: Vec::new(),
    };
    let recordings = case.question.recordings.iter().map(named).collect();
    (case, scenario, recordings)
}

/// Share of the fitted base parameters whose interval holds the truth.
fn held(d: &Diagnosis, case: &Case) -> f64 {
    let truth = &case.setup.truth;
    let held: Vec<bool> = d
        .base_parameters
        .iter()
        .filter_map(|b| {
            let layer = truth.layers.get(b.layer.checked_sub(1)?)?;
            let value = match b.name.as_str() {
                "stiffness_n_per_m" => layer.stiffness_n_per_m,
                "friction_ns_per_m2" => layer.friction_ns_per_m2,
                "thickness_m" => layer.thickness_m,
                _ => return None,
            };
            Some(b.low <= value && value <= b.high)
        })
        .collect();
    held.iter().filter(|h| **h).count() as f64 / held.len() as f64
}

#[test]
fn numbers_wrong_by_a_factor_up_to_three_are_found_and_said_and_nothing_is_accused() {
    for index in 0..2 {
        let (case, scenario, recordings) = case(4, Severity::Medium, Hide::Clean, index);
        let d = diagnose(&scenario, &recordings, &Options::default(), |_| {}).expect("a diagnosis").diagnosis;
        assert_eq!(d.verdict, Verdict::Parameters, "case {index}: {:?}", d.causes);
        assert!(d.findings.iter().any(|f| f.message.contains("times too")), "{:?}", d.findings);
        assert!(held(&d, &case) > 0.8, "case {index}: {:?}", d.base_parameters);
    }
}

/// Each of these effects shifts the layers that a fit without it finds.
#[test]
#[ignore = "half a minute; tests/accuracy.sh"]
fn one_effect_is_named_alone_although_the_numbers_are_guessed() {
    for (severity, index, effect) in [
        (Severity::Large, 2, "saturation"),
        (Severity::Large, 3, "cutting_force"),
        (Severity::Small, 5, "incomplete_release"),
    ] {
        let (_, scenario, recordings) = case(20001, severity, Hide::One, index);
        let d = diagnose(&scenario, &recordings, &Options::default(), |_| {}).expect("a diagnosis").diagnosis;
        let causes: Vec<&str> = d.causes.iter().map(|c| c.effect.as_str()).collect();
        assert_eq!((d.verdict, causes), (Verdict::Named, vec![effect]), "{:?}", d.findings);
    }
}

#[test]
fn without_a_scenario_the_layers_are_found() {
    let (case, _, recordings) = case(4, Severity::Small, Hide::Clean, 2);
    let found = scenario_from_recordings("phantom", &recordings, None).expect("layers");
    let truth = &case.setup.truth;
    assert_eq!(found.tissue.layers.len(), truth.layers.len());
    let d = diagnose(&found, &recordings, &Options::default(), |_| {}).expect("a diagnosis");
    assert!(d.diagnosis.causes.is_empty(), "{:?}", d.diagnosis.causes);
    for k in 1..truth.layers.len() {
        let (is_m, was_m) = (
            d.extended_scenario.tissue.front_m(k),
            truth.layers[..k].iter().map(|l| l.thickness_m).sum::<f64>(),
        );
        assert!((is_m - was_m).abs() < 3e-4, "face {k}: {is_m} m, truth {was_m} m");
    }
    assert!(held(&d.diagnosis, &case) > 0.8, "{:?}", d.diagnosis.base_parameters);
}
