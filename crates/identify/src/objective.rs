//! The likelihood of a model: whitened residuals, ruptures, priors.

use crate::blocks::Blocks;
use crate::events::{Event, judge};
use crate::forward::{Replayed, Track, breaks, free, imposed};
use crate::model::{Compiled, Model, NEVER, Number};
use crate::noise::{From, LOSS, Laid, Noise};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use stylet_record::motion::Piece;

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

/// The data with what sampling leaves open where something of a model's effects breaks: between two samples, and a depth that all
/// recordings share puts it anywhere between them.
#[must_use]
pub fn breaking(model: &Model, data: &Data) -> Data {
    let falling = |(r, b): (usize, &Blocks)| {
        let falls = model.compile(r).map_or_else(Vec::new, |c| breaks(&c, &pieces(&c, b)));
        b.clone().falling(falls)
    };
    let blocks: Vec<Blocks> = data.blocks.par_iter().enumerate().map(falling).collect();
    let same = blocks.iter().zip(data.blocks.iter()).all(|(a, b)| a.doubt_n == b.doubt_n);
    if same { data.clone() } else { data.on(blocks) }
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
        let sum = w.iter().map(|w| LOSS.value(*w)).sum::<f64>() + events;
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
    let mut sum: f64 = r.w.iter().map(|w| w.iter().map(|w| LOSS.value(*w)).sum::<f64>()).sum();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocks::BLOCK_S;
    use crate::model::{Belief, Own};
    use stylet_record::Recording;
    use stylet_tissue::{Layer, Tissue};

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-9), "{told} for {wanted}");
    }

    /// A layer that gives way by its force after 5 mm, at 9 mm; two recordings of different lengths at 4 mm/s.
    fn given() -> (Model, Data) {
        let layer = Layer {
            thickness_m: 0.02,
            stiffness_n_per_m: 200.0,
            friction_ns_per_m2: 3000.0,
            puncture_n: Some(1.0),
            name: String::new(),
        };
        let belief = Belief {
            tissue: Tissue { surface_m: 0.004, layers: vec![layer] },
            given: Vec::new(),
            tolerance: vec![0.3],
            thickness_tolerance: vec![0.1],
            surface_tolerance_m: 0.002,
        };
        let mut model = Model::base(Arc::new(belief), 2);
        model.free.own_surface = true;
        model.instants = vec![vec![2.2], vec![2.3]];
        model.scatter.force = 0.05;
        let recorded = |n: usize| {
            let t: Vec<f64> = (0..n).map(|k| k as f64 * 0.005).collect();
            let z = t.iter().map(|t| 0.004 * t).collect();
            let f = t.iter().map(|t| 0.9 * (t - 1.0).max(0.0) + 0.01 * (90.0 * t).sin()).collect();
            let exclude: Vec<bool> = (0..n).map(|k| (40..52).contains(&k)).collect();
            Blocks::new(&Recording::new(t, z, f).expect("a recording"), &exclude, BLOCK_S)
        };
        (model, Data::new(Arc::new(vec![recorded(800), recorded(600)]), Noise::white(0.05), 0.0))
    }

    #[test]
    fn recordings_are_counted_chosen_and_judged_by_their_noise() {
        let (_, d) = given();
        assert_eq!((d.recordings(), d.compared()), (2, 200 + 150 - 2 * 3));
        let second = d.only(&[1]);
        assert_eq!((second.recordings(), second.blocks[0].len(), second.compared()), (1, 150, 147));
        let e = vec![0.1; 150];
        let w = d.whiten(1, &e);
        for (k, w) in w.iter().enumerate() {
            near(*w, if (10..13).contains(&k) { 0.0 } else { 2.0 });
        }
        assert_eq!(second.whiten(0, &e), w);
        let coloured = d.colour(1, &w);
        assert!(
            coloured
                .iter()
                .enumerate()
                .all(|(k, e)| (e - if (10..13).contains(&k) { 0.0 } else { 0.1 }).abs() < 1e-12)
        );
        near(d.with_noise(Noise::white(0.2)).whiten(1, &e)[0], 0.5);
        // The noise that residuals tell is nowhere less than the floor.
        let told =
            Data { floor_n: 0.3, ..d.clone() }.judged_by(&[vec![0.01; 200], vec![0.01; 150]], From::Whole);
        assert_eq!(told.noise.bins.iter().map(|b| b.sd_n).fold(1.0, f64::min), 0.3);
        assert_eq!(told.floor_n, 0.3);
    }

    #[test]
    fn work_is_counted_in_blocks_that_are_replayed() {
        let (m, d) = given();
        let cost = |of: &dyn Fn()| {
            let before = d.work();
            of();
            d.work() - before
        };
        assert_eq!(cost(&|| assert!(replay(&m, &d, 0).is_some())), 200);
        assert_eq!(cost(&|| assert!(residuals(&m, &d).is_some())), 350);
        assert_eq!(cost(&|| d.worked(7)), 7);
        let trail = Trail::new(&m, &d, 1).expect("a trail");
        assert_eq!(cost(&|| assert!(Trail::new(&m, &d, 1).is_some())), 150);
        assert_eq!(cost(&|| assert!(trail.replay(&m, &d, 1).is_some())), 75);
        assert_eq!(cost(&|| assert!(trail.nats_at(&m, &d, 1, &[2.0]).is_finite())), 75);
        // Under another noise it is the same account.
        let other = d.with_noise(Noise::white(1.0));
        other.worked(5);
        assert_eq!(other.work(), d.work());
    }

    #[test]
    fn nats_are_those_of_residuals_of_ruptures_and_of_priors() {
        let (mut m, d) = given();
        m.own = [1e-4, -3e-4].map(|surface_m| Own { surface_m, ..Own::default() }).to_vec();
        m.tissue.layers[0].stiffness_n_per_m = 230.0;
        m.tissue.surface_m = 0.005;
        let left = residuals(&m, &d).expect("a replay");
        // A tenth and a half of the stiffness, half of what the surface is uncertain by, and two of the spread between recordings.
        let stiffness = 0.5 * (0.15_f64 / 0.3).powi(2);
        let surface = 0.5 * 0.5_f64.powi(2);
        let own: f64 = [1e-4, 3e-4].iter().map(|x| 0.5 * (x / m.scatter.surface_m).powi(2)).sum();
        near(prior_nats(&m), stiffness + surface + own);
        let events: f64 = (0..2).map(|r| judge(&left.events[r][0], &m.scatter).nats).sum();
        near(event_nats(&m, &left), events);
        let mut sum = 0.0;
        for r in 0..2 {
            let f = replay(&m, &d, r).expect("a replay").f;
            for k in 0..d.blocks[r].len() {
                near(left.e[r][k], d.blocks[r].f[k] - f[k]);
                if d.blocks[r].used[k] {
                    let w: f64 = (left.e[r][k] / 0.05).abs();
                    sum += if w < 2.5 { 0.5 * w * w } else { 2.5 * (w - 1.25) };
                }
            }
        }
        near(left.nats, sum + events + stiffness + surface + own);
        near(nats(&m, &left), left.nats);
    }

    #[test]
    fn nats_at_other_instants_are_those_of_the_model_that_has_them() {
        let (m, d) = given();
        let d = d.only(&[0]);
        let m = m.only(&[0]);
        let mut trail = Trail::new(&m, &d, 0).expect("a trail");
        let at = |t: f64| {
            let there = Model { instants: vec![vec![t]], ..m.clone() };
            residuals(&there, &d).expect("a replay").nats - prior_nats(&there)
        };
        for stand in [2.2, 3.0] {
            trail.stand(&d, 0, &[stand]);
            for t in [1.5, 2.2, 2.21, 3.4, NEVER] {
                near(trail.nats_at(&m, &d, 0, &[t]), at(t));
            }
        }
        // One newton at 200 N/m, 9 mm at 4 mm/s.
        assert!((trail.own_instants()[0] - 2.25).abs() < 1e-6);
        let moved = Model { instants: vec![vec![2.5]], ..m.clone() };
        assert_eq!(
            trail.replay(&moved, &d, 0).expect("a replay").f,
            replay(&moved, &d, 0).expect("a replay").f
        );
    }
}
