//! Effects that explain the data as well as a cause: its class.

use crate::effect_selection::{Search, effect_at_bound, required_gain_nats};
use crate::model_comparison::{bic_penalty, likelihood_gain};
use rayon::prelude::*;
use stylet_identify::fit::{Effort, Fit, fit_if_below};
use stylet_identify::model::EffectTerm;

/// Rivals within so many nats of the best form one class.
pub const EQUIVALENCE_NATS: f64 = 3.0;
/// A rival that was behind by more than this share of the gain when the cause was taken is no rival.
const FAR: f64 = 0.05;
/// ... unless it was behind by less than so many nats.
const NEAR_NATS: f64 = 25.0;
/// A rival that cannot come nearer than so many nats is not fitted to the end.
const OUT_OF_SIGHT: f64 = 40.0;

/// A rival of a cause: its name and by how many nats it is behind, numbers paid for (negative: ahead).
#[derive(Clone, Debug)]
pub struct CompetingEffect {
    /// Effect.
    pub name: &'static str,
    /// Nats behind.
    pub nats_behind: f64,
    /// The effect with its values.
    pub choice: EffectTerm,
}

/// The rivals of every cause of the best model. A rival that is ahead takes the cause's place.
pub fn find_competing_effects(search: &mut Search) -> Vec<Vec<CompetingEffect>> {
    let mut k = 0;
    let mut out: Vec<Vec<CompetingEffect>> = Vec::new();
    let mut swaps = 0;
    while k < search.best.model.effects.len() {
        let own = of(search, k);
        let ahead = own.iter().filter(|r| r.1 < -0.5).min_by(|a, b| a.1.total_cmp(&b.1));
        // More numbers have to be worth it when all that is left is noise.
        let worth = |f: &Fit| {
            f.model.effect_parameter_count() <= search.best.model.effect_parameter_count()
                || (!effect_at_bound(f, k)
                    && likelihood_gain(&search.best, f, &search.data).exceeds(required_gain_nats(
                        &search.best,
                        f,
                        &search.data,
                    )))
        };
        if let Some((f, _)) = ahead.filter(|r| swaps < 3 && worth(&r.0)) {
            search.replace_effect(k, f.clone());
            swaps += 1;
            (k, out) = (0, Vec::new());
            continue;
        }
        let name = |f: &Fit| f.model.effects[k].info.id;
        let rival = |(f, behind): &(Fit, f64)| CompetingEffect {
            name: name(f),
            nats_behind: *behind,
            choice: f.model.effects[k].clone(),
        };
        out.push(own.iter().map(rival).collect());
        k += 1;
    }
    out
}

fn of(search: &Search, k: usize) -> Vec<(Fit, f64)> {
    let model = &search.best.model;
    let own = &model.effects[k];
    let stage = search.stages.iter().rev().find(|s| s.selected.is_some_and(|t| t.0 == own.info.id));
    let Some(stage) = stage else { return Vec::new() };
    let best = stage.candidates.iter().map(|r| r.1).fold(f64::NEG_INFINITY, f64::max);
    let tried: Vec<EffectTerm> = stage
        .choices
        .iter()
        .zip(&stage.candidates)
        .filter(|(c, r)| {
            let close = best - r.1 < (FAR * best).max(NEAR_NATS);
            // A special case may have been behind only for what came into the model since.
            let special = c.info.nested_in.contains(&own.info.id);
            (close || special) && model.effects.iter().all(|e| e.info.id != c.info.id)
        })
        .map(|(c, _)| c.clone())
        .collect();
    let blocks = search.data.compared_block_count();
    let price = |f: &Fit| f.nats() + bic_penalty(f.model.effect_parameter_count(), blocks);
    let mine = price(&search.best);
    tried
        .into_par_iter()
        .filter_map(|choice| {
            let mut other = model.clone();
            other.effects[k] = choice;
            let wanted = mine + OUT_OF_SIGHT - bic_penalty(other.effect_parameter_count(), blocks);
            let f = fit_if_below(&other, &search.data, Effort::FULL, wanted)?;
            let behind = price(&f) - mine;
            // What holds the one named as a special case has to pay for its numbers, and did not.
            let nested = own.info.nested_in.contains(&f.model.effects[k].info.id);
            (!nested || behind < -0.5).then_some((f, behind))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{Search, find_competing_effects, of};
    use crate::model_comparison::bic_penalty;
    use crate::test_fixtures::{fit_from_truth, recordings_with_added_force, search_stage};
    use stylet_identify::fit::{Effort, fit_if_below};
    use stylet_identify::model::EffectTerm;
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

    fn rubs(c_n_per_m: f64) -> AnyEffect {
        CoulombFriction { c_n_per_m }.into()
    }

    fn pulls() -> AnyEffect {
        AsymmetricFriction { eps: 1e-3 }.into()
    }

    /// More friction at low speed.
    fn sticks(c_n_per_m: f64) -> AnyEffect {
        StribeckFriction { c_n_per_m, c_static_n_per_m: 1.1 * c_n_per_m, v_stribeck_mps: 2e-3 }.into()
    }

    /// Effects, and by how many nats they gained.
    type Tried<'a> = &'a [(AnyEffect, f64)];

    /// A search that took these effects, one after another, of insertions that have others and drift (N/s): each stage with what it tried.
    fn search(there: &[AnyEffect], drift_n_per_s: f64, taken: &[(AnyEffect, f64, Tried)]) -> Search {
        let runs = recordings_with_added_force(there, &[[4e-3, 3e-4], [6e-3, -3e-4]], |t| drift_n_per_s * t);
        let effects: Vec<AnyEffect> = taken.iter().map(|t| t.0.clone()).collect();
        let f = fit_from_truth(&effects, &runs.iter().collect::<Vec<_>>());
        let mut search = Search::for_tests(f.fit, f.data);
        search.stages =
            taken.iter().map(|(e, gain, tried)| search_stage(Some((e.id(), *gain)), 8.0, tried)).collect();
        search
    }

    /// The rivals of the first cause: by how much each is behind.
    fn told(search: &Search) -> Vec<(&'static str, f64)> {
        of(search, 0).iter().map(|(f, behind)| (f.model.effects[0].info.id, *behind)).collect()
    }

    fn names(search: &Search) -> Vec<&'static str> {
        told(search).iter().map(|r| r.0).collect()
    }

    #[test]
    fn a_rival_was_near_when_the_cause_was_taken() {
        // Within 25 nats, or a twentieth of the most that was gained.
        for (most, near) in [(100.0, 25.0), (1000.0, 50.0)] {
            let tried =
                [(drift(), most), (bias(), most - 0.99 * near), (rubs(1.0), most - near), (pulls(), 1.0)];
            let s = search(&[], 5e-4, &[(drift(), most, &tried)]);
            assert_eq!(names(&s), ["force_bias"]);
        }
    }

    #[test]
    fn a_rival_is_asked_of_the_stage_that_took_the_cause_and_is_not_in_the_law_already() {
        let tried = [(drift(), 30.0), (bias(), 29.0), (pulls(), 28.0)];
        let later = [(bias(), 9.0), (rubs(1.0), 9.0)];
        let mut s = search(&[], 5e-4, &[(drift(), 30.0, &tried), (bias(), 9.0, &later)]);
        assert_eq!(names(&s), ["asymmetric_friction"]);
        s.stages.insert(0, search_stage(Some(("force_drift", 1.0)), 8.0, &later));
        assert_eq!(names(&s), ["asymmetric_friction"], "the last one that took it");
        s.stages.retain(|s| s.selected.is_some_and(|t| t.0 == "force_bias"));
        assert!(names(&s).is_empty(), "nobody knows how it was taken");
    }

    /// Beside the force that both explain a rival pays for its numbers.
    #[test]
    fn a_rival_is_behind_by_what_it_leaves_and_by_what_its_numbers_cost() {
        let tried = [(drift(), 30.0), (bias(), 29.0), (sticks(1.0), 28.0)];
        let mut s = search(&[rubs(3.0)], 5e-4, &[(drift(), 30.0, &tried)]);
        let blocks = s.data.compared_block_count();
        let own = s.best.nats();
        for ahead in [-120.0, -60.0, -30.0, 0.0, 30.0, 60.0] {
            s.best.residuals.nats = own + ahead;
            let rivals = told(&s);
            assert_eq!(rivals.len(), 2);
            for ((e, numbers), (_, behind)) in [(bias(), 1), (sticks(1.0), 3)].iter().zip(rivals) {
                let mut model = s.best.model.clone();
                model.effects[0] = EffectTerm::new(e.info(), &e.parameters());
                // What stays more than 40 nats behind is not fitted to the end.
                let more = bic_penalty(*numbers, blocks) - bic_penalty(1, blocks);
                let f =
                    fit_if_below(&model, &s.data, Effort::FULL, s.best.nats() + 40.0 - more).expect("a fit");
                let wanted = f.nats() - s.best.nats() + more;
                assert!((behind - wanted).abs() < 1e-6, "{}: {behind} for {wanted}", e.id());
            }
        }
    }

    #[test]
    fn a_special_case_may_have_been_far_behind_and_what_holds_the_cause_has_to_be_ahead() {
        let tried = [(sticks(3.0), 900.0), (rubs(3.0), 10.0), (drift(), 10.0)];
        let s = search(&[rubs(5.0)], 0.0, &[(sticks(5.0), 900.0, &tried)]);
        assert_eq!(names(&s), ["coulomb_friction"]);
        let tried = [(rubs(3.0), 900.0), (sticks(5.0), 899.0)];
        let mut s = search(&[rubs(5.0)], 0.0, &[(rubs(5.0), 900.0, &tried)]);
        assert!(names(&s).is_empty());
        let own = s.best.nats();
        s.best.residuals.nats = own + 100.0;
        let behind = told(&s)[0].1 + 100.0;
        for (ahead, any) in [(-3.0, false), (0.0, false), (0.4, false), (0.6, true)] {
            s.best.residuals.nats = own + behind + ahead;
            assert_eq!(names(&s).len(), usize::from(any), "{ahead}");
        }
    }

    #[test]
    fn a_rival_that_is_ahead_takes_the_causes_place() {
        let tried = [(bias(), 300.0), (pulls(), 299.0), (drift(), 299.0)];
        let mut s = search(&[], 5e-3, &[(bias(), 300.0, &tried)]);
        let classes = find_competing_effects(&mut s);
        assert_eq!(s.best.model.effects[0].info.id, "force_drift");
        assert_eq!(s.stages[0].selected.map(|t| t.0), Some("force_drift"));
        assert_eq!(classes.len(), 1);
        assert_eq!(
            classes[0].iter().map(|r| r.name).collect::<Vec<_>>(),
            ["force_bias", "asymmetric_friction"]
        );
        assert!(classes[0].iter().all(|r| r.nats_behind > 10.0 && r.choice.info.id == r.name));
    }

    #[test]
    fn a_rival_that_is_ahead_by_less_than_half_a_nat_is_a_rival() {
        let tried = [(drift(), 30.0), (bias(), 29.0)];
        let s = || search(&[], 5e-4, &[(drift(), 30.0, &tried)]);
        let (behind, own) = (told(&s())[0].1, s().best.nats());
        for ahead in [-0.3, 0.2, 0.45, 0.6] {
            let mut s = s();
            s.best.residuals.nats = own + behind + ahead;
            let classes = find_competing_effects(&mut s);
            // Once it has the cause's place all are judged by what they leave.
            let stays = s.best.nats() == own + behind + ahead;
            assert_eq!(stays, ahead < 0.5, "{ahead}");
            assert!(!stays || (classes[0][0].nats_behind + ahead).abs() < 1e-6);
        }
    }

    #[test]
    fn more_numbers_take_a_causes_place_where_they_are_worth_it() {
        let slides =
            |c_n_per_m: f64, delta_m: f64| -> AnyEffect { PreslidingFriction { c_n_per_m, delta_m }.into() };
        let tried = [(rubs(50.0), 900.0), (slides(50.0, 5e-4), 899.0)];
        let mut s = search(&[slides(50.0, 1e-3)], 0.0, &[(rubs(50.0), 900.0, &tried)]);
        find_competing_effects(&mut s);
        assert_eq!(s.best.model.effects[0].info.id, "presliding_friction");
        // Seemingly ahead, but nothing of it is left when all that is left is noise.
        let tone = PeriodicInterference { amplitude_n: 1e-3, frequency_hz: 1.0, phase_rad: 0.5 };
        let tried = [(drift(), 900.0), (tone.into(), 899.0)];
        let mut s = search(&[], 5e-4, &[(drift(), 900.0, &tried)]);
        s.best.residuals.nats += 300.0;
        let classes = find_competing_effects(&mut s);
        assert_eq!(s.best.model.effects[0].info.id, "force_drift");
        assert!(classes[0][0].nats_behind < -50.0);
    }

    #[test]
    fn three_causes_at_most_give_their_places_away() {
        let right: [AnyEffect; 4] = [
            ForceDrift { rate_n_per_s: 0.1 }.into(),
            rubs(60.0),
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
        let taken: Vec<_> = wrong.iter().zip(&tried).map(|(e, t)| (e.clone(), 99.0, &t[..])).collect();
        let mut s = search(&right[1..], 0.1, &taken);
        let classes = find_competing_effects(&mut s);
        let names: Vec<&str> = s.best.model.effects.iter().map(|e| e.info.id).collect();
        assert_eq!(names, ["force_drift", "coulomb_friction", "cutting_force", "force_bias"]);
        assert!(classes[3][0].nats_behind < -1000.0, "{}", classes[3][0].nats_behind);
    }
}
