//! Re-estimates the standard deviations of random effects after each step of a fit.

use crate::likelihood::{Residuals, neg_log_posterior};
use crate::model::{Model, Scatter};
use crate::rupture_likelihood::{RuptureEvent, estimate_rupture_scatter};

/// Lower bound of a standard deviation between recordings, as a share of the library's value: from a few recordings the maximum-likelihood
/// estimate can collapse to zero.
const MIN_SHARE_OF_LIBRARY_SD: f64 = 0.1;

/// Standard deviations of rupture force and depth. With fixed random-effect scatter, the maximum over layers is used: a rupture without a
/// visible force drop is placed where the model predicts it, and would bias the estimate to zero.
fn rupture_scatter(model: &Model, events: &[Vec<RuptureEvent>]) -> Scatter {
    let of = |layer: &dyn Fn(usize) -> bool| -> Scatter {
        let chosen = events.iter().flat_map(|e| e.iter().enumerate()).filter(|e| layer(e.0)).map(|e| *e.1);
        estimate_rupture_scatter(&chosen.collect::<Vec<_>>(), &model.scatter)
    };
    if !model.fixed_scatter {
        return of(&|_| true);
    }
    let each = (0..model.layers()).map(|l| of(&|k| k == l));
    each.reduce(|a, b| Scatter {
        rupture_force: a.rupture_force.max(b.rupture_force),
        rupture_depth_m: a.rupture_depth_m.max(b.rupture_depth_m),
        ..a
    })
    .unwrap_or(model.scatter)
}

/// Re-estimates the standard deviations between recordings and updates the objective.
pub(super) fn update_scatter(model: &mut Model, at: &mut Residuals) {
    model.scatter = rupture_scatter(model, &at.ruptures);
    let spread = |x: &dyn Fn(usize) -> f64, least: f64| {
        let n = model.per_recording.len().max(1) as f64;
        ((0..model.per_recording.len()).map(|r| x(r).powi(2)).sum::<f64>() / n).sqrt().max(least)
    };
    let (mut surface_m, mut friction) = (model.scatter.surface_m, model.scatter.ln_friction);
    if model.free.recording_surface {
        surface_m = spread(&|r| model.per_recording[r].surface_m, 1e-6);
    }
    if model.free.recording_friction {
        friction = spread(&|r| model.per_recording[r].ln_friction, 1e-4);
    }
    if model.fixed_scatter {
        at.nats = neg_log_posterior(model, at);
        return;
    }
    if model.free.recording_effects {
        for k in 0..model.varying_parameters().count() {
            let least = MIN_SHARE_OF_LIBRARY_SD * model.library_varying_sd(k);
            model.scatter.varying[k] = spread(&|r| model.per_recording[r].varying[k], least);
        }
    }
    (model.scatter.surface_m, model.scatter.ln_friction) = (surface_m, friction);
    at.nats = neg_log_posterior(model, at);
}
