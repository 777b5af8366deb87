//! A replay whose neighbours need only the part that differs.

use super::saved::Saved;
use super::{Replayed, begin, go_on, imposed};
use crate::blocks::Blocks;
use crate::model::{Compiled, NEVER};
use stylet_record::motion::Piece;

/// A replay with what it remembered on the way: neighbours of its model need only the part that differs.
#[derive(Clone, Debug, Default)]
pub struct Track {
    pub(super) replayed: Replayed,
    pub(super) saved: Vec<Saved>,
    pub(super) instants: Vec<f64>,
}

impl Track {
    /// Replays a law and remembers.
    #[must_use]
    pub fn new(model: &Compiled, blocks: &Blocks, pieces: &[Piece], instants: &[f64]) -> Self {
        let mut track = Self { instants: instants.to_vec(), ..Self::default() };
        let first = begin(model, blocks, &mut track.replayed);
        let saved = &mut track.saved;
        go_on(model, blocks, pieces, instants, first, &mut track.replayed, &mut |here| {
            saved.push(here.saved());
            true
        });
        track
    }

    /// What [`imposed`] gives for a neighbour: the same effects and pieces, another number of the base law or instant. `was` is
    /// the model of the track. The part before a difference can show is taken over, and the part after both are the same again.
    #[must_use]
    pub fn neighbour(
        &self,
        was: &Compiled,
        now: &Compiled,
        blocks: &Blocks,
        pieces: &[Piece],
        instants: &[f64],
    ) -> Replayed {
        let first = self.first_difference(was, now, pieces, instants);
        let at = self.saved.partition_point(|s| s.piece <= first).saturating_sub(1);
        let mut out = self.replayed.clone();
        let Some(start) = self.saved.get(at) else {
            imposed(now, blocks, pieces, instants, &mut out);
            return out;
        };
        out.events.clone_from(&start.events);
        let done_with = done_with(was, now);
        // Before both instants have passed nothing has happened yet.
        let moved = self.instants.iter().zip(instants).filter(|(a, b)| a != b);
        let passed_s = moved.map(|(a, b)| a.max(*b)).fold(f64::NEG_INFINITY, f64::max);
        let mut same: Option<(usize, usize)> = None;
        let mut next = at;
        go_on(now, blocks, pieces, instants, start.clone(), &mut out, &mut |s| {
            let known = self.saved.get(next);
            next += 1;
            // The first one is the start itself: nothing has happened yet.
            let passed = pieces.get(s.piece).is_some_and(|p| p.from_s > passed_s);
            if passed
                && next > at + 1
                && s.walk.done >= done_with
                && known.is_some_and(|k| s.leads_on_like(k))
            {
                same = Some((s.block as usize, s.walk.done));
                return false;
            }
            true
        });
        if let Some((block, done)) = same {
            out.f[block..].copy_from_slice(&self.replayed.f[block..]);
            if let (Some(to), Some(from)) = (out.events.get_mut(done..), self.replayed.events.get(done..)) {
                to.copy_from_slice(from);
            }
        }
        out
    }

    /// The piece from which on a difference can show.
    pub(super) fn first_difference(
        &self,
        was: &Compiled,
        now: &Compiled,
        pieces: &[Piece],
        instants: &[f64],
    ) -> usize {
        let mut first = pieces.len();
        let of = |t: f64| pieces.partition_point(|p| p.to_s < t).saturating_sub(1);
        for (a, b) in self.instants.iter().zip(instants).filter(|(a, b)| a != b) {
            first = first.min(of(a.min(*b)));
        }
        let differs = was.law.slabs().iter().zip(now.law.slabs()).position(|(a, b)| a != b);
        if let Some(l) = differs {
            if !now.law.keeps_place() || was.to_true != now.to_true {
                return 0;
            }
            let front = was.law.slabs()[l].front_m.min(now.law.slabs()[l].front_m) - AHEAD_M;
            let reached = |p: &Piece| {
                let half = 0.5 * (p.to_s - p.from_s);
                (p.z_m + p.v_mps.abs() * half + p.a_mps2.abs() * half * half) * now.to_true >= front
            };
            first = first.min(pieces.iter().position(reached).unwrap_or(pieces.len()));
            // A layer is strained, if only by nothing, from the rupture of the one before.
            if let Some(before) = l.checked_sub(1).and_then(|k| self.instants.get(k)).filter(|t| **t < NEVER)
            {
                first = first.min(of(*before));
            }
        }
        first
    }
}

/// After so many ruptures two laws are the same: stiffness and puncture force of a layer that has given way are of the past.
pub(super) fn done_with(was: &Compiled, now: &Compiled) -> usize {
    let pairs = || was.law.slabs().iter().zip(now.law.slabs());
    let Some(last) = pairs().rposition(|(a, b)| a != b) else { return 0 };
    let lasting = pairs().any(|(a, b)| {
        a.front_m != b.front_m
            || a.thickness_m != b.thickness_m
            || a.friction_ns_per_m2 != b.friction_ns_per_m2
            || a.gripped != b.gripped
            // What clings to the shaft is dragged by the layer's own spring.
            || (a.gripped > 0.0 && a != b)
    });
    if lasting || !now.law.keeps_place() { usize::MAX } else { last + 1 }
}

/// A layer is felt at most so far in m before its front.
const AHEAD_M: f64 = 1e-5;
