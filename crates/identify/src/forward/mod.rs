//! The forward model: the law replayed over the blocks of a recording with its ruptures at given instants.
//!
//! | module | what |
//! |---|---|
//! | `walk` | law and chain over spans of smooth motion, jumps and ruptures |
//! | `saved`, `track` | a replay that remembers, so that neighbours of its model need only what differs |

mod saved;
#[cfg(test)]
mod tests;
mod track;
mod walk;

pub use track::Track;

use crate::blocks::Blocks;
use crate::events::Event;
use crate::model::{Compiled, NEVER};
use saved::{Here, Saved};
use stylet_record::motion::Piece;
use stylet_tissue::LawState;
use walk::{Grid, Walk, gathers_mps2};

/// Buffers of a replay.
#[derive(Clone, Debug, Default)]
pub struct Replayed {
    /// Predicted mean force of every block in N.
    pub f: Vec<f64>,
    /// One event per layer.
    pub events: Vec<Event>,
}

/// Pieces from one saved state to the next.
const EVERY: usize = 24;

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
        grid: Grid::default(),
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
        if model.smears {
            walk.grid = Grid::new(blocks, block as usize);
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
                if breaks <= rupture {
                    walk.jumps(at);
                }
                if rupture <= breaks {
                    walk.rupture(piece, pieces.get(index + 1), at, gathers_mps2(pieces, index));
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

/// The instants (s) at which something of an effect's own breaks, one after the other.
pub fn breaks(model: &Compiled, pieces: &[Piece]) -> Vec<f64> {
    let mut broken = vec![false; model.breaks_m.len()];
    let mut instants = Vec::new();
    for piece in pieces {
        let mut at = piece.from_s;
        loop {
            at = next_break(model, piece, at, &mut broken);
            if at == NEVER {
                break;
            }
            instants.push(at);
        }
    }
    instants
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
