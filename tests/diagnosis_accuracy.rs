//! Accuracy of the diagnosis on cases of the independent simulator: no false positives on clean data, and most strong effects are
//! identified. A sample of `stylet benchmark diagnose`; the longest are run by `tests/accuracy.sh`.

use stylet_diagnose::prediction::{Factor, PredictionOptions, Refit, predict, training_summary};
use stylet_diagnose::{NamedRecording, Options};
use stylet_examine::{
    Answer, CaseId, Hide, Plan, Question, Severity, Size, World, Wrong, results_table, run_cases,
};
use stylet_scenario::{Motion, Scenario, Segment};
use stylet_tissue::{AnyEffect, CoulombFriction, ForceDrift};

/// The assumed scenario and the recordings of a case.
fn inputs(question: &Question) -> Result<(Scenario, Vec<NamedRecording>), String> {
    let ron = question.assumed_ron.as_deref().unwrap_or_default();
    let scenario = Scenario::parse("assumed.ron", ron).map_err(|e| e.to_string())?;
    let recordings = question.recordings.iter();
    let recordings = recordings.map(|r| NamedRecording {
        name: r.name.clone(),
        recording: r.recording.clone(),
        notes: Vec::new(),
    });
    Ok((scenario, recordings.collect()))
}

fn answer(question: &Question) -> Result<Answer, String> {
    let (scenario, recordings) = inputs(question)?;
    let examined = stylet_diagnose::diagnose(&scenario, &recordings, &Options::default(), |_| {})
        .map_err(|e| e.to_string())?;
    let json = serde_json::to_string(&examined.diagnosis).map_err(|e| e.to_string())?;
    Answer::from_json(&json).map_err(|e| e.to_string())
}

/// A case of the plain world, all strong and by the largest severity.
fn case(wrong: Wrong, hide: Hide, seed: u64, index: u64) -> CaseId {
    CaseId { world: World::Plain, wrong, severity: Severity::Large, hide, size: Size::Strong, seed, index }
}

/// The first `count` cases of a seed that hide one effect.
fn cases_of(effect: &'static str, wrong: Wrong, seed: u64, count: usize) -> Vec<CaseId> {
    let plan = Plan {
        wrong: vec![wrong],
        hide: vec![Hide::One],
        cases: 200,
        only: vec![effect],
        seed,
        ..Plan::default()
    };
    plan.cases().into_iter().take(count).collect()
}

#[test]
fn clean_data_give_no_cause_and_strong_effects_are_identified() {
    let plan = Plan { hide: vec![Hide::Clean, Hide::One], cases: 8, seed: 1, ..Plan::default() };
    let outcomes = run_cases(&plan.cases(), None, &answer, &|_, _| {}).expect("a run");
    let table = results_table::results_text(&outcomes);
    println!("{table}");
    let clean: Vec<_> = outcomes.iter().filter(|o| o.id.hide == Hide::Clean).collect();
    assert_eq!(clean.len(), 4);
    assert!(clean.iter().all(|o| o.score.correct), "{table}");
    let found = outcomes.iter().filter(|o| o.id.hide == Hide::One && o.score.correct).count();
    assert!(found >= 3, "{table}");
    // The hidden effects were significant.
    assert!(outcomes.iter().any(|o| o.strength_sd > 5.0));
}

/// Its force steps at stops and layer boundaries resemble ruptures.
#[test]
#[ignore = "a minute; tests/accuracy.sh"]
fn a_cutting_force_with_steps_like_ruptures_is_identified() {
    let cases: Vec<CaseId> = [Wrong::Nothing, Wrong::ScatterPuncture, Wrong::Thickness]
        .into_iter()
        .flat_map(|wrong| cases_of("cutting_force", wrong, 128, 1))
        .collect();
    assert_eq!(cases.len(), 3);
    let outcomes = run_cases(&cases, None, &answer, &|_, _| {}).expect("a run");
    let table = results_table::results_text(&outcomes);
    assert!(outcomes.iter().all(|o| o.hidden == ["cutting_force"] && o.score.correct), "{table}");
}

/// Whether the shift of a boundary is larger than two standard deviations of the assumed thickness.
fn exceeds_tolerance(id: &CaseId) -> bool {
    let case = stylet_examine::make_case(id).expect("a case");
    let (assumed, _) = inputs(&case.question).expect("a scenario");
    let [(_, layer), (_, shift_m)] = &case.setup.effects[0].parameters()[..] else { return false };
    let thickness_m = assumed.tissue.layers[*layer as usize - 1].thickness_m;
    shift_m.abs() > 2.0 * assumed.thickness_tolerance * thickness_m
}

/// Shifts larger than the assumed tolerance of a thickness.
#[test]
#[ignore = "a minute; tests/accuracy.sh"]
fn a_shifted_boundary_is_distinguished_from_slightly_wrong_thicknesses() {
    let rows = [
        (Wrong::Nothing, 1),
        (Wrong::Ar2, 1),
        (Wrong::Thickness, 2),
        (Wrong::Coefficients, 1),
        (Wrong::ScatterSurface, 1),
    ];
    let of = |(wrong, count): (Wrong, usize)| {
        cases_of("boundary_shift", wrong, 128, 20).into_iter().filter(exceeds_tolerance).take(count)
    };
    let cases: Vec<CaseId> = rows.into_iter().flat_map(of).collect();
    assert_eq!(cases.len(), 6);
    let outcomes = run_cases(&cases, None, &answer, &|_, _| {}).expect("a run");
    let table = results_table::results_text(&outcomes);
    assert!(outcomes.iter().all(|o| o.hidden == ["boundary_shift"] && o.score.correct), "{table}");
    let shifts: Vec<_> =
        outcomes.iter().flat_map(|o| &o.parameters).filter(|n| n.name == "boundary_shift.shift_m").collect();
    assert!(
        shifts.len() == cases.len()
            && shifts.iter().filter(|n| n.interval_covers == Some(true)).count() + 1 >= cases.len(),
        "{table}"
    );
}

/// Not confused with scatter between insertions.
#[test]
#[ignore = "a minute; tests/accuracy.sh"]
fn a_rate_dependent_puncture_force_is_identified_under_wrong_assumptions() {
    let rows = [Wrong::Growing, Wrong::Encoder, Wrong::SurfaceEach, Wrong::ScatterFriction];
    let of = |wrong: Wrong| {
        let mut both = cases_of("rate_dependent_puncture", wrong, 3, 1);
        both.push(case(wrong, Hide::Clean, 3, 0));
        both
    };
    let cases: Vec<CaseId> = rows.into_iter().flat_map(of).collect();
    let outcomes = run_cases(&cases, None, &answer, &|_, _| {}).expect("a run");
    let table = results_table::results_text(&outcomes);
    let (clean, one): (Vec<_>, Vec<_>) = outcomes.iter().partition(|o| o.id.hide == Hide::Clean);
    assert_eq!((clean.len(), one.len()), (4, 4));
    assert!(clean.iter().all(|o| o.score.correct), "{table}");
    assert!(one.iter().all(|o| o.hidden == ["rate_dependent_puncture"] && o.score.correct), "{table}");
}

/// Two spectral lines close together and of equal size are no single tone.
#[test]
#[ignore = "a minute; tests/accuracy.sh"]
fn beats_are_not_identified_as_a_tone() {
    let outcomes =
        run_cases(&[case(Wrong::Nothing, Hide::Outside, 142, 6)], None, &answer, &|_, _| {}).expect("a run");
    let table = results_table::results_text(&outcomes);
    assert!(outcomes.iter().all(|o| o.hidden == ["beats_in_time"] && o.score.correct), "{table}");
}

/// Sensor drift must neither imitate a boundary shift nor hide a tone in the coloured noise.
#[test]
#[ignore = "a minute; tests/accuracy.sh"]
fn sensor_drift_is_no_boundary_shift_and_hides_no_tone() {
    let mut cases = vec![case(Wrong::Wander, Hide::Clean, 141, 0), case(Wrong::Wander, Hide::Clean, 141, 5)];
    for wrong in [Wrong::Wander, Wrong::Recordings] {
        cases.extend(cases_of("periodic_interference", wrong, 128, 1));
    }
    let outcomes = run_cases(&cases, None, &answer, &|_, _| {}).expect("a run");
    let table = results_table::results_text(&outcomes);
    assert!(outcomes.iter().all(|o| o.score.correct), "{table}");
    assert_eq!(outcomes.iter().filter(|o| o.hidden == ["periodic_interference"]).count(), 2);
}

#[test]
#[ignore = "a minute; tests/accuracy.sh"]
fn two_time_constants_of_relaxation_are_identified() {
    for terms in [1, 2] {
        let (case, truth) = cases_of("stress_relaxation", Wrong::Nothing, 128, 20)
            .iter()
            .filter_map(|id| stylet_examine::make_case(id).ok())
            .map(|case| (case.setup.effects[0].parameters(), case))
            .find(|(truth, _)| truth.len() == 2 * terms)
            .map(|(truth, case)| (case, truth))
            .expect("a case");
        assert!(truth[0].0.starts_with("terms.0.") && truth.len() == 2 * terms, "{truth:?}");
        let (assumed, recordings) = inputs(&case.question).expect("a scenario");
        let found = stylet_diagnose::diagnose(
            &assumed,
            &recordings,
            &Options { brief: true, ..Options::default() },
            |_| {},
        )
        .expect("a diagnosis")
        .diagnosis;
        let [cause] = found.causes.as_slice() else { panic!("{:?}", found.causes) };
        assert_eq!((cause.effect.as_str(), cause.parameters.len()), ("stress_relaxation", 2 * terms));
        for (path, value) in truth {
            let estimate = cause.parameters[&path];
            assert!((estimate.value / value - 1.0).abs() < 0.1, "{path}: {estimate:?} for {value}");
        }
    }
}

#[test]
fn the_model_of_a_diagnosis_predicts_a_held_out_recording_to_about_its_noise() {
    let plan = Plan { hide: vec![Hide::One], cases: 2, seed: 1, ..Plan::default() };
    for id in plan.cases() {
        let case = stylet_examine::make_case(&id).expect("a case");
        let (assumed, mut recordings) = inputs(&case.question).expect("a scenario");
        let kept = recordings.split_off(recordings.len() - 1);
        let found = stylet_diagnose::diagnose(
            &assumed,
            &recordings,
            &Options { brief: true, ..Options::default() },
            |_| {},
        )
        .expect("a diagnosis");
        let options = PredictionOptions { varying: Some(Vec::new()), ..PredictionOptions::default() };
        let predicted =
            predict(&found.extended_scenario, Some(&found.diagnosis), Some(&assumed), &options, &kept)
                .expect("a prediction");
        let p = &predicted.prediction;
        println!("{:?}: {p:?}", case.setup.effects);
        assert!(p.rmse_n < 1.25 * p.floor_n && p.held_out, "{p:?}");
        assert!((0.8..=0.98).contains(&p.band_coverage), "{p:?}");
        assert!(p.assumed_rmse_n.expect("of the assumed scenario") > 5.0 * p.rmse_n, "{p:?}");
    }
}

/// A needle with 30 % more friction, and a surface 1.5 mm closer.
#[test]
fn friction_and_surface_of_another_needle_are_refitted() {
    let text = "Scenario(name: \"two gels\", tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
        (thickness_m: 0.02, stiffness_n_per_m: 90.0, friction_ns_per_m2: 12000.0)]),
        motion: Program(start_m: -0.004, segments: [Move(velocity_mps: 0.004, duration_s: 8.0)]), robot: Replay)";
    let model = Scenario::parse("model.ron", text).expect("a scenario");
    let other = |seed: u64, velocity_mps: f64| {
        let mut scenario = model.clone();
        scenario.seed = seed;
        scenario.tissue.surface_m -= 1.5e-3;
        scenario.tissue.layers.iter_mut().for_each(|l| l.friction_ns_per_m2 *= 1.3);
        let duration_s = 0.032 / velocity_mps;
        let segments = vec![Segment::Move { velocity_mps, duration_s }];
        scenario.motion = Motion::Program { start_m: -0.004, segments };
        let recording = stylet_testbed::simulate(&scenario, seed).expect("an insertion").recording;
        NamedRecording { name: format!("{seed}"), recording, notes: Vec::new() }
    };
    let recordings = [other(1, 0.004), other(2, 0.003)];
    let both = [Refit::Surface, Refit::Friction];
    let none = PredictionOptions::default();
    let both = PredictionOptions { refit: both.to_vec(), ..none.clone() };
    let without = predict(&model, None, None, &none, &recordings).expect("a prediction").prediction;
    let with = predict(&model, None, None, &both, &recordings).expect("a prediction").prediction;
    let coverage = without.coverage_by_group.expect("without a refit");
    assert!(without.rmse_n > 3.0 * without.floor_n && coverage.same < 0.6, "{without:?}");
    assert!(coverage.unseen > 0.85 && without.varying == Factor::ALL, "{without:?}");
    assert!(with.rmse_n < 1.15 * with.floor_n && with.band_coverage > 0.8 && with.held_out, "{with:?}");
    for r in &with.recordings {
        let (shift, factor) = (r.surface_shift_m.expect("a shift"), r.friction_factor.expect("a factor"));
        assert!((shift + 1.5e-3).abs() < 1e-4 && (factor - 1.3).abs() < 0.03, "{r:?}");
    }
    let alone = predict(&model, None, None, &both, &recordings[..1]).expect("a prediction").prediction;
    assert!(!alone.held_out && alone.rmse_n < 1.15 * alone.floor_n, "{alone:?}");
}

/// Insertions of one group and a model of them that lacks the dry friction: the misfit is part of the band, no refit makes it
/// worse, and the mean curve of the recordings is named as better than a model of half the stiffness.
#[test]
fn the_band_of_a_model_holds_the_recordings_that_made_it_and_a_refit_moves_nothing() {
    let segments = || {
        let velocity_mps = 0.004;
        vec![
            Segment::Move { velocity_mps, duration_s: 8.0 },
            Segment::Hold { duration_s: 2.0 },
            Segment::Move { velocity_mps: -velocity_mps, duration_s: 8.0 },
        ]
    };
    let friction = |c: f64| -> Vec<AnyEffect> { vec![CoulombFriction { c_n_per_m: c }.into()] };
    let runs: Vec<(Scenario, NamedRecording)> =
        (1..=8).map(|k| two_gels(friction(8.0 + 0.6 * (k % 4) as f64), segments(), k)).collect();
    let recordings: Vec<NamedRecording> = runs.iter().map(|(_, r)| r.clone()).collect();
    let (made, new) = recordings.split_at(5);
    let model = &runs[0].0;
    let brief = Options { brief: true, ..Options::default() };
    let mut d =
        stylet_diagnose::diagnose(model, &recordings[..1], &brief, |_| {}).expect("a diagnosis").diagnosis;
    d.training = training_summary(model, &d, made);
    let run = |options: &PredictionOptions, on: &[NamedRecording]| {
        predict(model, Some(&d), None, options, on).expect("a prediction").prediction
    };
    let (none, all) = (
        PredictionOptions::default(),
        PredictionOptions { refit: Refit::ALL.to_vec(), ..Default::default() },
    );
    let own = run(&none, made);
    println!("{own:?}");
    assert!(own.varying.is_empty() && own.recordings.iter().all(|r| r.is_training_recording), "{own:?}");
    assert!((0.85..=0.97).contains(&own.band_coverage), "{own:?}");
    let refitted = run(&all, made);
    assert!(!refitted.refit.as_ref().expect("a refit").moved, "{refitted:?}");
    assert_eq!(refitted.rmse_n, own.rmse_n);
    // Recordings of the same group that did not make it: little to gain, nothing to lose.
    let (plain, refitted) = (run(&none, new), run(&all, new));
    assert_eq!(plain.varying, Factor::ALL);
    assert!(refitted.rmse_n <= 1.03 * plain.rmse_n, "{refitted:?}");
    let one = PredictionOptions { refit_on: new[..1].to_vec(), ..all };
    let (plain, refitted) = (run(&none, &new[1..]), run(&one, &new[1..]));
    assert!(refitted.rmse_n <= 1.03 * plain.rmse_n && refitted.held_out, "{refitted:?}");
    // Half the stiffness: the mean curve is better.
    let mut poor = model.clone();
    poor.tissue.layers.iter_mut().for_each(|l| l.stiffness_n_per_m *= 0.5);
    let worse = predict(&poor, Some(&d), None, &none, new).expect("a prediction").prediction;
    let mean = worse.baselines.iter().find(|b| b.name == "mean_curve").expect("a mean curve");
    assert!(mean.prediction_is_worse && mean.rmse_n < 0.5 * mean.prediction_rmse_n, "{worse:?}");
    assert!(plain.baselines.iter().all(|b| !b.prediction_is_worse), "{plain:?}");
}

/// Two gels, replayed with these effects at the given speeds.
fn two_gels(effects: Vec<AnyEffect>, segments: Vec<Segment>, seed: u64) -> (Scenario, NamedRecording) {
    let text = "Scenario(name: \"two gels\", tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
        (thickness_m: 0.02, stiffness_n_per_m: 90.0, friction_ns_per_m2: 12000.0)]),
        motion: Recorded, robot: Replay)";
    let assumed = Scenario::parse("two_gels.ron", text).expect("a scenario");
    let motion = Motion::Program { start_m: -0.004, segments };
    let truth = Scenario { effects, motion, ..assumed.clone() };
    let recording = stylet_testbed::simulate(&truth, seed).expect("an insertion").recording;
    (assumed, NamedRecording { name: format!("{seed}.csv"), recording, notes: Vec::new() })
}

#[test]
fn dry_friction_is_not_identifiable_at_one_constant_speed_and_is_not_reported() {
    let segments = vec![Segment::Move { velocity_mps: 0.0023, duration_s: 18.0 }];
    let friction: AnyEffect = CoulombFriction { c_n_per_m: 2.0 }.into();
    let runs = [1, 2].map(|seed| two_gels(vec![friction.clone()], segments.clone(), seed));
    let recordings = runs.each_ref().map(|(_, recording)| recording.clone());
    let found = stylet_diagnose::diagnose(&runs[0].0, &recordings, &Options::default(), |_| {})
        .expect("a diagnosis")
        .diagnosis;
    assert_eq!(found.verdict, stylet_diagnose::Verdict::None, "{:?}", found.causes);
    for id in ["coulomb_friction", "power_law_friction", "force_gain"] {
        assert!(found.not_identifiable.iter().any(|i| i == id), "{id} not in {:?}", found.not_identifiable);
    }
    assert!(!found.advice.is_empty());
}

#[test]
fn the_extended_scenario_can_be_read_again_and_holds_the_effect_found() {
    let segments = vec![
        Segment::Move { velocity_mps: 0.003, duration_s: 8.0 },
        Segment::Hold { duration_s: 2.0 },
        Segment::Move { velocity_mps: 0.004, duration_s: 4.0 },
        Segment::Move { velocity_mps: -0.004, duration_s: 12.0 },
    ];
    let (assumed, recording) = two_gels(vec![ForceDrift { rate_n_per_s: 0.01 }.into()], segments, 5);
    let found =
        stylet_diagnose::diagnose(&assumed, &[recording], &Options::default(), |_| {}).expect("a diagnosis");
    let text = found.extended_scenario.to_ron().expect("RON");
    let read = Scenario::parse("extended.ron", &text).expect("a valid scenario");
    let drift = |e: &AnyEffect| matches!(e, AnyEffect::ForceDrift(d) if (d.rate_n_per_s - 0.01).abs() < 1e-3);
    assert!(read.effects.iter().any(drift), "{text}");
    assert!(!found.diagnosis.gain.held_out, "one recording cannot be held out");
}
