//! How much recordings differ from one another, as a fit tells it.

use crate::events::{Event, scatter_of};
use crate::model::{Model, Scatter};
use crate::objective::{Residuals, nats};

/// A spread between insertions is at least this share of the typical one: it is not known to be nothing.
const LEAST_SPREAD: f64 = 0.1;

/// How ruptures scatter. In sets, as those of the layer do that scatter most: an instant that no drop of the force shows goes where the law
/// expects it, and would say that none scatters.
fn ruptures(model: &Model, events: &[Vec<Event>]) -> Scatter {
    let of = |layer: &dyn Fn(usize) -> bool| -> Scatter {
        let chosen = events.iter().flat_map(|e| e.iter().enumerate()).filter(|e| layer(e.0)).map(|e| *e.1);
        scatter_of(&chosen.collect::<Vec<_>>(), &model.scatter)
    };
    if !model.steady {
        return of(&|_| true);
    }
    let each = (0..model.layers()).map(|l| of(&|k| k == l));
    each.reduce(|a, b| Scatter { force: a.force.max(b.force), place_m: a.place_m.max(b.place_m), ..a })
        .unwrap_or(model.scatter)
}

/// Scatter between insertions as the events tell it.
pub(super) fn rescatter(model: &mut Model, at: &mut Residuals) {
    model.scatter = ruptures(model, &at.events);
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
