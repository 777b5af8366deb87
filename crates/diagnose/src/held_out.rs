//! How much better the extended model is on recordings that took no part in the fit.

use crate::fit::Data;
use crate::forward;
use crate::model::Model;
use crate::noise::Noise;
use crate::refine::fit_seeded;
use crate::search::{Candidate, Search};
use crate::track::Track;
use rayon::prelude::*;
use std::sync::Arc;

/// Samples by which a free rupture may be early or late without counting as an error.
const FORGIVEN: usize = 2;

/// Sums of squares and counts of one recording.
#[derive(Clone, Copy, Debug, Default)]
pub struct Before {
    /// Root mean square of the base law's residual in N.
    pub before_n: f64,
    /// Of the extended model's.
    pub after_n: f64,
    /// Samples.
    pub samples: usize,
}

/// Residual of a model with its own ruptures; near a rupture the best of the neighbouring samples counts.
#[must_use]
pub fn free_residual(model: &Model, track: &Track, noise: &Noise) -> Vec<f64> {
    let Some(compiled) = model.compile() else { return vec![f64::NAN; track.len()] };
    let mut out = vec![0.0; track.len()];
    let instants = forward::free(&compiled, track, &mut out);
    let mut e = out.clone();
    forward::departures(&compiled, track, &instants, noise, 0, &mut e);
    for instant in instants {
        let k = track.first_from(instant);
        for i in k.saturating_sub(FORGIVEN)..(k + FORGIVEN + 1).min(track.len()) {
            for j in i.saturating_sub(FORGIVEN)..(i + FORGIVEN + 1).min(track.len()) {
                let other = track.f[i] - out[j];
                if other.abs() < e[i].abs() {
                    e[i] = other;
                }
            }
        }
    }
    e
}

/// Root mean square over the samples in use.
#[must_use]
pub fn rms(track: &Track, e: &[f64]) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0_f64);
    for (e, used) in e.iter().zip(&track.used) {
        if *used {
            sum += e * e;
            n += 1.0;
        }
    }
    (sum / n.max(1.0)).sqrt()
}

/// Leaves out each recording in turn; with one recording the fit itself is reported.
#[must_use]
pub fn gain(search: &Search, base: &Candidate, best: &Candidate) -> Vec<Before> {
    let n = search.data.tracks.len();
    let one = |model: &Model, ruptures: &[Vec<f64>], left: usize| -> Vec<f64> {
        let model = if n < 2 { model.clone() } else { without(search, model, ruptures, left) };
        free_residual(&model, &search.data.tracks[left], &search.data.noise)
    };
    (0..n)
        .into_par_iter()
        .map(|left| {
            let track = &search.data.tracks[left];
            let before = one(&base.model, &base.ruptures, left);
            let after = if best.model.effects.is_empty() && best.model.given.len() == base.model.given.len() {
                before.clone()
            } else {
                one(&best.model, &best.ruptures, left)
            };
            Before { before_n: rms(track, &before), after_n: rms(track, &after), samples: track.len() }
        })
        .collect()
}

fn without(search: &Search, model: &Model, ruptures: &[Vec<f64>], left: usize) -> Model {
    let others = |k: &usize| *k != left;
    let n = search.data.tracks.len();
    let data = Data {
        tracks: Arc::new((0..n).filter(others).map(|k| search.data.tracks[k].clone()).collect()),
        ruptures: (0..n).filter(others).map(|k| ruptures[k].clone()).collect(),
        reach: Arc::new(Vec::new()),
        dead_n: search.data.dead_n,
        noise: search.data.noise,
    };
    // What averages over blocks would blur.
    let fast = model.effects.iter().any(|e| e.info.id == "periodic_interference")
        || model.compile().is_some_and(|m| m.feels_instants);
    let q = if fast { 1 } else { search.q };
    let coarse = data.blocks(q, data.noise.blocks(q));
    fit_seeded(model.clone(), &coarse, 5, 0.05).map_or_else(|| model.clone(), |f| f.model)
}
