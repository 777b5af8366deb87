//! What is known before the next insertion, and what an insertion would add to it.
//!
//! All candidates share a stem: the base law with what is settled. What a candidate adds to the force, and what its numbers
//! change, are columns over the recordings at hand and over a motion that may come, whitened by the noise and beside the law's
//! own condition for every rupture, whose spread is the scatter between insertions. Everything is the likelihood of
//! `stylet-identify`; nothing here has a law of its own.

use crate::candidate::Candidate;
use crate::gram::{products, sum, without_first};
use rayon::prelude::*;
use std::sync::Arc;
use stylet_identify::blocks::{BLOCK_S, Blocks};
use stylet_identify::fit::{Column, Tangent};
use stylet_identify::forward::{Replayed, free, imposed};
use stylet_identify::model::{Model, NEVER, Own, Role};
use stylet_identify::noise::Noise;
use stylet_identify::objective::{Data, pieces, replay, residuals};
use stylet_record::Recording;
use stylet_scenario::Motion;
use stylet_stats::linear::Symmetric;

/// Motions are compared over blocks of so many s ...
const COARSE_S: f64 = 0.06;
/// ... or of a share of their duration, so that a long one costs no more.
const MOST_BLOCKS: f64 = 800.0;
/// A planned motion is known exactly: so many samples per second are enough to see it.
const LOOK_HZ: f64 = 50.0;
/// What a slow autoregression leaves of one at least: beyond, its sum is not known.
const LEAST_LEFT: f64 = 0.1;
/// Insertions scatter at least so much, relative, until three have shown how much they do.
const UNSEEN_SCATTER: f64 = 0.01;
/// The same of a far face in m.
const UNSEEN_PLACE_M: f64 = 5e-5;
/// Recordings that show scatter.
const SHOWS_SCATTER: usize = 3;
/// Wavelength in m of the pattern along the depth that stands for what the library lacks.
const UNKNOWN_WAVE_M: f64 = 0.008;

/// What is known, and what may be the case.
pub struct Ground {
    /// What all candidates share.
    pub stem: Model,
    /// What may be the case; the first is believed most.
    pub candidates: Vec<Candidate>,
    /// Size in N of something that the library lacks, when that is among what may be the case.
    pub unknown_n: Option<f64>,
    /// The noise of blocks of [`BLOCK_S`].
    pub noise: Noise,
    /// Samples per second of what is planned.
    pub sample_hz: f64,
    /// The candidates' models, the law's numbers re-fitted to the recordings at hand.
    models: Vec<Model>,
    /// Products over the recordings at hand, priors included.
    before: Symmetric,
    /// Number of shared numbers.
    shared: usize,
    /// Whether the scatter between insertions is assumed: too few have been made to show it.
    pub scatter_assumed: bool,
}

/// What a motion would show.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Products over all columns.
    all: Symmetric,
    /// With what is fitted taken out.
    left: Symmetric,
    shared: usize,
}

impl Ground {
    /// From the recordings at hand (their forces play no part: where the stem stands has been fitted to them) and the model's
    /// instants in them.
    #[must_use]
    pub fn new(
        stem: Model,
        candidates: Vec<Candidate>,
        unknown_n: Option<f64>,
        old: &[Blocks],
        noise: Noise,
        sample_hz: f64,
    ) -> Option<Self> {
        let mut stem = stem;
        let scatter_assumed = old.len() < SHOWS_SCATTER && stem.scatter.force <= UNSEEN_SCATTER;
        if old.len() < SHOWS_SCATTER {
            stem.scatter.force = stem.scatter.force.max(UNSEEN_SCATTER);
            stem.scatter.place_m = stem.scatter.place_m.max(UNSEEN_PLACE_M);
        }
        let numbers = stem.shared();
        let mut ground = Self {
            shared: numbers.len(),
            stem,
            candidates,
            unknown_n,
            noise,
            sample_hz,
            models: Vec::new(),
            scatter_assumed,
            before: Symmetric::zeros(0),
        };
        let mut before = Symmetric::zeros(ground.shared + ground.extra());
        for (i, n) in numbers.iter().enumerate().filter(|(_, n)| n.sd.is_finite() && n.sd > 0.0) {
            before.add(i, i, 1.0 / (n.sd * n.sd));
        }
        if !old.is_empty() {
            let data = Data::new(Arc::new(old.to_vec()), ground.noise.clone(), 0.0);
            before = sum(&before, &ground.seen(&ground.stem, data)?);
        }
        ground.before = before;
        ground.models = (0..ground.candidates.len()).map(|k| ground.refitted(k)).collect();
        Some(ground)
    }

    /// A candidate's model with the law's numbers where, to first order, the recordings at hand have them beside it: what a
    /// candidate adds was imitated by these numbers when the stem was fitted.
    fn refitted(&self, which: usize) -> Model {
        let mut model = self.candidates[which].model(&self.stem);
        let Some((at, _)) = self.place(which) else { return model };
        let rows: Vec<usize> = (0..self.shared).collect();
        let with: Vec<f64> = rows.iter().map(|k| -self.before.at(*k, self.shared + at)).collect();
        let moves = self.before.part(&rows).factor().solve(&with);
        for (n, by) in self.stem.shared().iter().zip(moves).filter(|(_, by)| by.is_finite()) {
            let x = self.stem.get(n.role, 0) + by;
            model.set(n.role, 0, x.clamp(n.low, n.high));
        }
        model
    }

    /// The model of a candidate, the law's numbers re-fitted beside it; the stem for what the library lacks.
    #[must_use]
    pub fn model(&self, which: usize) -> &Model {
        self.models.get(which).unwrap_or(&self.stem)
    }

    /// Columns beside those of the shared numbers.
    fn extra(&self) -> usize {
        let own = |c: &Candidate| if c.choices.is_empty() { 0 } else { 1 + numbers_of(c) };
        self.candidates.iter().map(own).sum::<usize>() + usize::from(self.unknown_n.is_some())
    }

    /// Where a candidate's column stands, and those of its numbers; none for the stem alone.
    fn place(&self, which: usize) -> Option<(usize, std::ops::Range<usize>)> {
        let mut at = 0;
        for (k, c) in self.candidates.iter().enumerate() {
            if c.choices.is_empty() {
                if k == which {
                    return None;
                }
                continue;
            }
            let n = numbers_of(c);
            if k == which {
                return Some((at, at + 1..at + 1 + n));
            }
            at += 1 + n;
        }
        None
    }

    /// Products over recordings as the stem would have them.
    fn seen(&self, stem: &Model, mut data: Data) -> Option<Symmetric> {
        let mut blocks = (*data.blocks).clone();
        for (r, b) in blocks.iter_mut().enumerate() {
            b.f = replay(stem, &data, r)?.f;
        }
        data = Data::new(Arc::new(blocks), (*data.noise).clone(), 0.0);
        let at = residuals(stem, &data)?;
        let tangent = Tangent::new(stem, &data, &at);
        let change = |model: &Model| tangent.difference(stem, &data, &at, model);
        let first = stem.effects.len();
        let of: Vec<Option<Vec<Column>>> = self
            .candidates
            .par_iter()
            .filter(|c| !c.choices.is_empty())
            .map(|c| {
                let model = c.model(stem);
                let whole = change(&model)?;
                let mut columns = vec![whole.clone()];
                for n in model.shared() {
                    let Role::Effect { effect, .. } = n.role else { continue };
                    if effect < first {
                        continue;
                    }
                    let mut moved = model.clone();
                    let x = model.get(n.role, 0);
                    let h = if x + n.step > n.high { -n.step } else { n.step };
                    moved.set(n.role, 0, x + h);
                    let mut column = change(&moved)?;
                    for (now, was) in
                        column.w.iter_mut().zip(&whole.w).chain(column.rows.iter_mut().zip(&whole.rows))
                    {
                        now.iter_mut().zip(was).for_each(|(now, was)| *now = (*now - was) / h);
                    }
                    columns.push(column);
                }
                Some(columns)
            })
            .collect();
        let mut more: Vec<Column> =
            of.into_iter().collect::<Option<Vec<_>>>()?.into_iter().flatten().collect();
        if let Some(size_n) = self.unknown_n {
            let mut column = Column::default();
            for (r, b) in data.blocks.iter().enumerate() {
                let mut f = vec![0.0; b.len()];
                for p in b.pieces.iter().filter(|p| p.z_m > stem.tissue.surface_m) {
                    let turn = core::f64::consts::TAU * (p.z_m - stem.tissue.surface_m) / UNKNOWN_WAVE_M;
                    f[p.block as usize] = size_n * core::f64::consts::SQRT_2 * libm::sin(turn);
                }
                column.w.push(data.whiten(r, &f));
                column.rows.push(vec![0.0; 4 * at.events[r].len()]);
            }
            more.push(column);
        }
        Some(products(&tangent, &data, &more))
    }

    /// What is known before.
    #[must_use]
    pub fn known(&self) -> Shown {
        self.shown(self.before.clone())
    }

    fn shown(&self, all: Symmetric) -> Shown {
        Shown { left: without_first(&all, self.shared), all, shared: self.shared }
    }

    /// What is known once a motion has been made as well; none when the law cannot be replayed along it.
    #[must_use]
    pub fn after(&self, motion: &Motion) -> Option<Shown> {
        self.after_blocks(&self.blocks(motion)?)
    }

    /// The same of a motion in blocks.
    #[must_use]
    pub fn after_blocks(&self, blocks: &Blocks) -> Option<Shown> {
        let (blocks, data) = self.planned(blocks)?;
        let leader = alone(self.model(0), Vec::new());
        let instants = free(&leader.compile(0)?, &blocks.pieces);
        let stem = alone(&self.stem, instants);
        Some(self.shown(sum(&self.before, &self.seen(&stem, data)?)))
    }

    /// A motion in blocks, without forces; none for one that is recorded.
    #[must_use]
    pub fn blocks(&self, motion: &Motion) -> Option<Blocks> {
        let recording = sampled(motion, self.sample_hz.min(LOOK_HZ))?;
        Some(Blocks::new(&recording, &[], COARSE_S.max(recording.duration_s() / MOST_BLOCKS)))
    }

    /// Blocks with the forces of the likeliest candidate, judged by the noise of their length.
    fn planned(&self, blocks: &Blocks) -> Option<(Blocks, Data)> {
        let mut blocks = blocks.clone();
        let (f, _) = forces(self.model(0), &blocks)?;
        blocks.size_n.clone_from(&f.iter().map(|f| f.abs()).collect());
        blocks.f = f;
        let times = blocks.step_s * blocks.samples as f64 / BLOCK_S;
        let data = Data::new(Arc::new(vec![blocks.clone()]), coarser(&self.noise, times), 0.0);
        Some((blocks, data))
    }

    /// Largest force in N along a motion in blocks under every candidate, in their order.
    #[must_use]
    pub fn largest_n(&self, blocks: &Blocks) -> Option<Vec<f64>> {
        let largest = |f: &[f64]| f.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
        self.models.iter().map(|m| Some(largest(&forces(m, blocks)?.0))).collect()
    }

    /// Forces in N along a motion under every candidate, with the times (s) and positions (m) of the blocks.
    #[must_use]
    pub fn expected(&self, motion: &Motion) -> Option<Expected> {
        let blocks = self.blocks(motion)?;
        let time_s: Vec<f64> = blocks.from_s.iter().zip(&blocks.to_s).map(|(a, b)| 0.5 * (a + b)).collect();
        let position_m = time_s.iter().map(|t| blocks.motion.at(*t).0).collect();
        let force_n = self.models.iter().map(|m| Some(forces(m, &blocks)?.0)).collect::<Option<_>>()?;
        Some(Expected { time_s, position_m, force_n })
    }

    /// Pairs of candidates, each once.
    #[must_use]
    pub fn pairs(&self) -> Vec<(usize, usize)> {
        let n = self.candidates.len() + usize::from(self.unknown_n.is_some());
        (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).collect()
    }

    /// The name of a candidate, or of what the library lacks.
    #[must_use]
    pub fn name(&self, which: usize) -> &str {
        self.candidates.get(which).map_or(crate::candidate::UNKNOWN, |c| &c.name)
    }

    /// Nats by which two candidates are expected to differ: the truth's advantage over the other re-fitted. Of a special case
    /// and what holds it, the special case is tried against the truth of the other; else the harder way round counts.
    #[must_use]
    pub fn nats(&self, shown: &Shown, a: usize, b: usize) -> f64 {
        let n = self.candidates.len();
        if b >= n {
            return self.against(shown, b, a);
        }
        let (i, j) = (&self.candidates[a], &self.candidates[b]);
        if i.is_special_case_of(j) {
            self.against(shown, b, a)
        } else if j.is_special_case_of(i) {
            self.against(shown, a, b)
        } else {
            self.against(shown, a, b).min(self.against(shown, b, a))
        }
    }

    /// Nats that are left when `truth` holds and `other` is re-fitted: `min 1/2 |whitened(f_truth - f_other)|^2` over all
    /// numbers of the law and of the other, to first order.
    #[must_use]
    pub fn against(&self, shown: &Shown, truth: usize, other: usize) -> f64 {
        let at = |k: usize| -> Option<usize> {
            if k >= self.candidates.len() {
                Some(shown.left.size.saturating_sub(1))
            } else {
                self.place(k).map(|p| p.0)
            }
        };
        let mut x: Vec<(usize, f64)> = Vec::new();
        x.extend(at(truth).map(|k| (k, 1.0)));
        x.extend(at(other).map(|k| (k, -1.0)));
        let g = &shown.left;
        let all: f64 = x.iter().flat_map(|(i, a)| x.iter().map(move |(j, b)| a * b * g.at(*i, *j))).sum();
        let numbers: Vec<usize> = self.place(other).map_or_else(Vec::new, |p| p.1.collect());
        let cross: Vec<f64> = numbers.iter().map(|e| x.iter().map(|(i, a)| a * g.at(*i, *e)).sum()).collect();
        let half = g.part(&numbers).factor().half(&cross);
        (0.5 * (all - half.iter().map(|h| h * h).sum::<f64>())).max(0.0)
    }

    /// Correlation of two candidates' columns, everything that is fitted taken out; 0 where one of them is not seen at all.
    #[must_use]
    pub fn correlation(&self, shown: &Shown, a: usize, b: usize) -> f64 {
        let (Some((i, _)), Some((j, _))) = (self.place(a), self.place(b)) else { return 0.0 };
        let g = &shown.left;
        let size = (g.at(i, i) * g.at(j, j)).sqrt();
        let whole = (shown.all.at(shown.shared + i, shown.shared + i)
            * shown.all.at(shown.shared + j, shown.shared + j))
        .sqrt();
        if size > 1e-8 * whole && size > 0.0 { (g.at(i, j) / size).clamp(-1.0, 1.0) } else { 0.0 }
    }
}

/// Forces along a motion.
#[derive(Clone, Debug)]
pub struct Expected {
    /// Times in s.
    pub time_s: Vec<f64>,
    /// Positions in m.
    pub position_m: Vec<f64>,
    /// Forces in N, per candidate.
    pub force_n: Vec<Vec<f64>>,
}

impl Shown {
    /// Standard deviations of the shared numbers, in the scale of the fit; infinite where nothing tells one.
    #[must_use]
    pub fn sds(&self) -> Vec<f64> {
        let rows: Vec<usize> = (0..self.shared).collect();
        self.all.part(&rows).factor().inverse_diagonal().iter().map(|v| v.sqrt()).collect()
    }

    /// Half the logarithm of the determinant of the shared numbers' information: nats of knowledge about them.
    #[must_use]
    pub fn knowledge(&self) -> f64 {
        let rows: Vec<usize> = (0..self.shared).collect();
        0.5 * self.all.part(&rows).factor().log_determinant()
    }
}

fn numbers_of(c: &Candidate) -> usize {
    c.choices.iter().map(|c| c.info.parameters.iter().filter(|p| !p.whole).count()).sum()
}

/// The model for one recording that nobody has made yet.
fn alone(model: &Model, instants: Vec<f64>) -> Model {
    let mut model = model.clone();
    model.own = vec![Own::default()];
    let layers = model.layers();
    model.instants = vec![if instants.len() == layers { instants } else { vec![NEVER; layers] }];
    model
}

/// Forces (N) of a model along blocks with its own ruptures, and their instants (s).
fn forces(model: &Model, blocks: &Blocks) -> Option<(Vec<f64>, Vec<f64>)> {
    let compiled = alone(model, Vec::new()).compile(0)?;
    let course = pieces(&compiled, blocks);
    let instants = free(&compiled, &course);
    let mut out = Replayed::default();
    imposed(&compiled, blocks, &course, &instants, &mut out);
    out.f.iter().all(|f| f.is_finite()).then_some((out.f, instants))
}

/// A motion as a recording without forces; none for one that is recorded.
#[must_use]
pub fn sampled(motion: &Motion, sample_hz: f64) -> Option<Recording> {
    let plan = motion.plan()?;
    let n = (plan.duration_s() * sample_hz).floor() as usize + 1;
    let time_s: Vec<f64> = (0..n).map(|k| k as f64 / sample_hz).collect();
    let points: Vec<_> = time_s.iter().map(|t| plan.at(*t)).collect();
    let position = points.iter().map(|p| p.position_m).collect();
    let velocity = points.iter().map(|p| p.velocity_mps).collect();
    Recording::with_velocity(time_s, position, velocity, vec![0.0; n]).ok()
}

/// The noise of means over `times` blocks: what an autoregression adds up to in the long run, as white noise.
fn coarser(noise: &Noise, times: f64) -> Noise {
    let mut noise = noise.clone();
    for bin in &mut noise.bins {
        let left = 1.0 - bin.a.iter().chain(&bin.slow).sum::<f64>();
        let sd_n =
            (bin.innovation_n / left.clamp(LEAST_LEFT, 4.0)).max(0.3 * bin.sd_n) / times.max(1.0).sqrt();
        (bin.innovation_n, bin.sd_n) = (sd_n, sd_n);
        bin.a.fill(0.0);
        bin.slow.fill(0.0);
    }
    noise
}
