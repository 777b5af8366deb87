//! Starts for effects that show at ruptures alone.
//!
//! What such an effect does looks like scatter between insertions until it is taken out, and under a wide scatter no
//! derivative tells that: the strengths are tried one by one, each with puncture forces and scatter of its own.

use crate::propose::Start;
use stylet_identify::events::{Event, judge, scatter_of};
use stylet_identify::look::Look;
use stylet_identify::model::{Choice, Model, Role};
use stylet_identify::objective::{event_nats, replay};
use stylet_tissue::EffectInfo;

/// Strengths tried over the range in which a search starts, and again around the best of them.
const TRIED: usize = 21;

/// The best start of a one-parameter effect by the ruptures alone; `None` where it gains nothing.
#[must_use]
pub fn start(info: &'static EffectInfo, look: &Look) -> Option<Start> {
    let [parameter] = info.parameters else { return None };
    let stands = event_nats(&look.fit.model, &look.fit.residuals);
    let mut best: Option<(f64, f64)> = None;
    let (mut low, mut high) = parameter.search;
    for _ in 0..2 {
        let step = (high - low) / (TRIED - 1) as f64;
        for k in 0..TRIED {
            let x = low + step * k as f64;
            let Some(nats) = nats(look, &Choice::new(info, &[x])) else { continue };
            if best.is_none_or(|b| nats < b.1) {
                best = Some((x, nats));
            }
        }
        let at = best?.0;
        (low, high) = ((at - step).max(parameter.low), (at + step).min(parameter.high));
    }
    let (x, nats) = best?;
    let gained = stands - nats;
    (gained > 0.0).then(|| Start { choice: Choice::new(info, &[x]), nats: gained, visible: gained })
}

/// Nats of the ruptures where they are, with an effect, every puncture force as fits best, and the scatter that is left.
fn nats(look: &Look, choice: &Choice) -> Option<f64> {
    choice.effect().filter(|e| e.check().is_ok())?;
    let model = look.fit.model.with(choice.clone());
    let mut events: Vec<Vec<Event>> = (0..look.data.recordings())
        .map(|r| Some(replay(&model, look.data, r)?.events))
        .collect::<Option<_>>()?;
    for layer in 0..model.layers() {
        let factor = allowed(&model, layer, middle(look, &events, layer)?);
        for e in events.iter_mut().filter_map(|e| e.get_mut(layer)) {
            e.force = (1.0 + e.force) / factor - 1.0;
            e.force_rate /= factor;
        }
    }
    let all: Vec<Event> = events.into_iter().flatten().collect();
    let scatter = scatter_of(&all, &model.scatter);
    Some(all.iter().map(|e| judge(e, &scatter).nats).sum())
}

/// Elastic force over puncture force at the ruptures of a layer that the force has brought, in the mean; one without any.
fn middle(look: &Look, events: &[Vec<Event>], layer: usize) -> Option<f64> {
    let scatter = &look.fit.model.scatter;
    let by_force = |e: &Event| e.ruptured && e.force.is_finite() && judge(e, scatter).shares[0].powi(2) > 0.5;
    let shown = look.fit.residuals.events.iter().zip(events);
    let forces: Vec<f64> = shown
        .filter_map(|(was, now)| Some((was.get(layer)?, now.get(layer)?)))
        .filter(|(was, _)| by_force(was))
        .map(|(_, now)| 1.0 + now.force)
        .collect();
    let mean = forces.iter().sum::<f64>() / forces.len().max(1) as f64;
    if forces.is_empty() { Some(1.0) } else { (mean > 0.0).then_some(mean) }
}

/// A factor on a layer's puncture force that the belief allows.
fn allowed(model: &Model, layer: usize, factor: f64) -> f64 {
    let role = Role::Puncture(layer);
    let Some(n) = model.shared().into_iter().find(|n| n.role == role) else { return 1.0 };
    let now = model.get(role, 0);
    (factor * now).clamp(n.low, n.high) / now
}
