//! Starts for effects that show at ruptures alone.
//!
//! What such an effect does looks like scatter between insertions until it is taken out, and under a wide scatter no
//! derivative tells that: the strengths are tried one by one, each with puncture forces and scatter of its own.

use crate::propose::Start;
use rayon::prelude::*;
use stylet_identify::events::{Event, FORCE_GRID, judge, scatter_prior};
use stylet_identify::look::Look;
use stylet_identify::model::{Choice, Model, Role, Scatter};
use stylet_identify::objective::replay;
use stylet_tissue::EffectInfo;

/// Strengths tried over the range in which a search starts, and again around the best of them ...
const TRIED: usize = 21;
/// ... so often.
const PASSES: usize = 3;
/// A rupture says at most so many nats against a strength: where the speed jumps its instant is not known well enough.
const MOST_NATS: f64 = 12.0;

/// The best start of a one-parameter effect by the ruptures alone; `None` where it gains nothing.
#[must_use]
pub fn start(info: &'static EffectInfo, look: &Look) -> Option<Start> {
    let [parameter] = info.parameters else { return None };
    let stands = told(look, look.fit.model.clone())?.0;
    let mut best: Option<(f64, f64, Model)> = None;
    let (mut low, mut high) = parameter.search;
    for _ in 0..PASSES {
        let step = (high - low) / (TRIED - 1) as f64;
        let tried = (0..TRIED).into_par_iter().filter_map(|k| {
            let x = low + step * k as f64;
            let choice = Choice::new(info, &[x]);
            choice.effect().filter(|e| e.check().is_ok())?;
            let (nats, model) = told(look, look.fit.model.with(choice))?;
            Some((x, nats, model))
        });
        for one in tried.collect::<Vec<_>>() {
            if best.as_ref().is_none_or(|b| one.1 < b.1) {
                best = Some(one);
            }
        }
        let at = best.as_ref()?.0;
        (low, high) = ((at - step).max(parameter.low), (at + step).min(parameter.high));
    }
    let (x, nats, model) = best?;
    let gained = stands - nats;
    if gained <= 0.0 {
        return None;
    }
    Some(Start { choice: Choice::new(info, &[x]), nats: gained, visible: gained, model: Some(model) })
}

/// Nats of the ruptures where they are, with the puncture forces and the scatter that fit a model best, and the model that
/// has these.
fn told(look: &Look, mut model: Model) -> Option<(f64, Model)> {
    let events: Vec<Vec<Event>> = (0..look.data.recordings())
        .map(|r| Some(replay(&model, look.data, r)?.events))
        .collect::<Option<_>>()?;
    let layers: Vec<Layer> = (0..model.layers()).map(|l| Layer::new(&model, &events, l)).collect();
    let mut best: Option<(f64, Scatter, Vec<f64>)> = None;
    for force in FORCE_GRID {
        let scatter = Scatter { force, ..model.scatter };
        let told: Vec<(f64, f64)> = layers.iter().map(|l| l.best(&scatter)).collect();
        let nats = told.iter().map(|t| t.1).sum::<f64>() + scatter_prior(&scatter);
        if best.as_ref().is_none_or(|b| nats < b.0) {
            best = Some((nats, scatter, told.iter().map(|t| t.0).collect()));
        }
    }
    let (nats, scatter, factors) = best?;
    model.scatter = scatter;
    for (layer, factor) in factors.iter().enumerate() {
        let role = Role::Puncture(layer);
        model.set(role, 0, model.get(role, 0) * factor);
    }
    Some((nats, model))
}

/// A layer's events, and the factors on its puncture force that one of them asks for.
struct Layer {
    events: Vec<Event>,
    factors: Vec<f64>,
}

impl Layer {
    fn new(model: &Model, events: &[Vec<Event>], layer: usize) -> Self {
        let events: Vec<Event> = events.iter().filter_map(|e| e.get(layer).copied()).collect();
        let role = Role::Puncture(layer);
        let mut factors = vec![1.0];
        if let Some(n) = model.shared().into_iter().find(|n| n.role == role) {
            let now = model.get(role, 0);
            let asked = events.iter().filter(|e| e.ruptured && e.force.is_finite()).map(|e| 1.0 + e.force);
            factors.extend(asked.map(|f| (f * now).clamp(n.low, n.high) / now));
        }
        Self { events, factors }
    }

    /// The factor under which the events are likeliest, and their nats.
    fn best(&self, scatter: &Scatter) -> (f64, f64) {
        let nats = |factor: f64| -> f64 {
            let moved = |e: &Event| Event {
                force: (1.0 + e.force) / factor - 1.0,
                force_rate: e.force_rate / factor,
                ..*e
            };
            self.events.iter().map(|e| judge(&moved(e), scatter).nats.min(MOST_NATS)).sum()
        };
        let of = |factor: &f64| (*factor, nats(*factor));
        self.factors.iter().map(of).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((1.0, 0.0))
    }
}
