//! Layers measured alone, put together: does a layer behave alone as it does in a stack?

use crate::set::first::{Insertion, RATE, plain};
use crate::set::fitted::{Fitted, blocks, refitted};
use crate::set::laws::{Kind, slipping};
use crate::set::left_out::{floor, one_left_out, score};
use crate::set::population::{DRAWS, Population, predict};
use crate::set::repeats::Alone;
use crate::set::study::speeds;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rayon::prelude::*;
use std::sync::Arc;
use stylet_identify::model::{Belief, Choice, Day, Model};
use stylet_record::Recording;
use stylet_record::raw::{self, Raw};
use stylet_stats::median_of;
use stylet_tissue::{AnyEffect, DeepIndentation, Effect, ShaftSlip, Tissue};

/// Seed of what the starts begin with.
const SEED: u64 = 2;
/// A layer is at least so thick, in m.
const LEAST_M: f64 = 1e-3;

/// Fits every layer alone with the kind of law that the whole needs, puts the laws together and predicts the whole.
///
/// `alone` holds per layer of the whole the runs of that layer alone. What belongs to no layer is taken from the first.
#[must_use]
pub fn compose(
    kind: Kind,
    believed: &Tissue,
    alone: &[(String, Vec<Insertion>)],
    whole: &[&Insertion],
) -> Option<Alone> {
    let mut told = Vec::new();
    let mut fits = Vec::new();
    for (i, (name, runs)) in alone.iter().enumerate() {
        let runs: Vec<&Insertion> = runs.iter().collect();
        let tissue = Tissue { surface_m: believed.front_m(i), layers: vec![believed.layers.get(i)?.clone()] };
        let fit = by_itself(kind, &tissue, &runs)?;
        let floors: Option<Vec<f64>> = floor(&runs).iter().map(|f| f.as_ref().map(|f| f.0.rmse_n)).collect();
        let errors: Vec<f64> = one_left_out(&fit, &runs).iter().map(|s| s.rmse_n).collect();
        told.push((name.clone(), floors.map(|f| stylet_stats::mean(&f)), stylet_stats::mean(&errors)));
        let speed_mps = median_of(runs.iter().map(|r| r.speed_mps));
        let law = Model { effects: dry(&fit.fit.model, speed_mps), ..fit.fit.model.clone() };
        fits.push((Population::of(&fit, &runs), law));
    }
    let models: Vec<&Model> = fits.iter().map(|(_, law)| law).collect();
    // Where the whole begins is a matter of its set-up: where its force does. What lies beneath lies where it did.
    let begins = |runs: &mut dyn Iterator<Item = &Insertion>| median_of(runs.map(|r| r.contact_m));
    let moved_m = begins(&mut whole.iter().copied()) - begins(&mut alone.first()?.1.iter());
    let population = Population { law: together(believed, &models, moved_m)?, ..fits.first()?.0.clone() };
    let errors: Vec<f64> =
        whole.par_iter().map(|run| score(run, &predict(&population, run, None, DRAWS)).rmse_n).collect();
    let of =
        |members: &[usize]| members.iter().map(|i| errors[*i]).sum::<f64>() / members.len().max(1) as f64;
    let composed_n: Vec<f64> = speeds(whole).iter().map(|(_, members)| of(members)).collect();
    let mean_n = stylet_stats::mean(&composed_n);
    Some(Alone { alone: told, composed_n, mean_n })
}

fn by_itself(kind: Kind, tissue: &Tissue, runs: &[&Insertion]) -> Option<Fitted> {
    let recordings: Vec<&Recording> = runs.iter().map(|r| &r.recording).collect();
    let notes: Vec<_> = runs.iter().map(|r| r.notes.clone()).collect();
    let raw: Raw = raw::look(&recordings, &notes);
    if kind == Kind::Slip {
        return slipping(tissue, runs, &raw, &mut ChaCha8Rng::seed_from_u64(SEED)).map(|l| l.fitted);
    }
    let mut model = Model::base(Arc::new(plain(tissue, runs)), runs.len());
    (model.free.own_surface, model.free.own_friction) = (true, true);
    model.instants = runs.iter().map(|r| r.ruptures_s.clone()).collect();
    let drops = runs.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect());
    refitted(&model, blocks(runs, &raw), drops.collect())
}

/// The effects of a law that was measured at one speed: where it does not know what another one does, sliding is dry. The law holds the
/// exponent of the speed at nothing, which is friction that grows with the speed as the contact slips under a force.
fn dry(model: &Model, speed_mps: f64) -> Vec<Choice> {
    let held = |e: usize| model.bound.iter().any(|b| (b.effect, b.parameter, b.like) == (e, RATE, None));
    let one = |(e, choice): (usize, &Choice)| match choice.effect() {
        Some(AnyEffect::ShaftSlip(s)) if held(e) => {
            let dry = ShaftSlip {
                rate: -1.0 / s.exponent,
                push_n: s.plateau_n(speed_mps),
                pull_n: -s.plateau_n(-speed_mps),
                ..s
            };
            Choice::new(choice.info, &AnyEffect::from(dry).parameters())
        }
        _ => choice.clone(),
    };
    model.effects.iter().enumerate().map(one).collect()
}

/// One model of the layers of several: each where it was found, but the first one's surface, which has moved by so many m.
///
/// A layer that lies on another takes its far face along where it is pressed, which nobody has seen of a layer alone: it gives way by what
/// it bears, where that is known, and not where the next one lies at rest.
fn together(believed: &Tissue, alone: &[&Model], moved_m: f64) -> Option<Model> {
    let first = *alone.first()?;
    let mut model = first.only(&[]);
    let mut tissue = Tissue { surface_m: first.tissue.surface_m + moved_m, layers: Vec::new() };
    model.effects.clear();
    model.bound.clear();
    let mut sds = [0.0; 8];
    for (i, part) in alone.iter().enumerate() {
        let mut layer = part.tissue.layers.first()?.clone();
        layer.name.clone_from(&believed.layers.get(i)?.name);
        if let Some(next) = alone.get(i + 1) {
            let front_m = if i == 0 { tissue.surface_m } else { part.tissue.surface_m };
            layer.thickness_m = (next.tissue.surface_m - front_m).max(LEAST_M);
        }
        tissue.layers.push(layer);
        let differs: Vec<(usize, usize)> = part.differing().collect();
        for (e, choice) in part.effects.iter().enumerate() {
            let of_layer = choice.info.parameters.first().is_some_and(|p| p.path == "layer");
            if !of_layer && i > 0 {
                continue;
            }
            let mut values = choice.values.clone();
            if of_layer {
                values[0] = (i + 1) as f64;
            }
            model.effects.push(Choice::new(choice.info, &values));
            for k in (0..differs.len()).filter(|k| differs[*k].0 == e) {
                let place = model.differing().count();
                if let Some(sd) = place.checked_sub(1).and_then(|p| sds.get_mut(p)) {
                    *sd = part.differing_sd(k);
                }
            }
        }
    }
    let waits = |l: usize| {
        let of = |c: &Choice| matches!(c.effect(), Some(AnyEffect::DelayedPuncture(d)) if d.layer == l + 1);
        model.effects.iter().any(of)
    };
    let layers = tissue.layers.len();
    if tissue.layers.iter().take(layers - 1).enumerate().all(|(l, x)| x.puncture_n.is_some() || waits(l)) {
        let pushed = DeepIndentation::default();
        let farthest: Vec<f64> = pushed.info().parameters.iter().map(|p| p.high).collect();
        model.effects.push(Choice::new(pushed.info(), &farthest));
    }
    model.belief = Arc::new(Belief {
        tissue: tissue.clone(),
        given: Vec::new(),
        tolerance: vec![first.belief.tolerance.first().copied().unwrap_or(1.0); layers],
        thickness_tolerance: vec![0.0; layers],
        surface_tolerance_m: first.belief.surface_tolerance_m,
    });
    model.tissue = tissue;
    model.scatter.differing = sds;
    model.days = Vec::<Day>::new();
    model.day_of = Vec::new();
    Some(model)
}

#[cfg(test)]
mod tests {
    use super::{Kind, RATE, compose, dry, together};
    use crate::made::{gel, insertions};
    use crate::set::Insertion;
    use std::sync::Arc;
    use stylet_identify::model::{Belief, Bound, Choice, Model};
    use stylet_tissue::{
        AnyEffect, CoulombFriction, DelayedPuncture, Effect, Layer, LetGo, ShaftSlip, Tissue,
    };

    fn tissue(names: &[&str], surface_m: f64, thickness_m: f64, k: f64) -> Tissue {
        let layer = |name: &&str| Layer {
            name: (*name).to_owned(),
            thickness_m,
            stiffness_n_per_m: k,
            friction_ns_per_m2: 1000.0,
            puncture_n: None,
        };
        Tissue { surface_m, layers: names.iter().map(layer).collect() }
    }

    fn alone(surface_m: f64, k: f64, effects: &[AnyEffect]) -> Model {
        let belief = Belief {
            tissue: tissue(&["x"], surface_m, 0.05, k),
            given: Vec::new(),
            tolerance: vec![4.0],
            thickness_tolerance: vec![0.0],
            surface_tolerance_m: 2e-3,
        };
        let mut m = Model::base(Arc::new(belief), 1);
        m.effects = effects.iter().map(|e| Choice::new(e.info(), &e.parameters())).collect();
        m.free.own_effects = true;
        m
    }

    #[test]
    fn layers_measured_alone_stand_where_they_were_found_with_their_effects() {
        let whole = |c: f64| -> AnyEffect { CoulombFriction { c_n_per_m: c }.into() };
        let slip =
            |push_n: f64| -> AnyEffect { ShaftSlip { layer: 1, push_n, ..ShaftSlip::default() }.into() };
        let lets_go = |depth_m: f64| -> AnyEffect { LetGo { layer: 1, depth_m }.into() };
        let mut first = alone(0.004, 100.0, &[slip(1.1), lets_go(1e-3), whole(2.0)]);
        let mut second = alone(0.0155, 250.0, &[slip(2.2), lets_go(2e-3), whole(7.0)]);
        first.scatter.differing[0] = 3e-4;
        second.scatter.differing[0] = 5e-4;
        let believed = tissue(&["skin", "muscle"], 0.0, 0.03, 1.0);
        let m = together(&believed, &[&first, &second], 7e-4).expect("a law");
        assert!((m.tissue.surface_m - 0.0047).abs() < 1e-15);
        let [a, b] = &m.tissue.layers[..] else { unreachable!("two layers") };
        assert_eq!((a.name.as_str(), b.name.as_str(), b.thickness_m), ("skin", "muscle", 0.05));
        // As thick as the next one's surface lies behind where the whole begins, a millimetre at least.
        assert!((a.thickness_m - 0.0108).abs() < 1e-15, "{}", a.thickness_m);
        assert_eq!((a.stiffness_n_per_m, b.stiffness_n_per_m), (100.0, 250.0));
        let near = alone(0.0048, 250.0, &[]);
        assert_eq!(
            together(&believed, &[&first, &near], 0.0).expect("a law").tissue.layers[0].thickness_m,
            1e-3
        );
        // What belongs to no layer is the first one's.
        let ids: Vec<(&str, f64)> = m.effects.iter().map(|e| (e.info.id, e.values[0])).collect();
        assert_eq!(
            ids,
            [
                ("shaft_slip", 1.0),
                ("let_go", 1.0),
                ("coulomb_friction", 2.0),
                ("shaft_slip", 2.0),
                ("let_go", 2.0)
            ]
        );
        assert_eq!(m.scatter.differing[..3], [3e-4, 5e-4, 0.0]);
        assert_eq!(
            (m.belief.tolerance.as_slice(), m.belief.thickness_tolerance.as_slice()),
            (&[4.0, 4.0][..], &[0.0, 0.0][..])
        );
        assert!(m.days.is_empty() && m.day_of.is_empty() && m.bound.is_empty());
        // Nobody knows what the upper one bears: it gives way at its far face.
        let far = |m: &Model| m.effects.iter().find(|e| e.info.id == "deep_indentation").map(|e| e.values[0]);
        assert_eq!(far(&m), None);
        let mut known = first.clone();
        known.tissue.layers[0].puncture_n = Some(3.0);
        let told = together(&believed, &[&known, &second], 0.0).expect("a law");
        assert_eq!((far(&told), told.tissue.layers[0].puncture_n), (Some(1.0), Some(3.0)));
        let waits: AnyEffect = DelayedPuncture { layer: 1, force_n: 3.0, exponent: 10.0 }.into();
        first.effects.push(Choice::new(waits.info(), &waits.parameters()));
        assert_eq!(far(&together(&believed, &[&first, &second], 0.0).expect("a law")), Some(1.0));
        assert!(together(&believed, &[], 0.0).is_none());
        assert!(together(&tissue(&["one"], 0.0, 0.03, 1.0), &[&first, &second], 0.0).is_none());
    }

    /// A law of one speed slides by as much at that speed as it did, and by the same at any other one.
    #[test]
    fn sliding_is_dry_where_one_speed_is_all_that_was_measured() {
        let slip = ShaftSlip { push_n: 2.0, pull_n: 1.5, exponent: 8.0, ..ShaftSlip::default() };
        let mut m = alone(0.004, 100.0, &[slip.clone().into(), LetGo { layer: 1, depth_m: 1e-3 }.into()]);
        let told = |m: &Model| match dry(m, 2e-3)[0].effect() {
            Some(AnyEffect::ShaftSlip(s)) => s,
            other => unreachable!("{other:?}"),
        };
        // Where a rate was fitted, it stays.
        assert_eq!(told(&m), slip);
        m.bound = vec![Bound { effect: 0, parameter: RATE, like: None }];
        let s = told(&m);
        assert!((s.plateau_n(2e-3) - slip.plateau_n(2e-3)).abs() < 1e-12);
        for v_mps in [1e-3, 4e-3] {
            assert!((s.plateau_n(v_mps) - slip.plateau_n(2e-3)).abs() < 1e-12);
            assert!((s.plateau_n(-v_mps) - slip.plateau_n(-2e-3)).abs() < 1e-12);
        }
        assert_eq!((s.exponent, s.kept, dry(&m, 2e-3).len()), (slip.exponent, slip.kept, 2));
    }

    /// A stack that is the layer itself, set up a millimetre deeper.
    #[test]
    fn a_layer_alone_predicts_the_stack_that_it_is_wherever_that_begins() {
        let alone = insertions(&[], &[[0.008, 0.0], [0.016, 1e-4], [0.008, 0.0]]);
        let whole = insertions(&[], &[[0.008, 1e-3], [0.016, 1e-3], [0.008, 1e-3]]);
        let runs: Vec<&Insertion> = whole.iter().collect();
        let told = compose(Kind::Base, &gel(), &[("gel".to_owned(), alone)], &runs).expect("a law");
        let [(name, floor_n, error_n)] = &told.alone[..] else { unreachable!("one layer") };
        // The one at the other speed has nobody beside it.
        assert_eq!((name.as_str(), *floor_n), ("gel", None));
        assert!(*error_n > 0.0 && *error_n < 0.3, "{error_n}");
        assert_eq!(told.composed_n.len(), 2);
        assert!(told.composed_n.iter().all(|e| *e > 0.005 && *e < 0.3), "{:?}", told.composed_n);
        assert!((told.mean_n - 0.5 * (told.composed_n[0] + told.composed_n[1])).abs() < 1e-12);
        // A speed is told by the mean of its runs: one of them twice is that one.
        let [one, twice] = [&runs[..1], &[runs[0], runs[0]]].map(|runs| {
            let alone = insertions(&[], &[[0.008, 0.0], [0.016, 1e-4], [0.008, 0.0]]);
            compose(Kind::Base, &gel(), &[("gel".to_owned(), alone)], runs).expect("a law").mean_n
        });
        assert_eq!(one, twice);
        // Without the layer or its runs there is nothing to put together.
        assert!(compose(Kind::Base, &gel(), &[], &runs).is_none());
    }
}
