//! Negative log posterior of a model: Huber loss of whitened residuals, rupture terms, priors.

use crate::block_averages::BlockAverages;
use crate::forward_model::{
    IncrementalReplay, ReplayResult, break_times, free_rupture_times, replay_with_ruptures,
};
use crate::model::{CompiledModel, Model, NO_RUPTURE};
use crate::motion::MotionPiece;
use crate::noise::{Noise, NoiseSource, WhiteningPlan, huber_loss};
use crate::rupture_likelihood::{RuptureEvent, evaluate_rupture};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use stylet_stats::parallel::*;

/// Recordings in blocks with their noise model.
#[derive(Clone, Debug)]
pub struct FitData {
    /// The recordings.
    pub recordings: Arc<Vec<BlockAverages>>,
    /// The noise model.
    pub noise: Arc<Noise>,
    /// Lower bound of the noise in N, from the rounding of the recorded force.
    pub floor_n: f64,
    /// Whitening plan of each recording, computed on first use.
    plans: Arc<OnceLock<Vec<WhiteningPlan>>>,
    replayed: Arc<AtomicU64>,
}

impl FitData {
    /// Recordings with a noise model and the lower bound of its standard deviation.
    #[must_use]
    pub fn new(blocks: Arc<Vec<BlockAverages>>, noise: Noise, floor_n: f64) -> Self {
        Self {
            recordings: blocks,
            noise: Arc::new(noise),
            floor_n,
            plans: Arc::default(),
            replayed: Arc::default(),
        }
    }

    /// The same data, whose replayed blocks are counted in `replayed`.
    #[must_use]
    pub fn counted_in(self, replayed: &Arc<AtomicU64>) -> Self {
        Self { replayed: Arc::clone(replayed), ..self }
    }

    /// Normalised innovations of residuals `e` (N) of recording `r`; zero in blocks that are not compared.
    #[must_use]
    pub fn whiten(&self, r: usize, e: &[f64]) -> Vec<f64> {
        self.noise.whiten(&self.whitening_plans()[r], e)
    }

    /// Residuals (N) of recording `r` with normalised innovations `w`.
    #[must_use]
    pub fn unwhiten(&self, r: usize, w: &[f64]) -> Vec<f64> {
        self.noise.unwhiten(&self.whitening_plans()[r], w)
    }

    fn whitening_plans(&self) -> &[WhiteningPlan] {
        self.plans.get_or_init(|| self.recordings.iter().map(|b| self.noise.whitening_plan(b)).collect())
    }

    /// The same recordings with another noise model.
    #[must_use]
    pub fn with_noise(&self, noise: Noise) -> Self {
        Self { noise: Arc::new(noise), plans: Arc::default(), ..self.clone() }
    }

    /// Number of blocks replayed so far: a measure of cost that does not depend on the machine.
    #[must_use]
    pub fn blocks_replayed(&self) -> u64 {
        self.replayed.load(Ordering::Relaxed)
    }

    /// Adds to the count of replayed blocks.
    pub(crate) fn count_replayed(&self, blocks: u64) {
        self.replayed.fetch_add(blocks, Ordering::Relaxed);
    }

    /// The same recordings with the noise estimated from residuals.
    #[must_use]
    pub fn with_estimated_noise(&self, e: &[Vec<f64>], from: NoiseSource) -> Self {
        self.with_noise(Noise::estimate(&self.recordings, e, from, self.floor_n))
    }

    /// A subset of the recordings.
    #[must_use]
    pub fn subset(&self, which: &[usize]) -> Self {
        self.with_recordings(which.iter().map(|k| self.recordings[*k].clone()).collect())
    }

    /// Other recordings with the same noise model.
    #[must_use]
    pub fn with_recordings(&self, blocks: Vec<BlockAverages>) -> Self {
        Self { recordings: Arc::new(blocks), plans: Arc::default(), ..self.clone() }
    }

    /// The same recordings in blocks `m` times as long.
    #[must_use]
    pub fn coarsened(&self, m: usize) -> Self {
        self.with_recordings(self.recordings.par_iter().map(|b| b.coarsened(m)).collect())
    }

    /// Number of compared blocks.
    #[must_use]
    pub fn compared_block_count(&self) -> usize {
        self.recordings.iter().map(BlockAverages::compared_block_count).sum()
    }

    /// Number of recordings.
    #[must_use]
    pub fn recording_count(&self) -> usize {
        self.recordings.len()
    }
}

/// Residuals of a model.
#[derive(Clone, Debug, Default)]
pub struct Residuals {
    /// Recorded minus predicted force in N, per recording.
    pub residual_n: Vec<Vec<f64>>,
    /// Normalised innovations, per recording.
    pub innovations: Vec<Vec<f64>>,
    /// Ruptures, per recording and layer.
    pub ruptures: Vec<Vec<RuptureEvent>>,
    /// Negative log posterior in nats, without the normalisation of the noise density.
    pub nats: f64,
}

/// Motion pieces with velocity jumps placed as the model's delay and low-pass filters require.
#[must_use]
pub fn motion_pieces(model: &CompiledModel, blocks: &BlockAverages) -> Arc<Vec<MotionPiece>> {
    blocks.motion_pieces(model.smears_jumps, model.delay_s, model.jump_delay_s)
}

/// Predicts the force of one recording.
#[must_use]
pub fn replay(model: &Model, data: &FitData, r: usize) -> Option<ReplayResult> {
    let compiled = model.compile(r)?;
    let mut out = ReplayResult::default();
    let blocks = &data.recordings[r];
    replay_with_ruptures(
        &compiled,
        blocks,
        &motion_pieces(&compiled, blocks),
        &model.rupture_times_s[r],
        &mut out,
    );
    data.count_replayed(blocks.len() as u64);
    model.add_zero_steps(r, blocks, &mut out.force_n);
    out.force_n.iter().all(|f| f.is_finite()).then_some(out)
}

/// Adds the timing uncertainty of the model's break points to the block means: a break lies between two samples, but its depth, shared by
/// all recordings, can place it anywhere between them.
#[must_use]
pub fn with_break_uncertainty(model: &Model, data: &FitData) -> FitData {
    let falling = |(r, b): (usize, &BlockAverages)| {
        let falls = model.compile(r).map_or_else(Vec::new, |c| break_times(&c, &motion_pieces(&c, b)));
        b.clone().with_break_times(falls)
    };
    let blocks: Vec<BlockAverages> = data.recordings.par_iter().enumerate().map(falling).collect();
    let same = blocks.iter().zip(data.recordings.iter()).all(|(a, b)| a.extra_sd_n == b.extra_sd_n);
    if same { data.clone() } else { data.with_recordings(blocks) }
}

/// A replay of one recording with checkpoints, from which predictions of similar models are computed.
pub struct ReplayCache {
    compiled: CompiledModel,
    pieces: Arc<Vec<MotionPiece>>,
    incremental: IncrementalReplay,
}

impl ReplayCache {
    /// The cache of one recording.
    #[must_use]
    pub fn new(model: &Model, data: &FitData, r: usize) -> Option<Self> {
        let compiled = model.compile(r)?;
        let blocks = &data.recordings[r];
        let pieces = motion_pieces(&compiled, blocks);
        let replay_cache = IncrementalReplay::new(&compiled, blocks, &pieces, &model.rupture_times_s[r]);
        data.count_replayed(blocks.len() as u64);
        Some(Self { compiled, pieces, incremental: replay_cache })
    }

    /// As [`replay`], for a model that differs only in base parameters, geometry or a rupture time.
    #[must_use]
    pub fn replay(&self, model: &Model, data: &FitData, r: usize) -> Option<ReplayResult> {
        let compiled = model.compile(r)?;
        // On average half of the recording is replayed again.
        data.count_replayed(data.recordings[r].len() as u64 / 2);
        let mut out = self.incremental.replay_neighbour(
            &self.compiled,
            &compiled,
            &data.recordings[r],
            &self.pieces,
            &model.rupture_times_s[r],
        );
        model.add_zero_steps(r, &data.recordings[r], &mut out.force_n);
        out.force_n.iter().all(|f| f.is_finite()).then_some(out)
    }

    /// Rupture times (s) by the model's own criterion.
    #[must_use]
    pub fn free_rupture_times(&self) -> Vec<f64> {
        free_rupture_times(&self.compiled, &self.pieces)
    }

    /// Objective (nats) of the recording with other rupture times: loss of the residuals and rupture terms, without priors.
    #[must_use]
    pub fn nats_with_ruptures(&self, model: &Model, data: &FitData, r: usize, rupture_times: &[f64]) -> f64 {
        let b = &data.recordings[r];
        data.count_replayed(b.len() as u64 / 2);
        let mut now =
            self.incremental.replay_neighbour(&self.compiled, &self.compiled, b, &self.pieces, rupture_times);
        model.add_zero_steps(r, b, &mut now.force_n);
        let e: Vec<f64> = b.force_n.iter().zip(&now.force_n).map(|(y, f)| y - f).collect();
        let w = data.whiten(r, &e);
        let events: f64 = now.ruptures.iter().map(|e| evaluate_rupture(e, &model.scatter).nats).sum();
        let sum = w.iter().map(|w| huber_loss(*w)).sum::<f64>() + events;
        if sum.is_finite() { sum } else { NO_RUPTURE }
    }

    /// Rebuilds the cache at other rupture times.
    pub fn rebase(&mut self, data: &FitData, r: usize, rupture_times: &[f64]) {
        self.incremental =
            IncrementalReplay::new(&self.compiled, &data.recordings[r], &self.pieces, rupture_times);
    }
}

/// Residuals over all recordings; `None` when the model cannot be replayed.
#[must_use]
pub fn residuals(model: &Model, data: &FitData) -> Option<Residuals> {
    let mut all = Residuals::default();
    let one = |(r, b): (usize, &BlockAverages)| {
        let replayed = replay(model, data, r)?;
        let e: Vec<f64> = b.force_n.iter().zip(&replayed.force_n).map(|(y, f)| y - f).collect();
        let w = data.whiten(r, &e);
        Some((e, w, replayed.ruptures))
    };
    let each: Vec<Option<_>> = data.recordings.par_iter().enumerate().map(one).collect();
    for left in each {
        let (e, w, events) = left?;
        all.residual_n.push(e);
        all.innovations.push(w);
        all.ruptures.push(events);
    }
    all.nats = neg_log_posterior(model, &all);
    Some(all)
}

/// Negative log posterior in nats of given residuals.
pub(crate) fn neg_log_posterior(model: &Model, r: &Residuals) -> f64 {
    let mut sum: f64 = r.innovations.iter().map(|w| w.iter().map(|w| huber_loss(*w)).sum::<f64>()).sum();
    sum += rupture_nats(model, r);
    sum + prior_nats(model)
}

/// Rupture terms of the objective, in nats.
fn rupture_nats(model: &Model, r: &Residuals) -> f64 {
    r.ruptures.iter().flatten().map(|e| evaluate_rupture(e, &model.scatter).nats).sum()
}

/// Prior terms of the objective, in nats.
#[must_use]
pub fn prior_nats(model: &Model) -> f64 {
    let shared: f64 = model.shared_parameters().iter().map(|n| n.prior_nats(model.get(n.role, 0))).sum();
    let per_recording: f64 = model
        .recording_parameters()
        .iter()
        .filter(|n| n.prior_sd.is_finite())
        .map(|n| (0..model.per_recording.len()).map(|r| n.prior_nats(model.get(n.role, r))).sum::<f64>())
        .sum();
    shared + per_recording
}

#[cfg(test)]
mod tests;
