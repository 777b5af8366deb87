//! Law and chain along the motion.

use crate::blocks::Blocks;
use crate::events::Event;
use crate::model::Compiled;
use stylet_record::motion::{LEAST_JUMP_MPS, Piece};
use stylet_tissue::{Cell, LawState, MeasurementState, Strain};

/// What is remembered on the way.
pub(super) struct Walk<'a> {
    pub(super) model: &'a Compiled,
    pub(super) state: LawState,
    pub(super) chain: Option<MeasurementState>,
    pub(super) done: usize,
    pub(super) events: &'a mut Vec<Event>,
    pub(super) step_s: f64,
    /// Puncture force in N of the active layer at the span before.
    pub(super) threshold_n: f64,
    /// Until then (s) the tip of a needle that gives, or a sensor that lags, is still on its way to where a jump sends it.
    pub(super) restless_s: f64,
    /// Where the samples of the block lie, if it may matter.
    pub(super) grid: Grid<'a>,
}

/// Where the samples of a block lie.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Grid<'a> {
    from_s: f64,
    to_s: f64,
    /// Their instants in s.
    samples: &'a [f64],
}

impl<'a> Grid<'a> {
    pub(super) fn new(blocks: &'a Blocks, k: usize) -> Self {
        let (from_s, to_s) = (blocks.from_s[k], blocks.to_s[k]);
        Self { from_s, to_s, samples: between(&blocks.raw_t, from_s, to_s) }
    }

    fn is(&self, from_s: f64, to_s: f64) -> bool {
        from_s <= self.from_s && to_s >= self.to_s
    }

    /// A sample's share of the block, in s.
    fn each_s(&self) -> f64 {
        (self.to_s - self.from_s) / self.samples.len() as f64
    }
}

/// Those of some instants that lie from one on to before another.
fn between(instants: &[f64], from_s: f64, to_s: f64) -> &[f64] {
    let first = instants.partition_point(|t| *t < from_s);
    let count = instants[first..].iter().take_while(|t| **t < to_s).count();
    &instants[first..first + count]
}

/// So long in s after a jump of the speed or a rupture the force of a needle that gives, or of a sensor that lags, changes within a block as well.
const RESTLESS_S: f64 = 0.3;
/// Neighbours whose speeds differ by less than this share are of one motion; a jump of the speed is more.
const ALIKE: f64 = 0.3;
/// A threshold that changes by this share from one span to the next has jumped.
const JUMPED: f64 = 0.01;

impl Walk<'_> {
    /// Law and chain over a span of smooth motion: mean force times the span.
    pub(super) fn span(&mut self, piece: &Piece, from_s: f64, to_s: f64) -> f64 {
        let fast = from_s < self.restless_s || !self.grid.is(from_s, to_s);
        if fast && !self.grid.samples.is_empty() {
            return self.sampled(piece, from_s, to_s);
        }
        let t = 0.5 * (from_s + to_s);
        let total_n = self.stand(piece, t);
        let span_s = to_s - from_s;
        let Some(chain) = &mut self.chain else { return total_n * span_s };
        let cell = Cell {
            time_s: t,
            span_s,
            samples: span_s / self.step_s,
            velocity_mps: piece.at(t).1 * self.model.to_true,
            acceleration_mps2: piece.a_mps2 * self.model.to_true,
            tissue_n: total_n,
        };
        self.model.chain.mean(chain, &cell) * span_s
    }

    /// Law and chain over a span in which the force changes from sample to sample: the sum of the samples, each times its share of the block.
    fn sampled(&mut self, piece: &Piece, from_s: f64, to_s: f64) -> f64 {
        let (mut at_s, mut sum) = (from_s, 0.0);
        let grid = self.grid;
        for sample_s in between(grid.samples, from_s, to_s) {
            sum += self.reading(piece, at_s, *sample_s);
            at_s = *sample_s;
        }
        self.reading(piece, at_s, to_s);
        sum * grid.each_s()
    }

    /// Law and chain from one instant to another: the force at that one.
    fn reading(&mut self, piece: &Piece, from_s: f64, to_s: f64) -> f64 {
        // What a lag makes of a force goes by its mean.
        let lags = self.model.chain.smears();
        let total_n = self.stand(piece, if lags { 0.5 * (from_s + to_s) } else { to_s });
        let Some(chain) = &mut self.chain else { return total_n };
        let cell = Cell {
            time_s: to_s,
            span_s: to_s - from_s,
            samples: 1.0,
            velocity_mps: piece.at(to_s).1 * self.model.to_true,
            acceleration_mps2: piece.a_mps2 * self.model.to_true,
            tissue_n: total_n,
        };
        self.model.chain.after(chain, &cell)
    }

    /// The law at an instant of a piece: its force in N.
    fn stand(&mut self, piece: &Piece, at_s: f64) -> f64 {
        let (z, v) = piece.at(at_s);
        let (z, v) = (z * self.model.to_true, v * self.model.to_true);
        let events = &mut self.events[..];
        let threshold = &mut self.threshold_n;
        let note = |s: Strain| {
            note(events, &s);
            *threshold = s.puncture_n;
        };
        self.state.set_base_acceleration(piece.a_mps2 * self.model.to_true);
        self.model.law.step_imposed(&mut self.state, at_s, z, v, self.done, note).total_n
    }

    /// From one piece of smooth motion to the next: a needle that gives begins to follow another speed at that instant, and what friction remembers of
    /// the way turns there, not in the middle between the blocks.
    pub(super) fn pass(&mut self, before: &Piece, next: &Piece) {
        let jump_mps = (next.at(next.from_s).1 - before.at(before.to_s).1).abs();
        if jump_mps <= LEAST_JUMP_MPS {
            return;
        }
        if self.model.law.bends() || before.v_mps * next.v_mps < 0.0 {
            self.stand(before, before.to_s);
        }
        self.jumps(before.to_s);
    }

    /// The force jumps, or would if nothing smeared it.
    pub(super) fn jumps(&mut self, at_s: f64) {
        if self.model.smears {
            self.restless_s = at_s + RESTLESS_S;
        }
    }

    /// The rupture of the active layer at an instant.
    pub(super) fn rupture(&mut self, piece: &Piece, after: Option<&Piece>, at_s: f64, gathers_mps2: f64) {
        let (z, v) = piece.at(at_s);
        let (z, v) = (z * self.model.to_true, v * self.model.to_true);
        let layer = self.done;
        let (mut strained, mut tip_v) = (None, v);
        // The force just before.
        let most = self.events.get(layer).map_or(f64::NEG_INFINITY, |e| e.force);
        let before = &mut self.events[..];
        self.model.law.step_imposed(&mut self.state, at_s, z, v, layer, |s| {
            note(before, &s);
            if s.layer == layer + 1 {
                strained = Some(s);
            }
        });
        let (law, state) = (&self.model.law, self.state);
        let threshold_n = |v_mps: f64| {
            let mut then = f64::INFINITY;
            law.step_imposed(&mut { state }, at_s, z, v_mps, layer, |s| then = s.puncture_n);
            then
        };
        // Where the threshold itself has jumped, with the speed, it passed the force on the way.
        if let (Some(s), Some(event)) = (strained, self.events.get_mut(layer))
            && s.puncture_n.is_finite()
        {
            let jumped = |to: f64, from: f64| (to / from - 1.0).abs() > JUMPED;
            if jumped(s.puncture_n, self.threshold_n) && most < 0.0 && event.force > 0.0 {
                event.force = 0.0;
            } else if let Some(next) = after.filter(|_| event.force < 0.0 && piece.to_s - at_s < self.step_s)
            {
                // The speed jumps within a sample of here: so may the threshold.
                let then = threshold_n(next.v_mps * self.model.to_true);
                if jumped(then, s.puncture_n) && s.elastic_n > then {
                    event.force = 0.0;
                }
            }
        }
        if self.state.tip_velocity_mps().is_finite() {
            tip_v = self.state.tip_velocity_mps();
        }
        if let (Some(s), Some(event)) = (strained, self.events.get_mut(layer)) {
            event.ruptured = true;
            event.elastic_n = s.elastic_n;
            event.place_rate = tip_v.max(0.0);
            let stiffness = self.model.stiffness.get(layer).copied().unwrap_or(0.0);
            // As the force rises and the threshold falls.
            event.force_rate = if s.puncture_n.is_finite() {
                let ahead_s = self.step_s;
                let (now, then) =
                    (threshold_n(v), threshold_n(v + gathers_mps2 * self.model.to_true * ahead_s));
                // Where it is no force any more, it does not tell.
                let falls = Some((now - then) / ahead_s).filter(|f| f.is_finite()).unwrap_or(0.0);
                (stiffness * tip_v.max(0.0) + falls).max(0.0) / s.puncture_n
            } else {
                0.0
            };
        }
        self.done += 1;
        self.jumps(at_s);
        // And just after: what the layer lets go.
        let after = &mut self.events[..];
        self.model.law.step_imposed(&mut self.state, at_s, z, v, self.done, |s| {
            if s.layer > layer + 1 {
                note(after, &s);
            }
        });
    }
}

/// How fast the base gathers speed around a piece: by the pieces beside it, where they are about as fast.
pub(super) fn gathers_mps2(pieces: &[Piece], index: usize) -> f64 {
    let Some(here) = pieces.get(index) else { return 0.0 };
    let alike = |p: &&Piece| (p.v_mps - here.v_mps).abs() < ALIKE * here.v_mps.abs();
    let before = index.checked_sub(1).and_then(|k| pieces.get(k)).filter(alike).unwrap_or(here);
    let after = pieces.get(index + 1).filter(alike).unwrap_or(here);
    let middle_s = |p: &Piece| 0.5 * (p.from_s + p.to_s);
    let between_s = middle_s(after) - middle_s(before);
    if between_s > 0.0 { (after.v_mps - before.v_mps) / between_s } else { here.a_mps2 }
}

/// Keeps the largest strain of every layer while it is active.
pub(super) fn note(events: &mut [Event], s: &Strain) {
    let Some(event) = events.get_mut(s.layer - 1) else { return };
    if s.puncture_n.is_finite() && s.puncture_n > 0.0 {
        event.force = event.force.max(s.elastic_n / s.puncture_n - 1.0);
    }
    event.place_m = event.place_m.max(s.tip_m - s.far_m);
}
