use super::*;
use crate::diagnosis_json::{Cause, Diagnosis, Verdict};
use crate::test_fixtures::{search_result, search_stage, uniform_sequence};
use stylet_identify::model::FreeParameters;
use stylet_identify::noise::Noise;
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_tissue::{AnyEffect, Effect, ForceBias, ForceDrift};

fn drift() -> AnyEffect {
    ForceDrift { rate_n_per_s: 0.02 }.into()
}

#[test]
fn recordings_have_their_own_errors_and_the_noise_its_coefficients() {
    let mut search = search_result(&[drift()], 2, |t| 0.02 * t);
    let left =
        |square_n2: f64| Some(FreeRunResidual { mean_square_n2: square_n2, ..FreeRunResidual::default() });
    let within = search.data.recordings[1].within_block_sd_n();
    let result: Vec<f64> = errors_per_recording_n(&[None, left(0.04)], &search).collect();
    assert!(result[0].is_nan() && within > 1e-3);
    assert_eq!(result[1], (0.04 + within * within).sqrt());
    let s = &mut search.best.model;
    (s.scatter.rupture_force, s.scatter.rupture_depth_m, s.scatter.surface_m, s.scatter.ln_friction) =
        (0.1, 2e-3, 3e-4, 0.4);
    for (own_surface, own_friction) in [(true, false), (false, true)] {
        search.best.model.free = FreeParameters {
            recording_surface: own_surface,
            recording_friction: own_friction,
            ..search.best.model.free
        };
        let d = random_effect_sd(&search.best.model);
        assert_eq!((d.puncture, d.rupture_depth_m), (0.1, 2e-3));
        assert_eq!(d.surface_m, if own_surface { 3e-4 } else { 0.0 });
        assert_eq!(d.friction, if own_friction { 0.4 } else { 0.0 });
    }
    let mut noise = Noise::white(0.5);
    (noise.bins[0].ar[0], noise.bins[0].ar[1]) = (0.3, -0.2);
    search.data = search.data.with_noise(noise);
    assert_eq!(autoregression(&search), [0.3, -0.2]);
    let result = search_step(&search_stage(Some(("force_drift", 9.0)), 7.0, &[(drift(), 12.0)]));
    assert_eq!((result.selected.as_deref(), result.required_nats), (Some("force_drift"), 7.0));
    assert_eq!((result.candidates[0].effect.as_str(), result.candidates[0].gain_nats), ("force_drift", 12.0));
}

/// A diagnosis with this verdict and these causes.
fn diagnosis(verdict: Verdict, causes: Vec<Cause>) -> Diagnosis {
    let none = r#"{"verdict": "none", "causes": [], "base_parameters": [], "not_identifiable": [], "data_quality": [], "search_steps": [],
        "gain": {"held_out": false, "recordings": [], "rmse_before_n": 0, "rmse_after_n": 0, "floor_n": 0, "per_recording_n": []},
        "residual_structure": {"p_value": 1, "depends_on": [], "nats": 0}, "noise": {"sd_n": 0, "ar": [0, 0], "from_air": false},
        "advice": []}"#;
    Diagnosis { verdict, causes, ..serde_json::from_str(none).expect("a diagnosis") }
}

#[test]
fn extended_scenario_has_the_causes_and_the_parameters_of_their_model() {
    let mut search = search_result(&[drift(), ForceBias { force_n: 0.05 }.into()], 2, |t| 0.02 * t + 0.05);
    let scenario = stylet_scenario::parse(
        "a scenario",
        r#"(name: "a", tissue: (surface_m: 0.0, layers: []), motion: Recorded)"#,
    );
    let scenario = scenario.expect("a scenario");
    let (best, base) = (search.best.model.tissue.clone(), search.base.model.tissue.clone());
    assert!(best != base);
    let saturated = || {
        sensor_artefact_causes(&SensorArtefacts { limit_n: Some(2.5), ..SensorArtefacts::default() }, 0.1)
            .remove(0)
    };
    let drifts = || Cause { effect: "force_drift".to_owned(), ..saturated() };
    let of = |search: &Search, verdict, causes| {
        let s = extended_scenario(&scenario, search, &diagnosis(verdict, causes));
        (s.tissue, s.effects.iter().map(|e| e.id()).collect::<Vec<_>>())
    };
    assert_eq!(of(&search, Verdict::Named, vec![drifts()]), (best.clone(), vec!["force_drift"]));
    // Without a cause the base law is used; sensor artefacts belong to neither model.
    assert_eq!(of(&search, Verdict::None, vec![]), (base.clone(), vec![]));
    assert_eq!(of(&search, Verdict::Named, vec![saturated()]), (base.clone(), vec!["saturation"]));
    let both = vec![drifts(), saturated()];
    assert_eq!(of(&search, Verdict::Unknown, both).1, ["force_drift", "saturation"]);
    // Beside an unmodelled force the best partial model is kept, causes or none.
    let partial =
        PartialModel { effects: vec!["force_drift".to_owned(), "force_bias".to_owned()], share: 0.6 };
    let d = Diagnosis { partial: Some(partial), ..diagnosis(Verdict::Unknown, vec![]) };
    let s = extended_scenario(&scenario, &search, &d);
    assert_eq!(s.tissue, best);
    assert_eq!(s.effects.iter().map(|e| e.id()).collect::<Vec<_>>(), ["force_drift", "force_bias"]);
    search.best.model.effects.clear();
    assert_eq!(of(&search, Verdict::None, vec![]), (best, vec![]));
    assert_eq!(of(&search, Verdict::Unknown, vec![]), (base, vec![]));
}

/// All searches of a diagnosis share one limit.
#[test]
fn no_other_number_of_layers_is_tried_beyond_the_limit_of_replays() {
    let layer = "(thickness_m: 0.1, stiffness_n_per_m: 80.0, friction_ns_per_m2: 9000.0)";
    let text = format!("Scenario(name: \"a\", motion: Recorded, tissue: (layers: [{layer}]))");
    let scenario = Scenario::parse("a.ron", &text).expect("a scenario");
    let t: Vec<f64> = (0..2000).map(|k| f64::from(k) / 200.0).collect();
    let z: Vec<f64> = t.iter().map(|t| 2e-3 * t).collect();
    let mut uniform = uniform_sequence(3);
    let force = z.iter().map(|z| 80.0 * z + 9000.0 * z * 2e-3 + 0.01 * (uniform() - 0.5)).collect();
    let recording = Recording::new(t, z, force).expect("clean columns");
    let recordings = [NamedRecording { name: "a.csv".to_owned(), recording, notes: Vec::new() }];
    let replayed = ReplayCount::default();
    let count = || replayed.load(std::sync::atomic::Ordering::Relaxed);
    let brief = Options { brief: true, ..Options::default() };
    diagnose_given_layers(&scenario, &recordings, &brief, &replayed, &mut |_| {}).expect("a diagnosis");
    let first = count();
    assert!(first > 0 && simple_explanation(&scenario, &recordings, &replayed, &mut |_| {}).is_some());
    assert!(count() > first);
    replayed.store(u64::MAX / 2, std::sync::atomic::Ordering::Relaxed);
    assert!(simple_explanation(&scenario, &recordings, &replayed, &mut |_| {}).is_none());
}
