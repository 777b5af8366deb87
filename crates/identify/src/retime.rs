//! Ruptures moved to where a model wants them: a derivative sees only the block in which an instant lies.

use crate::model::{Model, NEVER};
use crate::objective::{Data, Trail};
use rayon::prelude::*;

/// Moves in blocks that are tried in either direction.
const MOVES: [f64; 6] = [0.5, 1.0, 2.0, 4.0, 9.0, 20.0];
/// A gain in nats that is worth a move.
const WORTH: f64 = 1e-6;

/// Moves every instant to the best of its neighbourhood, of the law's own rupture and of the drops given (s, per
/// recording). True when one moved.
pub fn retime(model: &mut Model, data: &Data, drops: &[Vec<f64>]) -> bool {
    let fixed = model.clone();
    let moved: Vec<(Vec<f64>, bool)> = (0..data.recordings())
        .into_par_iter()
        .map(|r| {
            let none = Vec::new();
            one(&fixed, data, r, drops.get(r).unwrap_or(&none))
        })
        .collect();
    let any = moved.iter().any(|m| m.1);
    model.instants = moved.into_iter().map(|m| m.0).collect();
    any
}

fn one(model: &Model, data: &Data, r: usize, drops: &[f64]) -> (Vec<f64>, bool) {
    let mut instants = model.instants[r].clone();
    let Some(mut trail) = Trail::new(model, data, r) else { return (instants, false) };
    let b = &data.blocks[r];
    let block_s = b.step_s * b.samples as f64;
    let (first, last) = b.span_s();
    let own = trail.own_instants();
    let mut best = trail.nats_at(model, data, r, &instants);
    let mut moved = false;
    // The law's own ruptures all at once: an earlier one carries the later ones along.
    if own.iter().zip(&instants).any(|(a, b)| a != b) {
        let value = trail.nats_at(model, data, r, &own);
        if value < best - WORTH {
            (best, moved) = (value, true);
            instants.clone_from(&own);
            trail.stand(data, r, &instants);
        }
    }
    for layer in 0..instants.len() {
        let low = if layer > 0 { instants[layer - 1] } else { first };
        if low == NEVER {
            break;
        }
        let high = instants.get(layer + 1).copied().unwrap_or(NEVER).min(last);
        let now = instants[layer];
        let mut tried: Vec<f64> = drops.to_vec();
        tried.push(own[layer]);
        if now < NEVER {
            tried.extend(MOVES.iter().flat_map(|m| [now - m * block_s, now + m * block_s]));
        }
        if layer + 1 == instants.len() || instants[layer + 1] == NEVER {
            tried.push(NEVER);
        }
        for t in tried {
            if (t < low || t > high) && t != NEVER || t == instants[layer] {
                continue;
            }
            let was = std::mem::replace(&mut instants[layer], t);
            let value = trail.nats_at(model, data, r, &instants);
            if value < best - WORTH {
                (best, moved) = (value, true);
                trail.stand(data, r, &instants);
            } else {
                instants[layer] = was;
            }
        }
    }
    (instants, moved)
}
