//! Moves rupture times by direct search: a derivative covers only the block of the rupture.

use crate::likelihood::{FitData, ReplayCache};
use crate::model::{Model, NO_RUPTURE};
use stylet_stats::parallel::*;

/// Trial moves (blocks), in either direction.
const MOVES_BLOCKS: [f64; 6] = [0.5, 1.0, 2.0, 4.0, 9.0, 20.0];
/// Smallest gain (nats) for which a time is moved: above rounding errors.
const MIN_GAIN_NATS: f64 = 1e-6;

/// Moves every rupture time to the best of trial moves, the model's own rupture time and the given force drops (s, per recording). Returns
/// whether any time moved.
pub fn update_event_times(model: &mut Model, data: &FitData, drops: &[Vec<f64>]) -> bool {
    let fixed = model.clone();
    let moved: Vec<(Vec<f64>, bool)> = (0..data.recording_count())
        .into_par_iter()
        .map(|r| {
            let none = Vec::new();
            update_one_recording(&fixed, data, r, drops.get(r).unwrap_or(&none))
        })
        .collect();
    let any = moved.iter().any(|m| m.1);
    model.rupture_times_s = moved.into_iter().map(|m| m.0).collect();
    any
}

fn update_one_recording(model: &Model, data: &FitData, r: usize, drops: &[f64]) -> (Vec<f64>, bool) {
    let mut rupture_times = model.rupture_times_s[r].clone();
    let Some(mut cache) = ReplayCache::new(model, data, r) else { return (rupture_times, false) };
    let b = &data.recordings[r];
    let block_s = b.block_s();
    let (first, last) = b.span_s();
    let law_times = cache.free_rupture_times();
    let mut best = cache.nats_with_ruptures(model, data, r, &rupture_times);
    let mut moved = false;
    // All rupture times of the model at once, because an earlier rupture shifts the later ones.
    if law_times.iter().zip(&rupture_times).any(|(a, b)| a != b) {
        let value = cache.nats_with_ruptures(model, data, r, &law_times);
        if value < best - MIN_GAIN_NATS {
            (best, moved) = (value, true);
            rupture_times.clone_from(&law_times);
            cache.rebase(data, r, &rupture_times);
        }
    }
    for layer in 0..rupture_times.len() {
        let low = if layer > 0 { rupture_times[layer - 1] } else { first };
        if low == NO_RUPTURE {
            break;
        }
        let high = rupture_times.get(layer + 1).copied().unwrap_or(NO_RUPTURE).min(last);
        let now = rupture_times[layer];
        let mut tried: Vec<f64> = drops.to_vec();
        tried.push(law_times[layer]);
        if now < NO_RUPTURE {
            tried.extend(MOVES_BLOCKS.iter().flat_map(|m| [now - m * block_s, now + m * block_s]));
        }
        if layer + 1 == rupture_times.len() || rupture_times[layer + 1] == NO_RUPTURE {
            tried.push(NO_RUPTURE);
        }
        for t in tried {
            if (t < low || t > high) && t != NO_RUPTURE || t == rupture_times[layer] {
                continue;
            }
            let was = std::mem::replace(&mut rupture_times[layer], t);
            let value = cache.nats_with_ruptures(model, data, r, &rupture_times);
            if value < best - MIN_GAIN_NATS {
                (best, moved) = (value, true);
                cache.rebase(data, r, &rupture_times);
            } else {
                rupture_times[layer] = was;
            }
        }
    }
    (rupture_times, moved)
}

#[cfg(test)]
mod tests;
