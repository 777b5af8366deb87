use super::{
    CandidateModel, FITTED_HOLD_SHARE, MIN_RELATIVE_GAIN, SpecimenFits, SpecimenReport, SpecimenStatistic,
    analyze_specimens, parameter_statistics, retest_curvature,
};
use super::{check_ramp_and_hold, fit_specimen, parameter_value, relaxation};
use crate::diagnosis_json::Verdict;
use crate::repeated_insertions::SegmentedRecording;
use crate::repeated_insertions::start_values::indentation_prior;
use std::sync::Arc;
use stylet_identify::model::{EffectTerm, Model};
use stylet_record::Recording;
use stylet_stats::student_t;
use stylet_tissue::{AnyEffect, Effect, ForceLaw, ForceLawState, Layer, NonlinearElasticity, Tissue};

fn tissue(k: f64) -> Tissue {
    let layer = Layer {
        name: "gel".to_owned(),
        thickness_m: 0.03,
        stiffness_n_per_m: k,
        friction_ns_per_m2: 0.0,
        puncture_n: None,
    };
    Tissue { surface_m: 0.001, layers: vec![layer] }
}

/// Ramp of 5 mm in 1 s and a hold, at 50 Hz, with noise of 1 mN.
fn specimen(name: &str, k: f64, effects: &[AnyEffect], hold_s: f64, seed: usize) -> SegmentedRecording {
    let t = tissue(k);
    let law = ForceLaw::new(&t, effects).expect("a law");
    let mut state = ForceLawState::default();
    let (mut times, mut z, mut f) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..((1.2 + hold_s) * 50.0) as usize {
        let at = 0.02 * i as f64;
        let (place, v) = if at < 0.2 {
            (0.0, 0.0)
        } else if at < 1.2 {
            (0.005 * (at - 0.2), 0.005)
        } else {
            (0.005, 0.0)
        };
        let force = law.step(&mut state, at, place, v, |_| {}).total_n;
        times.push(at);
        z.push(place);
        f.push(force + 2e-3 * (((i * 7919 + 31 * seed) % 101) as f64 / 101.0 - 0.5));
    }
    SegmentedRecording::new(name.to_owned(), Recording::new(times, z, f).expect("clean columns"), 1)
}

fn law(effects: &[AnyEffect]) -> Model {
    let mut m =
        Model::base(Arc::new(indentation_prior(&tissue(300.0), &specimen("a", 300.0, &[], 4.0, 1))), 1);
    m.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    m
}

#[test]
fn a_specimen_is_a_ramp_and_a_hold_of_three_seconds() {
    let good = specimen("a", 300.0, &[], 4.0, 1);
    assert_eq!(check_ramp_and_hold(&good), Ok(()));
    assert_eq!(
        check_ramp_and_hold(&specimen("a", 300.0, &[], 2.8, 1)).err().as_deref(),
        Some("held for only 2.8 s")
    );
    assert!(check_ramp_and_hold(&specimen("a", 300.0, &[], 3.1, 1)).is_ok());
    let mut short = good.clone();
    for c in [&mut short.recording.time_s, &mut short.recording.position_m, &mut short.recording.force_n] {
        let all: Vec<f64> = c.iter().copied().step_by(6).collect();
        *c = all;
    }
    assert_eq!(short.recording.len(), 44);
    short.phases.deepest = 10;
    assert_eq!(check_ramp_and_hold(&short).err().as_deref(), Some("44 samples are not enough"));
    for (count, fine) in [(50, true), (49, false)] {
        let mut r = good.clone();
        r.phases.deepest = 5;
        let t: Vec<f64> = (0..count).map(|k| 0.1 * f64::from(k)).collect();
        let n = t.len();
        r.recording = Recording::new(t, vec![0.0; n], vec![0.0; n]).expect("clean columns");
        r.phases.retraction = n;
        assert_eq!(check_ramp_and_hold(&r).is_ok(), fine, "{count}");
    }
    let mut just = good.clone();
    let t: Vec<f64> = (0..64).map(|k| 0.125 * f64::from(k)).collect();
    just.recording = Recording::new(t, vec![0.0; 64], vec![0.0; 64]).expect("clean columns");
    (just.phases.deepest, just.phases.retraction) = (63 - 24, 64);
    assert_eq!(check_ramp_and_hold(&just), Ok(()));
    let mut back = good;
    back.phases.retraction -= 5;
    assert_eq!(check_ramp_and_hold(&back).err().as_deref(), Some("the indenter is retracted"));
}

#[test]
fn relaxation_terms_are_sorted_by_time_constant() {
    let two = |a: (f64, f64), b: (f64, f64)| {
        law(&[NonlinearElasticity { kappa_per_m: 30.0 }.into(), relaxation(&[a, b])])
    };
    for m in [two((0.2, 0.5), (0.3, 6.0)), two((0.3, 6.0), (0.2, 0.5))] {
        let result = [
            "terms.0.fraction",
            "terms.0.time_constant_s",
            "terms.1.fraction",
            "terms.1.time_constant_s",
            "kappa_per_m",
        ]
        .map(|p| parameter_value(&m, p));
        assert_eq!(result, [Some(0.2), Some(0.5), Some(0.3), Some(6.0), Some(30.0)]);
    }
    let equal_times = two((0.2, 0.5), (0.3, 0.5));
    assert_eq!(
        parameter_value(&equal_times, "terms.0.fraction"),
        Some(0.2),
        "order unchanged for equal times"
    );
    let one = law(&[relaxation(&[(0.2, 0.5)])]);
    assert_eq!(
        (parameter_value(&one, "terms.0.fraction"), parameter_value(&one, "terms.1.fraction")),
        (Some(0.2), None)
    );
}

#[test]
fn statistics_have_student_intervals_and_log_time_constants() {
    let (fractions, times) = ([0.2, 0.26, 0.31, 0.24, 0.22], [0.5, 0.9, 0.7, 1.4, 0.8]);
    let each: Vec<super::SpecimenFits> = (0..5)
        .map(|k| super::SpecimenFits {
            errors: Vec::new(),
            models: vec![law(&[]), law(&[relaxation(&[(fractions[k], times[k])])])],
            straight: vec![((0.0, 0.0), law(&[])), ((0.0, 0.0), law(&[relaxation(&[(0.7, 9.0)])]))],
        })
        .collect();
    assert!(parameter_statistics(&each, 0, true).is_empty() && parameter_statistics(&[], 0, true).is_empty());
    assert!(
        (parameter_statistics(&each, 1, false)[0].mean - 0.7).abs() < 1e-9,
        "those of the model without curvature"
    );
    let result = parameter_statistics(&each, 1, true);
    let of = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / 5.0;
        let sd = (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 4.0).sqrt();
        (mean, student_t::quantile(0.975, 4.0) * sd / 5.0_f64.sqrt())
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} for {b}");
    let SpecimenStatistic { name, mean, low, high, range_90 } = result[0].clone();
    let (m, reach) = of(&fractions);
    assert_eq!(name, "terms.0.fraction");
    [(mean, m), (low, m - reach), (high, m + reach)].iter().for_each(|(a, b)| near(*a, *b));
    // Interpolated between neighbours of 0.2, 0.22 .. 0.31.
    near(range_90.0, 0.2 + 0.2 * 0.02);
    near(range_90.1, 0.31 - 0.2 * 0.05);
    let logs: Vec<f64> = times.iter().map(|x: &f64| x.ln()).collect();
    let (m, reach) = of(&logs);
    let t = &result[1];
    [(t.mean, m.exp()), (t.low, (m - reach).exp()), (t.high, (m + reach).exp())]
        .iter()
        .for_each(|(a, b)| near(*a, *b));
    near(t.range_90.0, (0.5_f64.ln() + 0.2 * (0.7_f64 / 0.5).ln()).exp());
}

#[test]
fn the_relaxation_of_specimens_is_found_and_nothing_else() {
    let relaxes = [relaxation(&[(0.3, 2.5)])];
    let mut recordings: Vec<SegmentedRecording> =
        (0..4).map(|k| specimen(&format!("{k}"), 280.0 + 20.0 * k as f64, &relaxes, 4.0, k)).collect();
    recordings.push(specimen("short", 300.0, &relaxes, 1.0, 9));
    let s = analyze_specimens(&tissue(300.0), &recordings).expect("specimens");
    assert_eq!(
        (s.used, s.unused.as_slice(), s.punctured.len()),
        (4, &[("short".to_owned(), "held for only 1.0 s".to_owned())][..], 0)
    );
    assert_eq!(
        s.candidates.iter().map(|r| r.kept).collect::<Vec<_>>(),
        [true, false, true, false],
        "{:?}",
        s.candidates
    );
    assert_eq!(s.kept_effects().collect::<Vec<_>>(), ["stress_relaxation"]);
    let of = |name: &str| s.parameters.iter().find(|n| n.name == name).expect("a number");
    assert!((of("terms.0.fraction").mean - 0.3).abs() < 0.02, "{:?}", s.parameters);
    assert!((of("terms.0.time_constant_s").mean / 2.5 - 1.0).abs() < 0.1, "{:?}", s.parameters);
    assert!(
        s.candidates[2].held_out_n < 0.3 * s.candidates[0].held_out_n
            && s.candidates[2].improved_share == 1.0
    );
    assert!(s.candidates[0].improved_share == 0.0 && s.candidates[2].fitted_n < 2e-3, "{:?}", s.candidates);
    let d = s.diagnosis(&recordings);
    assert_eq!((d.verdict, d.causes.len(), d.causes[0].confidence), (Verdict::Named, 1, 1.0));
    assert!(
        d.causes[0].parameters.keys().all(|k| k.starts_with("terms.")) && !d.causes[0].parameters.is_empty()
    );
    assert_eq!(
        (d.gain.rmse_before_n, d.gain.rmse_after_n),
        (s.candidates[0].held_out_n, s.candidates[2].held_out_n)
    );
    assert_eq!(d.not_identifiable, ["power_law_friction", "shaft_slip", "rate_dependent_puncture"]);
    // A linear spring.
    let plain: Vec<SegmentedRecording> =
        (0..4).map(|k| specimen(&format!("{k}"), 280.0 + 20.0 * k as f64, &[], 4.0, k)).collect();
    let s = analyze_specimens(&tissue(300.0), &plain).expect("specimens");
    assert_eq!(s.kept_effects().count(), 0, "{:?}", s.candidates);
    assert_eq!(s.diagnosis(&plain).verdict, Verdict::None);
    assert!(analyze_specimens(&tissue(300.0), &recordings[4..]).is_none());
    // Fast relaxation bends the ramp like a nonlinear spring.
    let fast = [relaxation(&[(0.4, 0.9)])];
    let fast: Vec<SegmentedRecording> =
        (0..4).map(|k| specimen(&format!("{k}"), 280.0 + 20.0 * k as f64, &fast, 4.0, k)).collect();
    let s = analyze_specimens(&tissue(300.0), &fast).expect("specimens");
    assert_eq!(s.kept_effects().collect::<Vec<_>>(), ["stress_relaxation"], "{:?}", s.candidates);
    assert!(s.parameters.iter().all(|n| n.name.starts_with("terms.")), "{:?}", s.parameters);
    assert!((s.parameters[0].mean - 0.4).abs() < 0.02, "{:?}", s.parameters);
    // Nonlinear spring with two relaxation terms.
    let both: [AnyEffect; 2] =
        [NonlinearElasticity { kappa_per_m: 150.0 }.into(), relaxation(&[(0.25, 0.3), (0.3, 3.0)])];
    let curved: Vec<SegmentedRecording> =
        (0..4).map(|k| specimen(&format!("{k}"), 280.0 + 20.0 * k as f64, &both, 9.0, k)).collect();
    let s = analyze_specimens(&tissue(300.0), &curved).expect("specimens");
    assert_eq!(s.candidates.iter().map(|r| r.kept).collect::<Vec<_>>(), [true; 4], "{:?}", s.candidates);
    let d = s.diagnosis(&curved);
    assert_eq!(
        d.causes.iter().map(|c| c.effect.as_str()).collect::<Vec<_>>(),
        ["nonlinear_elasticity", "stress_relaxation"]
    );
    assert_eq!(d.causes[0].parameters.keys().collect::<Vec<_>>(), ["kappa_per_m"]);
}

/// A change of the force after 60 % of the hold does not affect the fit.
#[test]
fn the_rest_of_the_hold_is_held_out() {
    let mut r = specimen("a", 300.0, &[], 4.0, 1);
    let t = r.recording.time_s.clone();
    let stop_s = t[r.phases.deepest];
    let end_s = stop_s + FITTED_HOLD_SHARE * (t[t.len() - 1] - stop_s);
    for (f, t) in r.recording.force_n.iter_mut().zip(&t) {
        *f += if *t > end_s { 0.5 } else { 0.0 };
    }
    let (fitted_n, rest_n) = fit_specimen(&tissue(300.0), &r).expect("a fit").errors[0];
    assert!(fitted_n < 2e-3 && (rest_n - 0.5).abs() < 0.01, "{fitted_n} {rest_n}");
}

/// Specimens with these errors (N, fitted and held out) under the third model, with and without
/// curvature.
fn judged(all: &[[(f64, f64); 2]]) -> Vec<SpecimenFits> {
    let of = |[with, without]: &[(f64, f64); 2]| SpecimenFits {
        errors: vec![*with; 3],
        models: Vec::new(),
        straight: vec![(*without, law(&[])); 3],
    };
    all.iter().map(of).collect()
}

fn rung(effect: &str, better: f64, kept: bool) -> CandidateModel {
    let effect = Some(effect.to_owned()).filter(|e| !e.is_empty());
    CandidateModel {
        step: String::new(),
        effect,
        fitted_n: 7.0,
        held_out_n: 8.0,
        improved_share: better,
        kept,
    }
}

/// 10 % less of both errors together in three of four specimens.
#[test]
fn the_nonlinear_spring_stays_if_most_specimens_need_it() {
    let result = |all: &[[(f64, f64); 2]], standing: usize| {
        let mut rungs = [
            rung("", 0.0, true),
            rung(NonlinearElasticity::ID, 1.0, true),
            rung("stress_relaxation", 1.0, true),
        ];
        let kept = retest_curvature(&judged(all), &mut rungs, standing);
        assert_eq!(rungs[1].kept, kept);
        (kept, (rungs[standing].fitted_n, rungs[standing].held_out_n))
    };
    let without = (1.2, 0.8);
    for (with, kept) in
        [((0.4, 1.3), true), ((1.3, 0.6), false), ((1.0 - MIN_RELATIVE_GAIN, 1.0 - MIN_RELATIVE_GAIN), false)]
    {
        let numbers = if kept { (7.0, 8.0) } else { without };
        assert_eq!(result(&[[with, without]; 4], 2), (kept, numbers), "{with:?}");
    }
    let (good, equal) = ([(0.5, 0.4), without], [without, without]);
    assert!(result(&[good, good, good, equal], 2).0 && !result(&[good, good, good, equal, equal], 2).0);
    assert_eq!(result(&[equal], 1), (true, (7.0, 8.0)));
}

#[test]
fn the_confidence_of_a_cause_is_that_of_its_best_kept_candidate() {
    let rungs = vec![
        rung("", 0.0, true),
        rung(NonlinearElasticity::ID, 0.8, true),
        rung("stress_relaxation", 0.9, true),
        rung("stress_relaxation", 1.0, false),
    ];
    let s = SpecimenReport {
        used: 4,
        unused: Vec::new(),
        punctured: Vec::new(),
        candidates: rungs,
        parameters: Vec::new(),
    };
    let sure: Vec<f64> = s.diagnosis(&[]).causes.iter().map(|c| c.confidence).collect();
    assert_eq!(sure, [0.8, 0.9]);
}
