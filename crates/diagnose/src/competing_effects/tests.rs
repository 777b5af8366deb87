use super::*;
use crate::test_fixtures::{fit_from_truth, recordings_with_added_force, search_stage};
use stylet_tissue::{
    AnyEffect, AsymmetricFriction, CoulombFriction, CuttingForce, DriveFriction, Effect, ForceBias,
    ForceDrift, PeriodicInterference, PreslidingFriction, StribeckFriction, TimeDelay, ToolInertia,
};

fn drift() -> AnyEffect {
    ForceDrift { rate_n_per_s: 1e-4 }.into()
}

fn bias() -> AnyEffect {
    ForceBias { force_n: 1e-4 }.into()
}

fn dry_friction(c_n_per_m: f64) -> AnyEffect {
    CoulombFriction { c_n_per_m }.into()
}

fn asymmetric() -> AnyEffect {
    AsymmetricFriction { eps: 1e-3 }.into()
}

/// Additional friction at low speed.
fn stribeck(c_n_per_m: f64) -> AnyEffect {
    StribeckFriction { c_n_per_m, c_static_n_per_m: 1.1 * c_n_per_m, v_stribeck_mps: 2e-3 }.into()
}

/// Effects with their gains in nats.
type Candidates<'a> = &'a [(AnyEffect, f64)];

/// A search that selected these effects from recordings with the effects `there` and a drift (N/s); each stage with
/// its candidates.
fn search(there: &[AnyEffect], drift_n_per_s: f64, selected: &[(AnyEffect, f64, Candidates)]) -> Search {
    let runs = recordings_with_added_force(there, &[[4e-3, 3e-4], [6e-3, -3e-4]], |t| drift_n_per_s * t);
    let effects: Vec<AnyEffect> = selected.iter().map(|t| t.0.clone()).collect();
    let f = fit_from_truth(&effects, &runs.iter().collect::<Vec<_>>());
    let mut search = Search::from_fit(f.fit, f.data);
    search.stages =
        selected.iter().map(|(e, gain, tried)| search_stage(Some((e.id(), *gain)), 8.0, tried)).collect();
    search
}

/// Competing effects of the first cause with the nats they are behind.
fn competitors(search: &Search) -> Vec<(&'static str, f64)> {
    competing_fits(search, 0).iter().map(|(f, behind)| (f.model.effects[0].info.id, *behind)).collect()
}

fn names(search: &Search) -> Vec<&'static str> {
    competitors(search).iter().map(|r| r.0).collect()
}

#[test]
fn competitors_were_close_at_the_selection_step() {
    // Within 25 nats, or a twentieth of the largest gain.
    for (most, limit) in [(100.0, 25.0), (1000.0, 50.0)] {
        let tried = [
            (drift(), most),
            (bias(), most - 0.99 * limit),
            (dry_friction(1.0), most - limit),
            (asymmetric(), 1.0),
        ];
        let s = search(&[], 5e-4, &[(drift(), most, &tried)]);
        assert_eq!(names(&s), ["force_bias"]);
    }
}

#[test]
fn competitors_come_from_the_selecting_stage_and_are_not_in_the_model() {
    let tried = [(drift(), 30.0), (bias(), 29.0), (asymmetric(), 28.0)];
    let later = [(bias(), 9.0), (dry_friction(1.0), 9.0)];
    let mut s = search(&[], 5e-4, &[(drift(), 30.0, &tried), (bias(), 9.0, &later)]);
    assert_eq!(names(&s), ["asymmetric_friction"]);
    s.stages.insert(0, search_stage(Some(("force_drift", 1.0)), 8.0, &later));
    assert_eq!(names(&s), ["asymmetric_friction"], "the last stage that selected it");
    s.stages.retain(|s| s.selected.is_some_and(|t| t.0 == "force_bias"));
    assert!(names(&s).is_empty(), "no stage selected it");
}

/// In the presence of a force that both explain, the additional parameters are penalised.
#[test]
fn distance_of_a_competitor_includes_the_parameter_penalty() {
    let tried = [(drift(), 30.0), (bias(), 29.0), (stribeck(1.0), 28.0)];
    let mut s = search(&[dry_friction(3.0)], 5e-4, &[(drift(), 30.0, &tried)]);
    let blocks = s.data.compared_block_count();
    let cause = s.best.nats();
    for ahead in [-120.0, -60.0, -30.0, 0.0, 30.0, 60.0] {
        s.best.residuals.nats = cause + ahead;
        let competitors = competitors(&s);
        assert_eq!(competitors.len(), 2);
        for ((e, parameters), (_, behind)) in [(bias(), 1), (stribeck(1.0), 3)].iter().zip(competitors) {
            let mut model = s.best.model.clone();
            model.effects[0] = EffectTerm::new(e.info(), &e.parameters());
            // A fit that stays more than 40 nats behind is stopped.
            let more = bic_penalty(*parameters, blocks) - bic_penalty(1, blocks);
            let f = fit_if_below(&model, &s.data, Effort::FULL, s.best.nats() + 40.0 - more).expect("a fit");
            let wanted = f.nats() - s.best.nats() + more;
            assert!((behind - wanted).abs() < 1e-6, "{}: {behind} for {wanted}", e.id());
        }
    }
}

#[test]
fn special_cases_always_compete_and_generalisations_must_be_ahead() {
    let tried = [(stribeck(3.0), 900.0), (dry_friction(3.0), 10.0), (drift(), 10.0)];
    let s = search(&[dry_friction(5.0)], 0.0, &[(stribeck(5.0), 900.0, &tried)]);
    assert_eq!(names(&s), ["coulomb_friction"]);
    let tried = [(dry_friction(3.0), 900.0), (stribeck(5.0), 899.0)];
    let mut s = search(&[dry_friction(5.0)], 0.0, &[(dry_friction(5.0), 900.0, &tried)]);
    assert!(names(&s).is_empty());
    let cause = s.best.nats();
    s.best.residuals.nats = cause + 100.0;
    let behind = competitors(&s)[0].1 + 100.0;
    for (ahead, any) in [(-3.0, false), (0.0, false), (0.4, false), (0.6, true)] {
        s.best.residuals.nats = cause + behind + ahead;
        assert_eq!(names(&s).len(), usize::from(any), "{ahead}");
    }
}

#[test]
fn competitor_that_is_ahead_replaces_the_cause() {
    let tried = [(bias(), 300.0), (asymmetric(), 299.0), (drift(), 299.0)];
    let mut s = search(&[], 5e-3, &[(bias(), 300.0, &tried)]);
    let competing = find_competing_effects(&mut s);
    assert_eq!(s.best.model.effects[0].info.id, "force_drift");
    assert_eq!(s.stages[0].selected.map(|t| t.0), Some("force_drift"));
    assert_eq!(competing.len(), 1);
    assert_eq!(
        competing[0].iter().map(|r| r.name).collect::<Vec<_>>(),
        ["force_bias", "asymmetric_friction"]
    );
    assert!(competing[0].iter().all(|r| r.nats_behind > 10.0 && r.choice.info.id == r.name));
}

#[test]
fn competitor_ahead_by_less_than_half_a_nat_does_not_replace() {
    let tried = [(drift(), 30.0), (bias(), 29.0)];
    let s = || search(&[], 5e-4, &[(drift(), 30.0, &tried)]);
    let (behind, cause) = (competitors(&s())[0].1, s().best.nats());
    for ahead in [-0.3, 0.2, 0.45, 0.6] {
        let mut s = s();
        s.best.residuals.nats = cause + behind + ahead;
        let competing = find_competing_effects(&mut s);
        // Once it replaces the cause, all are judged under its noise.
        let stays = s.best.nats() == cause + behind + ahead;
        assert_eq!(stays, ahead < 0.5, "{ahead}");
        assert!(!stays || (competing[0][0].nats_behind + ahead).abs() < 1e-6);
    }
}

#[test]
fn larger_effect_replaces_a_cause_only_if_its_parameters_pay_under_its_noise() {
    let presliding =
        |c_n_per_m: f64, delta_m: f64| -> AnyEffect { PreslidingFriction { c_n_per_m, delta_m }.into() };
    let tried = [(dry_friction(50.0), 900.0), (presliding(50.0, 5e-4), 899.0)];
    let mut s = search(&[presliding(50.0, 1e-3)], 0.0, &[(dry_friction(50.0), 900.0, &tried)]);
    find_competing_effects(&mut s);
    assert_eq!(s.best.model.effects[0].info.id, "presliding_friction");
    // Seemingly ahead, but without gain under its own noise.
    let tone = PeriodicInterference { amplitude_n: 1e-3, frequency_hz: 1.0, phase_rad: 0.5 };
    let tried = [(drift(), 900.0), (tone.into(), 899.0)];
    let mut s = search(&[], 5e-4, &[(drift(), 900.0, &tried)]);
    s.best.residuals.nats += 300.0;
    let competing = find_competing_effects(&mut s);
    assert_eq!(s.best.model.effects[0].info.id, "force_drift");
    assert!(competing[0][0].nats_behind < -50.0);
}

#[test]
fn at_most_three_causes_are_replaced() {
    let right: [AnyEffect; 4] = [
        ForceDrift { rate_n_per_s: 0.1 }.into(),
        dry_friction(60.0),
        CuttingForce { force_n: 0.2 }.into(),
        AsymmetricFriction { eps: 0.2 }.into(),
    ];
    let wrong: [AnyEffect; 4] = [
        ToolInertia { mass_kg: 0.1 }.into(),
        TimeDelay { delay_s: 1e-3 }.into(),
        DriveFriction { force_n: 0.01 }.into(),
        bias(),
    ];
    let tried: Vec<_> = right.iter().map(|e| [(e.clone(), 99.0)]).collect();
    let selected: Vec<_> = wrong.iter().zip(&tried).map(|(e, t)| (e.clone(), 99.0, &t[..])).collect();
    let mut s = search(&right[1..], 0.1, &selected);
    let competing = find_competing_effects(&mut s);
    let names: Vec<&str> = s.best.model.effects.iter().map(|e| e.info.id).collect();
    assert_eq!(names, ["force_drift", "coulomb_friction", "cutting_force", "force_bias"]);
    assert!(competing[3][0].nats_behind < -1000.0, "{}", competing[3][0].nats_behind);
}
