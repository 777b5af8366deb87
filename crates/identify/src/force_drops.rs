//! Detects drops of the measured force by local regressions with a step.
//!
//! Around every block, the force over 0.2 s and over 0.7 s on each side is regressed on `1, t, max(t, 0), v, sgn v` and a step; the block
//! itself is excluded because its mean contains part of the step. Friction and stiffness are covered by the other regressors, so a
//! significant negative step is the rupture of a layer or of an unmodelled structure.

use crate::block_averages::BlockAverages;
use stylet_stats::least_squares::NormalEquations;
use stylet_stats::order_statistics::median;

/// A force drop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceDrop {
    /// Time in s.
    pub time_s: f64,
    /// Recorded position in m.
    pub position_m: f64,
    /// Size in N.
    pub size_n: f64,
    /// Size in standard deviations of its estimate.
    pub score: f64,
}

/// Half widths of the regression window in s: the short one separates close ruptures, the long one finds small drops.
const WINDOWS_S: [f64; 2] = [0.2, 0.7];
/// Smallest score of a drop, in standard deviations.
const MIN_SCORE: f64 = 5.0;
/// Drops closer than this (s) count as one.
const MIN_SEPARATION_S: f64 = 0.12;
/// Number of regressors.
const REGRESSORS: usize = 6;

/// Force drops of a recording, in order of time.
#[must_use]
pub fn detect_force_drops(b: &BlockAverages) -> Vec<ForceDrop> {
    let length_s = b.block_s();
    let mut found: Vec<ForceDrop> = Vec::new();
    let motion: Vec<(f64, f64)> = (0..b.len()).map(|k| b.motion.at(b.mid_s(k))).collect();
    for window_s in WINDOWS_S {
        let half = ((window_s / length_s).round() as usize).max(6);
        for drop in score_peaks(b, &motion, half) {
            if found.iter().all(|d| (d.time_s - drop.time_s).abs() > MIN_SEPARATION_S.max(0.3 * window_s)) {
                found.push(drop);
            }
        }
    }
    found.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    found
}

fn score_peaks(b: &BlockAverages, motion: &[(f64, f64)], half: usize) -> Vec<ForceDrop> {
    let n = b.len();
    if n < 2 * half + 2 {
        return Vec::new();
    }
    let mut steps = vec![(0.0, f64::INFINITY, f64::INFINITY); n];
    for k in half..n - half {
        let gap = (k - half + 1..=k + half).any(|i| b.memory_reset[i] && b.used[i] && b.used[i - 1]);
        if !gap {
            steps[k] = fit_step(b, motion, k, half);
        }
    }
    let mut sds: Vec<f64> = steps.iter().map(|s| s.2).filter(|s| s.is_finite()).collect();
    let floor = 0.7 * median(&mut sds);
    let score = |k: usize| {
        if steps[k].1.is_finite() { -steps[k].0 / (steps[k].1 * steps[k].2.max(floor)) } else { 0.0 }
    };
    let scores: Vec<f64> = (0..n).map(score).collect();
    let reach = (half / 2).max(3);
    (half..n - half)
        .filter(|&k| {
            let (lo, hi) = (k - reach.min(k), (k + reach + 1).min(n));
            scores[k] > MIN_SCORE
                && (lo..hi).all(|j| if j < k { scores[j] < scores[k] } else { scores[j] <= scores[k] })
        })
        .map(|k| ForceDrop {
            time_s: b.mid_s(k),
            position_m: motion[k].0,
            size_n: -steps[k].0,
            score: scores[k],
        })
        .collect()
}

/// Regression with a step at block `k`: step (N), its standard deviation for unit noise, residual standard deviation (N).
fn fit_step(b: &BlockAverages, motion: &[(f64, f64)], k: usize, half: usize) -> (f64, f64, f64) {
    let (from, to) = (k - half, k + half + 1);
    let v0 = motion[k].1;
    let scale = (from..to).map(|i| (motion[i].1 - v0).abs()).fold(1e-7, f64::max);
    let mut sums = NormalEquations::<REGRESSORS>::new(REGRESSORS);
    let mut yy = 0.0;
    let mut count = 0.0;
    let mut sides = [0; 2];
    for i in (from..to).filter(|i| *i != k && b.used[*i]) {
        let t = (i as f64 - k as f64) / half as f64;
        let after = f64::from(u8::from(i > k));
        let v = motion[i].1;
        let sgn = if v.abs() > 1e-5 { v.signum() } else { 0.0 };
        let row = [1.0, t, t.max(0.0), (v - v0) / scale, sgn, after];
        sides[usize::from(i > k)] += 1;
        let y = b.force_n[i];
        yy += y * y;
        count += 1.0;
        sums.add(&row, y);
    }
    if sides[0] < 4 || sides[1] < 4 {
        return (0.0, f64::INFINITY, f64::INFINITY);
    }
    // Ridge for velocity terms that hardly change within the window.
    let mut h = sums.matrix();
    h.add(3, 3, 1e-3 * count);
    h.add(4, 4, 1e-3 * count);
    let factor = h.cholesky();
    let x = factor.solve(sums.moments());
    let left = yy - x.iter().zip(sums.moments()).map(|(x, g)| x * g).sum::<f64>();
    let noise = (left.max(0.0) / (count - REGRESSORS as f64).max(1.0)).sqrt();
    (x[5], factor.inverse_diagonal()[5].sqrt(), noise)
}

#[cfg(test)]
mod tests;
