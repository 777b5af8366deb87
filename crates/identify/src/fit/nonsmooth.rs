//! Continues a fit that stopped at a kink of the objective.

use super::damped_step::{apply_step, damped_step};
use super::{Effort, FIRST_DAMPING, Fit, Linearization, MAX_DAMPING_TRIALS, fit};
use crate::likelihood::{FitData, residuals};
use crate::model::Model;
use stylet_stats::linear_algebra::dot;
use stylet_stats::parallel::*;

/// Predicted gain (nats) of a full step below which a point counts as a minimum.
const MIN_PREDICTED_GAIN_NATS: f64 = 1.0;
/// Largest number of restarts from a kink.
const MAX_RESTARTS: usize = 3;

/// As [`fit`], but restarts where the linearization predicts a gain that no damped step achieves. A restart moves only the parameters whose
/// individual steps improve the objective: stick-slip and presliding friction have kinks, and the derivative on one side of a kink is wrong
/// on the other.
#[must_use]
pub fn fit_nonsmooth(model: &Model, data: &FitData, effort: Effort) -> Option<Fit> {
    let mut best = fit(model, data, effort)?;
    for _ in 0..MAX_RESTARTS {
        let Some(freed) = escape_kink(&best, data).and_then(|model| fit(&model, data, effort)) else { break };
        let gain = best.nats() - freed.nats();
        if gain > 0.0 {
            best = freed;
        }
        if gain < effort.min_gain_nats {
            break;
        }
    }
    Some(best)
}

/// A better model near a point at which the predicted gain of a full step is not achieved; `None` at a minimum.
pub(super) fn escape_kink(at: &Fit, data: &FitData) -> Option<Model> {
    let linearization = Linearization::new(&at.model, data, &at.residuals);
    let whole = damped_step(&at.model, data, &linearization, FIRST_DAMPING, |_| true)?;
    (0.5 * dot(&linearization.neg_gradient, &whole) >= MIN_PREDICTED_GAIN_NATS)
        .then(|| step_of_improving_parameters(at, data, &linearization))?
}

/// A better model by a joint step of the parameters whose individual steps improve the objective.
pub(super) fn step_of_improving_parameters(
    at: &Fit,
    data: &FitData,
    linearization: &Linearization,
) -> Option<Model> {
    let gains = |delta: &[f64]| {
        let next = apply_step(&at.model, data, linearization, delta, 1.0);
        residuals(&next, data).filter(|left| left.nats < at.nats()).map(|_| next)
    };
    let (ns, no) = (linearization.shared.len(), linearization.per_recording.len());
    let kind = |i: usize| if i < ns { i } else { ns + (i - ns) % no };
    let alone = |k: usize| damped_step(&at.model, data, linearization, FIRST_DAMPING, |i| kind(i) == k);
    let trusted: Vec<bool> =
        (0..ns + no).into_par_iter().map(|k| alone(k).and_then(|d| gains(&d)).is_some()).collect();
    let mut damping = FIRST_DAMPING;
    for _ in 0..MAX_DAMPING_TRIALS {
        let delta = damped_step(&at.model, data, linearization, damping, |i| trusted[kind(i)])?;
        if let Some(next) = gains(&delta) {
            return Some(next);
        }
        damping *= 8.0;
    }
    None
}
