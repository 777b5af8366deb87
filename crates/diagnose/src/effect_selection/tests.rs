use super::*;
use crate::base_law_fit::MAX_REPLAYS;
use crate::model_pruning::{effect_at_bound, required_gain_nats, strengths_are_determined};
use crate::repeated_insertions::SegmentedRecording;
use crate::repeated_insertions::multistart_fit::SetFit;
use crate::test_fixtures::{
    assumed_layers, blocks_of, data_of, fit_from_truth, fit_simulated, recordings_with_added_force,
    search_stage,
};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use std::sync::atomic::Ordering;
use stylet_identify::model::{EffectTerm, ParameterRole};
use stylet_tissue::{
    AnyEffect, AsymmetricFriction, CoulombFriction, Effect, ForceBias, ForceDrift, HiddenMembrane,
    PeriodicInterference, StribeckFriction,
};

fn data() -> FitData {
    let t: Vec<f64> = (0..600).map(|k| f64::from(k) / 100.0).collect();
    let z = t.iter().map(|t| if *t < 4.0 { 4e-3 * t } else { 0.016 - 4e-3 * (t - 4.0) }).collect();
    let f = t
        .iter()
        .enumerate()
        .map(|(k, t)| 0.3 * t + 0.01 * (((k * 7919) % 101) as f64 / 101.0 - 0.5))
        .collect();
    data_of(vec![blocks_of(t, z, f)], 0.02)
}

fn fit(effects: &[AnyEffect]) -> Fit {
    let assumed = assumed_layers(&[[0.05, 60.0, 4000.0]]);
    let mut model = Model::base(assumed, 1);
    model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    let residuals = residuals(&model, &data()).expect("a replay");
    Fit { model, residuals }
}

#[test]
fn parameter_is_at_a_bound_within_a_millionth_of_its_range() {
    let bias = |force_n: f64| -> AnyEffect { ForceBias { force_n }.into() };
    let f = fit(&[bias(0.1), AsymmetricFriction { eps: 0.2 }.into()]);
    assert!(!effect_at_bound(&f, 0) && !effect_at_bound(&f, 1));
    let role = ParameterRole::Effect { effect: 1, parameter: 0 };
    let n = f.model.shared_parameters().into_iter().find(|n| n.role == role).expect("free");
    assert!((n.high - n.low).is_finite());
    let near = 1e-6 * (n.high - n.low);
    for (x, at) in [
        (n.low + 0.9 * near, true),
        (n.low + 1.1 * near, false),
        (n.high - 0.9 * near, true),
        (n.high - 1.1 * near, false),
    ] {
        let mut moved = f.clone();
        moved.model.set(role, 0, x);
        assert_eq!((effect_at_bound(&moved, 0), effect_at_bound(&moved, 1)), (false, at), "{x}");
    }
}

#[test]
fn required_gain_is_the_penalty_of_the_additional_parameters() {
    let (none, one) = (fit(&[]), fit(&[ForceBias { force_n: 0.1 }.into()]));
    let stribeck = StribeckFriction { c_n_per_m: 2.0, c_static_n_per_m: 5.0, v_stribeck_mps: 1e-3 };
    let three = fit(&[stribeck.into()]);
    let d = data();
    let each = 0.5 * (d.compared_block_count() as f64).ln();
    assert!((required_gain_nats(&none, &one, &d) - each - 4.0).abs() < 1e-9);
    assert!((required_gain_nats(&one, &three, &d) - 2.0 * each - 4.0).abs() < 1e-9);
    assert!((required_gain_nats(&three, &one, &d) - 4.0).abs() < 1e-9);
}

#[test]
fn each_effect_appears_once() {
    let mut names = Vec::new();
    let (a, b) =
        (fit(&[ForceBias { force_n: 0.1 }.into()]), fit(&[CoulombFriction { c_n_per_m: 2.0 }.into()]));
    assert_eq!([&a, &b, &a, &b].map(|f| is_new_effect(&mut names, f)), [true, true, false, false]);
    assert_eq!(names, ["force_bias", "coulomb_friction", "force_bias", "coulomb_friction"]);
}

#[test]
fn replacing_effect_takes_over_the_stage_and_the_gain() {
    let old = fit(&[CoulombFriction { c_n_per_m: 2.0 }.into()]);
    let new = fit(&[ForceBias { force_n: 0.9 }.into()]);
    let more = old.nats() - new.nats();
    let mut search = Search::from_fit(old, data());
    let stage = |selected| search_stage(selected, 0.0, &[]);
    search.stages =
        vec![stage(Some(("coulomb_friction", 20.0))), stage(Some(("force_drift", 9.0))), stage(None)];
    search.replace_effect(0, new);
    let (name, gained) = search.stages[0].selected.expect("selected");
    assert_eq!(name, "force_bias");
    assert!((gained - 20.0 - more).abs() < 1e-9, "{gained}");
    assert_eq!(search.stages[1].selected, Some(("force_drift", 9.0)));
    assert_eq!(search.best.model.effects[0].info.id, "force_bias");
}

/// Recordings whose force drifts by 20 mN/s, fitted with these effects.
fn drifting(effects: &[AnyEffect]) -> SetFit {
    fit_simulated(effects, &[], &[[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]], |t| 0.02 * t)
}

fn drift(rate_n_per_s: f64) -> AnyEffect {
    ForceDrift { rate_n_per_s }.into()
}

#[test]
fn superfluous_effects_are_pruned_but_not_the_last() {
    let pruned = |effects: &[AnyEffect]| {
        let f = drifting(effects);
        let mut search = Search::from_fit(f.fit, f.data);
        search.prune();
        search.best.model.effects.iter().map(|e| e.info.id).collect::<Vec<_>>()
    };
    let bias: AnyEffect = ForceBias { force_n: 0.002 }.into();
    assert_eq!(pruned(&[drift(0.01), bias.clone()]), ["force_drift"]);
    assert_eq!(pruned(&[bias.clone(), drift(0.01)]), ["force_drift"]);
    assert_eq!(pruned(&[bias]), ["force_bias"]);
}

#[test]
fn strength_is_determined_at_five_standard_deviations() {
    let bias: AnyEffect = ForceBias { force_n: 0.002 }.into();
    let f = drifting(&[drift(0.01), bias]);
    assert!(strengths_are_determined(&f.fit, 0, &f.data));
    assert!(!strengths_are_determined(&f.fit, 1, &f.data));
    // The drift is determined by the noise over the length of a recording: a five-thousandth of it is not.
    let mut less = f.fit.clone();
    less.model.effects[0].values[0] = 1e-6;
    assert!(!strengths_are_determined(&less, 0, &f.data));
    less.model.effects[0].values[0] = -0.02;
    assert!(strengths_are_determined(&less, 0, &f.data));
}

fn dry_friction(c_n_per_m: f64) -> AnyEffect {
    CoulombFriction { c_n_per_m }.into()
}

/// Recordings with the effects `there` and an added sensor force (N), fitted with other effects and prepared for a
/// search.
fn search_over(
    there: &[AnyEffect],
    fitted: &[AnyEffect],
    more_n: impl Fn(f64) -> f64,
) -> (Search, PreparedRecordings) {
    search_of(
        &recordings_with_added_force(there, &[[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]], more_n),
        fitted,
    )
}

fn search_of(runs: &[SegmentedRecording], fitted: &[AnyEffect]) -> (Search, PreparedRecordings) {
    let f = fit_from_truth(fitted, &runs.iter().collect::<Vec<_>>());
    let prepared = PreparedRecordings::new(f.fit.model.assumed.clone(), f.data.recordings.to_vec(), 0.0);
    (Search::from_fit(f.fit, f.data), prepared)
}

/// Fit of the best model plus one effect.
fn with(search: &Search, effect: &AnyEffect) -> Fit {
    let model = search.best.model.with_effect(EffectTerm::new(effect.info(), &effect.parameters()));
    stylet_identify::fit::fit(&model, &search.data, Effort::FULL).expect("a fit")
}

/// Objective (nats) of a fit without one of its effects.
fn nats_without(search: &Search, f: &Fit, effect: usize) -> f64 {
    let less = stylet_identify::fit::fit(&f.model.without_effect(effect), &search.data, Effort::FULL);
    less.expect("a fit").nats()
}

#[test]
fn current_model_restarts_when_the_leader_had_better_start_values() {
    let (mut search, _) = search_over(&[], &[], |_| 0.0);
    let good = search.best.clone();
    let leader = with(&search, &drift(1e-4));
    let again = nats_without(&search, &leader, 0);
    let started = |search: &mut Search, ahead: f64, leader_ahead: f64, restarts: usize| {
        let mut leader = leader.clone();
        (search.best, search.base) = (good.clone(), good.clone());
        search.best.residuals.nats = again + ahead;
        leader.residuals.nats = search.best.nats() - leader_ahead;
        search.base.residuals.nats = f64::INFINITY;
        search.restarts = restarts;
        (search.restart_from_leader(&[leader]), search.restarts, search.base.nats().is_finite())
    };
    assert_eq!(started(&mut search, 4.1, 4.1, 0), (false, 0, false));
    assert_eq!(started(&mut search, 3.9, 4.1, 3), (false, 3, false));
    assert_eq!(started(&mut search, 4.1, 3.9, 3), (false, 3, false));
    // Less than a tenth of the leader's gain gives no restart.
    assert_eq!(started(&mut search, 4.3, 45.0, 3), (false, 3, false));
    // Then the noise is re-estimated.
    let (mut other, _) = search_over(&[], &[], |_| 0.0);
    assert_eq!(started(&mut other, 4.3, 40.5, 3), (true, 2, true));
    assert_eq!(started(&mut search, 4.1, 4.1, 3), (true, 2, true));
    assert!(!search.restart_from_leader(&[]) && !search.restart_from_leader(std::slice::from_ref(&good)));
    // A model with an effect does not become the base law.
    let (mut search, _) = search_over(&[], &[drift(1e-4)], |_| 0.0);
    let mut leader = with(&search, &dry_friction(0.1));
    search.restarts = 1;
    search.best.residuals.nats = nats_without(&search, &leader, 1) + 9.0;
    search.base.residuals.nats = f64::INFINITY;
    leader.residuals.nats = search.best.nats() - 9.0;
    assert!(search.restart_from_leader(&[leader]));
    assert_eq!(search.base.nats(), f64::INFINITY);
}

#[test]
fn tones_are_detected_and_excluded_from_the_noise() {
    let tone = |t: f64| 0.1 * (std::f64::consts::TAU * 2.3 * t).sin();
    let (mut search, _) = search_over(&[], &[], tone);
    let before = search.data.noise.sd_n();
    search.update_tones();
    assert_eq!(search.tones_hz.len(), 1);
    assert!((search.tones_hz[0] - 2.3).abs() < 0.02, "{:?}", search.tones_hz);
    assert!(search.data.noise.sd_n() < 0.5 * before);
    let left = residuals(&search.best.model, &search.data).expect("a replay").nats;
    assert_eq!(search.best.nats(), left);
    let coarse = search.coarse();
    assert_eq!(coarse.recordings[0].len(), search.data.recordings[0].len().div_ceil(3));
    // Without tones nothing changes.
    let (mut search, _) = search_over(&[], &[], |_| 0.0);
    let (noise, nats) = (search.data.noise.clone(), search.best.nats());
    search.update_tones();
    assert!(search.tones_hz.is_empty() && search.data.noise == noise && search.best.nats() == nats);
}

#[test]
fn search_ends_at_the_limit_of_replays() {
    let with_drift = |limit_reached: bool| {
        let (search, prepared) = search_over(&[], &[], |t| 0.1 * t);
        let blocks: usize = prepared.blocks.iter().map(|b| b.len()).sum();
        let before = if limit_reached { MAX_REPLAYS * blocks as u64 + 1 } else { 0 };
        prepared.replayed.store(before, Ordering::Relaxed);
        let mut search = Search::start(search.best, search.data);
        search.add_effects(1, &prepared, &mut |_| {});
        search.best.model.effects.len()
    };
    assert_eq!([false, true].map(with_drift), [1, 0]);
}

/// A drift together with a local force that no effect explains.
#[test]
fn reweighted_search_finds_the_drift() {
    let lump = |t: f64| 0.1 * (-(4.0 * (t - 4.0)).powi(2)).exp();
    let shown = |t: f64| 0.1 * t + lump(t);
    let of = |s: &Search| s.best.model.effects.iter().map(|e| (e.info.id, e.values[0])).collect::<Vec<_>>();
    let (search, prepared) = search_over(&[], &[drift(1e-4)], shown);
    let found_names = search.continue_reweighted(&prepared).expect("a fit");
    let found = of(&found_names);
    assert!(found.len() == 1 && found[0].0 == "force_drift", "{found:?}");
    assert!((found[0].1 / 0.1 - 1.0).abs() < 0.03, "{found:?}");
    assert!(found_names.stages.last().is_some_and(|s| s.selected.is_none()) && search.stages.is_empty());
}

#[test]
fn candidates_are_refitted_from_the_prior_when_the_leader_leaves_more_than_noise() {
    let there = HiddenMembrane { depth_m: 2e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
    let membrane: AnyEffect = there.into();
    let (mut search, prepared) = search_over(std::slice::from_ref(&membrane), &[], |_| 0.0);
    let start = |e: &AnyEffect| {
        let choice = EffectTerm::new(e.info(), &e.parameters());
        vec![EffectStart { choice, gain_nats: 1.0, detectable_nats: 1.0, model: None }]
    };
    let good = [with(&search, &dry_friction(1.0))];
    let mut full = good.clone();
    full[0].model.tissue.layers[0].stiffness_n_per_m *= 0.8;
    let weak = [start(&drift(1e-4)), start(&ForceBias { force_n: 1e-3 }.into())];
    let ranked = [weak.to_vec(), vec![start(&membrane); 4]].concat();
    let started = |search: &mut Search, full: &[Fit], ranked: &[Vec<EffectStart>], prior_refits: usize| {
        search.prior_refits = prior_refits;
        let names =
            search.refit_candidates_from_prior(full, ranked, &search.coarse(), &prepared).map(|all| {
                all.iter().map(|f| f.model.effects.last().map_or("", |e| e.info.id)).collect::<Vec<_>>()
            });
        (names, search.prior_refits)
    };
    // Each effect once, and none with less than half of the best gain.
    assert_eq!(started(&mut search, &full, &ranked, 2), (Some(vec!["hidden_membrane"]), 1));
    assert_eq!(started(&mut search, &full, &ranked[..3], 1), (Some(vec!["hidden_membrane"]), 0));
    // Breaking elements also start at the force drops.
    assert_eq!(started(&mut search, &good, &ranked, 2), (Some(vec!["hidden_membrane"]), 1));
    assert_eq!(started(&mut search, &full, &ranked, 0), (None, 0));
    assert_eq!(started(&mut search, &[], &ranked, 2), (None, 2));
    // The first that leaves only noise ends the refits.
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let noise_n: Vec<f64> = (0..1000).map(|_| 0.05 * normal()).collect();
    let drifting_runs = recordings_with_added_force(&[], &[[4e-3, 0.0], [6e-3, 0.0]], |t| {
        0.05 * t + noise_n[(50.0 * t).round() as usize]
    });
    let (mut drifts, prepared_too) = search_of(&drifting_runs, &[]);
    drifts.prior_refits = 1;
    let full_too = [with(&drifts, &dry_friction(1.0))];
    let names = |all: Vec<Fit>| all.iter().map(|f| f.model.effects[0].info.id).collect::<Vec<_>>();
    let begun_too = drifts
        .refit_candidates_from_prior(
            &full_too,
            &vec![start(&drift(1e-4)); 4],
            &drifts.coarse(),
            &prepared_too,
        )
        .map(names);
    assert_eq!(begun_too, Some(vec!["force_drift"]));
    // Noise alone, and noise with a slow force.
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut leader = full[0].clone();
    for e in &mut leader.residuals.residual_n {
        e.iter_mut().for_each(|e| *e = 0.01 * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0));
    }
    let leaves = |slow_n: f64| {
        let mut f = leader.clone();
        for e in &mut f.residuals.residual_n {
            e.iter_mut().enumerate().for_each(|(k, e)| *e += slow_n * (0.02 * k as f64).sin());
        }
        let normalised = |e: &Vec<f64>| e.iter().map(|e| e / 0.01).collect();
        f.residuals.innovations = f.residuals.residual_n.iter().map(normalised).collect();
        [f]
    };
    assert_eq!(started(&mut search, &leaves(0.0), &ranked, 2), (None, 2));
    assert_eq!(started(&mut search, &leaves(0.03), &ranked, 2).1, 1);
}

#[test]
fn effect_stays_when_it_gains_four_nats_more_than_its_penalty() {
    let mut counts = [0, 0];
    for bias_n in [0.0, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3, 8e-3] {
        let bias: AnyEffect = ForceBias { force_n: 1e-4 }.into();
        let (mut search, _) = search_over(&[], &[drift(0.02), bias], |t| 0.02 * t + bias_n);
        let less =
            stylet_identify::fit::fit(&search.best.model.without_effect(1), &search.data, Effort::FULL);
        let gained = likelihood_gain(&less.expect("a fit"), &search.best, &search.data);
        let wanted = 0.5 * (search.data.compared_block_count() as f64).ln() + 4.0;
        search.prune();
        let stays = search.best.model.effects.len() == 2;
        assert_eq!(stays, gained > wanted, "{gained} of {wanted}");
        if (gained - wanted).abs() < 2.7 {
            counts[usize::from(stays)] += 1;
        }
    }
    assert!(counts.iter().all(|n| *n > 0), "{counts:?}");
}

/// One step of a search and its start values; with the noise of the calm parts or of the whole residual.
fn grown(
    calm: bool,
    prior_refits: usize,
    there: &[AnyEffect],
    more_n: impl Fn(f64) -> f64,
) -> (Search, Vec<EffectStart>) {
    let (mut search, prepared) = search_over(there, &[], more_n);
    if calm {
        search.accept(search.best.clone());
    }
    search.prior_refits = prior_refits;
    let first = effect_starts(&ScoreTest::new(&search.best, &search.data), &prepared, &[]);
    let any = search.add_effect(&prepared);
    assert_eq!(any, search.stages.last().is_some_and(|s| s.selected.is_some()));
    (search, first.into_iter().map(|s| s[0].clone()).collect())
}

#[test]
fn effect_is_fitted_when_its_first_order_gain_is_half_of_the_required() {
    let mut counts = [0, 0];
    for drift_n_per_s in [6e-4, 8e-4] {
        let (search, first) = grown(false, 0, &[], |t| drift_n_per_s * t);
        let tried = |s: &EffectStart| search.stages[0].candidates.iter().any(|r| r.0 == s.choice.info.id);
        for s in first.iter().filter(|s| s.choice.info.stage != ChainStage::Puncture) {
            let parameters = s.choice.info.parameters.len() as f64;
            let needed = 0.5 * parameters * (search.data.compared_block_count() as f64).ln() + 4.0;
            assert!(s.gain_nats > 0.5 * needed || !tried(s), "{} of {needed}", s.gain_nats);
            if ["force_drift", "force_bias"].contains(&s.choice.info.id) {
                assert_eq!(tried(s), s.gain_nats > 0.5 * needed, "{} of {needed}", s.gain_nats);
                counts[usize::from(tried(s))] += 1;
            }
        }
        assert!(search.stages[0].candidates.iter().any(|r| r.0 == "rate_dependent_puncture"));
    }
    assert_eq!(counts, [1, 3]);
}

#[test]
fn candidates_far_behind_get_no_full_fit() {
    let names = |there: &[AnyEffect], prior_refits: usize, drift_n_per_s: f64| {
        let (search, _) = grown(true, prior_refits, there, |t| drift_n_per_s * t);
        let price =
            |parameters: usize| 0.5 * parameters as f64 * (search.data.compared_block_count() as f64).ln();
        let penalty_of: Vec<f64> = search.stages[0].candidates.iter().map(|r| r.1 - price(r.2)).collect();
        assert!(penalty_of.windows(2).all(|w| w[0] >= w[1]), "{penalty_of:?}");
        search.stages[0].candidates.iter().map(|r| r.0).collect::<Vec<_>>()
    };
    let punctures = "rate_dependent_puncture";
    assert_eq!(names(&[], 0, 0.02), ["force_drift", "force_bias", "position_dependent_force", punctures]);
    // Within thirty nats of the best no candidate is dropped.
    assert_eq!(
        names(&[], 0, 3e-4),
        ["respiration", "cutting_force", "asymmetric_friction", "position_dependent_force", punctures]
    );
    // A candidate with a large penalty may gain more than others and still rank behind them.
    assert_eq!(
        names(&[dry_friction(50.0)], 0, 0.0),
        ["respiration", "nonlinear_elasticity", "drive_friction", "hidden_membrane", punctures]
    );
}

#[test]
fn shape_parameters_need_not_be_determined() {
    let tone = PeriodicInterference { amplitude_n: 0.1, frequency_hz: 1.7, phase_rad: 0.0 };
    let sine = |t: f64| 0.1 * (std::f64::consts::TAU * 1.7 * t).sin();
    let (mut search, _) = search_over(&[], &[tone.into(), drift(1e-6)], sine);
    search.best.model.effects[0].values[2] = 0.0;
    assert!(strengths_are_determined(&search.best, 0, &search.data));
    assert!(!strengths_are_determined(&search.best, 1, &search.data));
}
