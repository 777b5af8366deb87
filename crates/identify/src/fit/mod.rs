//! Maximum a posteriori fit of all parameters and rupture times by bounded Levenberg-Marquardt steps on the Huber loss.
//!
//! | module | contents |
//! |---|---|
//! | `jacobian_column`, `linearization` | Jacobian of the residuals and normal equations |
//! | `damped_step` | one damped step within bounds and its extrapolation |
//! | `nonsmooth` | continues a fit that stopped at a kink of the objective |
//! | `scatter_update` | standard deviations of random effects |

mod damped_step;
mod jacobian_column;
mod linearization;
mod nonsmooth;
mod scatter_update;
#[cfg(test)]
mod tests;

pub use damped_step::apply_step;
pub use jacobian_column::JacobianColumn;
pub use linearization::Linearization;
pub use nonsmooth::fit_nonsmooth;

use crate::likelihood::{FitData, Residuals, residuals};
use crate::model::Model;
use damped_step::{clamp_to_bounds, damped_step, extrapolation_factor};
use scatter_update::update_scatter;

/// A fitted model.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// Its residuals.
    pub residuals: Residuals,
}

impl Fit {
    /// Negative log posterior in nats under the noise of the data.
    #[must_use]
    pub fn nats(&self) -> f64 {
        self.residuals.nats
    }

    /// Root mean square residual in N over the compared blocks.
    #[must_use]
    pub fn rms_n(&self, data: &FitData) -> f64 {
        let (mut sum, mut n) = (0.0, 0.0);
        for (b, e) in data.recordings.iter().zip(&self.residuals.residual_n) {
            for k in (0..b.len()).filter(|k| b.used[*k]) {
                sum += e[k] * e[k];
                n += 1.0;
            }
        }
        (sum / f64::max(n, 1.0)).sqrt()
    }
}

/// Stopping criteria of a fit.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Largest number of steps.
    pub max_iterations: usize,
    /// A fit stops when a step gains less than this many nats.
    pub min_gain_nats: f64,
}

impl Effort {
    /// A short fit for ranking candidates.
    pub const SHORT: Self = Self { max_iterations: 3, min_gain_nats: 0.3 };
    /// A fit to convergence.
    pub const FULL: Self = Self { max_iterations: 14, min_gain_nats: 0.03 };
}

/// Levenberg-Marquardt damping of the first step, relative to the diagonal of the normal matrix.
const FIRST_DAMPING: f64 = 1e-4;
/// Damping values tried per linearization, each eight times the previous one: up to steps of a millionth.
const MAX_DAMPING_TRIALS: usize = 7;

/// Fits a model from its current parameters.
#[must_use]
pub fn fit(model: &Model, data: &FitData, effort: Effort) -> Option<Fit> {
    fit_if_below(model, data, effort, f64::INFINITY)
}

/// As [`fit`], but stops when the objective would stay above `target_nats` even if every remaining step gained as much as the last one.
#[must_use]
pub fn fit_if_below(model: &Model, data: &FitData, effort: Effort, target_nats: f64) -> Option<Fit> {
    descend(model, data, effort, target_nats, update_scatter)
}

/// As [`fit`]; if ruptures scatter between recordings, also fits from zero scatter and returns the better result. Under a wide scatter, a
/// small offset of a rupture has almost no cost, so the first fit can stop at a local minimum.
#[must_use]
pub fn fit_from_zero_scatter(model: &Model, data: &FitData, effort: Effort) -> Option<Fit> {
    let wide = fit(model, data, effort)?;
    let mut none = wide.model.clone();
    (none.scatter.rupture_force, none.scatter.rupture_depth_m) = (0.0, 0.0);
    if none.scatter == wide.model.scatter {
        return Some(wide);
    }
    let held = Effort { max_iterations: 2, ..effort };
    let sharp =
        descend(&none, data, held, f64::INFINITY, |_, _| ()).and_then(|f| fit(&f.model, data, effort));
    Some(sharp.filter(|f| f.nats() < wide.nats()).unwrap_or(wide))
}

/// Descends from `model`; `scatter` re-estimates the random-effect standard deviations after each step.
fn descend(
    model: &Model,
    data: &FitData,
    effort: Effort,
    target_nats: f64,
    scatter: impl Fn(&mut Model, &mut Residuals),
) -> Option<Fit> {
    let mut best = model.clone();
    clamp_to_bounds(&mut best);
    let mut at = residuals(&best, data)?;
    scatter(&mut best, &mut at);
    let mut damping = FIRST_DAMPING;
    for turn in 1..=effort.max_iterations {
        let linearization = Linearization::new(&best, data, &at);
        let before = at.nats;
        let mut gained = false;
        for _ in 0..MAX_DAMPING_TRIALS {
            let Some(delta) = damped_step(&best, data, &linearization, damping, |_| true) else { break };
            let next = apply_step(&best, data, &linearization, &delta, 1.0);
            let Some(left) = residuals(&next, data) else {
                damping *= 10.0;
                continue;
            };
            if left.nats < at.nats {
                let further = extrapolation_factor(&linearization, &delta, at.nats - left.nats)
                    .map(|share| apply_step(&best, data, &linearization, &delta, share))
                    .and_then(|next| residuals(&next, data).map(|left| (next, left)))
                    .filter(|(_, f)| f.nats < left.nats);
                (best, at) = further.unwrap_or((next, left));
                scatter(&mut best, &mut at);
                damping = (damping * 0.1).max(1e-9);
                gained = true;
                break;
            }
            damping = (damping * 8.0).max(1e-6);
        }
        let gain = before - at.nats;
        let reach = at.nats - gain * (effort.max_iterations - turn) as f64;
        if !gained || gain < effort.min_gain_nats || (turn > 1 && reach > target_nats) {
            break;
        }
    }
    Some(Fit { model: best, residuals: at })
}
