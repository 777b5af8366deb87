//! The drop of a membrane, or of cutting that ends, may have been taken for that of a layer: the two exchanged.

use super::{Begun, Candidate, Search, choice};
use crate::fit::Data;
use crate::model::{Choice, Model};
use crate::noise::median;
use crate::refine::fit_seeded;
use crate::track::{NEVER, Track};
use rayon::prelude::*;

impl Search {
    /// Membranes and cutting forces at drops that were taken for a layer's rupture, with that layer's at a drop that nobody took.
    pub(super) fn exchanged(&self, stood: &Model, data: &Data) -> Vec<Begun> {
        let taken = stood.names();
        let choice = |id: &str, values: &[f64]| choice(id, values).filter(|c| !taken.contains(&c.info.id));
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
            // Cutting ends where the tip comes to a layer that is whole.
            tried.extend(choice("cutting_force", &[force]).map(|c| (c, there.clone())));
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
                Some((fit_seeded(stood.with(choice), &coarse, 4, 0.1)?, coarse, there.ruptures))
            })
            .collect();
        fits.into_iter().flatten().collect()
    }

    /// A membrane that breaks next to a layer: the candidate with the two drops given to the other each, where that
    /// fits better.
    pub(super) fn uncrossed(&self, candidate: Candidate) -> Candidate {
        const NEXT_TO_S: f64 = 0.6;
        let membranes = candidate.model.effects.iter().position(|e| e.info.id == "hidden_membrane");
        let Some(index) = membranes else { return candidate };
        let surface = candidate.model.assumed.surface_m;
        let mut best = candidate;
        for layer in 0..best.model.assumed.layers.len() {
            let [begins, slope, force] = *best.model.effects[index].values.as_slice() else { return best };
            let breaks = surface + begins + force / slope;
            let mut ruptures = best.ruptures.clone();
            let (mut depths, mut near) = (Vec::new(), 0);
            for (track, own) in self.data.tracks.iter().zip(&mut ruptures) {
                let (Some(was), Some(k)) =
                    (own.get(layer).copied(), track.z.iter().position(|z| *z >= breaks))
                else {
                    continue;
                };
                let at = track.before(k);
                let after = if layer > 0 { own[layer - 1] } else { f64::NEG_INFINITY };
                let before = own.get(layer + 1).copied().unwrap_or(NEVER);
                if (at - was).abs() < NEXT_TO_S && at > after && at < before {
                    near += 1;
                    depths.extend(track.z.get(track.first_from(was)));
                    own[layer] = at;
                }
            }
            if 2 * near <= ruptures.len() {
                continue;
            }
            let mut model = best.model.clone();
            model.effects[index].values[0] = (median(&mut depths) - surface - force / slope).max(1e-4);
            if let Some(new) = self.refitted(&model, &ruptures).filter(|new| new.nats < best.nats) {
                best = new;
            }
        }
        best
    }

    /// What broke was no membrane but a layer, whose rupture was sought elsewhere: the candidate without the membrane and
    /// with the rupture there, where that fits better.
    pub(super) fn unveiled(&self, candidate: Candidate) -> Candidate {
        let membranes = candidate.model.effects.iter().position(|e| e.info.id == "hidden_membrane");
        let Some(index) = membranes.filter(|_| candidate.model.effects.len() > 1) else { return candidate };
        let [begins, slope, force] = *candidate.model.effects[index].values.as_slice() else {
            return candidate;
        };
        let breaks = candidate.model.assumed.surface_m + begins + force / slope;
        let without = candidate.model.without(index);
        (0..candidate.model.assumed.layers.len())
            .filter_map(|layer| {
                let mut ruptures = candidate.ruptures.clone();
                for (track, own) in self.data.tracks.iter().zip(&mut ruptures) {
                    let at = track.before(track.z.iter().position(|z| *z >= breaks)?);
                    let after = if layer > 0 { own[layer - 1] } else { f64::NEG_INFINITY };
                    let before = own.get(layer + 1).copied().unwrap_or(NEVER);
                    *own.get_mut(layer).filter(|_| at > after && at < before)? = at;
                }
                self.refitted(&without, &ruptures)
            })
            .filter(|new| new.nats < candidate.nats)
            .min_by(|a, b| a.nats.total_cmp(&b.nats))
            .unwrap_or(candidate)
    }

    /// The ruptures with those of one layer at spare drops, the same depth in every recording and clear in one at
    /// least; `None` when there are none.
    pub(super) fn exchange_drops(&self, data: &Data, layer: usize) -> Option<Vec<Vec<f64>>> {
        const SAME_DEPTH_M: f64 = 2e-3;
        let z = |track: &Track, t: f64| track.z.get(track.first_from(t)).copied().unwrap_or(f64::INFINITY);
        let parts = || data.tracks.iter().zip(&data.ruptures).zip(&self.spare);
        let free = |ruptures: &[f64], t: f64| {
            let after = if layer > 0 { ruptures[layer - 1] } else { f64::NEG_INFINITY };
            t > after && t < ruptures.get(layer + 1).copied().unwrap_or(NEVER)
        };
        let depth = parts().find_map(|((track, ruptures), spare)| {
            spare.iter().find(|(t, clear)| *clear && free(ruptures, *t)).map(|(t, _)| z(track, *t))
        })?;
        let off = |track: &Track, t: f64| (z(track, t) - depth).abs();
        parts()
            .map(|((track, ruptures), spare)| {
                let there = spare.iter().map(|s| s.0).filter(|t| free(ruptures, *t));
                let nearest = there.min_by(|a, b| off(track, *a).total_cmp(&off(track, *b)))?;
                let mut new = ruptures.clone();
                new[layer] = nearest;
                (off(track, nearest) < SAME_DEPTH_M).then_some(new)
            })
            .collect()
    }
}
