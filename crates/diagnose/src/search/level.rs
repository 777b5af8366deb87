//! A layer gives way at about the same depth in all recordings: one that does not, or not at all, is tried
//! there.

use super::{Candidate, Search};
use crate::noise::median;
use crate::track::{NEVER, Track};

/// Ruptures of a layer that lie further apart (m) are looked at again.
const APART_M: f64 = 3e-3;

impl Search {
    /// The candidate with stray ruptures at the depth of the other recordings', where that fits better.
    pub(super) fn levelled(&self, candidate: Candidate) -> Candidate {
        let mut best = candidate;
        for layer in 0..best.model.assumed.layers.len() {
            for k in 0..self.data.tracks.len() {
                let Some(at) = self.stray(&best.ruptures, k, layer) else { continue };
                let mut ruptures = best.ruptures.clone();
                ruptures[k][layer] = at;
                if let Some(new) = self.refitted(&best.model, &ruptures).filter(|new| new.nats < best.nats) {
                    best = new;
                }
            }
        }
        best
    }

    /// The instant at which a recording first reaches the depth at which a layer gave way in the others, when its
    /// own rupture is far from there or was not seen.
    fn stray(&self, ruptures: &[Vec<f64>], k: usize, layer: usize) -> Option<f64> {
        let depth = |track: &Track, r: &[f64]| {
            let at = *r.get(layer)?;
            if at == NEVER { None } else { track.z.get(track.first_from(at)).copied() }
        };
        let track = &self.data.tracks[k];
        let own = depth(track, &ruptures[k]);
        let others = self.data.tracks.iter().zip(ruptures).enumerate().filter(|(j, _)| *j != k);
        let mut others: Vec<f64> = others.filter_map(|(_, (t, r))| depth(t, r)).collect();
        if others.len() < 2 {
            return None;
        }
        let usual = median(&mut others);
        if own.is_some_and(|own| (own - usual).abs() < APART_M) {
            return None;
        }
        let at = (1..track.len()).find(|i| track.z[*i] >= usual).map(|i| track.before(i))?;
        let after = if layer > 0 { ruptures[k][layer - 1] } else { f64::NEG_INFINITY };
        let before = ruptures[k].get(layer + 1).copied().unwrap_or(NEVER);
        (at > after && at < before).then_some(at)
    }
}
