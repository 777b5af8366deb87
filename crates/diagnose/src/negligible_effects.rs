//! Negligible effects: selected by the search, but too small to matter or without improvement on held-out recordings.

use crate::diagnosis_json::Cause;
use crate::held_out::{
    FreeRunResidual, held_out_residuals_with_random_effects, pooled_rms, sample_noise_sd_n,
};
use crate::selection_state::Search;
use stylet_identify::fit::{Effort, fit};
use stylet_stats::parallel::*;

/// A negligible effect.
#[derive(Clone, Debug)]
pub struct Negligible {
    /// Identifier of the effect.
    pub effect: String,
    /// Why it is negligible.
    pub reason: String,
}

/// Smallest change of the held-out RMS by a cause, as a share of the noise.
const MIN_RMS_CHANGE: f64 = 0.002;
/// Gain (nats per block) below which a cause must improve the held-out RMS.
const STRONG_NATS_PER_BLOCK: f64 = 0.3;

/// Negligible causes with their reasons; `nats_against_zero` are the values of [`Covariance::nats_against_zero`] by effect.
///
/// [`Covariance::nats_against_zero`]: crate::confidence_intervals::Covariance::nats_against_zero
pub fn negligible_effects(
    search: &Search,
    extended_held_out: &[Option<FreeRunResidual>],
    causes: &[Cause],
    nats_against_zero: &[(String, f64)],
) -> Vec<Negligible> {
    let free = search.best.model.free;
    let with_n = if free.recording_surface || free.recording_friction {
        pooled_rms(&held_out_residuals_with_random_effects(&search.best, &search.data), &search.data)
    } else {
        pooled_rms(extended_held_out, &search.data)
    };
    let effects = &search.best.model.effects;
    let compared = search.data.compared_block_count() as f64;
    let assess = |c: &Cause| -> Option<Negligible> {
        let k = effects.iter().position(|e| e.info.id == c.effect)?;
        let because = |reason: &str| Some(Negligible { effect: c.effect.clone(), reason: reason.to_owned() });
        if is_uncertain(c, nats_against_zero, search) {
            return because("not significantly different from zero after a search over all effects");
        }
        let reduced = fit(
            &search.best.model.without_effect(k),
            &search.data,
            Effort { max_iterations: 4, min_gain_nats: 0.5 },
        )?;
        let loss_nats = (reduced.nats() - search.best.nats()) / compared;
        if loss_nats > STRONG_NATS_PER_BLOCK {
            return None;
        }
        let without_n =
            pooled_rms(&held_out_residuals_with_random_effects(&reduced, &search.data), &search.data);
        let gained = (without_n - with_n) / sample_noise_sd_n(&search.data);
        if gained >= MIN_RMS_CHANGE {
            None
        } else if gained < 0.0 {
            because("does not improve the prediction of held-out recordings")
        } else {
            because("changes the prediction of held-out recordings by less than 0.2 % of the noise")
        }
    };
    causes.par_iter().filter_map(assess).collect()
}

/// Whether the strengths are less significant than the search required, under long-memory noise and free geometry.
fn is_uncertain(cause: &Cause, nats_against_zero: &[(String, f64)], search: &Search) -> bool {
    let stage = search.stages.iter().find(|s| s.selected.is_some_and(|t| t.0 == cause.effect));
    let against = nats_against_zero.iter().find(|a| a.0 == cause.effect);
    stage.zip(against).is_some_and(|(stage, (_, nats))| *nats < stage.required_nats)
}

#[cfg(test)]
mod tests;
