//! Ablation of a model: tests every term by cross-validation and evidence, and removes those that are not needed.

use super::cross_validation::PredictionScore;
use super::held_out_loss::{MIN_EFFECT_LOSS, exceeds_standard_error, is_significant, relative_losses};
use super::multistart_fit::SetFit;
use super::scored_model::{
    ModelFamily, ScoredModel, cross_validate, cross_validate_speeds, rms_errors_n, with_coarse_blocks,
};
use super::segmented_recording::SegmentedRecording;
use std::sync::Arc;
use stylet_identify::likelihood::residuals;
use stylet_identify::model::{Assumptions, EffectTerm, MAX_VARYING_PARAMETERS, Model, TiedParameter};
use stylet_identify::rupture_likelihood::RuptureEvent;
use stylet_stats::parallel::*;
use stylet_tissue::{AnyEffect, ShaftSlip};

/// Relative held-out loss from which a parameter group within an effect is kept. It is smaller than [`MIN_EFFECT_LOSS`] because the group
/// is never reported as a cause; one standard error suffices (Breiman et al. 1984: the simplest of about equal models).
const MIN_SHAPE_LOSS: f64 = 0.01;

/// A term of a model with its ablation result.
#[derive(Clone, Debug)]
pub struct ModelTerm {
    /// Effect that the term is, or belongs to.
    pub effect: &'static str,
    /// Name in reports.
    pub name: String,
    /// Held-out RMS error (N) per recording without the term.
    pub without_n: Vec<f64>,
    /// Relative held-out loss per recording without the term.
    pub held_out_loss: Vec<f64>,
    /// The same with whole speeds held out; empty for a single speed.
    pub held_out_speed_loss: Vec<f64>,
    /// Evidence (nats) for the term, penalised by BIC.
    pub gain_nats: f64,
    /// Whether the term is kept in the model.
    pub kept: bool,
    /// Whether the term may be reported as a cause.
    pub significant: bool,
}

impl ModelTerm {
    /// Whether this is an effect that improves prediction without significance: it is kept in the model but not reported as a cause.
    pub(crate) fn is_uncertain(&self) -> bool {
        self.kept && !self.significant && self.name == self.effect
    }
}

/// Candidate terms for removal, each with its name and the model without it; `events` are those of the fit.
fn removal_candidates(model: &Model, events: &[Vec<RuptureEvent>]) -> Vec<(&'static str, String, Model)> {
    let mut out = Vec::new();
    let has_slip = model.effects.iter().any(|c| c.info.id == ShaftSlip::ID);
    let mut tested: Vec<&str> = Vec::new();
    for id in model.effects.iter().map(|c| c.info.id) {
        if tested.contains(&id) || id == ShaftSlip::ID {
            continue;
        }
        tested.push(id);
        out.push((id, id.to_owned(), without_effect(model, events, id)));
    }
    if has_slip {
        let inactive: [(&str, &[(&str, f64)]); 4] = [
            ("nonlinear spring", &[("curvature_n_per_m2", 0.0)]),
            (
                "relaxation",
                &[
                    ("fractions.0", 0.0),
                    ("fractions.1", 0.0),
                    ("time_constants_s.0", 1.0),
                    ("time_constants_s.1", 10.0),
                ],
            ),
            ("wear", &[("wear_per_m", 0.0)]),
            ("rate", &[("rate", 0.0)]),
        ];
        for (name, numbers) in inactive {
            if let Some(model) = with_fixed_slip_parameters(model, numbers) {
                out.push((ShaftSlip::ID, format!("{}: {name}", ShaftSlip::ID), model));
            }
        }
    }
    out
}

/// Elastic forces (N) of a layer (0-based) at its ruptures, of the recordings in which it ruptured.
fn elastic_forces_at_ruptures_n(events: &[Vec<RuptureEvent>], layer: usize) -> Vec<f64> {
    let ruptured = events.iter().filter_map(|e| e.get(layer).filter(|e| e.ruptured));
    ruptured.map(|e| e.elastic_n).filter(|f| *f > 0.0).collect()
}

/// The model without the effects `id`. A layer that had a delayed puncture gets its observed rupture force as puncture force.
pub(super) fn without_effect(model: &Model, events: &[Vec<RuptureEvent>], id: &str) -> Model {
    let mut out = model.clone();
    let mut tissue = out.assumed.tissue.clone();
    // Random effects of parameters are indexed in the order of the effects.
    let stays: Vec<usize> = model
        .varying_parameters()
        .enumerate()
        .filter(|(_, d)| model.effects[d.0].info.id != id)
        .map(|d| d.0)
        .collect();
    let kept = |all: [f64; MAX_VARYING_PARAMETERS]| {
        std::array::from_fn(|k| stays.get(k).map_or(0.0, |from| all[*from]))
    };
    while let Some(k) = out.effects.iter().position(|c| c.info.id == id) {
        if let Some(AnyEffect::DelayedPuncture(delayed)) = out.effects[k].effect() {
            let layer = delayed.layer.saturating_sub(1);
            let forces_n = elastic_forces_at_ruptures_n(events, layer);
            let force_n = stylet_stats::median_of(forces_n.iter().copied());
            if forces_n.len() > 1 {
                out.scatter.rupture_force =
                    out.scatter.rupture_force.max(stylet_stats::sd(&forces_n) / force_n);
            }
            for t in [&mut tissue, &mut out.tissue] {
                if let Some(l) = t.layers.get_mut(layer) {
                    l.puncture_n = Some(if force_n.is_finite() { force_n } else { delayed.force_n });
                }
            }
        }
        out = out.without_effect(k);
    }
    out.per_recording.iter_mut().for_each(|o| o.varying = kept(o.varying));
    out.scatter.varying = kept(out.scatter.varying);
    out.assumed = Arc::new(Assumptions { tissue, ..(*out.assumed).clone() });
    out
}

/// The model with parameters of `shaft_slip` fixed at their inactive values; `None` if they already are.
fn with_fixed_slip_parameters(model: &Model, numbers: &[(&str, f64)]) -> Option<Model> {
    let mut out = model.clone();
    let mut any = false;
    for effect in 0..out.effects.len() {
        let term = &out.effects[effect];
        if term.info.id != ShaftSlip::ID {
            continue;
        }
        let mut values = term.values.clone();
        for (path, neutral) in numbers {
            let parameter = term.info.parameters.iter().position(|p| p.path == *path)?;
            any |= values[parameter] != *neutral;
            values[parameter] = *neutral;
            if !model.tied.iter().any(|b| b.effect == effect && b.parameter == parameter) {
                out.tied.push(TiedParameter { effect, parameter, tied_to: None });
            }
        }
        out.effects[effect] = EffectTerm::new(model.effects[effect].info, &values);
    }
    any.then_some(out)
}

/// Ablation result of a term.
struct AblationResult {
    /// Relative held-out loss per recording.
    loses: Vec<f64>,
    /// The same with whole speeds held out; empty for a single speed.
    speeds_lose: Vec<f64>,
    /// Evidence (nats) for the term: gain under the noise of the whole model minus the BIC penalty (Schwarz 1978).
    nats: f64,
}

impl AblationResult {
    fn new(
        whole: &SetFit,
        less: Option<&SetFit>,
        with: &[Option<PredictionScore>],
        without: &[Option<PredictionScore>],
    ) -> Self {
        let nats = |f: &SetFit| residuals(&f.fit.model, &whole.data).map(|r| r.nats);
        let numbers = |f: &SetFit| f.fit.model.shared_parameters().len() as f64;
        let beyond = |less: &SetFit| {
            let cost = 0.5
                * (numbers(whole) - numbers(less))
                * libm::log(whole.data.compared_block_count().max(1) as f64);
            Some(nats(less)? - nats(whole)? - cost)
        };
        let nats = less.and_then(beyond).unwrap_or(f64::INFINITY);
        Self { loses: relative_losses(without, with), speeds_lose: Vec::new(), nats }
    }

    /// Whether an effect is supported: significantly by held-out recordings, or by the evidence if held-out recordings do not contradict
    /// it.
    fn is_supported(&self) -> bool {
        let worse = |loses: &[f64]| !loses.is_empty() && stylet_stats::mean(loses) > 0.0;
        let uncontradicted = self.nats > 0.0 && (worse(&self.loses) || worse(&self.speeds_lose));
        uncontradicted || is_significant(&self.loses) || is_significant(&self.speeds_lose)
    }

    /// Whether an effect is kept.
    fn keeps_effect(&self) -> bool {
        self.is_supported() || exceeds_standard_error(&self.loses, MIN_EFFECT_LOSS)
    }

    /// Whether a parameter group within an effect is kept.
    fn keeps_shape(&self) -> bool {
        exceeds_standard_error(&self.loses, MIN_SHAPE_LOSS)
            || exceeds_standard_error(&self.speeds_lose, MIN_SHAPE_LOSS)
    }
}

/// Tests every term of the model by ablation, in ascending order of its held-out loss, and removes those that are not needed.
pub(super) fn ablate(best: &mut ScoredModel, recordings: &[&SegmentedRecording]) -> Vec<ModelTerm> {
    let at = with_coarse_blocks(&best.set_fit);
    let (whole, speeds) = (best.scores.clone(), cross_validate_speeds(&best.set_fit, recordings));
    let ask = |from: &SetFit, model: &Model| {
        let less = from.refit_with(model);
        let scores: Vec<Option<PredictionScore>> =
            less.as_ref().map_or_else(Vec::new, |f| cross_validate(f, recordings));
        let mut missed = AblationResult::new(from, less.as_ref(), &whole, &scores);
        missed.speeds_lose = less
            .as_ref()
            .map_or_else(Vec::new, |f| relative_losses(&cross_validate_speeds(f, recordings), &speeds));
        (less, scores, missed)
    };
    let asked: Vec<_> = removal_candidates(&at.fit.model, &at.fit.residuals.ruptures)
        .into_par_iter()
        .map(|(effect, name, model)| (effect, name, ask(&at, &model)))
        .collect();
    let mut order: Vec<usize> = (0..asked.len()).collect();
    let lost = |k: &usize| stylet_stats::mean(&asked[*k].2.2.loses);
    order.sort_by(|a, b| lost(a).total_cmp(&lost(b)));
    let mut gone: Vec<usize> = Vec::new();
    for k in order {
        let (effect, name, (less, _, missed)) = &asked[k];
        let stays = |m: &AblationResult| if name == effect { m.keeps_effect() } else { m.keeps_shape() };
        let Some(less) = less.as_ref().filter(|_| !stays(missed)) else { continue };
        let smaller = if gone.is_empty() {
            best.set_fit.refit_with(&less.fit.model)
        } else {
            // Repeats the test without the terms that were already removed.
            let now = &best.set_fit.fit;
            let now =
                removal_candidates(&now.model, &now.residuals.ruptures).into_iter().find(|c| c.1 == *name);
            let Some((less, _, missed)) = now.map(|c| ask(&with_coarse_blocks(&best.set_fit), &c.2)) else {
                continue;
            };
            less.filter(|_| !stays(&missed)).and_then(|f| best.set_fit.refit_with(&f.fit.model))
        };
        if let Some(smaller) = smaller {
            *best = ScoredModel::new(best.family, smaller, recordings);
            gone.push(k);
        }
    }
    if best.set_fit.fit.model.effects.is_empty() {
        best.family = ModelFamily::Base;
    }
    let asked = asked.into_iter().enumerate();
    asked
        .map(|(k, (effect, name, (_, scores, missed)))| ModelTerm {
            effect,
            name,
            without_n: rms_errors_n(&scores),
            significant: missed.is_supported(),
            held_out_loss: missed.loses,
            held_out_speed_loss: missed.speeds_lose,
            gain_nats: missed.nats,
            kept: !gone.contains(&k),
        })
        .collect()
}

#[cfg(test)]
pub(crate) mod tests;
