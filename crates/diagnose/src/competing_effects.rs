//! Finds effects that compete with each identified cause, and those that the data cannot distinguish from it.

use crate::model_comparison::{bic_penalty, likelihood_gain};
use crate::model_pruning::{effect_at_bound, required_gain_nats};
use crate::selection_state::Search;
use stylet_identify::fit::{Effort, Fit, fit_if_below};
use stylet_identify::model::EffectTerm;
use stylet_stats::parallel::*;

/// Largest difference (nats) of effects that count as equivalent.
pub const EQUIVALENCE_NATS: f64 = 3.0;
/// Largest gap between the gains of an effect and the best one at the selection step, as a share of the best gain, for the effect to be
/// refitted as a competitor.
const MAX_DISTANCE_SHARE: f64 = 0.05;
/// The same gap in nats; the larger of this and `MAX_DISTANCE_SHARE` applies.
const MAX_DISTANCE_NATS: f64 = 25.0;
/// The fit of a competing effect stops when it cannot come within this many nats of the cause.
const STOP_DISTANCE_NATS: f64 = 40.0;

/// An effect that competes with a cause.
#[derive(Clone, Debug)]
pub struct CompetingEffect {
    /// Identifier of the effect.
    pub name: &'static str,
    /// Penalised log likelihood (nats) by which it is worse than the cause; negative if it is better.
    pub nats_behind: f64,
    /// The effect with its fitted values.
    pub choice: EffectTerm,
}

/// Competing effects of every cause of the best model. A competitor that is better replaces the cause.
pub fn find_competing_effects(search: &mut Search) -> Vec<Vec<CompetingEffect>> {
    let mut k = 0;
    let mut out: Vec<Vec<CompetingEffect>> = Vec::new();
    let mut replacements = 0;
    while k < search.best.model.effects.len() {
        let fits = competing_fits(search, k);
        let ahead = fits.iter().filter(|r| r.1 < -0.5).min_by(|a, b| a.1.total_cmp(&b.1));
        // A model with more parameters must also be better under the noise estimated from its own residuals.
        let justified = |f: &Fit| {
            f.model.effect_parameter_count() <= search.best.model.effect_parameter_count()
                || (!effect_at_bound(f, k)
                    && likelihood_gain(&search.best, f, &search.data)
                        > required_gain_nats(&search.best, f, &search.data))
        };
        if let Some((f, _)) = ahead.filter(|r| replacements < 3 && justified(&r.0)) {
            search.replace_effect(k, f.clone());
            replacements += 1;
            (k, out) = (0, Vec::new());
            continue;
        }
        let name = |f: &Fit| f.model.effects[k].info.id;
        let competing = |(f, behind): &(Fit, f64)| CompetingEffect {
            name: name(f),
            nats_behind: *behind,
            choice: f.model.effects[k].clone(),
        };
        out.push(fits.iter().map(competing).collect());
        k += 1;
    }
    out
}

/// Fits with effect `k` replaced by a competitor, and the nats by which each is worse.
fn competing_fits(search: &Search, k: usize) -> Vec<(Fit, f64)> {
    let model = &search.best.model;
    let cause = &model.effects[k];
    let stage = search.stages.iter().rev().find(|s| s.selected.is_some_and(|t| t.0 == cause.info.id));
    let Some(stage) = stage else { return Vec::new() };
    let best = stage.candidates.iter().map(|r| r.1).fold(f64::NEG_INFINITY, f64::max);
    let tried: Vec<EffectTerm> = stage
        .choices
        .iter()
        .zip(&stage.candidates)
        .filter(|(c, r)| {
            let close = best - r.1 < (MAX_DISTANCE_SHARE * best).max(MAX_DISTANCE_NATS);
            // A special case of the cause is refitted too: effects selected later can make it sufficient.
            let special = c.info.nested_in.contains(&cause.info.id);
            (close || special) && model.effects.iter().all(|e| e.info.id != c.info.id)
        })
        .map(|(c, _)| c.clone())
        .collect();
    let blocks = search.data.compared_block_count();
    let penalised = |f: &Fit| f.nats() + bic_penalty(f.model.effect_parameter_count(), blocks);
    let cause_nats = penalised(&search.best);
    tried
        .into_par_iter()
        .filter_map(|choice| {
            let mut other = model.clone();
            other.effects[k] = choice;
            let wanted =
                cause_nats + STOP_DISTANCE_NATS - bic_penalty(other.effect_parameter_count(), blocks);
            let f = fit_if_below(&other, &search.data, Effort::FULL, wanted)?;
            let behind = penalised(&f) - cause_nats;
            // The gain of an effect that includes the cause as a special case must exceed its additional penalty.
            let nested = cause.info.nested_in.contains(&f.model.effects[k].info.id);
            (!nested || behind < -0.5).then_some((f, behind))
        })
        .collect()
}

#[cfg(test)]
mod tests;
