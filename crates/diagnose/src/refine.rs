//! From a coarse fit to one at full rate: ruptures where this model wants them, puncture forces where
//! the ruptures say, a membrane where it breaks.

use crate::fit::{Data, Fit, Residuals, fit, objective, residuals, rho};
use crate::forward::{self, Event};
use crate::model::{Model, Role};
use crate::noise::{Noise, median};
use crate::track::{NEVER, Track};

/// Nats of one recording.
fn nats(
    model: &Model,
    track: &Track,
    ruptures: &[usize],
    noise: &Noise,
    buffers: &mut (Vec<f64>, Vec<f64>, Vec<Event>),
) -> f64 {
    let Some(compiled) = model.compile() else { return f64::INFINITY };
    let (e, w, events) = buffers;
    e.resize(track.len(), 0.0);
    w.resize(track.len(), 0.0);
    forward::imposed(&compiled, track, ruptures, e, events);
    for (e, f) in e.iter_mut().zip(&track.f) {
        *e = f - *e;
    }
    noise.whiten(track, e, w);
    w.iter().map(|w| rho(*w)).sum::<f64>() + events.iter().map(|e| rho(e.u)).sum::<f64>()
}

/// Moves every rupture to the sample where this model fits best, by steps that double and halve. True
/// when one moved.
pub fn retime(model: &Model, data: &mut Data, wide: bool) -> bool {
    let mut moved = false;
    let tracks = data.tracks.clone();
    let mut buffers = (Vec::new(), Vec::new(), Vec::new());
    for (track, ruptures) in tracks.iter().zip(&mut data.ruptures) {
        let mut best = nats(model, track, ruptures, &data.noise, &mut buffers);
        for layer in 0..ruptures.len() {
            if ruptures[layer] == NEVER {
                continue;
            }
            let steps: &[i64] = if wide { &[1, 3, 9, 27, 81] } else { &[1, 4] };
            for sign in [-1_i64, 1] {
                let mut step = steps.len();
                let mut turns = 0;
                // From the widest step that helps to the narrowest.
                while step > 0 && turns < 30 {
                    turns += 1;
                    let to = ruptures[layer] as i64 + sign * steps[step - 1];
                    let low = if layer > 0 { ruptures[layer - 1] as i64 } else { 1 };
                    let high = ruptures
                        .get(layer + 1)
                        .filter(|r| **r != NEVER)
                        .map_or(track.len() as i64 - 1, |r| *r as i64);
                    if to >= low && to <= high {
                        let was = std::mem::replace(&mut ruptures[layer], to as usize);
                        let value = nats(model, track, ruptures, &data.noise, &mut buffers);
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
    }
    moved
}

/// Puts every puncture force where the elastic forces at the ruptures are, when that fits better.
pub fn seed_punctures(model: &mut Model, data: &Data) {
    let mut r = Residuals::default();
    if !residuals(model, data, &mut r) {
        return;
    }
    let layers = model.assumed.layers.len();
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
        let before = objective(model, &r);
        let mut trial = model.clone();
        trial.tissue.layers[layer].puncture_n = Some(median(&mut forces).clamp(low, high));
        let mut with = Residuals::default();
        if residuals(&trial, data, &mut with) && objective(&trial, &with) < before {
            *model = trial;
            r = with;
        }
    }
}

/// Tries values of the numbers in which the force is step-like.
fn walk_stepped(model: &mut Model, data: &Data) {
    let slots = model.slots();
    let Some(index) = slots.iter().position(|s| s.stepped) else { return };
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
}

/// Fits a model and moves its ruptures in turn.
#[must_use]
pub fn refine(model: &Model, data: &mut Data, rounds: usize, turns: usize, wide: bool) -> Option<Fit> {
    let enough = if turns < 6 { 0.2 } else { 0.02 };
    let mut model = model.clone();
    seed_punctures(&mut model, data);
    walk_stepped(&mut model, data);
    let mut best = fit(&model, data, turns, enough)?;
    for round in 0..rounds {
        let mut there = data.clone();
        let moved = retime(&best.model, &mut there, wide && round == 0);
        let mut next = best.model.clone();
        walk_stepped(&mut next, &there);
        seed_punctures(&mut next, &there);
        let Some(new) = fit(&next, &there, turns, enough) else { break };
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
