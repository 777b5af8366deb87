//! The forward model: force predicted by the tissue model and the measurement chain over the blocks of a recording, with imposed rupture
//! times.
//!
//! | module | contents |
//! |---|---|
//! | `time_stepper` | steps tissue model and measurement chain over spans of smooth motion, jumps and ruptures |
//! | `checkpoint`, `incremental_replay` | stored states, from which a similar model is replayed in part |

mod checkpoint;
mod incremental_replay;
#[cfg(test)]
mod tests;
mod time_stepper;

pub use incremental_replay::IncrementalReplay;

use crate::block_averages::BlockAverages;
use crate::model::{CompiledModel, NO_RUPTURE};
use crate::motion::MotionPiece;
use crate::rupture_likelihood::RuptureEvent;
use checkpoint::{Checkpoint, ReplayState};
use stylet_tissue::ForceLawState;
use time_stepper::{BlockSamples, TimeStepper, local_acceleration_mps2};

/// Predicted forces and rupture states of a recording.
#[derive(Clone, Debug, Default)]
pub struct ReplayResult {
    /// Predicted mean force of every block in N.
    pub force_n: Vec<f64>,
    /// One entry per layer.
    pub ruptures: Vec<RuptureEvent>,
}

/// Motion pieces between two checkpoints: a compromise between memory and the part that is replayed again.
const CHECKPOINT_PIECES: usize = 24;

/// Replays a model with ruptures at `rupture_times` (s; [`NO_RUPTURE`] for layers that do not rupture) into `out`.
pub fn replay_with_ruptures(
    model: &CompiledModel,
    blocks: &BlockAverages,
    pieces: &[MotionPiece],
    rupture_times: &[f64],
    out: &mut ReplayResult,
) {
    replay_visiting(model, blocks, pieces, rupture_times, out, &mut |_| true);
}

/// As [`replay_with_ruptures`]; `visit` as in [`advance`].
fn replay_visiting(
    model: &CompiledModel,
    blocks: &BlockAverages,
    pieces: &[MotionPiece],
    rupture_times: &[f64],
    out: &mut ReplayResult,
    visit: &mut impl FnMut(&TimeStepper) -> bool,
) {
    out.force_n.clear();
    out.force_n.resize(blocks.len(), 0.0);
    advance(model, blocks, pieces, rupture_times, initial_checkpoint(model, blocks), out, visit);
}

/// Initial state of a replay.
fn initial_checkpoint(model: &CompiledModel, blocks: &BlockAverages) -> Checkpoint {
    let intact = RuptureEvent { sample_step_s: blocks.sample_step_s, ..RuptureEvent::INITIAL };
    let state = ReplayState {
        piece: 0,
        ruptured_layers: 0,
        block: 0,
        force_integral: 0.0,
        threshold_n: f64::INFINITY,
        transient_until_s: f64::NEG_INFINITY,
        law: ForceLawState::default(),
        chain: model.has_measurement_chain.then(|| model.chain.start(0.0)),
        broken: vec![false; model.break_positions_m.len()],
    };
    Checkpoint { state, ruptures: vec![intact; model.puncture_n.len()] }
}

/// Continues from a checkpoint; `visit` is called every [`CHECKPOINT_PIECES`] pieces and ends the replay by
/// returning `false`.
fn advance(
    model: &CompiledModel,
    blocks: &BlockAverages,
    pieces: &[MotionPiece],
    rupture_times: &[f64],
    from: Checkpoint,
    out: &mut ReplayResult,
    visit: &mut impl FnMut(&TimeStepper) -> bool,
) {
    out.ruptures = from.ruptures;
    let mut stepper = TimeStepper {
        model,
        state: from.state,
        ruptures: &mut out.ruptures,
        sample_step_s: blocks.sample_step_s,
        samples: BlockSamples::default(),
    };
    let end_s = pieces.last().map_or(0.0, |p| p.end_s);
    for (index, piece) in pieces.iter().enumerate().skip(stepper.state.piece) {
        stepper.state.piece = index;
        if index % CHECKPOINT_PIECES == 0 && !visit(&stepper) {
            return;
        }
        if piece.block != stepper.state.block {
            let k = stepper.state.block as usize;
            out.force_n[k] = stepper.state.force_integral / (blocks.end_s[k] - blocks.start_s[k]);
            (stepper.state.block, stepper.state.force_integral) = (piece.block, 0.0);
        }
        if model.smears_jumps {
            stepper.samples = BlockSamples::new(blocks, piece.block as usize);
        }
        if let Some(before) = index.checked_sub(1).and_then(|k| pieces.get(k)) {
            stepper.cross_piece_boundary(before, piece);
        }
        let mut at = piece.start_s;
        loop {
            let rupture = rupture_times.get(stepper.state.ruptured_layers).copied().unwrap_or(NO_RUPTURE);
            let breaks = next_break(model, piece, at, &mut stepper.state.broken);
            let next = rupture.min(breaks);
            if next < piece.end_s || (rupture <= piece.end_s && piece.end_s >= end_s && rupture < NO_RUPTURE)
            {
                let next = next.max(at).min(piece.end_s);
                if next > at {
                    stepper.add_force(piece, at, next);
                    at = next;
                }
                if breaks <= rupture {
                    stepper.mark_jump(at);
                }
                if rupture <= breaks {
                    stepper.rupture(piece, pieces.get(index + 1), at, local_acceleration_mps2(pieces, index));
                }
                continue;
            }
            if piece.end_s > at {
                stepper.add_force(piece, at, piece.end_s);
            }
            break;
        }
    }
    let last = stepper.state.block as usize;
    if let Some(force_n) = out.force_n.get_mut(last) {
        *force_n = stepper.state.force_integral / (blocks.end_s[last] - blocks.start_s[last]);
    }
}

/// First time (s) from `at_s` to the end of the piece at which the tip reaches an unbroken break position, which is then marked as broken;
/// [`NO_RUPTURE`] if there is none.
fn next_break(model: &CompiledModel, piece: &MotionPiece, at_s: f64, broken: &mut [bool]) -> f64 {
    let mut first = (NO_RUPTURE, usize::MAX);
    for (k, place) in model.break_positions_m.iter().enumerate().filter(|(k, _)| !broken[*k]) {
        let (z0, z1) = (model.true_motion(piece, at_s).0, model.true_motion(piece, piece.end_s).0);
        if z1 >= *place {
            let share = if z1 > z0 { ((place - z0) / (z1 - z0)).clamp(0.0, 1.0) } else { 0.0 };
            let at = at_s + share * (piece.end_s - at_s);
            if at < first.0 {
                first = (at, k);
            }
        }
    }
    if first.1 < broken.len() {
        broken[first.1] = true;
    }
    // A time at the end of the piece does not cut it.
    if first.0 < piece.end_s { first.0 } else { NO_RUPTURE }
}

/// Times (s) at which the tip reaches the break positions of the model.
pub fn break_times(model: &CompiledModel, pieces: &[MotionPiece]) -> Vec<f64> {
    let mut broken = vec![false; model.break_positions_m.len()];
    let mut rupture_times = Vec::new();
    for piece in pieces {
        let mut at = piece.start_s;
        loop {
            at = next_break(model, piece, at, &mut broken);
            if at == NO_RUPTURE {
                break;
            }
            rupture_times.push(at);
        }
    }
    rupture_times
}

/// Times (s) at which the model ruptures by its own criterion, as they appear in the recorded force.
pub fn free_rupture_times(model: &CompiledModel, pieces: &[MotionPiece]) -> Vec<f64> {
    let mut state = ForceLawState::default();
    let mut rupture_times = vec![NO_RUPTURE; model.puncture_n.len()];
    for piece in pieces {
        for t in [0.75 * piece.start_s + 0.25 * piece.end_s, 0.25 * piece.start_s + 0.75 * piece.end_s] {
            let (z, v) = model.true_motion(piece, t);
            model.law.step(&mut state, t, z, v, |r| {
                if let Some(instant) = rupture_times.get_mut(r.layer - 1) {
                    *instant = r.time_s;
                }
            });
        }
    }
    rupture_times
}
