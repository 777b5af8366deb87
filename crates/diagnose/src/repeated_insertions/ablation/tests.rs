use super::{AblationResult, ablate, removal_candidates, with_fixed_slip_parameters, without_effect};
use crate::repeated_insertions::multistart_fit::SetFit;
use crate::repeated_insertions::scored_model::{ModelFamily, ScoredModel, active_effects};
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use crate::test_fixtures;
use crate::test_fixtures::{assumed_layers, fit_from_truth, simulated_recordings};
use stylet_identify::likelihood::residuals;
use stylet_identify::model::{EffectTerm, MAX_VARYING_PARAMETERS, Model, Scatter, TiedParameter};
use stylet_identify::rupture_likelihood::RuptureEvent;
use stylet_tissue::{
    AnyEffect, CoulombFriction, DelayedPuncture, Effect, ForceBias, ReleaseDepth, ShaftSlip, StribeckFriction,
};

pub(crate) fn model(all: &[AnyEffect]) -> Model {
    let belief = assumed_layers(&[[0.02, 100.0, 1000.0]; 2]);
    let mut m = Model::base(belief, 1);
    m.effects = all.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    m
}

pub(crate) fn stick_slip(layer: usize) -> AnyEffect {
    ShaftSlip {
        layer,
        push_n: 1.0,
        curvature_n_per_m2: 3e3,
        fractions: [0.1, 0.2],
        time_constants_s: [0.5, 7.0],
        wear_per_m: 4.0,
        rate: -0.1,
        ..ShaftSlip::default()
    }
    .into()
}

pub(crate) fn delayed(layer: usize, force_n: f64) -> AnyEffect {
    DelayedPuncture { layer, force_n, exponent: 9.0 }.into()
}

pub(crate) fn release(layer: usize) -> AnyEffect {
    ReleaseDepth { layer, depth_m: 1e-3 }.into()
}

#[test]
fn every_effect_and_every_slip_term_is_a_removal_candidate() {
    let m = model(&[stick_slip(1), delayed(1, 1.5), release(1), stick_slip(2), delayed(2, 2.5), release(2)]);
    let all = removal_candidates(&m, &[]);
    let names: Vec<&str> = all.iter().map(|c| c.1.as_str()).collect();
    assert_eq!(
        names,
        [
            "delayed_puncture",
            "release_depth",
            "shaft_slip: nonlinear spring",
            "shaft_slip: relaxation",
            "shaft_slip: wear",
            "shaft_slip: rate"
        ]
    );
    assert_eq!(all.iter().map(|c| c.0).collect::<Vec<_>>()[1..3], ["release_depth", "shaft_slip"]);
    let count = |m: &Model| m.effects.len();
    assert_eq!(all.iter().map(|c| count(&c.2)).collect::<Vec<_>>(), [4, 4, 6, 6, 6, 6]);
    let value = |m: &Model, e: usize, path: &str| {
        let k = m.effects[e].info.parameters.iter().position(|p| p.path == path).expect("a parameter");
        m.effects[e].values[k]
    };
    for e in [0, 3] {
        assert_eq!(value(&all[2].2, e, "curvature_n_per_m2"), 0.0);
        assert_eq!(
            (value(&all[3].2, e, "fractions.1"), value(&all[3].2, e, "time_constants_s.1")),
            (0.0, 10.0)
        );
        assert_eq!(
            (value(&all[3].2, e, "time_constants_s.0"), value(&all[3].2, e, "curvature_n_per_m2")),
            (1.0, 3e3)
        );
        assert_eq!((value(&all[4].2, e, "wear_per_m"), value(&all[5].2, e, "rate")), (0.0, 0.0));
    }
    // Without stick-slip only whole effects are candidates.
    assert_eq!(removal_candidates(&model(&[CoulombFriction { c_n_per_m: 3.0 }.into()]), &[]).len(), 1);
    assert!(removal_candidates(&model(&[]), &[]).is_empty());
    assert_eq!(removal_candidates(&model(&[stick_slip(1)]), &[]).len(), 4);
}

#[test]
fn fixed_parameters_are_inactive_and_not_fitted() {
    let m = model(&[delayed(1, 1.5), stick_slip(1), stick_slip(2)]);
    let wear = m.effects[1].info.parameters.iter().position(|p| p.path == "wear_per_m").expect("a parameter");
    let out = with_fixed_slip_parameters(&m, &[("wear_per_m", 0.0)]).expect("it wore");
    let bound = |e| TiedParameter { effect: e, parameter: wear, tied_to: None };
    assert_eq!(out.tied, [bound(1), bound(2)]);
    let mut half = m.clone();
    half.tied = vec![TiedParameter { effect: 2, parameter: wear, tied_to: Some(1) }];
    assert_eq!(
        with_fixed_slip_parameters(&half, &[("wear_per_m", 0.0)]).expect("it wore").tied,
        [half.tied[0], bound(1)]
    );
    assert!(with_fixed_slip_parameters(&out, &[("wear_per_m", 0.0)]).is_none());
    assert!(with_fixed_slip_parameters(&m, &[("no such parameter", 0.0)]).is_none());
}

#[test]
fn removing_a_delay_gives_the_layer_a_puncture_force() {
    let mut m = model(&[delayed(2, 2.5), stick_slip(1), delayed(1, 1.5), release(1), release(2)]);
    (m.per_recording[0].varying[0], m.scatter.varying[1]) = (3e-4, 2e-4);
    let out = without_effect(&m, &[], "delayed_puncture");
    assert_eq!(out.effects.len(), 3);
    for t in [&out.tissue, &out.assumed.tissue] {
        assert_eq!([t.layers[0].puncture_n, t.layers[1].puncture_n], [Some(1.5), Some(2.5)]);
    }
    assert_eq!(
        (out.per_recording[0].varying, out.scatter.varying),
        (m.per_recording[0].varying, m.scatter.varying)
    );
    let same = without_effect(&m, &[], "shaft_slip");
    assert_eq!((same.effects.len(), same.tissue.layers[0].puncture_n), (4, None));
    let none = without_effect(&m, &[], "release_depth");
    assert_eq!(
        (none.per_recording[0].varying, none.scatter.varying),
        ([0.0; MAX_VARYING_PARAMETERS], [0.0; MAX_VARYING_PARAMETERS])
    );
}

/// A delayed layer ruptures at its observed force, with its observed scatter.
#[test]
fn the_new_puncture_force_is_the_observed_rupture_force() {
    let m = model(&[delayed(1, 1.5)]);
    let event =
        |elastic_n: f64, ruptured: bool| RuptureEvent { elastic_n, ruptured, ..RuptureEvent::INITIAL };
    let events =
        [vec![event(1.8, true)], vec![event(2.0, true)], vec![event(2.2, true)], vec![event(9.0, false)]];
    let out = without_effect(&m, &events, "delayed_puncture");
    assert_eq!(
        (out.tissue.layers[0].puncture_n, out.assumed.tissue.layers[0].puncture_n),
        (Some(2.0), Some(2.0))
    );
    assert!((out.scatter.rupture_force - 0.1).abs() < 1e-12, "{}", out.scatter.rupture_force);
    let wide = Model { scatter: Scatter { rupture_force: 0.3, ..m.scatter }, ..m };
    assert_eq!(without_effect(&wide, &events, "delayed_puncture").scatter.rupture_force, 0.3);
}

#[test]
fn an_effect_is_supported_by_held_out_loss_or_by_uncontradicted_evidence() {
    let about = |mean: f64| vec![mean - 0.01, mean, mean + 0.01];
    let missed = |loses: f64, speeds: &[f64], nats: f64| AblationResult {
        loses: about(loses),
        speeds_lose: speeds.to_vec(),
        nats,
    };
    for (loses, speeds, nats, wanted) in [
        (0.2, vec![], -9.0, true),
        (0.02, vec![], -9.0, false),
        (0.02, vec![], 9.0, true),
        (-0.02, vec![], 9.0, false),
        (-0.02, about(0.03), 9.0, true),
        (-0.02, about(0.3), -9.0, true),
    ] {
        assert_eq!(missed(loses, &speeds, nats).is_supported(), wanted, "{loses} {speeds:?} {nats}");
    }
    assert!(missed(0.12, &[], -9.0).keeps_effect() && !missed(0.09, &[], -9.0).keeps_effect());
    let unsure = AblationResult { loses: vec![0.0, 0.2, 0.3], ..missed(0.0, &[], -9.0) };
    assert!(unsure.keeps_effect() && !unsure.is_supported());
    assert!(missed(0.03, &[], -9.0).keeps_shape() && !missed(0.01, &[], 9.0).keeps_shape());
}

#[test]
fn the_evidence_of_a_term_is_penalised_per_parameter() {
    let bias: AnyEffect = ForceBias { force_n: 1e-3 }.into();
    let recordings = simulated_recordings(&[], &FOUR);
    let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
    let (whole, less) = (fit_from_truth(&[bias], &recordings), fit_from_truth(&[], &recordings));
    let nats = |f: &SetFit| residuals(&f.fit.model, &whole.data).expect("a replay").nats;
    let cost = 0.5 * (whole.data.compared_block_count() as f64).ln();
    let result = AblationResult::new(&whole, Some(&less), &[], &[]).nats;
    assert!((result - (nats(&less) - nats(&whole) - cost)).abs() < 1e-9, "{result}");
    assert_eq!(AblationResult::new(&whole, None, &[], &[]).nats, f64::INFINITY);
}

pub(crate) fn friction(c_n_per_m: f64) -> AnyEffect {
    CoulombFriction { c_n_per_m }.into()
}

/// Two recordings at each of two speeds.
pub(crate) const FOUR: [[f64; 2]; 4] = [[0.008, 1e-4], [0.008, -1e-4], [0.016, 0.0], [0.016, 1e-4]];

#[test]
fn ablation_removes_an_unneeded_term_and_keeps_a_needed_one() {
    let true_one = friction(150.0);
    let recordings = simulated_recordings(std::slice::from_ref(&true_one), &FOUR);
    let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
    let bias: AnyEffect = ForceBias { force_n: 1e-3 }.into();
    let mut candidate = ScoredModel::new(
        ModelFamily::Library,
        fit_from_truth(&[bias.clone(), true_one], &recordings),
        &recordings,
    );
    let before = candidate.held_out_n();
    let result = ablate(&mut candidate, &recordings);
    let kept: Vec<(&str, &str, bool)> = result.iter().map(|p| (p.effect, p.name.as_str(), p.kept)).collect();
    assert_eq!(kept, [("force_bias", "force_bias", false), ("coulomb_friction", "coulomb_friction", true)]);
    let mean = |k: usize| stylet_stats::mean(&result[k].without_n);
    assert!(mean(0) < 1.01 * before && mean(1) > 1.05 * before, "{before}: {} {}", mean(0), mean(1));
    assert_eq!(
        (active_effects(&candidate.set_fit.fit.model), candidate.family),
        (vec!["coulomb_friction"], ModelFamily::Library)
    );
    assert!(candidate.held_out_n() < 1.01 * before);
    // Without terms the model is the base law.
    let recordings = simulated_recordings(&[], &FOUR);
    let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
    let mut candidate =
        ScoredModel::new(ModelFamily::Library, fit_from_truth(&[bias], &recordings), &recordings);
    assert!(!ablate(&mut candidate, &recordings)[0].kept);
    assert_eq!((candidate.family, candidate.set_fit.fit.model.effects.len()), (ModelFamily::Base, 0));
}

/// Two effects explain the same friction: one is removed, and the other is then needed.
#[test]
fn of_two_equivalent_terms_one_stays() {
    let true_one = friction(150.0);
    let recordings = simulated_recordings(std::slice::from_ref(&true_one), &FOUR);
    let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
    let same: AnyEffect =
        StribeckFriction { c_n_per_m: 75.0, c_static_n_per_m: 75.0, v_stribeck_mps: 2e-3 }.into();
    let mut candidate = ScoredModel::new(
        ModelFamily::Library,
        fit_from_truth(&[friction(75.0), same], &recordings),
        &recordings,
    );
    let result = ablate(&mut candidate, &recordings);
    assert_eq!(result.iter().filter(|p| p.kept).count(), 1, "{result:?}");
    assert_eq!(candidate.set_fit.fit.model.effects.len(), 1);
}

/// The unmodelled force is an oscillation of 4 N: a term is judged by its share of the error.
#[test]
fn ablation_is_relative_to_the_error() {
    let all = [[0.008, 0.0], [0.008, 1e-4], [0.016, 0.0], [0.016, 1e-4]];
    let recordings = test_fixtures::recordings_with_added_force(&[], &all, |t| 4.0 * (9.0 * t).sin());
    let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
    let bias: AnyEffect = ForceBias { force_n: 1e-3 }.into();
    let mut candidate =
        ScoredModel::new(ModelFamily::Library, fit_from_truth(&[bias], &recordings), &recordings);
    assert!(candidate.held_out_n() > 1.5, "{}", candidate.held_out_n());
    assert!(!ablate(&mut candidate, &recordings)[0].kept);
}
