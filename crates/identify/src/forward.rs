//! The forward model: the law replayed over the blocks of a recording with its ruptures at given instants.

use crate::blocks::Blocks;
use crate::events::Event;
use crate::model::{Compiled, NEVER};
use crate::motion::Piece;
use stylet_tissue::{Cell, LawState, MeasurementState, Strain};

/// Buffers of a replay.
#[derive(Clone, Debug, Default)]
pub struct Replayed {
    /// Predicted mean force of every block in N.
    pub f: Vec<f64>,
    /// One event per layer.
    pub events: Vec<Event>,
}

/// What is remembered on the way.
struct Walk<'a> {
    model: &'a Compiled,
    state: LawState,
    chain: Option<MeasurementState>,
    done: usize,
    events: &'a mut Vec<Event>,
    step_s: f64,
    /// Puncture force in N of the active layer at the span before.
    threshold_n: f64,
    /// Until then (s) the tip of a needle that gives is still on its way to where a jump sends it.
    restless_s: f64,
}

/// So long in s after a jump of the speed or a rupture the force of a needle that gives changes within a block as well.
const RESTLESS_S: f64 = 0.3;
/// A smaller change of the speed in m/s is no jump.
const LEAST_JUMP_MPS: f64 = 2e-5;
/// The two places in a span, as shares of it, whose mean is right for a cubic (Gauss and Legendre).
const TWO: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// A threshold that changes by this share from one span to the next has jumped.
const JUMPED: f64 = 0.01;

impl Walk<'_> {
    /// Law and chain over a span of smooth motion: mean force times the span.
    fn span(&mut self, piece: &Piece, from_s: f64, to_s: f64) -> f64 {
        let t = 0.5 * (from_s + to_s);
        let total_n = if from_s < self.restless_s {
            TWO.iter().map(|share| self.stand(piece, from_s + share * (to_s - from_s))).sum::<f64>() / 2.0
        } else {
            self.stand(piece, t)
        };
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

    /// From one piece of smooth motion to the next: a needle that gives begins to follow another speed at that instant, and not in the
    /// middle between the blocks.
    fn pass(&mut self, before: &Piece, next: &Piece) {
        let jump_mps = (next.at(next.from_s).1 - before.at(before.to_s).1).abs();
        if self.model.law.bends() && jump_mps > LEAST_JUMP_MPS {
            self.stand(before, before.to_s);
            self.restless_s = before.to_s + RESTLESS_S;
        }
    }

    /// The rupture of the active layer at an instant.
    fn rupture(&mut self, piece: &Piece, after: Option<&Piece>, at_s: f64) {
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
                let mut then = f64::INFINITY;
                let v = next.v_mps * self.model.to_true;
                let mut peek = self.state;
                self.model.law.step_imposed(&mut peek, at_s, z, v, layer, |s| then = s.puncture_n);
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
            event.force_rate =
                if s.puncture_n.is_finite() { stiffness * tip_v.max(0.0) / s.puncture_n } else { 0.0 };
        }
        self.done += 1;
        if self.model.law.bends() {
            self.restless_s = at_s + RESTLESS_S;
        }
        // And just after: what the layer lets go.
        let after = &mut self.events[..];
        self.model.law.step_imposed(&mut self.state, at_s, z, v, self.done, |s| {
            if s.layer > layer + 1 {
                note(after, &s);
            }
        });
    }
}

/// Keeps the largest strain of every layer while it is active.
fn note(events: &mut [Event], s: &Strain) {
    let Some(event) = events.get_mut(s.layer - 1) else { return };
    if s.puncture_n.is_finite() && s.puncture_n > 0.0 {
        event.force = event.force.max(s.elastic_n / s.puncture_n - 1.0);
    }
    event.place_m = event.place_m.max(s.tip_m - s.far_m);
}

/// Replays a law with the ruptures at `instants` (s; [`NEVER`] for those that never were).
pub fn imposed(model: &Compiled, blocks: &Blocks, pieces: &[Piece], instants: &[f64], out: &mut Replayed) {
    let first = begin(model, blocks, out);
    go_on(model, blocks, pieces, instants, first, out, &mut |_| true);
}

/// Room for a replay, and where it begins.
fn begin(model: &Compiled, blocks: &Blocks, out: &mut Replayed) -> Saved {
    out.f.clear();
    out.f.resize(blocks.len(), 0.0);
    out.events.clear();
    out.events.resize(model.puncture_n.len(), Event { step_s: blocks.step_s, ..Event::UNSEEN });
    Saved {
        piece: 0,
        state: LawState::default(),
        chain: model.measures.then(|| model.chain.start(0.0)),
        done: 0,
        threshold_n: f64::INFINITY,
        restless_s: f64::NEG_INFINITY,
        broken: vec![false; model.breaks_m.len()],
        block: 0,
        sum: 0.0,
        events: out.events.clone(),
    }
}

/// All that a replay remembers before a piece.
#[derive(Clone, Debug)]
struct Saved {
    piece: usize,
    state: LawState,
    chain: Option<MeasurementState>,
    done: usize,
    threshold_n: f64,
    restless_s: f64,
    broken: Vec<bool>,
    block: u32,
    sum: f64,
    events: Vec<Event>,
}

/// Where a replay stands before a piece.
struct Here<'a, 'b> {
    piece: usize,
    walk: &'a Walk<'b>,
    broken: &'a [bool],
    block: u32,
    sum: f64,
}

impl Here<'_, '_> {
    fn saved(&self) -> Saved {
        Saved {
            piece: self.piece,
            state: self.walk.state,
            chain: self.walk.chain.clone(),
            done: self.walk.done,
            threshold_n: self.walk.threshold_n,
            restless_s: self.walk.restless_s,
            broken: self.broken.to_vec(),
            block: self.block,
            sum: self.sum,
            events: self.walk.events.clone(),
        }
    }

    /// Whether everything from here on is the same.
    fn leads_on_like(&self, other: &Saved) -> bool {
        let walk = self.walk;
        self.piece == other.piece
            && walk.done == other.done
            && self.block == other.block
            && self.sum == other.sum
            && walk.threshold_n == other.threshold_n
            && walk.restless_s == other.restless_s
            && walk.state == other.state
            && walk.chain == other.chain
            && self.broken == other.broken
            && walk.events.get(walk.done..) == other.events.get(other.done..)
    }
}

/// Pieces from one saved state to the next.
const EVERY: usize = 24;

/// A replay with what it remembered on the way: neighbours of its model need only the part that differs.
#[derive(Clone, Debug, Default)]
pub struct Track {
    replayed: Replayed,
    saved: Vec<Saved>,
    instants: Vec<f64>,
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
    fn first_difference(&self, was: &Compiled, now: &Compiled, pieces: &[Piece], instants: &[f64]) -> usize {
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
fn done_with(was: &Compiled, now: &Compiled) -> usize {
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

/// Goes on from a saved state; `visit` is called every [`EVERY`] pieces and ends it by `false`.
fn go_on(
    model: &Compiled,
    blocks: &Blocks,
    pieces: &[Piece],
    instants: &[f64],
    from: Saved,
    out: &mut Replayed,
    visit: &mut impl FnMut(&Here) -> bool,
) {
    let Saved {
        piece: first,
        state,
        chain,
        done,
        threshold_n,
        restless_s,
        mut broken,
        mut block,
        mut sum,
        events,
    } = from;
    out.events = events;
    let mut walk = Walk {
        model,
        state,
        chain,
        done,
        events: &mut out.events,
        step_s: blocks.step_s,
        threshold_n,
        restless_s,
    };
    let end_s = pieces.last().map_or(0.0, |p| p.to_s);
    for (index, piece) in pieces.iter().enumerate().skip(first) {
        if index % EVERY == 0 {
            let here = Here { piece: index, walk: &walk, broken: &broken, block, sum };
            if !visit(&here) {
                return;
            }
        }
        if piece.block != block {
            let k = block as usize;
            out.f[k] = sum / (blocks.to_s[k] - blocks.from_s[k]);
            (block, sum) = (piece.block, 0.0);
        }
        if let Some(before) = index.checked_sub(1).and_then(|k| pieces.get(k)) {
            walk.pass(before, piece);
        }
        let mut at = piece.from_s;
        loop {
            let rupture = instants.get(walk.done).copied().unwrap_or(NEVER);
            let breaks = next_break(model, piece, at, &mut broken);
            let next = rupture.min(breaks);
            if next < piece.to_s || (rupture <= piece.to_s && piece.to_s >= end_s && rupture < NEVER) {
                let next = next.max(at).min(piece.to_s);
                if next > at {
                    sum += walk.span(piece, at, next);
                    at = next;
                }
                if rupture <= breaks {
                    walk.rupture(piece, pieces.get(index + 1), at);
                }
                continue;
            }
            if piece.to_s > at {
                sum += walk.span(piece, at, piece.to_s);
            }
            break;
        }
    }
    if let Some(k) = Some(block as usize).filter(|k| *k < out.f.len()) {
        out.f[k] = sum / (blocks.to_s[k] - blocks.from_s[k]);
    }
}

/// When in a piece something of an effect's own breaks, from `at_s` on; it is then marked as broken.
fn next_break(model: &Compiled, piece: &Piece, at_s: f64, broken: &mut [bool]) -> f64 {
    let mut first = (NEVER, usize::MAX);
    for (k, place) in model.breaks_m.iter().enumerate().filter(|(k, _)| !broken[*k]) {
        let (z0, z1) = (piece.at(at_s).0 * model.to_true, piece.at(piece.to_s).0 * model.to_true);
        if z1 >= *place {
            let share = if z1 > z0 { ((place - z0) / (z1 - z0)).clamp(0.0, 1.0) } else { 0.0 };
            let at = at_s + share * (piece.to_s - at_s);
            if at < first.0 {
                first = (at, k);
            }
        }
    }
    if first.1 < broken.len() {
        broken[first.1] = true;
    }
    // Only an instant inside the piece cuts it.
    if first.0 < piece.to_s { first.0 } else { NEVER }
}

/// Replays with the law's own ruptures; returns the instants (s) at which they show in the recorded force.
pub fn free(model: &Compiled, pieces: &[Piece]) -> Vec<f64> {
    let mut state = LawState::default();
    let mut instants = vec![NEVER; model.puncture_n.len()];
    for piece in pieces {
        for t in [0.75 * piece.from_s + 0.25 * piece.to_s, 0.25 * piece.from_s + 0.75 * piece.to_s] {
            let (z, v) = piece.at(t);
            model.law.step(&mut state, t, z * model.to_true, v * model.to_true, |r| {
                if let Some(instant) = instants.get_mut(r.layer - 1) {
                    *instant = r.time_s;
                }
            });
        }
    }
    instants
}
