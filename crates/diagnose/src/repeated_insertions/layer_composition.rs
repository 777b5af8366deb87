//! Composes models of layers that were measured separately, and compares the prediction with recordings of the whole stack.

use super::cross_validation::{leave_one_out_scores, repeatability_floor, score_prediction};
use super::multistart_fit::{SetFit, fit_from, set_blocks};
use super::parameter_estimates::is_at_bound;
use super::population_prediction::{DRAWS, predict_force, simulate_force};
use super::random_effects_population::Population;
use super::repeatability_report::CompositionReport;
use super::scored_model::ModelFamily;
use super::segmented_recording::{SegmentedRecording, mean_speeds};
use super::start_values::{base_law_prior, is_rate_held};
use super::stick_slip_fit::fit_stick_slip;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use std::sync::Arc;
use stylet_identify::model::{
    Assumptions, DayParameters, EffectTerm, Model, NO_RUPTURE, ParameterRole, RecordingParameters,
};
use stylet_record::Recording;
use stylet_record::sensor_artefacts::{self, SensorArtefacts};
use stylet_stats::median_of;
use stylet_stats::parallel::*;
use stylet_tissue::{AnyEffect, DeepIndentation, Effect, ShaftSlip, Tissue};

/// Seed of the random start values, constant so that equal recordings give equal results.
const START_VALUE_SEED: u64 = 2;
/// Smallest thickness of a composed layer in m.
const MIN_THICKNESS_M: f64 = 1e-3;

/// Fits every layer separately with a model of the given family, stacks the layers and predicts the recordings of the stack.
///
/// `alone` contains, per layer of the stack, its name and the recordings of that layer alone. Effects that belong to no layer are taken
/// from the first.
#[must_use]
pub fn compose_layers(
    kind: ModelFamily,
    assumed: &Tissue,
    alone: &[(String, Vec<SegmentedRecording>)],
    whole: &[&SegmentedRecording],
) -> Option<CompositionReport> {
    let mut single_layers = Vec::new();
    let mut fits = Vec::new();
    for (i, (name, recordings)) in alone.iter().enumerate() {
        let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
        let tissue = Tissue { surface_m: assumed.front_m(i), layers: vec![assumed.layers.get(i)?.clone()] };
        let fit = fit_single_layer(kind, &tissue, &recordings)?;
        let floors: Option<Vec<f64>> =
            repeatability_floor(&recordings).iter().map(|f| f.as_ref().map(|f| f.0.rmse_n)).collect();
        let errors: Vec<f64> = leave_one_out_scores(&fit, &recordings).iter().map(|s| s.rmse_n).collect();
        single_layers.push((
            name.clone(),
            floors.map(|f| stylet_stats::mean(&f)),
            stylet_stats::mean(&errors),
        ));
        let speed_mps = median_of(recordings.iter().map(|r| r.speed_mps));
        let like = fits.first().and_then(|(_, combined): &(Population, Model)| shaft_slip_of(combined));
        let combined = Model {
            effects: identified_effects(&fit.fit.model, speed_mps, like.as_ref()),
            ..fit.fit.model.clone()
        };
        fits.push((Population::from_fit(&fit, &recordings), combined));
    }
    let models: Vec<&Model> = fits.iter().map(|(_, combined)| combined).collect();
    // The surface of the stack depends on its set-up: it is shifted by the difference of the contact positions, then fitted to the loading
    // of the other recordings. Deeper layers keep their positions.
    let begins = |recordings: &mut dyn Iterator<Item = &SegmentedRecording>| {
        median_of(recordings.map(|r| r.contact_m))
    };
    let moved_m = begins(&mut whole.iter().copied()) - begins(&mut alone.first()?.1.iter());
    let combined = stack_models(assumed, &models, moved_m)?;
    let shifts_m: Vec<f64> = whole.iter().map(|run| surface_shift_m(&combined, run)).collect();
    let one = |r: usize| {
        let others = (0..whole.len()).filter(|o| *o != r && shifts_m[*o].is_finite()).map(|o| shifts_m[o]);
        let further_m = Some(median_of(others)).filter(|m| m.is_finite()).unwrap_or(0.0);
        let population = Population { model: with_moved_surface(&combined, further_m), ..fits[0].0.clone() };
        score_prediction(whole[r], &predict_force(&population, whole[r], None, DRAWS)).rmse_n
    };
    let errors: Vec<f64> = (0..whole.len()).into_par_iter().map(one).collect();
    let of =
        |members: &[usize]| members.iter().map(|i| errors[*i]).sum::<f64>() / members.len().max(1) as f64;
    let composed_n: Vec<f64> = mean_speeds(whole).iter().map(|(_, members)| of(members)).collect();
    let mean_n = stylet_stats::mean(&composed_n);
    Some(CompositionReport { single_layers, composed_n, mean_n })
}

fn fit_single_layer(
    kind: ModelFamily,
    tissue: &Tissue,
    recordings: &[&SegmentedRecording],
) -> Option<SetFit> {
    let samples: Vec<&Recording> = recordings.iter().map(|r| &r.recording).collect();
    let notes: Vec<_> = recordings.iter().map(|r| r.notes.clone()).collect();
    let artefacts: SensorArtefacts = sensor_artefacts::find_sensor_artefacts(&samples, &notes);
    if kind == ModelFamily::ShaftSlip {
        return fit_stick_slip(
            tissue,
            recordings,
            &artefacts,
            &mut ChaCha8Rng::seed_from_u64(START_VALUE_SEED),
        )
        .map(|l| l.set_fit);
    }
    let mut model = Model::base(Arc::new(base_law_prior(tissue, recordings)), recordings.len());
    (model.free.recording_surface, model.free.recording_friction) = (true, true);
    model.rupture_times_s = recordings.iter().map(|r| r.ruptures_s.clone()).collect();
    let drops = recordings.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect());
    fit_from(&model, set_blocks(recordings, &artefacts), drops.collect())
}

/// Effects of a layer measured alone, with substitutes for parameters that its recordings do not identify.
///
/// At one speed the rate exponent is not identified: `rate` is set to `-1 / exponent`, which is Coulomb friction at constant plateau. A
/// shaft parameter at its bound is not identified either: it is taken from the first layer, `like`, because the shaft is the same. The push
/// plateau then has the same ratio to the pull plateau, and the force held right after a rupture is unchanged.
fn identified_effects(model: &Model, speed_mps: f64, like: Option<&ShaftSlip>) -> Vec<EffectTerm> {
    let one = |(e, term): (usize, &EffectTerm)| match term.effect() {
        Some(AnyEffect::ShaftSlip(mut s)) => {
            let unknown = |path: &str| {
                let place = term.info.parameters.iter().position(|p| p.path == path);
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
            if is_rate_held(model, e) {
                let (push_n, pull_n) = (s.plateau_n(speed_mps), -s.plateau_n(-speed_mps));
                s = ShaftSlip { rate: -1.0 / s.exponent, push_n, pull_n, ..s };
            }
            EffectTerm::of(&s.into())
        }
        _ => term.clone(),
    };
    model.effects.iter().enumerate().map(one).collect()
}

fn shaft_slip_of(model: &Model) -> Option<ShaftSlip> {
    model.effects.iter().find_map(|c| match c.effect() {
        Some(AnyEffect::ShaftSlip(s)) => Some(s),
        _ => None,
    })
}

/// Force (N) of a layer right after its rupture; with this puncture force it ruptures without a drop.
fn residual_plateau_n(model: &Model, layer: usize) -> f64 {
    let holds = model.effects.iter().find_map(|c| match c.effect() {
        Some(AnyEffect::ShaftSlip(s)) if s.layer == layer + 1 => Some(s.retained_share * s.push_n),
        _ => None,
    });
    holds.unwrap_or(0.0).max(f64::EPSILON)
}

/// Puncture force (N) of a layer, immediate or delayed.
fn puncture_force_n(model: &Model, layer: usize) -> Option<f64> {
    let delayed = model.effects.iter().find_map(|c| match c.effect() {
        Some(AnyEffect::DelayedPuncture(d)) if d.layer == layer + 1 => Some(d.force_n),
        _ => None,
    });
    delayed.or(model.tissue.layers.get(layer)?.puncture_n)
}

/// The model with its surface shifted by `further_m`; the boundaries below the first layer are unchanged.
fn with_moved_surface(combined: &Model, further_m: f64) -> Model {
    let mut out = combined.clone();
    out.tissue.surface_m += further_m;
    if let [first, _, ..] = &mut out.tissue.layers[..] {
        first.thickness_m = (first.thickness_m - further_m).max(MIN_THICKNESS_M);
    }
    out
}

/// Shift (m) of the surface that fits the loading of a recording from contact to the first rupture, by Gauss-Newton steps with a one-sided
/// difference.
fn surface_shift_m(combined: &Model, run: &SegmentedRecording) -> f64 {
    let mut combined = combined.clone();
    (combined.per_recording, combined.rupture_times_s) =
        (vec![RecordingParameters::default()], vec![vec![NO_RUPTURE; combined.layers()]]);
    let (r, first_s) = (&run.recording, run.first_rupture_s());
    let mut further_m = 0.0;
    for _ in 0..8 {
        let here = simulate_force(&with_moved_surface(&combined, further_m), run);
        let Some((here, there)) =
            here.zip(simulate_force(&with_moved_surface(&combined, further_m + 1e-6), run))
        else {
            break;
        };
        let until_s = first_s.min(here.1).min(there.1);
        let loading =
            (run.phases.start..=run.phases.deepest.min(r.len() - 1)).filter(|i| r.time_s[*i] < until_s);
        let (along, square) = loading.fold((0.0, 0.0), |(along, square), i| {
            let slope = 1e6 * (there.0[i] - here.0[i]);
            (along + slope * (r.force_n[i] - here.0[i]), square + slope * slope)
        });
        if square > 0.0 {
            further_m += along / square;
        }
    }
    further_m
}

/// Stacks single-layer models at their measured positions, with the surface shifted by `moved_m`.
///
/// In a stack a layer deforms its far boundary, which a layer alone cannot show. If all puncture forces are known, layers therefore rupture
/// by force and not at the boundary at rest (`deep_indentation` at its upper bound). The layers are loaded in series, so a layer with a
/// lower puncture force than the one above ruptures together with it.
fn stack_models(assumed: &Tissue, alone: &[&Model], moved_m: f64) -> Option<Model> {
    let first = *alone.first()?;
    let mut model = first.subset(&[]);
    let mut tissue = Tissue { surface_m: first.tissue.surface_m + moved_m, layers: Vec::new() };
    model.effects.clear();
    model.tied.clear();
    let mut sds = [0.0; 8];
    for (i, part) in alone.iter().enumerate() {
        let mut layer = part.tissue.layers.first()?.clone();
        layer.name.clone_from(&assumed.layers.get(i)?.name);
        if let Some(next) = alone.get(i + 1) {
            let front_m = if i == 0 { tissue.surface_m } else { part.tissue.surface_m };
            layer.thickness_m = (next.tissue.surface_m - front_m).max(MIN_THICKNESS_M);
        }
        tissue.layers.push(layer);
        let differs: Vec<(usize, usize)> = part.varying_parameters().collect();
        for (e, term) in part.effects.iter().enumerate() {
            let of_layer = term.info.parameters.first().is_some_and(|p| p.path == "layer");
            if !of_layer && i > 0 {
                continue;
            }
            let mut values = term.values.clone();
            if of_layer {
                values[0] = (i + 1) as f64;
            }
            model.effects.push(EffectTerm::new(term.info, &values));
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
    let puncture_forces: Vec<Option<f64>> = (0..layers).map(|l| puncture_force_n(&model, l)).collect();
    if puncture_forces[..layers - 1].iter().all(Option::is_some) {
        let pushed = DeepIndentation::default();
        let farthest: Vec<f64> = pushed.info().parameters.iter().map(|p| p.high).collect();
        model.effects.push(EffectTerm::new(pushed.info(), &farthest));
    }
    let mut above_n = 0.0;
    for (l, puncture_forces) in puncture_forces.iter().enumerate() {
        if puncture_forces.is_some_and(|n| n < above_n) {
            let delayed = |c: &EffectTerm| matches!(c.effect(), Some(AnyEffect::DelayedPuncture(d)) if d.layer == l + 1);
            while let Some(k) = model.effects.iter().position(delayed) {
                model = model.without_effect(k);
            }
            model.tissue.layers[l].puncture_n = Some(residual_plateau_n(&model, l));
        }
        above_n = puncture_forces.unwrap_or(above_n).max(above_n);
    }
    let tissue = model.tissue.clone();
    model.assumed = Arc::new(Assumptions {
        tissue: tissue.clone(),
        known_effects: Vec::new(),
        further_effects: Vec::new(),
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
mod tests;
