//! An insertion nobody has seen: draws from what varies between recordings and days, their mean and their band.

use crate::set::first::Insertion;
use crate::set::fitted::Fitted;
use crate::set::instrument::line;
use stylet_identify::model::{Choice, Day, Model, NEVER, Own};
use stylet_record::Recording;
use stylet_stats::median_of;
use stylet_stats::normal::quantile;
use stylet_tissue::{Effect, LawState, Reading};

/// Draws of a prediction.
pub const DRAWS: usize = 64;

/// The part of an insertion that a sample belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// In air and until the first rupture.
    Loading,
    /// After it, on the way in.
    Cutting,
    /// At rest, deep.
    Hold,
    /// On the way back.
    Back,
}

/// What varies, and what the law leaves.
#[derive(Clone, Debug)]
pub struct Population {
    /// The law with no recording of its own.
    pub law: Model,
    /// Root mean square (N) of what is left, by [`Part`], of a recording that takes part in the fit; single samples with their noise.
    pub residual_n: [f64; 4],
    /// Recordings that the law was fitted to: what varies between them is known as well as so many can tell.
    pub recordings: usize,
}

/// Radical inverse of `k` in a base: points of the Halton sequence.
fn halton(mut k: usize, base: usize) -> f64 {
    let (mut share, mut out) = (1.0, 0.0);
    while k > 0 {
        share /= base as f64;
        out += share * (k % base) as f64;
        k /= base;
    }
    out
}

/// Bases of the Halton sequence.
const PRIMES: [usize; 24] =
    [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89];

impl Population {
    /// What a fit says of insertions in general.
    #[must_use]
    pub fn of(fitted: &Fitted, runs: &[&Insertion]) -> Self {
        let mut sums = [(0.0, 0.0); 4];
        let model = &fitted.fit.model;
        for (r, (b, e)) in fitted.data.blocks.iter().zip(&fitted.fit.residuals.e).enumerate() {
            let first = model.instants[r].iter().copied().fold(NEVER, f64::min);
            for k in (0..b.len()).filter(|k| b.used[*k]) {
                let part = part(runs[r], 0.5 * (b.from_s[k] + b.to_s[k]), first) as usize;
                sums[part].0 += e[k] * e[k];
                sums[part].1 += 1.0;
            }
        }
        // Blocks average the noise of single samples away.
        let noise_n = median_of(runs.iter().map(|r| single(&r.recording)));
        let of = |(s, n): (f64, f64)| (s / f64::max(n, 1.0) + noise_n * noise_n).sqrt();
        Self { law: model.only(&[]), residual_n: sums.map(of), recordings: runs.len() }
    }

    /// What is left of a recording that takes no part, over what is left of one that does: about a mean of `n` values another one scatters
    /// by `sqrt((n + 1)/n)` of their standard deviation, they by `sqrt((n - 1)/n)`.
    fn beyond(&self) -> f64 {
        let n = self.recordings.max(2) as f64;
        ((n + 1.0) / (n - 1.0)).sqrt()
    }

    /// The `k`-th drawn insertion, from 1 on; on a known day or on one that is drawn too.
    fn draw(&self, k: usize, day: Option<usize>) -> Model {
        let mut dimension = 0;
        // What varies is drawn about a mean that so many recordings tell no better.
        let n = self.recordings.max(2) as f64;
        let mut normal = || {
            let base = PRIMES[dimension % PRIMES.len()];
            dimension += 1;
            quantile(halton(k, base)) * (1.0 + 1.0 / n).sqrt()
        };
        let mut model = self.law.clone();
        let s = &self.law.scatter;
        let (surface, friction) = (normal(), normal());
        let free = model.free;
        let mut own = Own::default();
        if free.own_surface {
            own.surface_m = s.surface_m * surface;
        }
        if free.own_friction {
            own.friction = s.friction * friction;
        }
        for layer in 0..model.layers() {
            let factor = (1.0 + s.force * normal()).max(0.2);
            if let Some(f) = &mut model.tissue.layers[layer].puncture_n {
                *f *= factor;
            }
            for choice in &mut model.effects {
                if let Some(mut effect) = choice.effect() {
                    effect.toughened(layer + 1, factor);
                    *choice = Choice::new(choice.info, &effect.parameters());
                }
            }
        }
        if free.own_effects {
            for k in 0..self.law.differing().count() {
                own.differing[k] = self.law.differing_sd(k) * normal();
            }
        }
        let drawn = Day { surface_m: s.day_surface_m * normal(), friction: s.day_friction * normal() };
        let day = day.unwrap_or_else(|| {
            model.days.push(Day {
                surface_m: if free.day_surface { drawn.surface_m } else { 0.0 },
                friction: if free.day_friction { drawn.friction } else { 0.0 },
            });
            model.days.len() - 1
        });
        model.own = vec![own];
        model.day_of = vec![day];
        model.instants = vec![vec![NEVER; model.layers()]];
        model
    }
}

/// Samples of a window in which single ones scatter about a line.
const WINDOW: usize = 8;

/// Standard deviation (N) of single samples about what a block follows.
fn single(recording: &Recording) -> f64 {
    let (t, f) = (&recording.time_s, &recording.force_n);
    let of = |(t, f): (&[f64], &[f64])| line(t, f).sd_n * (WINDOW as f64 / (WINDOW as f64 - 2.0)).sqrt();
    median_of(t.chunks_exact(WINDOW).zip(f.chunks_exact(WINDOW)).map(of))
}

/// The force (N) of the `k`-th drawn insertion (from 1 on), moved as `run` was, without what the law leaves.
#[must_use]
pub fn drawn(population: &Population, run: &Insertion, k: usize, day: Option<usize>) -> Option<Vec<f64>> {
    force(population, run, k, day).map(|f| f.0)
}

/// The same with the instant (s) of its first rupture.
fn force(population: &Population, run: &Insertion, k: usize, day: Option<usize>) -> Option<(Vec<f64>, f64)> {
    let r = &run.recording;
    let model = population.draw(k, day).compile(0)?;
    let mut chain = model.chain.start(2.0 * r.sample_hz());
    let mut state = LawState::default();
    let mut first_s = NEVER;
    let force = (0..r.len())
        .map(|i| {
            let (t, z, v) = (r.time_s[i], r.position_m[i] * model.to_true, r.velocity_mps[i] * model.to_true);
            let f = model.law.step(&mut state, t, z, v, |at| first_s = first_s.min(at.time_s)).total_n;
            if !model.measures {
                return f;
            }
            let reading = Reading { time_s: t, velocity_mps: v, tissue_n: f, ..Reading::default() };
            model.chain.step(&mut chain, &reading)
        })
        .collect::<Vec<f64>>();
    force.iter().all(|f| f.is_finite()).then_some((force, first_s))
}

/// The part of an insertion at a time, its first rupture being at `first_s`.
#[must_use]
pub fn part(run: &Insertion, time_s: f64, first_s: f64) -> Part {
    let at = |i: usize| run.recording.time_s.get(i).copied().unwrap_or(f64::INFINITY);
    if time_s >= at(run.phases.back) {
        Part::Back
    } else if time_s > at(run.phases.deepest) {
        Part::Hold
    } else if time_s >= first_s {
        Part::Cutting
    } else {
        Part::Loading
    }
}

/// A prediction.
#[derive(Clone, Debug, Default)]
pub struct Prediction {
    /// Mean force in N at every sample.
    pub mean: Vec<f64>,
    /// Lower end of the 90 % band in N.
    pub low: Vec<f64>,
    /// Upper end.
    pub high: Vec<f64>,
}

/// Predicts a recording from its motion alone.
#[must_use]
pub fn predict(population: &Population, run: &Insertion, day: Option<usize>, draws: usize) -> Prediction {
    let r = &run.recording;
    let forces: Vec<(Vec<f64>, f64)> = (1..=draws).filter_map(|k| force(population, run, k, day)).collect();
    if forces.is_empty() {
        return Prediction::default();
    }
    let beyond = population.beyond();
    // Quantiles of a normal distribution in five pieces of equal share.
    let pieces: Vec<f64> = (0..5).map(|k| quantile(0.1 + 0.2 * f64::from(k))).collect();
    let mut out = Prediction::default();
    let mut all = Vec::with_capacity(forces.len() * pieces.len());
    for i in 0..r.len() {
        out.mean.push(forces.iter().map(|f| f.0[i]).sum::<f64>() / forces.len() as f64);
        all.clear();
        for (force, first_s) in &forces {
            let scatter = beyond * population.residual_n[part(run, r.time_s[i], *first_s) as usize];
            all.extend(pieces.iter().map(|q| force[i] + scatter * q));
        }
        let n = all.len();
        let (low, high) = (n / 20, n - 1 - n / 20);
        all.select_nth_unstable_by(low, f64::total_cmp);
        out.low.push(all[low]);
        all.select_nth_unstable_by(high, f64::total_cmp);
        out.high.push(all[high]);
    }
    out
}

/// Friction along the shaft in N as the mean law has it, a layer counting as ruptured from the next of these instants (s) on and
/// not before: what a compensation may take from a measured force at every instant.
#[must_use]
pub fn friction(population: &Population, recording: &Recording, instants: &[f64]) -> Option<Vec<f64>> {
    let mut model = population.law.clone();
    model.own = vec![Own::default()];
    model.day_of = Vec::new();
    let law = model.compile(0)?.law;
    let layers = model.layers();
    let mut state = LawState::default();
    let (r, mut out) = (recording, Vec::with_capacity(recording.len()));
    for i in 0..r.len() {
        let ruptured = instants.iter().take(layers).take_while(|t| **t <= r.time_s[i]).count();
        let (t, z, v) = (r.time_s[i], r.position_m[i], r.velocity_mps[i]);
        out.push(law.step_imposed(&mut state, t, z, v, ruptured, |_| {}).friction_n);
    }
    Some(out)
}
