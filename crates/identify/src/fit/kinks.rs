//! Fits past kinks of the law.

use super::step::{moved, step};
use super::{Effort, FIRST_DAMPING, Fit, TRIES, Tangent, fit};
use crate::model::Model;
use crate::objective::{Data, residuals};
use rayon::prelude::*;
use stylet_stats::linear::dot;

/// A tangent that promises less than so many nats where no step gains is as good as level.
const LEVEL: f64 = 1.0;
/// A fit is freed of kinks at most so often.
const FREED: usize = 3;

/// As [`fit`], but not ended by a kink: where the tangent promises a gain and no step along it keeps that, those numbers go on alone whose
/// own steps gain. Laws that cling and slip have kinks: a derivative across one tells of neither side.
#[must_use]
pub fn fit_past_kinks(model: &Model, data: &Data, effort: Effort) -> Option<Fit> {
    let mut best = fit(model, data, effort)?;
    for _ in 0..FREED {
        let Some(freed) = freed(&best, data).and_then(|model| fit(&model, data, effort)) else { break };
        let gain = best.nats() - freed.nats();
        if gain > 0.0 {
            best = freed;
        }
        if gain < effort.enough {
            break;
        }
    }
    Some(best)
}

/// A likelier model near one from which no step along the whole tangent gains what it promises.
pub(super) fn freed(at: &Fit, data: &Data) -> Option<Model> {
    let tangent = Tangent::new(&at.model, data, &at.residuals);
    let whole = step(&at.model, data, &tangent, FIRST_DAMPING, |_| true)?;
    (0.5 * dot(&tangent.slope, &whole) >= LEVEL).then(|| trusting(at, data, &tangent))?
}

/// A likelier model by a step of those numbers that gain by a step of their own.
pub(super) fn trusting(at: &Fit, data: &Data, tangent: &Tangent) -> Option<Model> {
    let gains = |delta: &[f64]| {
        let next = moved(&at.model, data, tangent, delta, 1.0);
        residuals(&next, data).filter(|left| left.nats < at.nats()).map(|_| next)
    };
    let (ns, no) = (tangent.shared.len(), tangent.own.len());
    let kind = |i: usize| if i < ns { i } else { ns + (i - ns) % no };
    let alone = |k: usize| step(&at.model, data, tangent, FIRST_DAMPING, |i| kind(i) == k);
    let trusted: Vec<bool> =
        (0..ns + no).into_par_iter().map(|k| alone(k).and_then(|d| gains(&d)).is_some()).collect();
    let mut damping = FIRST_DAMPING;
    for _ in 0..TRIES {
        let delta = step(&at.model, data, tangent, damping, |i| trusted[kind(i)])?;
        if let Some(next) = gains(&delta) {
            return Some(next);
        }
        damping *= 8.0;
    }
    None
}
