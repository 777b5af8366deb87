//! Layers measured alone, put together: does a layer behave alone as it does in a stack?

use crate::set::first::{Insertion, plain};
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
use stylet_tissue::Tissue;

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
        fits.push((Population::of(&fit, &runs), fit));
    }
    let models: Vec<&Model> = fits.iter().map(|(_, f)| &f.fit.model).collect();
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

/// One model of the layers of several: each where it was found, but the first one's surface, which has moved by so many m.
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
    let layers = tissue.layers.len();
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
    use super::{Kind, compose, together};
    use crate::made::{gel, insertions};
    use crate::set::Insertion;
    use std::sync::Arc;
    use stylet_identify::model::{Belief, Choice, Model};
    use stylet_tissue::{AnyEffect, CoulombFriction, Effect, Layer, LetGo, ShaftSlip, Tissue};

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
        assert!(together(&believed, &[], 0.0).is_none());
        assert!(together(&tissue(&["one"], 0.0, 0.03, 1.0), &[&first, &second], 0.0).is_none());
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
