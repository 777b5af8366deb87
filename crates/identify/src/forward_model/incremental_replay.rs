//! Replays models that differ in one base parameter or rupture time, by reusing the unchanged part of a stored replay.

use super::checkpoint::Checkpoint;
use super::{ReplayResult, advance, replay_visiting, replay_with_ruptures};
use crate::block_averages::BlockAverages;
use crate::model::{CompiledModel, NO_RUPTURE};
use crate::motion::MotionPiece;

/// A replay with checkpoints. A model that differs in one parameter is replayed only where the result can differ.
#[derive(Clone, Debug, Default)]
pub struct IncrementalReplay {
    pub(super) result: ReplayResult,
    pub(super) checkpoints: Vec<Checkpoint>,
    pub(super) rupture_times_s: Vec<f64>,
}

impl IncrementalReplay {
    /// Replays the model and stores checkpoints.
    #[must_use]
    pub fn new(
        model: &CompiledModel,
        blocks: &BlockAverages,
        pieces: &[MotionPiece],
        rupture_times: &[f64],
    ) -> Self {
        let (mut result, mut checkpoints) = (ReplayResult::default(), Vec::new());
        replay_visiting(model, blocks, pieces, rupture_times, &mut result, &mut |here| {
            checkpoints.push(here.checkpoint());
            true
        });
        Self { result, checkpoints, rupture_times_s: rupture_times.to_vec() }
    }

    /// The result of [`replay_with_ruptures`] for `now`, which has the same effects and pieces as the model `was` of this replay but
    /// another base parameter or rupture time. Reuses the part before the first possible difference and the part after both states agree
    /// again.
    pub(crate) fn replay_neighbour(
        &self,
        was: &CompiledModel,
        now: &CompiledModel,
        blocks: &BlockAverages,
        pieces: &[MotionPiece],
        rupture_times: &[f64],
    ) -> ReplayResult {
        let first = self.first_difference(was, now, pieces, rupture_times);
        let at = self.checkpoints.partition_point(|s| s.state.piece <= first).saturating_sub(1);
        let mut out = self.result.clone();
        let Some(start) = self.checkpoints.get(at) else {
            replay_with_ruptures(now, blocks, pieces, rupture_times, &mut out);
            return out;
        };
        let done_with = ruptures_until_equal(was, now);
        // The states can agree again only after both rupture times have passed.
        let moved = self.rupture_times_s.iter().zip(rupture_times).filter(|(a, b)| a != b);
        let passed_s = moved.map(|(a, b)| a.max(*b)).fold(f64::NEG_INFINITY, f64::max);
        let mut same: Option<(usize, usize)> = None;
        let mut next = at;
        advance(now, blocks, pieces, rupture_times, start.clone(), &mut out, &mut |s| {
            let known = self.checkpoints.get(next);
            next += 1;
            // The first visit is the start itself, where the states agree trivially.
            let passed = pieces.get(s.state.piece).is_some_and(|p| p.start_s > passed_s);
            let agrees = passed
                && next > at + 1
                && s.state.ruptured_layers >= done_with
                && known.is_some_and(|k| s.continues_like(k));
            if agrees {
                same = Some((s.state.block as usize, s.state.ruptured_layers));
            }
            !agrees
        });
        if let Some((block, done)) = same {
            out.force_n[block..].copy_from_slice(&self.result.force_n[block..]);
            if let (Some(to), Some(from)) = (out.ruptures.get_mut(done..), self.result.ruptures.get(done..)) {
                to.copy_from_slice(from);
            }
        }
        out
    }

    /// Index of the first piece whose prediction can differ.
    pub(super) fn first_difference(
        &self,
        was: &CompiledModel,
        now: &CompiledModel,
        pieces: &[MotionPiece],
        rupture_times: &[f64],
    ) -> usize {
        let mut first = pieces.len();
        let of = |t: f64| pieces.partition_point(|p| p.end_s < t).saturating_sub(1);
        for (a, b) in self.rupture_times_s.iter().zip(rupture_times).filter(|(a, b)| a != b) {
            first = first.min(of(a.min(*b)));
        }
        let differs = was.law.slabs().iter().zip(now.law.slabs()).position(|(a, b)| a != b);
        if let Some(l) = differs {
            if !now.law.tip_follows_base() || was.true_over_recorded != now.true_over_recorded {
                return 0;
            }
            let front = was.law.slabs()[l].front_m.min(now.law.slabs()[l].front_m) - CONTACT_MARGIN_M;
            let reached = |p: &MotionPiece| {
                let half = 0.5 * (p.end_s - p.start_s);
                (p.position_m + p.velocity_mps.abs() * half + p.acceleration_mps2.abs() * half * half)
                    * now.true_over_recorded
                    >= front
            };
            first = first.min(pieces.iter().position(reached).unwrap_or(pieces.len()));
            // A layer is loaded from the rupture of the previous one on.
            if let Some(before) =
                l.checked_sub(1).and_then(|k| self.rupture_times_s.get(k)).filter(|t| **t < NO_RUPTURE)
            {
                first = first.min(of(*before));
            }
        }
        first
    }
}

/// Number of ruptures after which both models have the same force: stiffness and puncture force of a ruptured layer have no effect.
/// `usize::MAX` if they differ to the end.
pub(super) fn ruptures_until_equal(was: &CompiledModel, now: &CompiledModel) -> usize {
    let pairs = || was.law.slabs().iter().zip(now.law.slabs());
    let Some(last) = pairs().rposition(|(a, b)| a != b) else { return 0 };
    let lasting = pairs().any(|(a, b)| {
        a.front_m != b.front_m
            || a.thickness_m != b.thickness_m
            || a.friction_ns_per_m2 != b.friction_ns_per_m2
            || a.replaced_friction_share != b.replaced_friction_share
            // Tissue that sticks to the shaft is loaded through the layer's stiffness.
            || (a.replaced_friction_share > 0.0 && a != b)
    });
    if lasting || !now.law.tip_follows_base() { usize::MAX } else { last + 1 }
}

/// Margin (m) above the front of a layer within which it may already act, for the rounding of positions.
const CONTACT_MARGIN_M: f64 = 1e-5;
