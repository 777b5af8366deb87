//! Layers measured alone, put together: does a layer behave alone as it does in a stack?

use crate::repeated_insertions::cross_validation::{
    leave_one_out_scores, repeatability_floor, score_prediction,
};
use crate::repeated_insertions::diagnose_set::mean_speeds;
use crate::repeated_insertions::model_selection::{ModelFamily, fit_stick_slip};
use crate::repeated_insertions::multistart_fit::{SetFit, fit_from, set_blocks};
use crate::repeated_insertions::parameter_estimates::is_at_bound;
use crate::repeated_insertions::population_prediction::{DRAWS, Population, predict_force, simulate_force};
use crate::repeated_insertions::repeatability_report::CompositionReport;
use crate::repeated_insertions::start_values::{SLIP_RATE_INDEX, SegmentedRecording, base_law_prior};
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rayon::prelude::*;
use std::sync::Arc;
use stylet_identify::model::{
    Assumptions, DayParameters, EffectTerm, Model, NO_RUPTURE, ParameterRole, RecordingParameters,
};
use stylet_record::Recording;
use stylet_record::sensor_artefacts::{self, SensorArtefacts};
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
pub fn compose_layers(
    kind: ModelFamily,
    believed: &Tissue,
    alone: &[(String, Vec<SegmentedRecording>)],
    whole: &[&SegmentedRecording],
) -> Option<CompositionReport> {
    let mut told = Vec::new();
    let mut fits = Vec::new();
    for (i, (name, runs)) in alone.iter().enumerate() {
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let tissue = Tissue { surface_m: believed.front_m(i), layers: vec![believed.layers.get(i)?.clone()] };
        let fit = by_itself(kind, &tissue, &runs)?;
        let floors: Option<Vec<f64>> =
            repeatability_floor(&runs).iter().map(|f| f.as_ref().map(|f| f.0.rmse_n)).collect();
        let errors: Vec<f64> = leave_one_out_scores(&fit, &runs).iter().map(|s| s.rmse_n).collect();
        told.push((name.clone(), floors.map(|f| stylet_stats::mean(&f)), stylet_stats::mean(&errors)));
        let speed_mps = median_of(runs.iter().map(|r| r.speed_mps));
        let like = fits.first().and_then(|(_, law): &(Population, Model)| shaft(law));
        let law =
            Model { effects: told_of(&fit.fit.model, speed_mps, like.as_ref()), ..fit.fit.model.clone() };
        fits.push((Population::from_fit(&fit, &runs), law));
    }
    let models: Vec<&Model> = fits.iter().map(|(_, law)| law).collect();
    // Where the whole begins is a matter of its set-up: where its force does, and where the others build theirs up. What lies beneath lies
    // where it did.
    let begins = |runs: &mut dyn Iterator<Item = &SegmentedRecording>| median_of(runs.map(|r| r.contact_m));
    let moved_m = begins(&mut whole.iter().copied()) - begins(&mut alone.first()?.1.iter());
    let law = together(believed, &models, moved_m)?;
    let rises_m: Vec<f64> = whole.iter().map(|run| rises_m(&law, run)).collect();
    let one = |r: usize| {
        let others = (0..whole.len()).filter(|o| *o != r && rises_m[*o].is_finite()).map(|o| rises_m[o]);
        let further_m = Some(median_of(others)).filter(|m| m.is_finite()).unwrap_or(0.0);
        let population = Population { model: moved_by(&law, further_m), ..fits[0].0.clone() };
        score_prediction(whole[r], &predict_force(&population, whole[r], None, DRAWS)).rmse_n
    };
    let errors: Vec<f64> = (0..whole.len()).into_par_iter().map(one).collect();
    let of =
        |members: &[usize]| members.iter().map(|i| errors[*i]).sum::<f64>() / members.len().max(1) as f64;
    let composed_n: Vec<f64> = mean_speeds(whole).iter().map(|(_, members)| of(members)).collect();
    let mean_n = stylet_stats::mean(&composed_n);
    Some(CompositionReport { single_layers: told, composed_n, mean_n })
}

fn by_itself(kind: ModelFamily, tissue: &Tissue, runs: &[&SegmentedRecording]) -> Option<SetFit> {
    let recordings: Vec<&Recording> = runs.iter().map(|r| &r.recording).collect();
    let notes: Vec<_> = runs.iter().map(|r| r.notes.clone()).collect();
    let raw: SensorArtefacts = sensor_artefacts::find_sensor_artefacts(&recordings, &notes);
    if kind == ModelFamily::ShaftSlip {
        return fit_stick_slip(tissue, runs, &raw, &mut ChaCha8Rng::seed_from_u64(SEED)).map(|l| l.set_fit);
    }
    let mut model = Model::base(Arc::new(base_law_prior(tissue, runs)), runs.len());
    (model.free.recording_surface, model.free.recording_friction) = (true, true);
    model.rupture_times_s = runs.iter().map(|r| r.ruptures_s.clone()).collect();
    let drops = runs.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect());
    fit_from(&model, set_blocks(runs, &raw), drops.collect())
}

/// The effects of a law that was measured alone, with what its own runs do not tell.
///
/// Measured at one speed it does not know what another one does: there sliding is dry. The law holds the exponent of the speed at nothing,
/// which is friction that grows with the speed as the contact slips under a force. And where a number of the shaft's stands at its bound,
/// nothing tells it: it is that of the first layer, `like`, for what the shaft decides is common to the layers; of a hold when pushed that
/// is what it is to the hold when pulled, and what is held right after the rupture stays.
fn told_of(model: &Model, speed_mps: f64, like: Option<&ShaftSlip>) -> Vec<EffectTerm> {
    let held = |e: usize| {
        model.tied.iter().any(|b| (b.effect, b.parameter, b.tied_to) == (e, SLIP_RATE_INDEX, None))
    };
    let one = |(e, choice): (usize, &EffectTerm)| match choice.effect() {
        Some(AnyEffect::ShaftSlip(mut s)) => {
            let unknown = |path: &str| {
                let place = choice.info.parameters.iter().position(|p| p.path == path);
                place.is_some_and(|parameter| {
                    is_at_bound(model, ParameterRole::Effect { effect: e, parameter })
                })
            };
            if let Some(like) = like.filter(|l| l.push_n > 0.0 && l.pull_n > 0.0) {
                if unknown("push_n") {
                    let after_n = s.retained_share * s.push_n;
                    s.push_n = s.pull_n * like.push_n / like.pull_n;
                    s.retained_share =
                        if s.push_n > 0.0 { after_n / s.push_n } else { like.retained_share }.min(1.0);
                }
                if unknown("exponent") {
                    s.exponent = like.exponent;
                }
                if unknown("wear_per_m") {
                    s.wear_per_m = like.wear_per_m;
                }
            }
            if held(e) {
                let (push_n, pull_n) = (s.plateau_n(speed_mps), -s.plateau_n(-speed_mps));
                s = ShaftSlip { rate: -1.0 / s.exponent, push_n, pull_n, ..s };
            }
            EffectTerm::new(choice.info, &AnyEffect::from(s).parameters())
        }
        _ => choice.clone(),
    };
    model.effects.iter().enumerate().map(one).collect()
}

/// The shaft that a law has.
fn shaft(model: &Model) -> Option<ShaftSlip> {
    model.effects.iter().find_map(|c| match c.effect() {
        Some(AnyEffect::ShaftSlip(s)) => Some(s),
        _ => None,
    })
}

/// What a layer holds right after it has given way (N): one that gives way at this shows no drop.
fn after_n(model: &Model, layer: usize) -> f64 {
    let holds = model.effects.iter().find_map(|c| match c.effect() {
        Some(AnyEffect::ShaftSlip(s)) if s.layer == layer + 1 => Some(s.retained_share * s.push_n),
        _ => None,
    });
    holds.unwrap_or(0.0).max(f64::EPSILON)
}

/// What a layer bears before it gives way (N), at once or for a while.
fn bears_n(model: &Model, layer: usize) -> Option<f64> {
    let waits = model.effects.iter().find_map(|c| match c.effect() {
        Some(AnyEffect::DelayedPuncture(d)) if d.layer == layer + 1 => Some(d.force_n),
        _ => None,
    });
    waits.or(model.tissue.layers.get(layer)?.puncture_n)
}

/// A law whose surface lies so many m further in; what lies beneath the first layer stays.
fn moved_by(law: &Model, further_m: f64) -> Model {
    let mut out = law.clone();
    out.tissue.surface_m += further_m;
    if let [first, _, ..] = &mut out.tissue.layers[..] {
        first.thickness_m = (first.thickness_m - further_m).max(LEAST_M);
    }
    out
}

/// How much further in (m) the surface of a law would lie where a run builds its force up as the law does: least squares from contact to
/// the first rupture.
fn rises_m(law: &Model, run: &SegmentedRecording) -> f64 {
    let mut law = law.clone();
    (law.per_recording, law.rupture_times_s) =
        (vec![RecordingParameters::default()], vec![vec![NO_RUPTURE; law.layers()]]);
    let (r, first_s) = (&run.recording, run.ruptures_s.iter().copied().fold(NO_RUPTURE, f64::min));
    let mut further_m = 0.0;
    for _ in 0..8 {
        let here = simulate_force(&moved_by(&law, further_m), run);
        let Some((here, there)) = here.zip(simulate_force(&moved_by(&law, further_m + 1e-6), run)) else {
            break;
        };
        let until_s = first_s.min(here.1).min(there.1);
        let way = (run.phases.start..=run.phases.deepest.min(r.len() - 1)).filter(|i| r.time_s[*i] < until_s);
        let (along, square) = way.fold((0.0, 0.0), |(along, square), i| {
            let slope = 1e6 * (there.0[i] - here.0[i]);
            (along + slope * (r.force_n[i] - here.0[i]), square + slope * slope)
        });
        if square > 0.0 {
            further_m += along / square;
        }
    }
    further_m
}

/// One model of the layers of several: each where it was found, but the first one's surface, which has moved by so many m.
///
/// A layer that lies on another takes its far face along where it is pressed, which nobody has seen of a layer alone: it gives way by what
/// it bears, where that is known, and not where the next one lies at rest. Pressed, it rests on the next one, which bears the same force:
/// one that bears less than the layer above has nothing left to bear when that one is through, and gives way with it.
fn together(believed: &Tissue, alone: &[&Model], moved_m: f64) -> Option<Model> {
    let first = *alone.first()?;
    let mut model = first.subset(&[]);
    let mut tissue = Tissue { surface_m: first.tissue.surface_m + moved_m, layers: Vec::new() };
    model.effects.clear();
    model.tied.clear();
    let mut sds = [0.0; 8];
    for (i, part) in alone.iter().enumerate() {
        let mut layer = part.tissue.layers.first()?.clone();
        layer.name.clone_from(&believed.layers.get(i)?.name);
        if let Some(next) = alone.get(i + 1) {
            let front_m = if i == 0 { tissue.surface_m } else { part.tissue.surface_m };
            layer.thickness_m = (next.tissue.surface_m - front_m).max(LEAST_M);
        }
        tissue.layers.push(layer);
        let differs: Vec<(usize, usize)> = part.varying_parameters().collect();
        for (e, choice) in part.effects.iter().enumerate() {
            let of_layer = choice.info.parameters.first().is_some_and(|p| p.path == "layer");
            if !of_layer && i > 0 {
                continue;
            }
            let mut values = choice.values.clone();
            if of_layer {
                values[0] = (i + 1) as f64;
            }
            model.effects.push(EffectTerm::new(choice.info, &values));
            for k in (0..differs.len()).filter(|k| differs[*k].0 == e) {
                let place = model.varying_parameters().count();
                if let Some(sd) = place.checked_sub(1).and_then(|p| sds.get_mut(p)) {
                    *sd = part.varying_sd(k);
                }
            }
        }
    }
    model.tissue = tissue;
    let layers = model.layers();
    let bears: Vec<Option<f64>> = (0..layers).map(|l| bears_n(&model, l)).collect();
    if bears[..layers - 1].iter().all(Option::is_some) {
        let pushed = DeepIndentation::default();
        let farthest: Vec<f64> = pushed.info().parameters.iter().map(|p| p.high).collect();
        model.effects.push(EffectTerm::new(pushed.info(), &farthest));
    }
    let mut above_n = 0.0;
    for (l, bears) in bears.iter().enumerate() {
        if bears.is_some_and(|n| n < above_n) {
            let waits = |c: &EffectTerm| matches!(c.effect(), Some(AnyEffect::DelayedPuncture(d)) if d.layer == l + 1);
            while let Some(k) = model.effects.iter().position(waits) {
                model = model.without_effect(k);
            }
            model.tissue.layers[l].puncture_n = Some(after_n(&model, l));
        }
        above_n = bears.unwrap_or(above_n).max(above_n);
    }
    let tissue = model.tissue.clone();
    model.assumed = Arc::new(Assumptions {
        tissue: tissue.clone(),
        known_effects: Vec::new(),
        tolerance: vec![first.assumed.tolerance.first().copied().unwrap_or(1.0); layers],
        thickness_tolerance: vec![0.0; layers],
        surface_tolerance_m: first.assumed.surface_tolerance_m,
    });
    model.scatter.varying = sds;
    model.days = Vec::<DayParameters>::new();
    model.day_of = Vec::new();
    Some(model)
}

#[cfg(test)]
mod tests {
    use super::{ModelFamily, SLIP_RATE_INDEX, compose_layers, moved_by, rises_m, together, told_of};
    use crate::repeated_insertions::SegmentedRecording;
    use crate::test_fixtures::{self, gel_tissue, simulated_recordings};
    use std::sync::Arc;
    use stylet_identify::model::{Assumptions, EffectTerm, Model, TiedParameter};
    use stylet_tissue::{
        AnyEffect, CoulombFriction, DelayedPuncture, Effect, Layer, ReleaseDepth, ShaftSlip, Tissue,
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
        let belief = Assumptions {
            tissue: tissue(&["x"], surface_m, 0.05, k),
            known_effects: Vec::new(),
            tolerance: vec![4.0],
            thickness_tolerance: vec![0.0],
            surface_tolerance_m: 2e-3,
        };
        let mut m = Model::base(Arc::new(belief), 1);
        m.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        m.free.recording_effects = true;
        m
    }

    #[test]
    fn layers_measured_alone_stand_where_they_were_found_with_their_effects() {
        let whole = |c: f64| -> AnyEffect { CoulombFriction { c_n_per_m: c }.into() };
        let slip =
            |push_n: f64| -> AnyEffect { ShaftSlip { layer: 1, push_n, ..ShaftSlip::default() }.into() };
        let lets_go = |depth_m: f64| -> AnyEffect { ReleaseDepth { layer: 1, depth_m }.into() };
        let mut first = alone(0.004, 100.0, &[slip(1.1), lets_go(1e-3), whole(2.0)]);
        let mut second = alone(0.0155, 250.0, &[slip(2.2), lets_go(2e-3), whole(7.0)]);
        first.scatter.varying[0] = 3e-4;
        second.scatter.varying[0] = 5e-4;
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
                ("release_depth", 1.0),
                ("coulomb_friction", 2.0),
                ("shaft_slip", 2.0),
                ("release_depth", 2.0)
            ]
        );
        assert_eq!(m.scatter.varying[..3], [3e-4, 5e-4, 0.0]);
        assert_eq!(
            (m.assumed.tolerance.as_slice(), m.assumed.thickness_tolerance.as_slice()),
            (&[4.0, 4.0][..], &[0.0, 0.0][..])
        );
        assert!(m.days.is_empty() && m.day_of.is_empty() && m.tied.is_empty());
        // Nobody knows what the upper one bears: it gives way at its far face.
        let far = |m: &Model| m.effects.iter().find(|e| e.info.id == "deep_indentation").map(|e| e.values[0]);
        assert_eq!(far(&m), None);
        let mut known = first.clone();
        known.tissue.layers[0].puncture_n = Some(3.0);
        let told = together(&believed, &[&known, &second], 0.0).expect("a law");
        assert_eq!((far(&told), told.tissue.layers[0].puncture_n), (Some(1.0), Some(3.0)));
        let waits: AnyEffect = DelayedPuncture { layer: 1, force_n: 3.0, exponent: 10.0 }.into();
        first.effects.push(EffectTerm::new(waits.info(), &waits.parameters()));
        assert_eq!(far(&together(&believed, &[&first, &second], 0.0).expect("a law")), Some(1.0));
        // A layer that bears more than the one above gives way by itself, and one that bears less with it: at what it holds then.
        for (bears_n, wanted_n) in [(4.0, 4.0), (2.9, 2.2)] {
            let mut lower = second.clone();
            lower.tissue.layers[0].puncture_n = Some(bears_n);
            let m = together(&believed, &[&known, &lower], 0.0).expect("a law");
            assert_eq!(m.tissue.layers[1].puncture_n, Some(wanted_n), "{bears_n}");
            let waits: AnyEffect = DelayedPuncture { layer: 1, force_n: bears_n, exponent: 10.0 }.into();
            lower.tissue.layers[0].puncture_n = None;
            lower.effects.insert(0, EffectTerm::new(waits.info(), &waits.parameters()));
            let m = together(&believed, &[&known, &lower], 0.0).expect("a law");
            let waiting = m.effects.iter().filter(|e| e.info.id == waits.info().id).count();
            assert_eq!(
                (m.tissue.layers[1].puncture_n, waiting),
                if bears_n > 3.0 { (None, 1) } else { (Some(wanted_n), 0) }
            );
            assert_eq!(m.scatter.varying[..3], [3e-4, 5e-4, 0.0]);
        }
        assert!(together(&believed, &[], 0.0).is_none());
        assert!(together(&tissue(&["one"], 0.0, 0.03, 1.0), &[&first, &second], 0.0).is_none());
    }

    /// A law of one speed slides by as much at that speed as it did, and by the same at any other one.
    #[test]
    fn sliding_is_dry_where_one_speed_is_all_that_was_measured() {
        let slip = ShaftSlip { push_n: 2.0, pull_n: 1.5, exponent: 8.0, ..ShaftSlip::default() };
        let mut m =
            alone(0.004, 100.0, &[slip.clone().into(), ReleaseDepth { layer: 1, depth_m: 1e-3 }.into()]);
        let told = |m: &Model| match told_of(m, 2e-3, None)[0].effect() {
            Some(AnyEffect::ShaftSlip(s)) => s,
            other => unreachable!("{other:?}"),
        };
        // Where a rate was fitted, it stays.
        assert_eq!(told(&m), slip);
        m.tied = vec![TiedParameter { effect: 0, parameter: SLIP_RATE_INDEX, tied_to: None }];
        let s = told(&m);
        assert!((s.plateau_n(2e-3) - slip.plateau_n(2e-3)).abs() < 1e-12);
        for v_mps in [1e-3, 4e-3] {
            assert!((s.plateau_n(v_mps) - slip.plateau_n(2e-3)).abs() < 1e-12);
            assert!((s.plateau_n(-v_mps) - slip.plateau_n(-2e-3)).abs() < 1e-12);
        }
        assert_eq!(
            (s.exponent, s.retained_share, told_of(&m, 2e-3, None).len()),
            (slip.exponent, slip.retained_share, 2)
        );
    }

    /// Stacks of a layer that lies half a millimetre deeper than the law has it, whatever their force does after the rupture.
    #[test]
    fn a_law_is_laid_where_a_run_builds_its_force_up() {
        let mut law = Model::base(
            test_fixtures::fit_from_truth(
                &[],
                &simulated_recordings(&[], &[[0.008, 0.0]]).iter().collect::<Vec<_>>(),
            )
            .fit
            .model
            .assumed,
            1,
        );
        law.tissue = gel_tissue();
        for deeper_m in [5e-4, -8e-4, 0.0] {
            let mut run = simulated_recordings(&[], &[[0.008, deeper_m]]).remove(0);
            let told = rises_m(&law, &run);
            assert!((told - deeper_m).abs() < 3e-5, "{told} for {deeper_m}");
            let first_s = run.ruptures_s[0];
            for (t, f) in run.recording.time_s.iter().zip(&mut run.recording.force_n) {
                *f += f64::from(u8::from(*t > first_s));
            }
            assert!((rises_m(&law, &run) - told).abs() < 1e-9);
        }
        let moved = moved_by(
            &together(
                &tissue(&["a", "b"], 0.0, 0.03, 1.0),
                &[&alone(0.004, 1.0, &[]), &alone(0.015, 1.0, &[])],
                0.0,
            )
            .expect("a law"),
            7e-4,
        );
        assert!(
            (moved.tissue.surface_m - 0.0047).abs() < 1e-15
                && (moved.tissue.front_m(1) - 0.015).abs() < 1e-15
        );
    }

    /// Numbers of the shaft that stand at their bounds are nothing that was measured.
    #[test]
    fn what_a_layers_own_runs_do_not_tell_is_the_first_layers() {
        let like = ShaftSlip {
            push_n: 2.0,
            pull_n: 1.0,
            exponent: 7.0,
            wear_per_m: 40.0,
            retained_share: 0.5,
            ..ShaftSlip::default()
        };
        let told = |slip: &ShaftSlip| {
            let m = alone(0.004, 100.0, &[slip.clone().into()]);
            match told_of(&m, 2e-3, Some(&like))[0].effect() {
                Some(AnyEffect::ShaftSlip(s)) => s,
                other => unreachable!("{other:?}"),
            }
        };
        let known =
            ShaftSlip { push_n: 1.5, pull_n: 1.2, retained_share: 0.8, wear_per_m: 60.0, ..like.clone() };
        assert_eq!(told(&known), known);
        let push_n = 8.0 + 3.0 * (8.0 - 0.05);
        let open = ShaftSlip {
            push_n,
            exponent: 200.0,
            wear_per_m: 0.0,
            retained_share: 0.6 / push_n,
            ..known.clone()
        };
        let s = told(&open);
        // Twice what it holds when pulled, of which a quarter is the 0.6 N after the rupture.
        assert!((s.push_n - 2.4).abs() < 1e-12 && (s.retained_share - 0.25).abs() < 1e-12, "{s:?}");
        assert_eq!((s.pull_n, s.exponent, s.wear_per_m), (1.2, 7.0, 40.0));
        // The first layer has nobody to ask.
        let m = alone(0.004, 100.0, &[open.clone().into()]);
        assert_eq!(told_of(&m, 2e-3, None)[0].effect(), Some(AnyEffect::ShaftSlip(open)));
    }

    /// A stack that is the layer itself, set up a millimetre deeper.
    #[test]
    fn a_layer_alone_predicts_the_stack_that_it_is_wherever_that_begins() {
        let alone = simulated_recordings(&[], &[[0.008, 0.0], [0.016, 1e-4], [0.008, 0.0]]);
        let whole = simulated_recordings(&[], &[[0.008, 1e-3], [0.016, 1e-3], [0.008, 1e-3]]);
        let runs: Vec<&SegmentedRecording> = whole.iter().collect();
        let told = compose_layers(ModelFamily::Base, &gel_tissue(), &[("gel".to_owned(), alone)], &runs)
            .expect("a law");
        let [(name, floor_n, error_n)] = &told.single_layers[..] else { unreachable!("one layer") };
        // The one at the other speed has nobody beside it.
        assert_eq!((name.as_str(), *floor_n), ("gel", None));
        assert!(*error_n > 0.0 && *error_n < 0.3, "{error_n}");
        assert_eq!(told.composed_n.len(), 2);
        assert!(told.composed_n.iter().all(|e| *e > 0.005 && *e < 0.3), "{:?}", told.composed_n);
        assert!((told.mean_n - 0.5 * (told.composed_n[0] + told.composed_n[1])).abs() < 1e-12);
        // A speed is told by the mean of its runs: one of them twice or three times is that one.
        let [twice, thrice] = [&[runs[0]; 2][..], &[runs[0]; 3]].map(|runs| {
            let alone = simulated_recordings(&[], &[[0.008, 0.0], [0.016, 1e-4], [0.008, 0.0]]);
            compose_layers(ModelFamily::Base, &gel_tissue(), &[("gel".to_owned(), alone)], runs)
                .expect("a law")
                .mean_n
        });
        assert_eq!(twice, thrice);
        // Without the layer or its runs there is nothing to put together.
        assert!(compose_layers(ModelFamily::Base, &gel_tissue(), &[], &runs).is_none());
    }
}
