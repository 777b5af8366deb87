//! How much recordings differ from one another, as a fit tells it.

use crate::events::scatter_of;
use crate::model::Model;
use crate::objective::{Residuals, nats};

/// A spread between insertions is at least this share of the typical one: it is not known to be nothing.
const LEAST_SPREAD: f64 = 0.1;

/// Scatter between insertions as the events tell it.
pub(super) fn rescatter(model: &mut Model, at: &mut Residuals) {
    let events: Vec<_> = at.events.iter().flatten().copied().collect();
    model.scatter = scatter_of(&events, &model.scatter);
    let spread = |x: &dyn Fn(usize) -> f64, least: f64| {
        let n = model.own.len().max(1) as f64;
        ((0..model.own.len()).map(|r| x(r).powi(2)).sum::<f64>() / n).sqrt().max(least)
    };
    let (mut surface_m, mut friction) = (model.scatter.surface_m, model.scatter.friction);
    if model.free.own_surface {
        surface_m = spread(&|r| model.own[r].surface_m, 1e-6);
    }
    if model.free.own_friction {
        friction = spread(&|r| model.own[r].friction, 1e-4);
    }
    if model.steady {
        at.nats = nats(model, at);
        return;
    }
    if model.free.own_effects {
        for k in 0..model.differing().count() {
            let least = LEAST_SPREAD * model.differing_said(k);
            model.scatter.differing[k] = spread(&|r| model.own[r].differing[k], least);
        }
    }
    (model.scatter.surface_m, model.scatter.friction) = (surface_m, friction);
    at.nats = nats(model, at);
}
