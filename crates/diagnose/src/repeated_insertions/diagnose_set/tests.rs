use super::{
    MAX_EXCESS_OVER_FLOOR, ablation_rows, add_fault, advice, base_predictions, cause, diagnosis, is_unknown,
    negligible_effects, search_step,
};
use crate::diagnosis_json::{Cause, Diagnosis, Estimate, Verdict};
use crate::repeated_insertions::ablation::ModelTerm;
use crate::repeated_insertions::cross_validation::HeldOutPrediction;
use crate::repeated_insertions::held_out_loss::paired_confidence;
use crate::repeated_insertions::instrument_faults::InstrumentReport;
use crate::repeated_insertions::model_selection::CandidateModels;
use crate::repeated_insertions::parameter_estimates::ParameterEstimate;
use crate::repeated_insertions::repeatability_report::{MeanReport, RepeatabilityReport, Variability};
use crate::repeated_insertions::scored_model::{ModelFamily, ScoredModel};
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use crate::test_fixtures;
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_tissue::{AnyEffect, CoulombFriction};

fn candidate(kind: ModelFamily, errors_n: &[f64], nats: f64, with: bool) -> ScoredModel {
    let friction: [AnyEffect; 1] = [CoulombFriction { c_n_per_m: 3.0 }.into()];
    test_fixtures::unmeasured_candidate(kind, &friction[..usize::from(with)], errors_n, nats)
}

#[test]
fn the_share_of_a_cause_is_its_loss_relative_to_the_explained_error() {
    let base = candidate(ModelFamily::Base, &[0.5, 0.7], -20.0, false);
    let best = candidate(ModelFamily::Library, &[0.2, 0.1], -150.0, true);
    let estimate = |at_bound| ParameterEstimate {
        owner: "coulomb_friction".to_owned(),
        path: "c_n_per_m".to_owned(),
        value: 3.0,
        low: 2.0,
        high: 4.5,
        at_bound,
    };
    let other = ParameterEstimate {
        owner: "release_depth".to_owned(),
        path: "depth_m".to_owned(),
        at_bound: true,
        ..estimate(false)
    };
    let c = cause("coulomb_friction", &[estimate(false), other.clone()], 0.97, &[0.3, 0.4], &best, &base);
    // Mean squares 0.37, 0.025 and 0.125.
    assert!((c.share - (0.125 - 0.025) / (0.37 - 0.025)).abs() < 1e-12, "{}", c.share);
    let nats = base.set_fit.fit.nats() - best.set_fit.fit.nats();
    assert!((c.gain_nats - nats).abs() < 1e-9 && (nats - 130.0).abs() < 20.0, "{}", c.gain_nats);
    assert_eq!((c.confidence, c.parameters.len(), c.parameters["c_n_per_m"].high), (0.97, 1, 4.5));
    let c = cause("coulomb_friction", &[estimate(true)], 0.97, &[0.3, 0.4], &best, &base);
    // The rule of all claims limits the confidence, see `claims`.
    assert_eq!((c.confidence, c.at_bound), (0.97, vec!["c_n_per_m".to_owned()]));
    assert_eq!(cause("x", &[], 1.0, &[3.0, 4.0], &best, &base).share, 1.0);
    assert_eq!(cause("x", &[], 1.0, &[0.01, 0.01], &best, &base).share, 0.0);
    assert_eq!(cause("x", &[], 1.0, &[f64::NAN, 0.01], &best, &base).share, 1.0);
    assert_eq!(cause("x", &[], 1.0, &[0.3], &base, &best).gain_nats, 0.0);
}

#[test]
fn a_drift_that_a_correction_left_is_one_cause_with_the_corrected_one() {
    let drift = |value: f64, confidence: f64| {
        let estimate = Estimate { value, low: value - 0.001, high: value + 0.002 };
        let parameters = [("rate_n_per_s".to_owned(), estimate)].into_iter().collect();
        Cause { effect: "force_drift".to_owned(), confidence, parameters, ..Cause::default() }
    };
    let mut causes = vec![drift(0.003, 0.4)];
    add_fault(&mut causes, drift(0.012, 0.9), true);
    let e = causes[0].parameters["rate_n_per_s"];
    assert_eq!((causes.len(), causes[0].confidence), (1, 0.9));
    assert!(
        (e.value - 0.015).abs() < 1e-12 && (e.low - 0.014).abs() < 1e-12 && (e.high - 0.017).abs() < 1e-12
    );
    // A correction that the model takes back was none.
    add_fault(&mut causes, drift(-0.0145, 0.9), true);
    assert_eq!(causes, []);
    causes = vec![drift(0.003, 0.4)];
    add_fault(&mut causes, Cause { effect: "force_bias".to_owned(), ..Cause::default() }, true);
    // A tone stays in the recordings: its frequency is not added.
    add_fault(&mut causes, drift(0.003, 0.9), false);
    assert_eq!(causes[0].parameters["rate_n_per_s"].value, 0.003);
    assert_eq!(causes.len(), 2);
}

fn term(effect: &'static str, name: &str, without_n: &[f64], kept: bool) -> ModelTerm {
    ModelTerm {
        effect,
        name: name.to_owned(),
        without_n: without_n.to_vec(),
        held_out_loss: Vec::new(),
        held_out_speed_loss: Vec::new(),
        gain_nats: 0.0,
        kept,
        significant: kept,
    }
}

fn candidates() -> CandidateModels {
    CandidateModels {
        base: candidate(ModelFamily::Base, &[0.5, 0.7], -20.0, false),
        library: Some(candidate(ModelFamily::Library, &[0.3, 0.1], -90.0, true)),
        slip: Some(candidate(ModelFamily::ShaftSlip, &[0.25, 0.35], -70.0, true)),
        best: candidate(ModelFamily::Library, &[0.3, 0.1], -90.0, true),
        terms: vec![
            term("shaft_slip", "wear", &[0.4, 0.6], true),
            term("shaft_slip", "rate", &[0.21, 0.2], false),
            term("shaft_slip", "lost", &[f64::INFINITY], true),
        ],
    }
}

#[test]
fn the_ablation_lists_candidates_and_terms() {
    let all = ablation_rows(&candidates());
    let result: Vec<(&str, f64, Option<f64>, bool)> = all
        .iter()
        .map(|b| {
            (
                b.step.as_str(),
                (b.held_out_n * 1e9).round() / 1e9,
                b.without_n.map(|x| (x * 1e9).round() / 1e9),
                b.kept,
            )
        })
        .collect();
    assert_eq!(
        result,
        [
            ("base law with library effects", 0.2, None, true),
            ("stick-slip of the shaft", 0.3, None, false),
            ("wear", 0.2, Some(0.5), true),
            ("rate", 0.2, Some(0.205), false),
            ("lost", 0.2, None, true),
        ]
    );
    let negligible = negligible_effects(&candidates());
    assert_eq!(negligible.len(), 1);
    assert_eq!(
        (negligible[0].effect.as_str(), negligible[0].reason.as_str()),
        ("shaft_slip", "rate: held-out RMS error 0.205 N without it, 0.200 N with it")
    );
    let e = search_step(&candidates());
    assert_eq!(e.selected.as_deref(), Some("coulomb_friction"));
    let l = candidates();
    let gained = |candidate: &ScoredModel| l.base.set_fit.fit.nats() - candidate.set_fit.fit.nats();
    assert_eq!(
        (e.candidates[0].effect.as_str(), e.candidates[1].effect.as_str()),
        ("shaft_slip", "coulomb_friction")
    );
    assert!((e.candidates[0].gain_nats - gained(l.slip.as_ref().expect("it"))).abs() < 1e-9);
    assert!((e.candidates[1].gain_nats - gained(&l.best)).abs() < 1e-9 && e.candidates[1].gain_nats > 50.0);
    let plain = CandidateModels { best: l.base.clone(), ..candidates() };
    assert_eq!(search_step(&plain).selected, None);
}

#[test]
fn advice_warns_of_bounds_and_disagreeing_starts() {
    let estimate = |at_bound| ParameterEstimate {
        owner: "layer.1".to_owned(),
        path: "stiffness_n_per_m".to_owned(),
        value: 3.0,
        low: 2.0,
        high: 4.5,
        at_bound,
    };
    let (slip, library) = (
        candidate(ModelFamily::ShaftSlip, &[0.1], 0.0, true),
        candidate(ModelFamily::Library, &[0.1], 0.0, true),
    );
    assert!(advice(&library, &[estimate(false)]).is_empty());
    let one = advice(&library, &[estimate(true), estimate(false)]);
    assert!(
        one.len() == 1 && one[0].ends_with("not determined by the data: stiffness_n_per_m of layer.1."),
        "{one:?}"
    );
    let one = advice(&slip, &[estimate(false)]);
    assert!(one.len() == 1 && one[0].contains("Only 3 of 8 starts"), "{one:?}");
    let mut agree = slip;
    agree.set_fit.starts = (8, 4);
    assert!(advice(&agree, &[]).is_empty());
}

/// Report with these RMS errors (N) of base law, selected model and floor; the noise is 0.1 N.
fn repeats(base_n: f64, extended_n: f64, floor_n: Option<f64>) -> RepeatabilityReport {
    RepeatabilityReport {
        recordings: Vec::new(),
        speeds: Vec::new(),
        mean: MeanReport {
            floor_n,
            base_n,
            model_n: extended_n,
            with_discrepancy_n: extended_n,
            ..MeanReport::default()
        },
        phases: Vec::new(),
        variability: Variability {
            surface_m: 0.0,
            friction: 0.0,
            puncture: 0.0,
            day_surface_m: 0.0,
            day_friction: 0.0,
            drops: Vec::new(),
            release_positions_m: Vec::new(),
            residual_n: Vec::new(),
        },
        starts: (8, 3),
        ablation: Vec::new(),
        instrument: InstrumentReport { noise_n: Some(0.1), ..InstrumentReport::default() },
        composition: None,
        nested: None,
    }
}

fn diagnose_with(candidates: &CandidateModels, repeats: &RepeatabilityReport) -> Diagnosis {
    diagnosis(candidates, &[], &test_fixtures::gel_tissue(), &[], repeats, &SensorArtefacts::default())
}

/// Unexplained: more than 10 % of the base law's excess over the floor and more than 20 % above the
/// floor.
#[test]
fn the_verdict_is_unknown_above_the_unexplained_share() {
    let share = |base: f64, extended: f64| (extended * extended - 0.01) / (base * base - 0.01);
    for (base_n, extended_n, unknown) in [
        (0.5, 0.18, false),
        (0.5, 0.19, true),
        // Less than 20 % above the floor.
        (0.13, 0.119, false),
        (0.13, 0.121, true),
    ] {
        let d = diagnose_with(&candidates(), &repeats(base_n, extended_n, Some(0.1)));
        // The residuals of these candidates depend on no feature.
        assert_eq!(d.verdict, Verdict::Named, "{extended_n}");
        let mean = repeats(base_n, extended_n, Some(0.1)).mean;
        assert_eq!(is_unknown(d.residual_structure.share, &mean, 1e-4), unknown, "{extended_n}");
        assert!(!is_unknown(d.residual_structure.share, &mean, 0.01), "{extended_n}");
        assert!(
            (d.residual_structure.share - share(base_n, extended_n)).abs() < 1e-9,
            "{}",
            d.residual_structure.share
        );
        assert_eq!((d.gain.floor_n, d.gain.rmse_before_n, d.gain.rmse_after_n), (0.1, base_n, extended_n));
    }
    // The thresholds themselves (8 of 80 N^2; 20 % above the floor of 1 N) are explained.
    for (base_n, extended_n) in [(9.0, 3.0), (2.0, 1.0 + MAX_EXCESS_OVER_FLOOR)] {
        let repeats = repeats(base_n, extended_n, Some(1.0));
        let d = diagnose_with(&candidates(), &repeats);
        assert!(!is_unknown(d.residual_structure.share, &repeats.mean, 1e-4), "{extended_n}");
    }
    assert_eq!(diagnose_with(&candidates(), &repeats(0.5, 0.6, Some(0.1))).residual_structure.share, 1.0);
    assert_eq!(diagnose_with(&candidates(), &repeats(0.5, 0.05, Some(0.1))).residual_structure.share, 0.0);
    // The empirical discrepancy does not explain.
    let mut learned = repeats(0.5, 0.19, Some(0.1));
    learned.mean.with_discrepancy_n = 0.1;
    let share = diagnose_with(&candidates(), &learned).residual_structure.share;
    assert!(is_unknown(share, &learned.mean, 1e-4));
    // Without a floor: at least the noise.
    let d = diagnose_with(&candidates(), &repeats(0.5, 0.4, None));
    assert_eq!((d.verdict, d.gain.floor_n, d.noise.sd_n), (Verdict::Named, 0.1, 0.1));
}

#[test]
fn the_base_law_alone_gives_none() {
    let plain =
        CandidateModels { best: candidate(ModelFamily::Base, &[0.5, 0.7], -20.0, false), ..candidates() };
    let d = diagnose_with(&plain, &repeats(0.119, 0.119, Some(0.1)));
    assert_eq!((d.verdict, d.residual_structure.share, d.causes.len()), (Verdict::None, 0.0, 0));
    assert!(is_unknown(1.0, &repeats(0.121, 0.121, Some(0.1)).mean, 1e-4));
}

#[test]
fn a_cause_is_judged_by_its_kept_term() {
    let mut candidates = candidates();
    candidates.best = candidate(ModelFamily::Library, &[0.2, 0.1], -90.0, true);
    candidates.terms = vec![
        term("coulomb_friction", "coulomb_friction", &[0.9, 0.9], false),
        term("coulomb_friction", "wear", &[0.5, 0.6], true),
        term("coulomb_friction", "coulomb_friction", &[0.3, 0.4], true),
    ];
    let d = diagnose_with(&candidates, &repeats(0.5, 0.12, Some(0.1)));
    assert_eq!(d.causes.len(), 1);
    // Mean squares 0.37, 0.025 and 0.125.
    assert!((d.causes[0].share - 0.1 / 0.345).abs() < 1e-12, "{}", d.causes[0].share);
    assert_eq!(d.causes[0].confidence, paired_confidence(&[0.3, 0.4], &[0.2, 0.1]));
    assert_eq!(d.search_steps[0].selected.as_deref(), Some("coulomb_friction"));
}

#[test]
fn an_insignificant_effect_stays_in_the_model_and_is_no_cause() {
    let mut candidates = candidates();
    candidates.best = candidate(ModelFamily::Library, &[0.2, 0.1], -90.0, true);
    candidates.terms = vec![ModelTerm {
        significant: false,
        ..term("coulomb_friction", "coulomb_friction", &[0.3, 0.2], true)
    }];
    let d = diagnose_with(&candidates, &repeats(0.12, 0.12, Some(0.1)));
    assert_eq!((d.verdict, d.causes.len(), d.negligible.len()), (Verdict::None, 0, 1));
    assert!(d.negligible[0].reason.contains("not significant"), "{}", d.negligible[0].reason);
    candidates.terms[0].significant = true;
    let d = diagnose_with(&candidates, &repeats(0.12, 0.12, Some(0.1)));
    assert_eq!((d.verdict, d.causes.len(), d.negligible.len()), (Verdict::Named, 1, 0));
}

#[test]
fn base_predictions_are_reused_if_the_base_law_is_best() {
    let recordings = test_fixtures::simulated_recordings(&[], &[[0.008, 0.0], [0.016, 1e-4], [0.008, 0.0]]);
    let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
    let base = ScoredModel {
        set_fit: test_fixtures::fit_from_truth(&[], &recordings),
        ..candidate(ModelFamily::Base, &[0.1; 3], 0.0, false)
    };
    let best = vec![HeldOutPrediction::default(); 3];
    let candidates = CandidateModels { base, ..candidates() };
    let result = base_predictions(&candidates, &best, &recordings);
    assert_eq!(result.iter().filter(|o| o.score.rmse_n > 0.0 && o.population.is_some()).count(), 3);
    let candidates = CandidateModels { best: candidates.base.clone(), ..candidates };
    let result = base_predictions(&candidates, &best, &recordings);
    assert_eq!(result.iter().filter(|o| o.population.is_none()).count(), 3);
}
