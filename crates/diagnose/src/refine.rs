//! From a coarse fit to one at full rate: ruptures where this model wants them, puncture forces where
//! the ruptures say, a membrane where it breaks.

use crate::fit::{Data, Fit, Residuals, dead_zone, fit, fit_from, objective, residuals, rho};
use crate::forward::{self, Replay};
use crate::model::{Compiled, Model, Role};
use crate::noise::{Noise, median};
use crate::track::{NEVER, Track};
use rayon::prelude::*;

/// Seconds of a recording before a rupture that a move of it may reach back to.
const BEFORE_S: f64 = 1.3;
/// Seconds after it in which a move shows.
const AFTER_S: f64 = 2.0;

/// A piece of a recording around the rupture of one layer, replayed again and again from its start.
struct Window<'a> {
    model: &'a Compiled,
    track: &'a Track,
    noise: &'a Noise,
    dead_n: f64,
    layer: usize,
    from: usize,
    to: usize,
    start: Replay,
    e: Vec<f64>,
}

impl<'a> Window<'a> {
    fn new(model: &'a Compiled, track: &'a Track, data: &'a Data, ruptures: &[f64], layer: usize) -> Self {
        let from = track.first_from(ruptures[layer] - BEFORE_S - model.delay_s);
        let to = track.first_from(ruptures[layer] + AFTER_S);
        let mut start = Replay::start(model, track);
        for i in 0..from {
            start.step(model, track, ruptures, i);
        }
        let (noise, dead_n) = (&data.noise, data.dead_n);
        Self { model, track, noise, dead_n, layer, from, to, start, e: vec![0.0; to.saturating_sub(from)] }
    }

    /// Where a rupture may be moved to.
    fn holds(&self, at_s: f64) -> bool {
        let at = self.track.first_from(at_s - self.model.delay_s);
        at > self.from + 3 && self.track.first_from(at_s) + 3 < self.to
    }

    fn nats(&mut self, ruptures: &[f64], events: bool) -> f64 {
        let mut replay = self.start.clone();
        for (e, i) in self.e.iter_mut().zip(self.from..self.to) {
            *e = replay.step(self.model, self.track, ruptures, i);
        }
        forward::departures(self.model, self.track, ruptures, self.noise, self.from, &mut self.e);
        dead_zone(self.dead_n, &mut self.e);
        let mut nats = 0.0;
        for k in 2..self.e.len() {
            nats += rho(self.noise.one(self.track, self.from + k, [self.e[k], self.e[k - 1], self.e[k - 2]]));
        }
        let layers = self.layer..(self.layer + 2).min(if events { ruptures.len() } else { 0 });
        nats + layers
            .filter(|l| self.track.first_from(ruptures[*l]) < self.to)
            .map(|l| rho(replay.event(self.model, ruptures, l).u))
            .sum::<f64>()
    }
}

/// Steps in samples by which ruptures are moved: at first, later, and for models that feel where
/// between two samples a rupture is.
const WIDE: [f64; 5] = [1.0, 3.0, 9.0, 27.0, 81.0];
const NARROW: [f64; 2] = [1.0, 4.0];
const BETWEEN: [f64; 4] = [0.05, 0.1, 0.2, 0.4];

/// Moves every rupture to the instant where this model fits best, by steps that double and halve; with
/// `events` as far as the law's own rupture is near. True when one moved.
pub fn retime(model: &Model, data: &mut Data, wide: bool, events: bool) -> bool {
    let Some(compiled) = model.compile() else { return false };
    let mut steps: Vec<f64> = Vec::new();
    if compiled.feels_instants {
        steps.extend(BETWEEN);
    }
    steps.extend(if wide { &WIDE[..] } else { &NARROW[..] });
    let whole = Data { ruptures: Vec::new(), ..data.clone() };
    let mut ruptures = std::mem::take(&mut data.ruptures);
    let tracks = data.tracks.clone();
    let one = |(k, (track, ruptures)): (usize, (&Track, &mut Vec<f64>))| {
        retime_one(&compiled, &whole, (k, track), ruptures, &steps, events)
    };
    let moved: Vec<bool> = tracks.par_iter().zip(&mut ruptures).enumerate().map(one).collect();
    data.ruptures = ruptures;
    moved.contains(&true)
}

/// The same of one recording.
fn retime_one(
    compiled: &Compiled,
    whole: &Data,
    (k, track): (usize, &Track),
    ruptures: &mut [f64],
    steps: &[f64],
    events: bool,
) -> bool {
    let mut moved = false;
    for layer in 0..ruptures.len() {
        if ruptures[layer] == NEVER {
            continue;
        }
        let mut window = Window::new(compiled, track, whole, ruptures, layer);
        let mut best = window.nats(ruptures, events);
        let reach = whole.reach.get(k).and_then(|a| a.get(layer)).copied().unwrap_or(f64::INFINITY);
        let (first, last) = (ruptures[layer] - reach, ruptures[layer] + reach);
        let low = if layer > 0 { ruptures[layer - 1] } else { track.before(1) };
        let end = track.t.last().copied().unwrap_or(0.0);
        let high = ruptures.get(layer + 1).copied().unwrap_or(NEVER).min(end).min(last);
        let low = low.max(first);
        for sign in [-1.0, 1.0] {
            let mut step = steps.len();
            let mut turns = 0;
            // From the widest step that helps to the narrowest.
            while step > 0 && turns < 30 {
                turns += 1;
                let to = ruptures[layer] + sign * steps[step - 1] / track.sample_hz;
                if to >= low && to <= high && window.holds(to) {
                    let was = std::mem::replace(&mut ruptures[layer], to);
                    let value = window.nats(ruptures, events);
                    if value < best - 1e-9 {
                        best = value;
                        moved = true;
                        continue;
                    }
                    ruptures[layer] = was;
                }
                step -= 1;
            }
        }
    }
    moved
}

/// Puts every puncture force where the elastic forces at the ruptures are, when that fits better. Returns the
/// residuals of the model as it then is; `None` when it cannot be replayed.
pub fn seed_punctures(model: &mut Model, data: &Data) -> Option<Residuals> {
    let mut r = Residuals::default();
    if !residuals(model, data, &mut r) {
        return None;
    }
    let layers = model.assumed.layers.len();
    let events_alone = crate::columns::are_linear(model);
    for layer in 0..layers {
        let Some(assumed) = model.assumed.layers[layer].puncture_n else { continue };
        let mut forces: Vec<f64> = data
            .ruptures
            .iter()
            .enumerate()
            .filter(|(_, rupt)| rupt.get(layer).is_some_and(|k| *k != NEVER))
            .filter_map(|(k, _)| r.events.get(k * layers + layer))
            .map(|e| e.elastic_n / e.ratio)
            .collect();
        if forces.is_empty() {
            continue;
        }
        let (low, high) = (assumed * (1.0 - model.tolerance), assumed * (1.0 + model.tolerance));
        let mut trial = model.clone();
        let new = median(&mut forces).clamp(low, high);
        let old = model.tissue.layers[layer].puncture_n.unwrap_or(assumed);
        trial.tissue.layers[layer].puncture_n = Some(new);
        if events_alone {
            // Nothing but the layer's events and the prior change.
            let share = new / old - 1.0;
            let own = || r.events.iter().skip(layer).step_by(layers);
            let events: f64 = own().map(|e| rho(e.u_at(0.0, share)) - rho(e.u)).sum();
            let sd = model.tolerance * assumed;
            let drawn = 0.5 * (((new - assumed) / sd).powi(2) - ((old - assumed) / sd).powi(2));
            if events + drawn < 0.0 {
                *model = trial;
                r.events.iter_mut().skip(layer).step_by(layers).for_each(|e| *e = e.with_puncture(share));
            }
            continue;
        }
        let before = objective(model, &r);
        let mut with = Residuals::default();
        if residuals(&trial, data, &mut with) && objective(&trial, &with) < before {
            *model = trial;
            r = with;
        }
    }
    Some(r)
}

/// Fits a model after its puncture forces were put where the ruptures are.
#[must_use]
pub fn fit_seeded(mut model: Model, data: &Data, turns: usize, enough: f64) -> Option<Fit> {
    let at = seed_punctures(&mut model, data)?;
    fit_from(&model, data, at, turns, enough)
}

/// Tries values of the numbers in which the force is step-like; true when there are any.
fn walk_stepped(model: &mut Model, data: &Data) -> bool {
    let slots = model.slots();
    let Some(index) = slots.iter().position(|s| s.stepped) else { return false };
    let mut r = Residuals::default();
    let mut p = model.vector(&slots);
    let mut best = f64::INFINITY;
    for step in [0.0, 1e-3, -1e-3, 3e-4, -3e-4, 1e-4, -1e-4, 3e-5, -3e-5, 1e-5, -1e-5, 3e-6, -3e-6] {
        for _ in 0..8 {
            let mut q = p.clone();
            q[index] += step;
            let mut trial = model.clone();
            trial.set(&slots, &q);
            if !residuals(&trial, data, &mut r) {
                break;
            }
            let value = objective(&trial, &r);
            if value >= best {
                break;
            }
            best = value;
            p = q;
            *model = trial;
            if step == 0.0 {
                break;
            }
        }
    }
    true
}

/// Fits a model and moves its ruptures in turn.
#[must_use]
pub fn refine(model: &Model, data: &mut Data, rounds: usize, turns: usize, wide: bool) -> Option<Fit> {
    let enough = if turns < 6 { 0.2 } else { 0.02 };
    // What is stepped is walked after the puncture forces at first, before them later.
    let mut model = model.clone();
    let at = seed_punctures(&mut model, data)?;
    let mut best = if walk_stepped(&mut model, data) {
        fit(&model, data, turns, enough)?
    } else {
        fit_from(&model, data, at, turns, enough)?
    };
    for round in 0..rounds {
        let again = |events: bool| {
            let mut there = data.clone();
            let moved = retime(&best.model, &mut there, wide && round == 0, events);
            let mut next = best.model.clone();
            walk_stepped(&mut next, &there);
            Some((fit_seeded(next, &there, turns, enough)?, there, moved))
        };
        let Some((mut new, mut there, mut moved)) = again(true) else { break };
        // A puncture force and all the instants that it sets hold one another in place: where the force itself
        // tells the instants, they go first and the puncture force follows.
        if wide
            && round == 0
            && let Some(other) = again(false)
            && other.0.nats < new.nats
        {
            (new, there, moved) = other;
        }
        let gained = best.nats - new.nats;
        if gained > 0.0 {
            *data = there;
            best = new;
        }
        if !moved || gained < 0.05 {
            break;
        }
    }
    Some(best)
}

/// Fitted uncertainties: the covariance of the numbers by the curvature at the optimum.
#[must_use]
pub fn covariance_diagonal(model: &Model, data: &Data) -> Option<Vec<(Role, f64, f64)>> {
    use crate::fit::{jacobian, normal, solve};
    let (mut at, mut work) = (Residuals::default(), Residuals::default());
    if !residuals(model, data, &mut at) {
        return None;
    }
    let jac = jacobian(model, data, &at, &mut work, None);
    let (h, _) = normal(model, &jac, &at);
    let live: Vec<usize> = (0..h.len()).filter(|i| h[*i][*i] > 0.0 && !jac.slots[*i].stepped).collect();
    let sub: Vec<Vec<f64>> = live.iter().map(|&i| live.iter().map(|&j| h[i][j]).collect()).collect();
    let p = model.vector(&jac.slots);
    let mut out: Vec<(Role, f64, f64)> =
        jac.slots.iter().zip(&p).map(|(s, p)| (s.role, *p, f64::NAN)).collect();
    for (k, &i) in live.iter().enumerate() {
        let mut unit = vec![0.0; live.len()];
        unit[k] = 1.0;
        if let Some(x) = solve(&sub, &unit) {
            out[i].2 = x[k].max(0.0).sqrt();
        }
    }
    Some(out)
}
