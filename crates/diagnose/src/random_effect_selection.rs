//! Selects random effects: a surface position and a friction factor per recording.
//!
//! They are not causes. They are added if their gain exceeds their penalty, and removed if an effect explains the differences between
//! recordings.

use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty, likelihood_gain};
use stylet_identify::fit::{Effort, Fit, fit, fit_if_below};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{FreeParameters, Model, RecordingParameters};
use stylet_identify::noise::NoiseSource;
use stylet_stats::parallel::*;

/// Penalty in nats of the free random effects.
fn penalty_nats(free: FreeParameters, data: &FitData) -> f64 {
    let effect_count = usize::from(free.recording_surface) + usize::from(free.recording_friction);
    let parameters = effect_count * data.recording_count().saturating_sub(1);
    bic_penalty(parameters, data.compared_block_count()) + MIN_GAIN_NATS * effect_count as f64
}

/// The model with other random effects.
fn with_random_effects(model: &Model, own_surface: bool, own_friction: bool) -> Model {
    let mut m = model.clone();
    m.free = FreeParameters { recording_surface: own_surface, recording_friction: own_friction, ..m.free };
    for own in &mut m.per_recording {
        *own = RecordingParameters {
            surface_m: if own_surface { own.surface_m } else { 0.0 },
            ln_friction: if own_friction { own.ln_friction } else { 0.0 },
            ..*own
        };
    }
    m
}

/// Selects the random effects with the smallest penalised objective; the noise is then estimated again from the residual.
pub fn select_random_effects(best: Fit, data: FitData) -> (Fit, FitData) {
    if data.recording_count() < 2 {
        return (best, data);
    }
    let now = best.model.free;
    let choices: Vec<(bool, bool)> = [(false, false), (true, false), (false, true), (true, true)]
        .into_iter()
        .filter(|c| *c != (now.recording_surface, now.recording_friction))
        .collect();
    let penalised_nats = |f: &Fit| f.nats() + penalty_nats(f.model.free, &data);
    let fits: Vec<Fit> = choices
        .par_iter()
        .filter_map(|c| {
            let m = with_random_effects(&best.model, c.0, c.1);
            fit_if_below(
                &m,
                &data,
                Effort { max_iterations: 6, min_gain_nats: 0.3 },
                penalised_nats(&best) - penalty_nats(m.free, &data),
            )
        })
        .collect();
    let Some(other) = fits.into_iter().min_by(|a, b| penalised_nats(a).total_cmp(&penalised_nats(b))) else {
        return (best, data);
    };
    if penalised_nats(&other) >= penalised_nats(&best) {
        return (best, data);
    }
    // The gain must also hold under the noise of the larger model.
    let effect_count =
        |f: &Fit| usize::from(f.model.free.recording_surface) + usize::from(f.model.free.recording_friction);
    let penalty = penalty_nats(other.model.free, &data) - penalty_nats(now, &data);
    let gained = if effect_count(&other) >= effect_count(&best) {
        likelihood_gain(&best, &other, &data)
    } else {
        -likelihood_gain(&other, &best, &data)
    };
    let is_better = gained > penalty;
    if !is_better {
        return (best, data);
    }
    let data = data.with_estimated_noise(&other.residuals.residual_n, NoiseSource::Detrended);
    let refitted = fit(&other.model, &data, Effort::FULL).unwrap_or(other);
    (refitted, data)
}

#[cfg(test)]
mod tests;
