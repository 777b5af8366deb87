//! The likelihood of a model: whitened residuals, ruptures, priors.

use crate::blocks::Blocks;
use crate::events::{Event, judge};
use crate::forward::{Replayed, Track, free, imposed};
use crate::model::{Compiled, Model, NEVER, Number};
use crate::motion::Piece;
use crate::noise::{From, Laid, Noise, rho};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

/// Recordings in blocks and the noise by which they are judged.
#[derive(Clone, Debug)]
pub struct Data {
    /// The recordings.
    pub blocks: Arc<Vec<Blocks>>,
    /// The noise.
    pub noise: Arc<Noise>,
    /// The noise is nowhere less, in N: what the recorded force is rounded to leaves open.
    pub floor_n: f64,
    /// How each recording is whitened.
    laid: Arc<OnceLock<Vec<Laid>>>,
    work: Arc<AtomicU64>,
}

impl Data {
    /// Recordings judged by a noise that is nowhere less than `floor_n`.
    #[must_use]
    pub fn new(blocks: Arc<Vec<Blocks>>, noise: Noise, floor_n: f64) -> Self {
        Self { blocks, noise: Arc::new(noise), floor_n, laid: Arc::default(), work: Arc::default() }
    }

    /// Normalised innovations of residuals `e` (N) of recording `r`; blocks that are not compared give zero.
    #[must_use]
    pub fn whiten(&self, r: usize, e: &[f64]) -> Vec<f64> {
        self.noise.whiten(&self.laid()[r], e)
    }

    /// Residuals (N) of recording `r` whose normalised innovations are `w`.
    #[must_use]
    pub fn colour(&self, r: usize, w: &[f64]) -> Vec<f64> {
        self.noise.colour(&self.laid()[r], w)
    }

    fn laid(&self) -> &[Laid] {
        self.laid.get_or_init(|| self.blocks.iter().map(|b| self.noise.laid(b)).collect())
    }

    /// The same recordings judged by another noise.
    #[must_use]
    pub fn with_noise(&self, noise: Noise) -> Self {
        Self { noise: Arc::new(noise), laid: Arc::default(), ..self.clone() }
    }

    /// Blocks replayed so far for these recordings, under whatever noise: what a diagnosis costs, the same on every machine.
    #[must_use]
    pub fn work(&self) -> u64 {
        self.work.load(Ordering::Relaxed)
    }

    /// So many more blocks were replayed.
    pub fn worked(&self, blocks: u64) {
        self.work.fetch_add(blocks, Ordering::Relaxed);
    }

    /// The same recordings judged by the noise that residuals tell.
    #[must_use]
    pub fn judged_by(&self, e: &[Vec<f64>], from: From) -> Self {
        self.with_noise(Noise::estimate(&self.blocks, e, from, self.floor_n))
    }

    /// Some of the recordings.
    #[must_use]
    pub fn only(&self, which: &[usize]) -> Self {
        self.on(which.iter().map(|k| self.blocks[*k].clone()).collect())
    }

    /// Other recordings judged by the same noise.
    #[must_use]
    pub fn on(&self, blocks: Vec<Blocks>) -> Self {
        Self { blocks: Arc::new(blocks), laid: Arc::default(), ..self.clone() }
    }

    /// Number of blocks compared.
    #[must_use]
    pub fn compared(&self) -> usize {
        self.blocks.iter().map(|b| b.used.iter().filter(|u| **u).count()).sum()
    }

    /// Number of recordings.
    #[must_use]
    pub fn recordings(&self) -> usize {
        self.blocks.len()
    }
}

/// What a model leaves.
#[derive(Clone, Debug, Default)]
pub struct Residuals {
    /// Recorded less predicted force in N, per recording.
    pub e: Vec<Vec<f64>>,
    /// Normalised innovations.
    pub w: Vec<Vec<f64>>,
    /// Events, per recording and layer.
    pub events: Vec<Vec<Event>>,
    /// Negative logarithmic likelihood with priors, in nats, but for the noise's own normalisation.
    pub nats: f64,
}

/// The pieces of smooth motion that a model sees.
#[must_use]
pub fn pieces(model: &Compiled, blocks: &Blocks) -> Arc<Vec<Piece>> {
    blocks.pieces_seen(model.smears, model.delay_s, model.placed_s)
}

/// Replays one recording.
#[must_use]
pub fn replay(model: &Model, data: &Data, r: usize) -> Option<Replayed> {
    let compiled = model.compile(r)?;
    let mut out = Replayed::default();
    let blocks = &data.blocks[r];
    imposed(&compiled, blocks, &pieces(&compiled, blocks), &model.instants[r], &mut out);
    data.worked(blocks.len() as u64);
    out.f.iter().all(|f| f.is_finite()).then_some(out)
}

/// A replay of a model with what it remembered, per recording: what neighbours of the model are computed from.
pub struct Trail {
    compiled: Compiled,
    seen: Arc<Vec<Piece>>,
    track: Track,
}

impl Trail {
    /// The trail of one recording.
    #[must_use]
    pub fn new(model: &Model, data: &Data, r: usize) -> Option<Self> {
        let compiled = model.compile(r)?;
        let blocks = &data.blocks[r];
        let seen = pieces(&compiled, blocks);
        let track = Track::new(&compiled, blocks, &seen, &model.instants[r]);
        data.worked(blocks.len() as u64);
        Some(Self { compiled, seen, track })
    }

    /// As [`replay`], of a model that differs in a number of the base law, of its geometry, or in an instant.
    #[must_use]
    pub fn replay(&self, model: &Model, data: &Data, r: usize) -> Option<Replayed> {
        let compiled = model.compile(r)?;
        // On average from the middle on.
        data.worked(data.blocks[r].len() as u64 / 2);
        let out =
            self.track.neighbour(&self.compiled, &compiled, &data.blocks[r], &self.seen, &model.instants[r]);
        out.f.iter().all(|f| f.is_finite()).then_some(out)
    }

    /// The instants (s) at which the law itself ruptures.
    #[must_use]
    pub fn own_instants(&self) -> Vec<f64> {
        free(&self.compiled, &self.seen)
    }

    /// Nats of the recording with its ruptures at other instants: residuals and events, with the noise as it is.
    #[must_use]
    pub fn nats_at(&self, model: &Model, data: &Data, r: usize, instants: &[f64]) -> f64 {
        let b = &data.blocks[r];
        data.worked(b.len() as u64 / 2);
        let now = self.track.neighbour(&self.compiled, &self.compiled, b, &self.seen, instants);
        let e: Vec<f64> = b.f.iter().zip(&now.f).map(|(y, f)| y - f).collect();
        let w = data.whiten(r, &e);
        let events: f64 = now.events.iter().map(|e| judge(e, &model.scatter).nats).sum();
        let sum = w.iter().map(|w| rho(*w)).sum::<f64>() + events;
        if sum.is_finite() { sum } else { NEVER }
    }

    /// Goes on from other instants.
    pub fn stand(&mut self, data: &Data, r: usize, instants: &[f64]) {
        self.track = Track::new(&self.compiled, &data.blocks[r], &self.seen, instants);
    }
}

/// What a model leaves of all recordings; `None` when it cannot be replayed.
#[must_use]
pub fn residuals(model: &Model, data: &Data) -> Option<Residuals> {
    let mut all = Residuals::default();
    let one = |(r, b): (usize, &Blocks)| {
        let replayed = replay(model, data, r)?;
        let e: Vec<f64> = b.f.iter().zip(&replayed.f).map(|(y, f)| y - f).collect();
        let w = data.whiten(r, &e);
        Some((e, w, replayed.events))
    };
    let each: Vec<Option<_>> = data.blocks.par_iter().enumerate().map(one).collect();
    for left in each {
        let (e, w, events) = left?;
        all.e.push(e);
        all.w.push(w);
        all.events.push(events);
    }
    all.nats = nats(model, &all);
    Some(all)
}

/// Nats of residuals that are at hand.
#[must_use]
pub fn nats(model: &Model, r: &Residuals) -> f64 {
    let mut sum: f64 = r.w.iter().map(|w| w.iter().map(|w| rho(*w)).sum::<f64>()).sum();
    sum += event_nats(model, r);
    sum + prior_nats(model)
}

/// Nats of the events alone.
#[must_use]
pub fn event_nats(model: &Model, r: &Residuals) -> f64 {
    r.events.iter().flatten().map(|e| judge(e, &model.scatter).nats).sum()
}

/// Nats of the priors.
#[must_use]
pub fn prior_nats(model: &Model) -> f64 {
    let of = |n: &Number, x: f64| if n.sd.is_finite() { 0.5 * ((x - n.mean) / n.sd).powi(2) } else { 0.0 };
    let shared: f64 = model.shared().iter().map(|n| of(n, model.get(n.role, 0))).sum();
    let own: f64 = model
        .own_numbers()
        .iter()
        .filter(|n| n.sd.is_finite())
        .map(|n| (0..model.own.len()).map(|r| of(n, model.get(n.role, r))).sum::<f64>())
        .sum();
    shared + own
}
