//! The fit of a set from several starts: the objective has many optima, and one start in three finds the best.

use crate::raw::Raw;
use crate::set::first::{DAY_FRICTION, DAY_SURFACE_M, Guess, Insertion, first};
use rand::{RngExt, rngs::ChaCha8Rng};
use rayon::prelude::*;
use std::sync::Arc;
use stylet_identify::blocks::Blocks;
use stylet_identify::discrepancy::discrepancy;
use stylet_identify::fit::{Effort, Fit, Tangent, fit};
use stylet_identify::model::{Model, Role};
use stylet_identify::noise::Noise;
use stylet_identify::objective::Data;
use stylet_identify::retime::retime;
use stylet_tissue::Tissue;

/// Length of the blocks of a set in s: insertions repeat no better.
pub const SET_BLOCK_S: f64 = 0.08;
/// Starts look at blocks so many times as long.
const COARSE: usize = 3;
/// The first fits see misfits of this share of the largest force as noise.
const FIRST_SHARE: f64 = 0.1;
/// The spread between days that is expected counts as that of so many days.
const EXPECTED_DAYS: f64 = 4.0;
/// Turns of the fits of a first look, and of those that go on;
const FIRST_LOOK: [usize; 2] = [6, 6];
/// the latter start from numbers that stand.
const LONG_LOOK: [usize; 2] = [6, 8];
/// So many starts go on.
const GO_ON: usize = 8;
/// So many fits that differ by more than a share are looked at closely,
const FEW_FITS: usize = 4;
/// that share,
const SAME: f64 = 0.002;
/// if they leave less than so many times what the best one leaves.
const WITHIN: f64 = 1.4;
/// Fits agree when their errors differ by less than this share.
const AGREE: f64 = 0.03;

/// A set that is fitted.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The fit.
    pub fit: Fit,
    /// The recordings, and what is left as noise.
    pub data: Data,
    /// Instants (s) of the drops of every recording.
    pub drops: Vec<Vec<f64>>,
    /// Starts, and how many of them came to the same error.
    pub starts: (usize, usize),
}

impl Fitted {
    /// Root mean square in N of what the fit leaves with the ruptures where they were seen.
    #[must_use]
    pub fn rms_n(&self) -> f64 {
        self.fit.rms_n(&self.data)
    }

    /// The same recordings with another law, fitted from where it stands.
    #[must_use]
    pub fn with(&self, model: &Model) -> Option<Self> {
        let (fit, data) = settle(model, self.data.clone(), &self.drops, &[6])?;
        Some(Self { fit, data, drops: self.drops.clone(), starts: self.starts })
    }
}

/// The recordings in blocks, without the samples that the raw force excludes.
#[must_use]
pub fn blocks(runs: &[&Insertion], raw: &Raw) -> Vec<Blocks> {
    let none = Vec::new();
    runs.par_iter()
        .enumerate()
        .map(|(r, run)| Blocks::new(&run.recording, raw.exclude.get(r).unwrap_or(&none), SET_BLOCK_S))
        .collect()
}

/// The first noise: misfits of a share of the largest force.
fn unsettled(blocks: Vec<Blocks>) -> Data {
    let largest = blocks.iter().flat_map(|b| &b.size_n).fold(1e-6_f64, |m, f| m.max(*f));
    Data::new(Arc::new(blocks), Noise::white(FIRST_SHARE * largest), 1e-3)
}

/// A model fitted to recordings from where it stands, by the set's own noise.
#[must_use]
pub fn refitted(model: &Model, blocks: Vec<Blocks>, drops: Vec<Vec<f64>>) -> Option<Fitted> {
    let (fit, data) = settle(model, unsettled(blocks), &drops, &[6, 8])?;
    Some(Fitted { fit, data, drops, starts: (1, 1) })
}

/// What start `k` begins with: the first in the middle of what is thought possible, the others anywhere in it.
fn guess(k: usize, rng: &mut ChaCha8Rng) -> Guess {
    let mut within = |(low, high): (f64, f64)| {
        let drawn = rng.random::<f64>();
        low + (high - low) * if k == 0 { 0.5 } else { drawn }
    };
    let mut times = |(low, high): (f64, f64)| libm::exp(within((libm::log(low), libm::log(high))));
    let (exponent, fast, slow, waits) =
        (times((4.0, 18.0)), times((0.03, 3.0)), times((4.0, 20.0)), times((6.0, 20.0)));
    Guess {
        straight: within((0.1, 0.9)),
        hold: within((0.3, 0.9)),
        pull: within((0.3, 0.9)),
        kept: within((0.4, 1.0)),
        exponent,
        wear_per_m: [within((0.0, 80.0)), within((0.0, 120.0))],
        rate: within((-0.3, 0.1)),
        fractions: [within((0.02, 0.4)), within((0.02, 0.4))],
        times_s: [fast, slow],
        waits,
        surface_m: within((-1.5e-3, 5e-4)),
        // Deeper layers rupture where the force drops, or shortly behind their front without a drop of their own.
        gives_way_m: Some(within((-4e-3, 6e-3))).filter(|m| *m > 0.0),
    }
}

/// Fits in rounds, the noise being what the round before has left.
#[must_use]
pub fn settle(model: &Model, data: Data, drops: &[Vec<f64>], rounds: &[usize]) -> Option<(Fit, Data)> {
    let mut data = data;
    let mut best: Option<Fit> = None;
    for turns in rounds {
        let mut from = best.as_ref().map_or(model, |b| &b.model).clone();
        if let Some(best) = &best {
            data = data.with_noise(discrepancy(&data.blocks, &best.residuals.e, data.floor_n));
            retime(&mut from, &data, drops);
            spreads(&mut from, &data, best);
        }
        best = Some(fit(&from, &data, Effort { turns: *turns, enough: 0.05 })?);
    }
    let best = best?;
    data = data.with_noise(discrepancy(&data.blocks, &best.residuals.e, data.floor_n));
    Some((best, data))
}

/// Spreads between recordings and between days as a fit tells them: the mean square of the numbers and of what the data leave open
/// of them (expectation maximisation with the fit's own curvature), so that a number nobody can see keeps the spread that it had.
fn spreads(model: &mut Model, data: &Data, at: &Fit) {
    let tangent = Tangent::new(&at.model, data, &at.residuals);
    let (recordings, own) = (data.recordings(), tangent.own.len());
    let conditional = |places: &[usize]| -> Vec<f64> {
        let factor = tangent.matrix.part(places).factor();
        (0..places.len())
            .map(|i| {
                let unit: Vec<f64> = (0..places.len()).map(|j| f64::from(u8::from(i == j))).collect();
                factor.solve(&unit)[i].max(0.0)
            })
            .collect()
    };
    let mut sums = vec![(0.0, 0.0); own];
    for r in 0..recordings {
        // An instant that never was moves nothing.
        let moves: Vec<usize> = (0..own)
            .filter(|o| tangent.matrix.at(tangent.place(*o, r), tangent.place(*o, r)) > 0.0)
            .collect();
        let places: Vec<usize> = moves.iter().map(|o| tangent.place(*o, r)).collect();
        for (o, variance) in moves.iter().zip(conditional(&places)) {
            let x = at.model.get(tangent.own[*o].role, r);
            sums[*o].0 += x * x + variance;
            sums[*o].1 += 1.0;
        }
    }
    for (n, (sum, count)) in tangent.own.iter().zip(&sums) {
        let sd = (sum / f64::max(*count, 1.0)).sqrt();
        match n.role {
            Role::OwnSurface => model.scatter.surface_m = sd,
            Role::OwnFriction => model.scatter.friction = sd,
            Role::OwnEffect(k) => model.scatter.differing[k] = sd,
            _ => {}
        }
    }
    let mut days = [(0.0, 0.0); 2];
    for (i, n) in tangent.shared.iter().enumerate() {
        let kind = match n.role {
            Role::DaySurface(_) => 0,
            Role::DayFriction(_) => 1,
            _ => continue,
        };
        days[kind].0 += at.model.get(n.role, 0).powi(2) + conditional(&[i])[0];
        days[kind].1 += 1.0;
    }
    // Few days tell little of their spread: what is expected of it counts as much as some more days.
    let spread = |(sum, n): (f64, f64), expected: f64| {
        ((sum + EXPECTED_DAYS * expected * expected) / (n + EXPECTED_DAYS)).sqrt()
    };
    model.scatter.day_surface_m = spread(days[0], DAY_SURFACE_M);
    model.scatter.day_friction = spread(days[1], DAY_FRICTION);
}

/// Fits from every start, those that leave least first.
fn from_all(models: &[Model], data: &Data, drops: &[Vec<f64>], rounds: &[usize]) -> Vec<(f64, Model)> {
    let one = |model: &Model| {
        let (fit, data) = settle(model, data.clone(), drops, rounds)?;
        Some((fit.rms_n(&data), fit.model))
    };
    let mut found: Vec<(f64, Model)> = models.par_iter().filter_map(one).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

/// Fits of a set from `starts` starts: the best few that differ, those that leave least first.
///
/// What leaves least need not predict best: which of them stands is for recordings left out to say. Deterministic for any number of
/// threads; `rng` draws what the starts begin with.
#[must_use]
pub fn fitted(
    believed: &Tissue,
    runs: &[&Insertion],
    raw: &Raw,
    starts: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<Fitted> {
    let fine = blocks(runs, raw);
    let drops: Vec<Vec<f64>> =
        runs.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect()).collect();
    let coarse = unsettled(fine.iter().map(|b| b.coarser(COARSE)).collect());
    let guesses: Vec<Guess> = (0..starts.max(1)).map(|k| guess(k, rng)).collect();
    let began: Vec<Model> = guesses.iter().map(|g| first(believed, runs, g)).collect();
    // Most starts are given up after a look; those that promise most go on.
    let mut found = from_all(&began, &coarse, &drops, &FIRST_LOOK);
    found.truncate(GO_ON);
    let promising: Vec<Model> = found.into_iter().map(|f| f.1).collect();
    let found = from_all(&promising, &coarse, &drops, &LONG_LOOK);
    let Some(best) = found.first().map(|f| f.0) else { return Vec::new() };
    let agree = found.iter().filter(|f| f.0 < best * (1.0 + AGREE)).count();
    let mut apart: Vec<&(f64, Model)> = Vec::new();
    for one in found.iter().filter(|f| f.0 < best * WITHIN) {
        if apart.len() < FEW_FITS && apart.iter().all(|f| one.0 > f.0 * (1.0 + SAME)) {
            apart.push(one);
        }
    }
    let whole = unsettled(fine);
    let models: Vec<Model> = apart.into_iter().map(|f| f.1.clone()).collect();
    let mut out: Vec<Fitted> = models
        .par_iter()
        .filter_map(|model| {
            let (fit, data) = settle(model, whole.clone(), &drops, &[4, 8, 10])?;
            Some(Fitted { fit, data, drops: drops.clone(), starts: (found.len(), agree) })
        })
        .collect();
    out.sort_by(|a, b| a.rms_n().total_cmp(&b.rms_n()));
    out
}
