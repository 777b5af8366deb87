use super::*;
use crate::diagnosis_json::{Cause, DataQualityNote};
use stylet_record::QualityNote;

/// A diagnosis of two recordings that agrees: predictions to the noise of 0.02 N.
fn agreeing() -> Diagnosis {
    let text = r#"{"verdict": "none", "causes": [], "not_identifiable": [], "data_quality": [], "search_steps": [], "advice": [],
        "base_parameters": [{"layer": 1, "name": "stiffness_n_per_m", "assumed": 50, "value": 52, "low": 51, "high": 53,
                             "changed": true, "at_bound": false}],
        "gain": {"held_out": true, "recordings": ["a", "b"], "rmse_before_n": 0.021, "rmse_after_n": 0.021,
                 "rmse_given_scatter_n": 0.021, "floor_n": 0.02, "per_recording_n": []},
        "residual_structure": {"p_value": 0.4, "depends_on": [], "nats": 0}, "noise": {"sd_n": 0.02, "ar": [0, 0], "from_air": false}}"#;
    serde_json::from_str(text).expect("a diagnosis")
}

fn named(confidence: f64) -> Diagnosis {
    let cause = Cause { effect: "coulomb_friction".to_owned(), confidence, ..Cause::default() };
    Diagnosis { verdict: Verdict::Named, causes: vec![cause], ..agreeing() }
}

fn kinds(d: &Diagnosis) -> Vec<FindingKind> {
    d.findings.iter().map(|f| f.kind).collect()
}

/// A finding and a change of the diagnosis that gives it.
type Contradiction = (FindingKind, fn(&mut Diagnosis));

/// Every change that contradicts the model, and the kind of its finding.
fn contradictions() -> Vec<Contradiction> {
    vec![
        (FindingKind::PredictionError, |d| d.gain.rmse_given_scatter_n = 0.041),
        (FindingKind::ResidualStructure, |d| d.residual_structure.p_value = 9e-4),
        (FindingKind::AtBound, |d| d.base_parameters[0].at_bound = true),
        (FindingKind::Scatter, |d| d.random_effect_sd.puncture = 0.3),
        (FindingKind::Scatter, |d| d.random_effect_sd.friction = 2.3),
        (FindingKind::Scatter, |d| d.random_effect_sd.rupture_depth_m = 5e-3),
        (FindingKind::Scatter, |d| d.random_effect_sd.surface_m = 6e-3),
        (FindingKind::NoiseLevel, |d| d.gain.floor_n = 0.7),
    ]
}

const SENSOR: Context = Context {
    one_motion: false,
    sensor_noise_n: Some(0.02),
    air_noise_n: None,
    resolution_n: 0.0,
    is_search_limit_reached: false,
};

#[test]
fn predictions_to_the_noise_agree() {
    let mut d = agreeing();
    apply(&mut d, &SENSOR);
    assert!(d.agrees && d.findings.is_empty() && d.verdict == Verdict::None);
    // At twice the noise, and with large scatter that is known, they still do.
    d.gain.rmse_given_scatter_n = 0.04;
    (d.gain.rmse_before_n, d.gain.rmse_after_n) = (0.6, 0.6);
    d.random_effect_sd.puncture = 0.29;
    d.random_effect_sd.rupture_depth_m = 4.9e-3;
    apply(&mut d, &SENSOR);
    assert!(d.agrees && d.findings.is_empty());
}

#[test]
fn a_search_that_was_cut_short_neither_agrees_nor_is_sure() {
    let cut_short = Context { is_search_limit_reached: true, ..SENSOR };
    let mut d = agreeing();
    apply(&mut d, &cut_short);
    assert!(!d.agrees && kinds(&d) == [FindingKind::SearchLimit]);
    let mut d = named(0.99);
    apply(&mut d, &cut_short);
    assert_eq!(d.causes[0].confidence, MAX_CONFIDENCE_CONTRADICTED);
}

#[test]
fn agreement_is_impossible_beside_a_contradiction() {
    for (kind, change) in contradictions() {
        let mut d = agreeing();
        change(&mut d);
        apply(&mut d, &SENSOR);
        assert!(!d.agrees && kinds(&d).contains(&kind), "{kind:?}: {:?}", d.findings);
        assert_eq!(d.verdict, Verdict::None, "{kind:?}: a finding is no structure of the residual");
    }
}

#[test]
fn no_cause_is_sure_beside_a_contradiction() {
    for (kind, change) in contradictions() {
        let mut d = named(1.0);
        change(&mut d);
        apply(&mut d, &SENSOR);
        assert!(
            d.causes[0].confidence <= MAX_CONFIDENCE_CONTRADICTED,
            "{kind:?}: {}",
            d.causes[0].confidence
        );
        assert_eq!(d.verdict, Verdict::Named);
    }
    let mut d = named(1.0);
    d.causes[0].at_bound = vec!["c_n_per_m".to_owned()];
    apply(&mut d, &SENSOR);
    assert_eq!(
        (kinds(&d), d.causes[0].confidence),
        (vec![FindingKind::AtBound], MAX_CONFIDENCE_CONTRADICTED)
    );
    assert!(d.findings[0].message.starts_with("c_n_per_m of coulomb_friction is at its bound"));
    // A low confidence stays.
    let mut d = named(0.3);
    d.residual_structure.p_value = 1e-9;
    apply(&mut d, &SENSOR);
    assert_eq!(d.causes[0].confidence, 0.3);
}

#[test]
fn one_recording_or_one_motion_limits_the_confidence_and_says_so() {
    let mut d = named(1.0);
    d.gain.recordings.truncate(1);
    apply(&mut d, &SENSOR);
    assert_eq!((kinds(&d), d.causes[0].confidence), (vec![FindingKind::OneRecording], 0.9));
    let mut d = named(1.0);
    apply(&mut d, &Context { one_motion: true, ..SENSOR });
    assert_eq!((kinds(&d), d.causes[0].confidence), (vec![FindingKind::OneMotion], 0.9));
    // It does not contradict agreement.
    let mut d = agreeing();
    d.gain.recordings.truncate(1);
    apply(&mut d, &SENSOR);
    assert!(d.agrees && kinds(&d) == [FindingKind::OneRecording]);
}

#[test]
fn a_lower_limit_is_no_bound_and_an_outlier_is_named() {
    let mut d = agreeing();
    (d.base_parameters[0].at_bound, d.base_parameters[0].at_least) = (true, true);
    apply(&mut d, &SENSOR);
    assert!(d.agrees, "{:?}", d.findings);
    let note: QualityNote =
        serde_json::from_str(r#"{"kind": "outlier_recording", "message": "", "numbers": {}}"#)
            .expect("a note");
    d.data_quality.push(DataQualityNote { recording: "b".to_owned(), note });
    apply(&mut d, &SENSOR);
    assert!(!d.agrees && d.findings[0].message == "b is not like the other recordings");
}

#[test]
fn noise_is_compared_with_the_sensor_and_with_air() {
    let message = |noise_n: f64, context: Context| noise_level(noise_n, &context);
    assert_eq!(message(0.1, SENSOR), None);
    assert_eq!(
        message(0.7, SENSOR).as_deref(),
        Some("the noise of 0.7 N is 35 times that of the scenario's sensor, 0.02 N")
    );
    let air = Context { sensor_noise_n: None, air_noise_n: Some(0.01), ..SENSOR };
    assert_eq!(message(0.06, air).as_deref(), Some("the noise of 0.06 N is 6 times that in air, 0.01 N"));
    // A coarse force has the noise of its steps, and a sensor without noise is no reference.
    assert_eq!(message(0.7, Context { resolution_n: 0.2, ..SENSOR }), None);
    assert_eq!(message(0.7, Context { sensor_noise_n: Some(0.0), ..SENSOR }), None);
}

#[test]
fn equal_motions_are_recognised_at_any_rate_and_start() {
    let motion = |hz: f64, speed: f64, start_s: f64| {
        let n = (10.0 * hz) as usize;
        let t: Vec<f64> = (0..=n).map(|k| k as f64 / hz).collect();
        let z = t.iter().map(|t| speed * t.min(6.0)).collect();
        let shifted = t.iter().map(|t| t + start_s).collect();
        Recording::new(shifted, z, vec![0.0; n + 1]).expect("a recording")
    };
    let first = motion(200.0, 0.004, 0.0);
    assert!(have_one_motion(&[first.clone(), motion(170.0, 0.004, 3.0)]));
    assert!(!have_one_motion(&[first.clone(), motion(200.0, 0.0042, 0.0)]));
    assert!(!have_one_motion(&[first.clone(), motion(200.0, 0.004, 1.0), motion(200.0, 0.002, 0.0)]));
    assert!(!have_one_motion(&[first]));
}
