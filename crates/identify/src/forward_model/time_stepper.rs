//! Steps tissue model and measurement chain along the motion.

use super::checkpoint::{Checkpoint, ReplayState};
use crate::block_averages::BlockAverages;
use crate::model::CompiledModel;
use crate::motion::{MIN_JUMP_MPS, MotionPiece};
use crate::rupture_likelihood::RuptureEvent;
use stylet_tissue::{AveragingInterval, RuptureCriterion};

/// A running replay.
pub(super) struct TimeStepper<'a> {
    pub(super) model: &'a CompiledModel,
    pub(super) state: ReplayState,
    pub(super) ruptures: &'a mut Vec<RuptureEvent>,
    pub(super) sample_step_s: f64,
    /// Sample times of the current block if jumps are low-pass filtered, else empty.
    pub(super) samples: BlockSamples<'a>,
}

/// Sample times of a block.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BlockSamples<'a> {
    from_s: f64,
    to_s: f64,
    /// Sample times in s.
    time_s: &'a [f64],
}

impl<'a> BlockSamples<'a> {
    pub(super) fn new(blocks: &'a BlockAverages, k: usize) -> Self {
        let (from_s, to_s) = (blocks.start_s[k], blocks.end_s[k]);
        Self { from_s, to_s, time_s: between(&blocks.sample_time_s, from_s, to_s) }
    }

    fn covered_by(&self, from_s: f64, to_s: f64) -> bool {
        from_s <= self.from_s && to_s >= self.to_s
    }

    /// Time (s) that one sample represents in its block.
    fn share_s(&self) -> f64 {
        (self.to_s - self.from_s) / self.time_s.len() as f64
    }
}

/// The times within `[from_s, to_s)`.
fn between(times: &[f64], from_s: f64, to_s: f64) -> &[f64] {
    let first = times.partition_point(|t| *t < from_s);
    let count = times[first..].iter().take_while(|t| **t < to_s).count();
    &times[first..first + count]
}

/// Duration (s) of the transient after a velocity jump or rupture, in which a compliant needle or a lagging sensor is evaluated at every
/// sample instead of once per piece.
const TRANSIENT_S: f64 = 0.3;
/// Relative velocity difference up to which neighbouring pieces belong to one motion; a velocity jump is larger.
const SAME_MOTION_SHARE: f64 = 0.3;
/// Relative change of the puncture force between spans from which it counts as a jump.
const THRESHOLD_JUMP_SHARE: f64 = 0.01;

impl TimeStepper<'_> {
    pub(super) fn checkpoint(&self) -> Checkpoint {
        Checkpoint { state: self.state.clone(), ruptures: self.ruptures.clone() }
    }

    /// Whether this replay continues like one from `other`. The strain of ruptured layers has no further effect.
    pub(super) fn continues_like(&self, other: &Checkpoint) -> bool {
        let done = self.state.ruptured_layers;
        self.state == other.state && self.ruptures.get(done..) == other.ruptures.get(done..)
    }

    /// Adds a span of smooth motion to the integral of the force.
    pub(super) fn add_force(&mut self, piece: &MotionPiece, from_s: f64, to_s: f64) {
        self.state.force_integral += self.force_integral(piece, from_s, to_s);
    }

    /// Integral of the force over a span of smooth motion, in N s.
    fn force_integral(&mut self, piece: &MotionPiece, from_s: f64, to_s: f64) -> f64 {
        let fast = from_s < self.state.transient_until_s || !self.samples.covered_by(from_s, to_s);
        if fast && !self.samples.time_s.is_empty() {
            return self.sampled_force_integral(piece, from_s, to_s);
        }
        let t = 0.5 * (from_s + to_s);
        let total_n = self.law_force(piece, t);
        let span_s = to_s - from_s;
        let Some(chain) = &mut self.state.chain else { return total_n * span_s };
        let interval = averaging_interval(self.model, piece, t, span_s, total_n);
        let interval = AveragingInterval { samples: span_s / self.sample_step_s, ..interval };
        self.model.chain.mean_force(chain, &interval) * span_s
    }

    /// The same for a span in transient: sum over the samples, each times the time it represents.
    fn sampled_force_integral(&mut self, piece: &MotionPiece, from_s: f64, to_s: f64) -> f64 {
        let (mut at_s, mut sum) = (from_s, 0.0);
        let samples = self.samples;
        for sample_s in between(samples.time_s, from_s, to_s) {
            sum += self.force_at_sample(piece, at_s, *sample_s);
            at_s = *sample_s;
        }
        self.force_at_sample(piece, at_s, to_s);
        sum * samples.share_s()
    }

    /// Steps tissue model and measurement chain from one time to another; returns the force (N) at the latter.
    fn force_at_sample(&mut self, piece: &MotionPiece, from_s: f64, to_s: f64) -> f64 {
        // A first-order lag responds to the mean force over the interval.
        let lags = self.model.chain.has_lag();
        let total_n = self.law_force(piece, if lags { 0.5 * (from_s + to_s) } else { to_s });
        let Some(chain) = &mut self.state.chain else { return total_n };
        let interval = averaging_interval(self.model, piece, to_s, to_s - from_s, total_n);
        self.model.chain.force_at_end(chain, &interval)
    }

    /// Tissue force in N at a time of a piece.
    fn law_force(&mut self, piece: &MotionPiece, at_s: f64) -> f64 {
        let (z, v) = self.model.true_motion(piece, at_s);
        let ruptures = &mut self.ruptures[..];
        let ReplayState { law, threshold_n, ruptured_layers, .. } = &mut self.state;
        law.set_base_acceleration(piece.acceleration_mps2 * self.model.true_over_recorded);
        let record = |s: RuptureCriterion| {
            record_strain(ruptures, &s);
            *threshold_n = s.puncture_n;
        };
        self.model.law.step_imposed(law, at_s, z, v, *ruptured_layers, record).total_n
    }

    /// Crosses the border between two pieces. If the velocity jumps, the model is stepped exactly to the border, because a compliant needle
    /// or path-dependent friction changes its branch there.
    pub(super) fn cross_piece_boundary(&mut self, before: &MotionPiece, next: &MotionPiece) {
        let jump_mps = (next.at(next.start_s).1 - before.at(before.end_s).1).abs();
        if jump_mps <= MIN_JUMP_MPS {
            return;
        }
        if self.model.law.has_compliant_needle() || before.velocity_mps * next.velocity_mps < 0.0 {
            self.law_force(before, before.end_s);
        }
        self.mark_jump(before.end_s);
    }

    /// Marks the start of a transient if the force is low-pass filtered.
    pub(super) fn mark_jump(&mut self, at_s: f64) {
        if self.model.smears_jumps {
            self.state.transient_until_s = at_s + TRANSIENT_S;
        }
    }

    /// Rupture of the active layer.
    pub(super) fn rupture(
        &mut self,
        piece: &MotionPiece,
        after: Option<&MotionPiece>,
        at_s: f64,
        acceleration_mps2: f64,
    ) {
        let (z, v) = self.model.true_motion(piece, at_s);
        let layer = self.state.ruptured_layers;
        let (mut strained, mut tip_v) = (None, v);
        // Force just before.
        let excess_before = self.ruptures.get(layer).map_or(f64::NEG_INFINITY, |e| e.force_excess);
        let before = &mut self.ruptures[..];
        self.model.law.step_imposed(&mut self.state.law, at_s, z, v, layer, |s| {
            record_strain(before, &s);
            if s.layer == layer + 1 {
                strained = Some(s);
            }
        });
        let (law, state) = (&self.model.law, self.state.law);
        let threshold_n = |v_mps: f64| {
            let mut then = f64::INFINITY;
            law.step_imposed(&mut { state }, at_s, z, v_mps, layer, |s| then = s.puncture_n);
            then
        };
        // If the puncture force jumps with the velocity past the elastic force, the rupture is exactly at the threshold.
        if let (Some(s), Some(event)) = (strained, self.ruptures.get_mut(layer))
            && s.puncture_n.is_finite()
        {
            let jumped = |to: f64, from: f64| (to / from - 1.0).abs() > THRESHOLD_JUMP_SHARE;
            if jumped(s.puncture_n, self.state.threshold_n) && excess_before < 0.0 && event.force_excess > 0.0
            {
                event.force_excess = 0.0;
            } else if let Some(next) =
                after.filter(|_| event.force_excess < 0.0 && piece.end_s - at_s < self.sample_step_s)
            {
                // The velocity, and with it the puncture force, jumps within a sampling interval.
                let then = threshold_n(next.velocity_mps * self.model.true_over_recorded);
                if jumped(then, s.puncture_n) && s.elastic_n > then {
                    event.force_excess = 0.0;
                }
            }
        }
        if self.state.law.tip_velocity_mps().is_finite() {
            tip_v = self.state.law.tip_velocity_mps();
        }
        if let (Some(s), Some(event)) = (strained, self.ruptures.get_mut(layer)) {
            event.ruptured = true;
            event.elastic_n = s.elastic_n;
            event.depth_rate_mps = tip_v.max(0.0);
            let stiffness = self.model.stiffness_n_per_m.get(layer).copied().unwrap_or(0.0);
            // Rate of the elastic force minus rate of the puncture force.
            event.force_excess_rate = if s.puncture_n.is_finite() {
                let ahead_s = self.sample_step_s;
                let (now, then) = (
                    threshold_n(v),
                    threshold_n(v + acceleration_mps2 * self.model.true_over_recorded * ahead_s),
                );
                // An infinite puncture force gives no information about the rate.
                let threshold_fall = Some((now - then) / ahead_s).filter(|f| f.is_finite()).unwrap_or(0.0);
                (stiffness * tip_v.max(0.0) + threshold_fall).max(0.0) / s.puncture_n
            } else {
                0.0
            };
        }
        self.state.ruptured_layers += 1;
        self.mark_jump(at_s);
        // Strain of the deeper layers just after the release.
        let after = &mut self.ruptures[..];
        self.model.law.step_imposed(&mut self.state.law, at_s, z, v, self.state.ruptured_layers, |s| {
            if s.layer > layer + 1 {
                record_strain(after, &s);
            }
        });
    }
}

/// Input of the measurement chain for one sample in a span of `span_s`, at a time of a piece.
fn averaging_interval(
    model: &CompiledModel,
    piece: &MotionPiece,
    at_s: f64,
    span_s: f64,
    tissue_n: f64,
) -> AveragingInterval {
    let (position_m, velocity_mps) = model.true_motion(piece, at_s);
    AveragingInterval {
        time_s: at_s,
        span_s,
        samples: 1.0,
        position_m,
        velocity_mps,
        acceleration_mps2: piece.acceleration_mps2 * model.true_over_recorded,
        tissue_n,
    }
}

/// Acceleration (m/s²) of the base around a piece, from the velocities of neighbouring pieces of the same motion.
pub(super) fn local_acceleration_mps2(pieces: &[MotionPiece], index: usize) -> f64 {
    let Some(here) = pieces.get(index) else { return 0.0 };
    let same_motion = |p: &&MotionPiece| {
        (p.velocity_mps - here.velocity_mps).abs() < SAME_MOTION_SHARE * here.velocity_mps.abs()
    };
    let before = index.checked_sub(1).and_then(|k| pieces.get(k)).filter(same_motion).unwrap_or(here);
    let after = pieces.get(index + 1).filter(same_motion).unwrap_or(here);
    let middle_s = |p: &MotionPiece| 0.5 * (p.start_s + p.end_s);
    let between_s = middle_s(after) - middle_s(before);
    if between_s > 0.0 {
        (after.velocity_mps - before.velocity_mps) / between_s
    } else {
        here.acceleration_mps2
    }
}

/// Updates the largest strain of a layer while it is active.
pub(super) fn record_strain(ruptures: &mut [RuptureEvent], s: &RuptureCriterion) {
    let Some(event) = ruptures.get_mut(s.layer - 1) else { return };
    if s.puncture_n.is_finite() && s.puncture_n > 0.0 {
        event.force_excess = event.force_excess.max(s.elastic_n / s.puncture_n - 1.0);
    }
    event.depth_excess_m = event.depth_excess_m.max(s.tip_m - s.far_m);
}
