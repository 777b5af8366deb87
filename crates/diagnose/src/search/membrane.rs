//! A membrane's drop may have been taken for that of a layer: the two exchanged.

use super::{Begun, Search, choice};
use crate::fit::{Data, fit};
use crate::model::{Choice, Model};
use crate::noise::median;
use crate::refine::seed_punctures;
use crate::track::NEVER;
use rayon::prelude::*;

impl Search {
    /// Membranes at drops that were taken for a layer's rupture, with that layer's at a drop that nobody took.
    pub(super) fn exchanged(&self, stood: &Model, data: &Data) -> Vec<Begun> {
        let mut tried: Vec<(Choice, Data)> = Vec::new();
        let surface = stood.assumed.surface_m;
        for layer in 0..stood.assumed.layers.len() {
            let Some(other) = self.exchange_drops(data, layer) else { continue };
            // Where the membrane broke, and what it let go.
            let (mut depths, mut forces) = (Vec::new(), Vec::new());
            for (track, ruptures) in data.tracks.iter().zip(&data.ruptures) {
                let k = track.first_from(ruptures[layer]);
                if (4..track.len().saturating_sub(4)).contains(&k) {
                    depths.push(track.z[k] - surface);
                    forces.push(track.f[k - 3] - track.f[k + 2]);
                }
            }
            let (breaks, force) = (median(&mut depths), median(&mut forces).max(0.02));
            let there = Data { ruptures: other, ..data.clone() };
            for stretch in [1e-3, 4e-3, 12e-3] {
                let values = [breaks - stretch, force / stretch, force];
                if let Some(choice) = choice("hidden_membrane", &values).filter(|_| values[0] > 0.0) {
                    tried.push((choice, there.clone()));
                }
            }
        }
        let fits: Vec<Option<Begun>> = tried
            .into_par_iter()
            .map(|(choice, there)| {
                let coarse = there.blocks(self.q, there.noise.blocks(self.q));
                let mut model = stood.with(choice);
                seed_punctures(&mut model, &coarse);
                Some((fit(&model, &coarse, 4, 0.1)?, coarse, there.ruptures))
            })
            .collect();
        fits.into_iter().flatten().collect()
    }

    /// The ruptures with those of one layer at spare drops, the same depth in every recording; `None` when
    /// there are none.
    pub(super) fn exchange_drops(&self, data: &Data, layer: usize) -> Option<Vec<Vec<f64>>> {
        const SAME_DEPTH_M: f64 = 2e-3;
        let mut depth: Option<f64> = None;
        let mut out = Vec::new();
        for ((track, ruptures), spare) in data.tracks.iter().zip(&data.ruptures).zip(&self.spare) {
            let mut new = ruptures.clone();
            let after = if layer > 0 { ruptures[layer - 1] } else { f64::NEG_INFINITY };
            let before = ruptures.get(layer + 1).copied().unwrap_or(NEVER);
            let z = |t: f64| track.z.get(track.first_from(t)).copied().unwrap_or(f64::INFINITY);
            let free = spare.iter().copied().filter(|t| *t > after && *t < before);
            let nearest = match depth {
                None => free.min_by(|a, b| a.total_cmp(b)),
                Some(d) => free.min_by(|a, b| (z(*a) - d).abs().total_cmp(&(z(*b) - d).abs())),
            };
            let at = nearest.filter(|t| depth.is_none_or(|d: f64| (z(*t) - d).abs() < SAME_DEPTH_M))?;
            depth = depth.or(Some(z(at)));
            new[layer] = at;
            out.push(new);
        }
        (!out.is_empty()).then_some(out)
    }
}
