//! The two-level fit: shared numbers, and for each run a shift of the surface and a factor on friction.
//!
//! Minimised is `sum_runs (m/n) sum_samples rho(e/sigma) + sum_runs (shift/s1)^2 + (ln factor/s2)^2`, by
//! Levenberg-Marquardt within bounds (Marquardt 1963); `rho` is Huber's loss. A run of `n` samples
//! Own numbers of runs of one speed have mean zero, nearly: the law has to say what speed does. A run of `n` samples
//! counts as `m` = 60 independent ones, for its residual is the law's and changes slowly.

use crate::forward;
use crate::gain;
use crate::run::{Columns, Run};
use crate::shape::{Own, Shape};
use rayon::prelude::*;

/// Independent samples that a run counts for.
pub const INDEPENDENT: f64 = 60.0;
/// Where Huber's loss turns linear, in standard deviations.
const HUBER: f64 = 2.5;
/// Runs of one speed scatter about the law: the mean of their own numbers is zero to within this share
/// of their standard deviation. What all runs of a speed have in common, the law has to say.
const GROUP: f64 = 0.15;
/// Numbers of each run: shift, friction.
const OWN: usize = 2;

/// How much the runs' own numbers scatter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Standard deviation of the shift in m.
    pub shift_m: f64,
    /// Of the logarithm of friction.
    pub friction_log: f64,
    /// Of the residual in N.
    pub residual_n: f64,
}

impl Default for Spread {
    fn default() -> Self {
        Self { shift_m: 5e-4, friction_log: 0.15, residual_n: 0.2 }
    }
}

/// A fitted law.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Its form.
    pub shape: Shape,
    /// Shared numbers.
    pub x: Vec<f64>,
    /// Per run what it has of its own.
    pub own: Vec<Own>,
    /// Per run and layer the elastic force at the rupture in N (zero: none).
    pub at_rupture: Vec<Vec<f64>>,
    /// How much the own numbers scatter.
    pub spread: Spread,
    /// Half the objective.
    pub cost: f64,
    /// Root mean square of the residual in N, all runs alike.
    pub rms_n: f64,
}

/// How long to try.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Steps per round.
    pub steps: usize,
    /// Rounds, with the spread re-estimated before each but the first.
    pub rounds: usize,
}

struct Replay {
    e: Vec<f64>,
    at_rupture: Vec<f64>,
}

fn own_of(shape: &Shape, run: &Run, numbers: &[f64]) -> Own {
    Own {
        shift_m: numbers[0],
        friction_log: numbers[1],
        puncture_n: vec![None; run.ruptures.len()],
        drops: run.ruptures.iter().enumerate().map(|(i, r)| r.is_some() && shape.imposes(i)).collect(),
        releases_m: run.releases_m.clone(),
    }
}

fn replay(shape: &Shape, x: &[f64], own: &Own, data: &Columns) -> Option<Replay> {
    let (mut e, mut at_rupture) = (Vec::new(), Vec::new());
    if !forward::imposed(shape, x, own, data, &mut e, &mut at_rupture) {
        return None;
    }
    for (e, f) in e.iter_mut().zip(&data.f) {
        *e = f - *e;
    }
    Some(Replay { e, at_rupture })
}

fn loss(e: &[f64], sigma: f64) -> f64 {
    let sum: f64 = e
        .iter()
        .map(|e| {
            let u = (e / sigma).abs();
            if u <= HUBER { 0.5 * u * u } else { HUBER * (u - 0.5 * HUBER) }
        })
        .sum();
    sum * INDEPENDENT / e.len().max(1) as f64
}

fn prior(own: &[f64], spread: &Spread) -> f64 {
    let (a, b) = (own[0] / spread.shift_m, own[1] / spread.friction_log);
    0.5 * (a * a + b * b)
}

/// Fits a form to runs, from `x` and the runs' own numbers where they are known.
#[must_use]
pub fn fit(
    shape: &Shape,
    x: Vec<f64>,
    own: Option<&[Own]>,
    runs: &[&Run],
    spread: Spread,
    effort: Effort,
) -> Option<Fit> {
    let mut spread = spread;
    let mut own: Vec<[f64; OWN]> = match own {
        Some(own) => own.iter().map(|o| [o.shift_m, o.friction_log]).collect(),
        None => vec![[0.0; OWN]; runs.len()],
    };
    let mut x = x;
    let mut cost = f64::INFINITY;
    let mut replays = Vec::new();
    for round in 0..effort.rounds {
        if round > 0 {
            spread = respread(&own, &replays, spread);
        }
        (cost, replays) = minimise(shape, &mut x, &mut own, runs, &spread, effort.steps)?;
    }
    let mean =
        replays.iter().map(|r| crate::stats::rms(&r.e).powi(2)).sum::<f64>() / runs.len().max(1) as f64;
    Some(Fit {
        shape: shape.clone(),
        x,
        own: runs.iter().zip(&own).map(|(run, own)| own_of(shape, run, own)).collect(),
        at_rupture: replays.into_iter().map(|r| r.at_rupture).collect(),
        spread,
        cost,
        rms_n: libm::sqrt(mean),
    })
}

/// The spread that the fitted runs show, not less than a fifth of what was assumed.
fn respread(own: &[[f64; OWN]], replays: &[Replay], old: Spread) -> Spread {
    let of = |k: usize, least: f64| {
        let sum: f64 = own.iter().map(|o| o[k] * o[k]).sum();
        libm::sqrt(sum / own.len().max(1) as f64).max(least)
    };
    let all: Vec<f64> = replays.iter().map(|r| crate::stats::rms(&r.e)).collect();
    let first = Spread::default();
    Spread {
        shift_m: of(0, 0.2 * first.shift_m),
        friction_log: of(1, 0.2 * first.friction_log),
        residual_n: crate::stats::rms(&all).clamp(0.3 * old.residual_n, 5.0),
    }
}

fn evaluate(
    shape: &Shape,
    x: &[f64],
    own: &[[f64; OWN]],
    runs: &[&Run],
    spread: &Spread,
) -> Option<(f64, Vec<Replay>)> {
    let replays: Option<Vec<Replay>> = runs
        .par_iter()
        .zip(own)
        .map(|(run, own)| replay(shape, x, &own_of(shape, run, own), run.seen_by(shape)))
        .collect();
    let replays = replays?;
    let each: f64 =
        replays.iter().zip(own).map(|(r, own)| loss(&r.e, spread.residual_n) + prior(own, spread)).sum();
    let groups: f64 = gain::speeds(runs)
        .iter()
        .map(|(_, members)| {
            let mut sum = 0.0;
            for (k, s) in [spread.shift_m, spread.friction_log].into_iter().enumerate() {
                let mean = members.iter().map(|r| own[*r][k]).sum::<f64>() / members.len() as f64;
                sum += 0.5 * (mean / (GROUP * s)).powi(2);
            }
            sum
        })
        .sum();
    let likely: f64 =
        shape.numbers().iter().zip(x).map(|(n, x)| 0.5 * ((x - n.start) / n.prior).powi(2)).sum();
    Some((each + groups + likely, replays))
}

/// Normal equations of one run: shared numbers, then its own.
struct Normal {
    h: Vec<f64>,
    g: Vec<f64>,
}

fn normal(
    shape: &Shape,
    x: &[f64],
    own: &[f64; OWN],
    run: &Run,
    at: &Replay,
    spread: &Spread,
) -> Option<Normal> {
    let numbers = shape.numbers();
    let size = x.len() + OWN;
    let n = at.e.len();
    let mut columns: Vec<Vec<f64>> = Vec::with_capacity(size);
    let mut p = x.to_vec();
    for (j, number) in numbers.iter().enumerate() {
        let step = number.scale * if number.stepped { 0.05 } else { 1e-3 };
        let step = if p[j] + step > number.high { -step } else { step };
        let keep = p[j];
        p[j] += step;
        let there = replay(shape, &p, &own_of(shape, run, own), run.seen_by(shape))?;
        p[j] = keep;
        columns.push(there.e.iter().zip(&at.e).map(|(a, b)| (a - b) / step).collect());
    }
    for k in 0..OWN {
        let step = if k == 0 { 1e-6 } else { 1e-3 };
        let mut moved = *own;
        moved[k] += step;
        let there = replay(shape, x, &own_of(shape, run, &moved), run.seen_by(shape))?;
        columns.push(there.e.iter().zip(&at.e).map(|(a, b)| (a - b) / step).collect());
    }
    let scale = INDEPENDENT / n.max(1) as f64 / (spread.residual_n * spread.residual_n);
    let weights: Vec<f64> = at
        .e
        .iter()
        .map(|e| {
            scale
                * if e.abs() <= HUBER * spread.residual_n { 1.0 } else { HUBER * spread.residual_n / e.abs() }
        })
        .collect();
    let mut h = vec![0.0; size * size];
    let mut g = vec![0.0; size];
    for a in 0..size {
        let weighted: Vec<f64> = columns[a].iter().zip(&weights).map(|(c, w)| c * w).collect();
        g[a] = weighted.iter().zip(&at.e).map(|(c, e)| c * e).sum();
        for b in 0..=a {
            let sum: f64 = weighted.iter().zip(&columns[b]).map(|(p, q)| p * q).sum();
            h[a * size + b] = sum;
            h[b * size + a] = sum;
        }
    }
    for k in 0..OWN {
        let s = if k == 0 { spread.shift_m } else { spread.friction_log };
        h[(x.len() + k) * size + x.len() + k] += 1.0 / (s * s);
        g[x.len() + k] += own[k] / (s * s);
    }
    Some(Normal { h, g })
}

fn minimise(
    shape: &Shape,
    x: &mut Vec<f64>,
    own: &mut Vec<[f64; OWN]>,
    runs: &[&Run],
    spread: &Spread,
    steps: usize,
) -> Option<(f64, Vec<Replay>)> {
    let numbers = shape.numbers();
    let (shared, size) = (x.len(), x.len() + OWN * runs.len());
    let (mut cost, mut replays) = evaluate(shape, x, own, runs, spread)?;
    let mut damping = 1e-2;
    for _ in 0..steps {
        let parts: Option<Vec<Normal>> = runs
            .par_iter()
            .zip(own.par_iter())
            .zip(replays.par_iter())
            .map(|((run, own), at)| normal(shape, x, own, run, at, spread))
            .collect();
        let parts = parts?;
        let mut h = vec![0.0; size * size];
        let mut g = vec![0.0; size];
        let block = shared + OWN;
        for (r, part) in parts.iter().enumerate() {
            let place = |k: usize| if k < shared { k } else { shared + OWN * r + (k - shared) };
            for a in 0..block {
                g[place(a)] += part.g[a];
                for b in 0..block {
                    h[place(a) * size + place(b)] += part.h[a * block + b];
                }
            }
        }
        for (_, members) in gain::speeds(runs) {
            let n = members.len() as f64;
            for (k, s) in [spread.shift_m, spread.friction_log].into_iter().enumerate() {
                let mean = members.iter().map(|r| own[*r][k]).sum::<f64>() / n;
                let weight = 1.0 / (GROUP * s * n).powi(2);
                for a in &members {
                    g[shared + OWN * a + k] += weight * n * mean;
                    for b in &members {
                        h[(shared + OWN * a + k) * size + shared + OWN * b + k] += weight;
                    }
                }
            }
        }
        for (k, n) in numbers.iter().enumerate() {
            let weight = 1.0 / (n.prior * n.prior);
            h[k * size + k] += weight;
            g[k] += weight * (x[k] - n.start);
        }
        // What stands at a bound and wants beyond stays there.
        let fixed: Vec<bool> = (0..size)
            .map(|k| {
                k < shared
                    && ((x[k] <= numbers[k].low && g[k] > 0.0) || (x[k] >= numbers[k].high && g[k] < 0.0))
            })
            .collect();
        let mut better = false;
        for _ in 0..7 {
            let Some(step) = solve(&h, &g, &fixed, size, damping, &numbers) else {
                damping *= 10.0;
                continue;
            };
            let nx: Vec<f64> =
                (0..shared).map(|k| (x[k] - step[k]).clamp(numbers[k].low, numbers[k].high)).collect();
            let nown: Vec<[f64; OWN]> = own
                .iter()
                .enumerate()
                .map(|(r, o)| {
                    let d = &step[shared + OWN * r..];
                    [(o[0] - d[0]).clamp(-3e-3, 3e-3), (o[1] - d[1]).clamp(-1.0, 1.0)]
                })
                .collect();
            if let Some((next, there)) = evaluate(shape, &nx, &nown, runs, spread)
                && next < cost
            {
                let gain = (cost - next) / cost;
                (*x, *own, cost, replays) = (nx, nown, next, there);
                damping = (damping * 0.2).max(1e-7);
                better = gain > 3e-4;
                break;
            }
            damping *= 4.0;
        }
        if !better {
            break;
        }
    }
    Some((cost, replays))
}

/// Solves `(H + damping D) step = g` by Cholesky; fixed numbers do not move.
fn solve(
    h: &[f64],
    g: &[f64],
    fixed: &[bool],
    size: usize,
    damping: f64,
    numbers: &[crate::shape::Number],
) -> Option<Vec<f64>> {
    let mut a = h.to_vec();
    let mut b = g.to_vec();
    for k in 0..size {
        let least = numbers.get(k).map_or(1e-9, |n| 1e-3 / (n.scale * n.scale));
        a[k * size + k] += damping * h[k * size + k].max(least);
        if fixed[k] {
            for j in 0..size {
                a[k * size + j] = 0.0;
                a[j * size + k] = 0.0;
            }
            a[k * size + k] = 1.0;
            b[k] = 0.0;
        }
    }
    for j in 0..size {
        for i in j..size {
            let mut sum = a[i * size + j];
            for k in 0..j {
                sum -= a[i * size + k] * a[j * size + k];
            }
            if i == j {
                if sum <= 0.0 || !sum.is_finite() {
                    return None;
                }
                a[j * size + j] = libm::sqrt(sum);
            } else {
                a[i * size + j] = sum / a[j * size + j];
            }
        }
    }
    for i in 0..size {
        for k in 0..i {
            b[i] -= a[i * size + k] * b[k];
        }
        b[i] /= a[i * size + i];
    }
    for i in (0..size).rev() {
        for k in i + 1..size {
            b[i] -= a[k * size + i] * b[k];
        }
        b[i] /= a[i * size + i];
    }
    b.iter().all(|x| x.is_finite()).then_some(b)
}
