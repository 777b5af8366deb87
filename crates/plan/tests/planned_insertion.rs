//! A planned insertion distinguishes effects that one at constant speed leaves open, and the diagnosis of both
//! recordings names the true one.

use stylet_diagnose::{NamedRecording, Options, Verdict, diagnose};
use stylet_plan::{Limits, check_by_simulation, from_diagnosis, from_scenario, identifiability, plan};
use stylet_scenario::{Motion, Scenario};

const LIMITS: Limits =
    Limits { depth_m: 0.05, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 60.0, force_n: 20.0 };

fn assumed() -> Scenario {
    Scenario::parse(
        "test",
        r#"Scenario(name: "two gels", tissue: (layers: [
            (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
            (thickness_m: 0.03, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0)]),
            motion: Constant(start_m: -0.005, velocity_mps: 0.0025, duration_s: 22.0), robot: Replay)"#,
    )
    .expect("a scenario")
}

fn measured(motion: &Motion, seed: u64) -> NamedRecording {
    let mut there = assumed();
    there
        .effects
        .push(stylet_tissue::AnyEffect::from_parameters("coulomb_friction", &[5.0]).expect("an effect"));
    there.tissue.layers[0].friction_ns_per_m2 *= 0.95;
    there.motion = motion.clone();
    let recording = stylet_testbed::simulate(&there, seed).expect("simulated").recording;
    NamedRecording { name: format!("{seed}.csv"), recording, notes: Vec::new() }
}

#[test]
fn a_planned_motion_identifies_friction_laws_hidden_at_constant_speed() {
    let scenario = assumed();
    let (before, begin) = from_scenario(&scenario, None).expect("an information state");
    let seen = identifiability(&before);
    for hidden in ["coulomb_friction", "stribeck_friction", "force_gain"] {
        assert!(
            seen.not_identifiable.iter().any(|i| i == hidden),
            "{hidden} at one constant speed: {:?}",
            seen.not_identifiable
        );
    }
    assert!(!seen.not_identifiable.iter().any(|i| i == "periodic_interference"));
    let planned = plan(&before, &LIMITS, &begin).expect("a plan").0;
    let after =
        identifiability(&from_scenario(&scenario, Some(&planned.motion)).expect("an information state").0);
    for shown in ["coulomb_friction", "stribeck_friction"] {
        assert!(!after.not_identifiable.iter().any(|i| i == shown), "{shown}: {:?}", after.not_identifiable);
    }
    // An unidentifiable effect stays so under any motion.
    assert!(
        after.not_identifiable.iter().any(|i| i == "force_gain")
            && planned.never_detectable.iter().any(|n| n == "force_gain")
    );
}

#[test]
fn the_planned_insertion_leads_to_the_correct_single_effect() {
    let scenario = assumed();
    let first = measured(&scenario.motion, 1);
    let blind =
        diagnose(&scenario, std::slice::from_ref(&first), &Options::default(), |_| {}).expect("a diagnosis");
    assert_eq!(blind.diagnosis.verdict, Verdict::None);
    assert!(blind.diagnosis.not_identifiable.iter().any(|i| i == "coulomb_friction"));
    let (state, begin) = from_diagnosis(&scenario, &blind).expect("an information state");
    let planned = plan(&state, &LIMITS, &begin).expect("a plan").0;
    assert!(planned.probability_decided > planned.probability_now + 0.3);
    // The recordings have different motions.
    let both = [first, measured(&planned.motion, 2)];
    let actual = diagnose(&scenario, &both, &Options { brief: true, ..Options::default() }, |_| {})
        .expect("a diagnosis")
        .diagnosis;
    assert_eq!(actual.verdict, Verdict::Named, "{:?}", actual.causes);
    assert_eq!(actual.causes.iter().map(|c| c.effect.as_str()).collect::<Vec<_>>(), ["coulomb_friction"]);
}

#[test]
fn the_plan_does_not_depend_on_the_number_of_threads() {
    let one = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let (state, begin) = from_scenario(&assumed(), None).expect("an information state");
            plan(&state, &LIMITS, &begin).expect("a plan").0
        })
    };
    assert_eq!(one(1), one(3));
}

#[test]
#[ignore = "a minute; tests/accuracy.sh"]
fn the_selected_motion_is_tested_on_separate_simulations() {
    let scenario = assumed();
    let first = measured(&scenario.motion, 1);
    let blind =
        diagnose(&scenario, std::slice::from_ref(&first), &Options::default(), |_| {}).expect("a diagnosis");
    let (state, begin) = from_diagnosis(&scenario, &blind).expect("an information state");
    let (by_gaps, mut found) = plan(&state, &LIMITS, &begin).expect("a plan");
    found.best.truncate(2);
    let mut actual = Vec::new();
    let checked =
        check_by_simulation(&found, &LIMITS, &scenario, &state, std::slice::from_ref(&first), |what| {
            actual.push(what.to_owned());
        })
        .expect("a plan");
    assert_eq!(checked.probability_source, "simulated");
    assert!(found.best.iter().any(|f| f.motion == checked.motion));
    // The other motion was simulated as well and was not better.
    let other = &checked.alternatives[0];
    assert!(other.simulated > 0 && other.correct <= other.simulated);
    assert!(checked.simulated.iter().all(|t| t.trials > 0 && t.correct <= t.trials));
    // Most simulated insertions decide, and the reported probability agrees with them.
    let (of, decided) = checked.simulated.iter().fold((0, 0), |(n, d), t| (n + t.trials, d + t.correct));
    assert!(2 * decided > of, "{:?}", checked.simulated);
    assert!((checked.probability_decided - decided as f64 / of as f64).abs() < 0.25);
    assert!(checked.probability_decided > by_gaps.probability_now);
    assert!(actual.iter().any(|what| what.starts_with("motion 2 of 2")));
}
