//! The fit: whitened robust least squares by Levenberg-Marquardt within bounds.
//!
//! Objective in nats: `sum rho(w_i) + sum rho(u_j) + sum p_k^2/2`, with `w` the whitened residuals, `u`
//! the rupture events, `p` the base parameters' departure from what was assumed in units of the
//! tolerance, and `rho` Huber's loss (`w^2/2` up to 3, linear beyond).

use crate::forward::{self, Event};
use crate::model::{Model, Role, Slot};
use crate::noise::Noise;
use crate::track::Track;
use rayon::prelude::*;
use std::sync::Arc;

/// Where Huber's loss turns linear, in standard deviations.
pub const HUBER: f64 = 3.0;

/// Huber's loss.
#[must_use]
#[inline]
pub fn rho(w: f64) -> f64 {
    let size = w.abs();
    if size <= HUBER { 0.5 * w * w } else { HUBER * (size - 0.5 * HUBER) }
}

/// Its weight.
#[inline]
fn weight(w: f64) -> f64 {
    let size = w.abs();
    if size <= HUBER { 1.0 } else { HUBER / size }
}

/// The data of a fit: tracks, where layers ruptured in each, the noise.
#[derive(Clone, Debug)]
pub struct Data {
    /// The recordings.
    pub tracks: Arc<Vec<Track>>,
    /// Per recording and layer the time (s) at which the recorded force shows its rupture, or
    /// [`NEVER`](crate::track::NEVER).
    pub ruptures: Vec<Vec<f64>>,
    /// Per recording and layer how far (s) a rupture may be moved at a time.
    pub reach: Arc<Vec<Vec<f64>>>,
    /// Half a step of the recorded force in N where that hides the noise: departures within it do not count.
    pub dead_n: f64,
    /// The noise.
    pub noise: Noise,
}

impl Data {
    /// Samples in all.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.tracks.iter().map(Track::len).sum()
    }

    /// The same in blocks of `q`; `scale` is the noise there.
    #[must_use]
    pub fn blocks(&self, q: usize, noise: Noise) -> Self {
        let tracks = self.tracks.iter().zip(&self.ruptures).map(|(track, r)| track.blocks(q, r)).collect();
        Self {
            tracks: Arc::new(tracks),
            ruptures: self.ruptures.clone(),
            reach: self.reach.clone(),
            dead_n: self.dead_n,
            noise,
        }
    }
}

/// A prediction for all recordings, one after another.
#[derive(Clone, Debug, Default)]
pub struct Residuals {
    /// Recorded force less the predicted one in N.
    pub e: Vec<f64>,
    /// Whitened.
    pub w: Vec<f64>,
    /// Rupture events, recordings by layers.
    pub events: Vec<Event>,
    scratch: Vec<Vec<Event>>,
}

/// From so many samples on recordings are replayed side by side.
pub(crate) const WORTH_THREADS: usize = 8192;

/// Replays a model over all recordings; false when it cannot be replayed.
pub fn residuals(model: &Model, data: &Data, out: &mut Residuals) -> bool {
    let Some(compiled) = model.compile() else { return false };
    let n = data.samples();
    out.e.resize(n, 0.0);
    out.w.resize(n, 0.0);
    out.events.clear();
    out.scratch.resize_with(data.tracks.len(), Vec::new);
    let e = slices(&data.tracks, &mut out.e);
    let w = slices(&data.tracks, &mut out.w);
    let parts = data.tracks.iter().zip(&data.ruptures).zip(e.into_iter().zip(w)).zip(&mut out.scratch);
    let parts: Vec<Part> =
        parts.map(|(((track, ruptures), (e, w)), events)| Part { track, ruptures, e, w, events }).collect();
    let one = |part: Part| {
        forward::imposed(&compiled, part.track, part.ruptures, part.e, part.events);
        forward::departures(&compiled, part.track, part.ruptures, &data.noise, 0, part.e);
        dead_zone(data.dead_n, part.e);
        data.noise.whiten(part.track, part.e, part.w);
    };
    if n < WORTH_THREADS {
        parts.into_iter().for_each(one);
    } else {
        parts.into_par_iter().for_each(one);
    }
    out.events.extend(out.scratch.iter().flatten().copied());
    out.w.iter().all(|w| w.is_finite())
}

/// One recording and where its residuals go.
struct Part<'a> {
    track: &'a Track,
    ruptures: &'a [f64],
    e: &'a mut [f64],
    w: &'a mut [f64],
    events: &'a mut Vec<Event>,
}

/// A vector over all recordings as one slice for each.
fn slices<'a>(tracks: &[Track], mut whole: &'a mut [f64]) -> Vec<&'a mut [f64]> {
    let mut parts = Vec::with_capacity(tracks.len());
    for track in tracks {
        let (part, rest) = std::mem::take(&mut whole).split_at_mut(track.len());
        parts.push(part);
        whole = rest;
    }
    parts
}

/// Takes what rounding may have done off every departure.
#[inline]
pub(crate) fn dead_zone(half_step_n: f64, e: &mut [f64]) {
    if half_step_n > 0.0 {
        e.iter_mut().for_each(|e| *e -= e.clamp(-half_step_n, half_step_n));
    }
}

/// The objective of a replayed model, in nats.
#[must_use]
pub fn objective(model: &Model, r: &Residuals) -> f64 {
    let samples: f64 = r.w.iter().map(|w| rho(*w)).sum();
    let events: f64 = r.events.iter().map(|e| rho(e.u)).sum();
    samples + events + prior(model)
}

/// Nats of the base parameters' departure from what was assumed.
fn prior(model: &Model) -> f64 {
    model
        .slots()
        .iter()
        .filter(|slot| matches!(slot.role, Role::Base { .. }))
        .map(|slot| {
            let x = (model.get(slot) - 1.0) / model.tolerance;
            0.5 * x * x
        })
        .sum()
}

/// A fitted model.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model at its best.
    pub model: Model,
    /// Its objective in nats.
    pub nats: f64,
}

/// Columns of the Jacobian: change of whitened residuals and events per unit of each number.
pub struct Jacobian {
    /// The numbers.
    pub slots: Vec<Slot>,
    /// One column per number: samples, then events.
    pub columns: Vec<Vec<f64>>,
}

/// Jacobian at a model whose residuals are `at`; the columns of the base parameters are those of `keep`
/// if given, which were worked out nearby.
pub fn jacobian(
    model: &Model,
    data: &Data,
    at: &Residuals,
    work: &mut Residuals,
    keep: Option<Jacobian>,
) -> Jacobian {
    let slots = model.slots();
    let base = |s: &Slot| matches!(s.role, Role::Base { .. });
    let known = match keep {
        Some(keep) => {
            Some(keep.columns.into_iter().zip(&keep.slots).filter(|(_, s)| base(s)).map(|(c, _)| c).collect())
        }
        None => crate::columns::base(model, data, at, &slots),
    };
    differences(model, data, at, work, slots, known)
}

/// The Jacobian with one replay for every number.
#[cfg(test)]
pub(crate) fn jacobian_by_differences(
    model: &Model,
    data: &Data,
    at: &Residuals,
    work: &mut Residuals,
) -> Jacobian {
    differences(model, data, at, work, model.slots(), None)
}

fn differences(
    model: &Model,
    data: &Data,
    at: &Residuals,
    work: &mut Residuals,
    slots: Vec<Slot>,
    known: Option<Vec<Vec<f64>>>,
) -> Jacobian {
    let p = model.vector(&slots);
    let mut columns = known.unwrap_or_default();
    let one = |work: &mut Residuals, j: usize| {
        let slot = &slots[j];
        let mut column = vec![0.0; at.w.len() + at.events.len()];
        if slot.stepped {
            return column;
        }
        let mut trial = model.clone();
        let mut q = p.clone();
        let step = if q[j] + slot.step > slot.high { -slot.step } else { slot.step };
        q[j] += step;
        trial.set(&slots, &q);
        if residuals(&trial, data, work) {
            let inverse = 1.0 / step;
            for (c, (new, old)) in column.iter_mut().zip(work.w.iter().zip(&at.w)) {
                *c = (new - old) * inverse;
            }
            for (c, (new, old)) in column[at.w.len()..].iter_mut().zip(work.events.iter().zip(&at.events)) {
                *c = (new.u - old.u) * inverse;
            }
        }
        column
    };
    for j in columns.len()..slots.len() {
        columns.push(one(work, j));
    }
    Jacobian { slots, columns }
}

/// Normal equations with Huber's weights and the prior: `(J'WJ, J'Wr)`.
#[must_use]
pub fn normal(model: &Model, jac: &Jacobian, at: &Residuals) -> (Vec<Vec<f64>>, Vec<f64>) {
    let m = jac.slots.len();
    let r: Vec<f64> = at.w.iter().copied().chain(at.events.iter().map(|e| e.u)).collect();
    let weights: Vec<f64> = r.iter().map(|w| weight(*w)).collect();
    // Punctures show in events alone: their columns begin with zeros.
    let from: Vec<usize> =
        jac.columns.iter().map(|c| c.iter().position(|x| *x != 0.0).unwrap_or(c.len())).collect();
    let mut h = vec![vec![0.0; m]; m];
    let mut g = vec![0.0; m];
    let mut weighted = Vec::with_capacity(r.len());
    for i in 0..m {
        weighted.clear();
        weighted.extend(jac.columns[i][from[i]..].iter().zip(&weights[from[i]..]).map(|(x, w)| x * w));
        g[i] = dot(&weighted, &r[from[i]..]);
        for j in 0..=i {
            let both = from[i].max(from[j]);
            h[i][j] = dot(&weighted[both - from[i]..], &jac.columns[j][both..]);
            h[j][i] = h[i][j];
        }
    }
    let sd = model.tolerance;
    for (i, slot) in jac.slots.iter().enumerate() {
        if matches!(slot.role, Role::Base { .. }) {
            h[i][i] += 1.0 / (sd * sd);
            g[i] += (model.get(slot) - 1.0) / (sd * sd);
        }
    }
    (h, g)
}

/// Scalar product, in eight lanes so that it runs in vector registers with the same bits everywhere.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            lanes[k] += x[k] * y[k];
        }
    }
    lanes.iter().sum::<f64>() + rest
}

/// Solves a symmetric positive system by Cholesky; `None` when it is not positive.
#[must_use]
pub fn solve(h: &[Vec<f64>], g: &[f64]) -> Option<Vec<f64>> {
    let n = g.len();
    let mut l = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let rest = h[i][j] - sum;
            if i == j {
                if rest.is_nan() || rest <= 1e-14 * h[i][i].abs() {
                    return None;
                }
                l[i][i] = rest.sqrt();
            } else {
                l[i][j] = rest / l[j][j];
            }
        }
    }
    let mut x = g.to_vec();
    for i in 0..n {
        let sum: f64 = (0..i).map(|k| l[i][k] * x[k]).sum();
        x[i] = (x[i] - sum) / l[i][i];
    }
    for i in (0..n).rev() {
        let sum: f64 = (i + 1..n).map(|k| l[k][i] * x[k]).sum();
        x[i] = (x[i] - sum) / l[i][i];
    }
    Some(x)
}

/// Fits a model from where it stands: at most `turns` steps, until a step gains less than `enough`
/// nats.
#[must_use]
pub fn fit(model: &Model, data: &Data, turns: usize, enough: f64) -> Option<Fit> {
    let mut at = Residuals::default();
    residuals(model, data, &mut at).then(|| fit_from(model, data, at, turns, enough)).flatten()
}

/// The same of a model whose residuals are known.
#[must_use]
pub fn fit_from(model: &Model, data: &Data, mut at: Residuals, turns: usize, enough: f64) -> Option<Fit> {
    let mut work = Residuals::default();
    let mut best = model.clone();
    let slots = best.slots();
    let begins = best.vector(&slots);
    best.set(&slots, &begins);
    if best.vector(&slots) != model.vector(&slots) && !residuals(&best, data, &mut at) {
        return None;
    }
    let mut nats = objective(&best, &at);
    let mut lambda = 1e-4;
    let mut last: Option<Jacobian> = None;
    let linear = crate::columns::are_linear(model);
    for turn in 0..turns {
        // The columns of the base parameters serve for two turns; for three where they cost a replay each. Only with
        // columns of its own does a turn say that nothing more is to be gained.
        let keep = last.take().filter(|_| turn % if linear { 2 } else { 3 } != 0);
        let kept = keep.is_some();
        let jac = jacobian(&best, data, &at, &mut work, keep);
        let p = best.vector(&jac.slots);
        let (h, g) = normal(&best, &jac, &at);
        let mut gained = 0.0;
        for _ in 0..6 {
            let Some(q) = step(&jac.slots, &p, &h, &g, lambda) else {
                lambda = (lambda * 10.0).max(1e-3);
                continue;
            };
            let free = jac.slots.iter().zip(&q).all(|(s, q)| *q > s.low && *q < s.high);
            if free && promised(&p, &q, &h, &g) < HOPE * enough {
                break;
            }
            let mut trial = best.clone();
            trial.set(&jac.slots, &q);
            if residuals(&trial, data, &mut work) {
                let value = objective(&trial, &work);
                if value < nats {
                    gained = nats - value;
                    nats = value;
                    best = trial;
                    std::mem::swap(&mut at, &mut work);
                    lambda = (lambda * 0.1).max(1e-9);
                    break;
                }
            }
            lambda = (lambda * 10.0).max(1e-3);
        }
        last = Some(jac).filter(|_| gained >= enough);
        if gained < enough && !kept {
            break;
        }
    }
    Some(Fit { model: best, nats })
}

/// A step that promises less than this share of what is enough is not tried.
const HOPE: f64 = 0.3;

/// Nats that a step from `p` to `q` gains by the curvature at `p`.
fn promised(p: &[f64], q: &[f64], h: &[Vec<f64>], g: &[f64]) -> f64 {
    let d: Vec<f64> = q.iter().zip(p).map(|(q, p)| q - p).collect();
    let bent: f64 = h.iter().zip(&d).map(|(row, di)| di * dot(row, &d)).sum();
    -dot(g, &d) - 0.5 * bent
}

/// One step within the bounds: numbers at a bound that want beyond it stay there.
fn step(slots: &[Slot], p: &[f64], h: &[Vec<f64>], g: &[f64], lambda: f64) -> Option<Vec<f64>> {
    let n = p.len();
    let mut free: Vec<bool> = slots.iter().enumerate().map(|(i, s)| !s.stepped && h[i][i] > 0.0).collect();
    for _ in 0..4 {
        let index: Vec<usize> = (0..n).filter(|i| free[*i]).collect();
        if index.is_empty() {
            return None;
        }
        let sub: Vec<Vec<f64>> = index
            .iter()
            .map(|&i| {
                index.iter().map(|&j| if i == j { h[i][i] * (1.0 + lambda) } else { h[i][j] }).collect()
            })
            .collect();
        let right: Vec<f64> = index.iter().map(|&i| -g[i]).collect();
        let d = solve(&sub, &right)?;
        let mut out = p.to_vec();
        let mut blocked = false;
        for (&i, d) in index.iter().zip(&d) {
            let want = p[i] + d;
            out[i] = want.clamp(slots[i].low, slots[i].high);
            let stuck = (p[i] <= slots[i].low && want < slots[i].low)
                || (p[i] >= slots[i].high && want > slots[i].high);
            if stuck {
                free[i] = false;
                blocked = true;
            }
        }
        if !blocked {
            return Some(out);
        }
    }
    None
}
