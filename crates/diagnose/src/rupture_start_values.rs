//! Start values of effects that act on rupture forces alone, such as a rate-dependent puncture force.
//!
//! Without such an effect the rupture forces have a large scatter, under which the gradient of the likelihood is close to zero. Strengths
//! are therefore tried on a grid, each with its own puncture forces and scatter.

use crate::effect_start::EffectStart;
use stylet_identify::likelihood::replay;
use stylet_identify::model::{EffectTerm, Model, ParameterRole, Scatter};
use stylet_identify::rupture_likelihood::{
    FORCE_SCATTER_GRID, RuptureEvent, evaluate_rupture, scatter_prior_nats,
};
use stylet_identify::score_test::ScoreTest;
use stylet_stats::parallel::*;
use stylet_tissue::EffectInfo;

/// Grid points per pass. The first pass covers the search range of the parameter; later ones refine the grid around the best point.
const GRID_POINTS: usize = 21;
/// Passes of the grid search.
const GRID_PASSES: usize = 3;
/// Largest contribution (nats) of one rupture to the objective: near a velocity jump the rupture time is uncertain.
const MAX_EVENT_NATS: f64 = 12.0;

/// Best start value of a one-parameter effect from the ruptures; `None` when no strength improves their likelihood.
pub fn start_from_ruptures(info: &'static EffectInfo, score_test: &ScoreTest) -> Option<EffectStart> {
    let [parameter] = info.parameters else { return None };
    let current = rupture_objective(score_test, score_test.fit.model.clone())?.0;
    let mut best: Option<(f64, f64, Model)> = None;
    let (mut low, mut high) = parameter.search;
    for _ in 0..GRID_PASSES {
        let step = (high - low) / (GRID_POINTS - 1) as f64;
        let tried = (0..GRID_POINTS).into_par_iter().filter_map(|k| {
            let x = low + step * k as f64;
            let choice = EffectTerm::new(info, &[x]);
            choice.effect().filter(|e| e.check().is_ok())?;
            let (nats, model) = rupture_objective(score_test, score_test.fit.model.with_effect(choice))?;
            Some((x, nats, model))
        });
        for one in tried.collect::<Vec<_>>() {
            if best.as_ref().is_none_or(|b| one.1 < b.1) {
                best = Some(one);
            }
        }
        let best_strength = best.as_ref()?.0;
        (low, high) = ((best_strength - step).max(parameter.low), (best_strength + step).min(parameter.high));
    }
    let (x, nats, model) = best?;
    let gained = current - nats;
    if gained <= 0.0 {
        return None;
    }
    Some(EffectStart {
        choice: EffectTerm::new(info, &[x]),
        gain_nats: gained,
        detectable_nats: gained,
        model: Some(model),
    })
}

/// Minimum over puncture forces and force scatter of the objective (nats) of the ruptures at their present times, and the model with these
/// values.
fn rupture_objective(score_test: &ScoreTest, mut model: Model) -> Option<(f64, Model)> {
    let events: Vec<Vec<RuptureEvent>> = (0..score_test.data.recording_count())
        .map(|r| Some(replay(&model, score_test.data, r)?.ruptures))
        .collect::<Option<_>>()?;
    let layers: Vec<LayerEvents> =
        (0..model.layers()).map(|l| LayerEvents::new(&model, &events, l)).collect();
    let mut best: Option<(f64, Scatter, Vec<f64>)> = None;
    for force in FORCE_SCATTER_GRID {
        let scatter = Scatter { rupture_force: force, ..model.scatter };
        let best_factors: Vec<(f64, f64)> = layers.iter().map(|l| l.best(&scatter)).collect();
        let nats = best_factors.iter().map(|t| t.1).sum::<f64>() + scatter_prior_nats(&scatter);
        if best.as_ref().is_none_or(|b| nats < b.0) {
            best = Some((nats, scatter, best_factors.iter().map(|t| t.0).collect()));
        }
    }
    let (nats, scatter, factors) = best?;
    model.scatter = scatter;
    for (layer, factor) in factors.iter().enumerate() {
        let role = ParameterRole::Puncture(layer);
        model.set(role, 0, model.get(role, 0) * factor);
    }
    Some((nats, model))
}

/// Rupture events of one layer, and trial factors on its puncture force, each of which fits one event.
struct LayerEvents {
    events: Vec<RuptureEvent>,
    factors: Vec<f64>,
}

impl LayerEvents {
    fn new(model: &Model, events: &[Vec<RuptureEvent>], layer: usize) -> Self {
        let events: Vec<RuptureEvent> = events.iter().filter_map(|e| e.get(layer).copied()).collect();
        let role = ParameterRole::Puncture(layer);
        let mut factors = vec![1.0];
        if let Some(n) = model.shared_parameters().into_iter().find(|n| n.role == role) {
            let now = model.get(role, 0);
            let proposed = events
                .iter()
                .filter(|e| e.ruptured && e.force_excess.is_finite())
                .map(|e| 1.0 + e.force_excess);
            factors.extend(proposed.map(|f| (f * now).clamp(n.low, n.high) / now));
        }
        Self { events, factors }
    }

    /// Factor with the smallest objective, and that objective in nats.
    fn best(&self, scatter: &Scatter) -> (f64, f64) {
        let nats = |factor: f64| -> f64 {
            let moved = |e: &RuptureEvent| RuptureEvent {
                force_excess: (1.0 + e.force_excess) / factor - 1.0,
                force_excess_rate: e.force_excess_rate / factor,
                ..*e
            };
            self.events.iter().map(|e| evaluate_rupture(&moved(e), scatter).nats.min(MAX_EVENT_NATS)).sum()
        };
        let of = |factor: &f64| (*factor, nats(*factor));
        self.factors.iter().map(of).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((1.0, 0.0))
    }
}

#[cfg(test)]
mod tests;
