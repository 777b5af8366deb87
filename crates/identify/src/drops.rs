//! Drops of the measured force: local regressions with a step.
//!
//! Around every block the force is regressed on `1, t, t after, v, sgn v` and a step, over 0.2 s and over 0.7 s on each
//! side, the block itself left out (a step inside it is blended). What friction and stiffness do is smooth or follows the
//! speed; what remains as a fall is a rupture, of a layer or of something that the layers do not know.

use crate::blocks::Blocks;
use crate::linear::Symmetric;
use stylet_stats::order::median;

/// One drop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drop {
    /// Instant in s.
    pub time_s: f64,
    /// Recorded position in m.
    pub position_m: f64,
    /// By how much the force falls, in N.
    pub size_n: f64,
    /// The same in standard deviations.
    pub score: f64,
}

/// Half widths in s.
const WINDOWS_S: [f64; 2] = [0.2, 0.7];
/// A drop has at least this many standard deviations.
const LEAST_SD: f64 = 5.0;
/// Two drops nearer than this are one.
const APART_S: f64 = 0.12;
/// Regressors.
const N: usize = 6;

/// The drops of a recording, in order of time.
#[must_use]
pub fn drops(b: &Blocks) -> Vec<Drop> {
    let length_s = b.step_s * b.samples as f64;
    let mut found: Vec<Drop> = Vec::new();
    let motion: Vec<(f64, f64)> =
        (0..b.len()).map(|k| b.motion.at(0.5 * (b.from_s[k] + b.to_s[k]))).collect();
    for window_s in WINDOWS_S {
        let half = ((window_s / length_s).round() as usize).max(6);
        for drop in peaks(b, &motion, half) {
            if found.iter().all(|d| (d.time_s - drop.time_s).abs() > APART_S.max(0.3 * window_s)) {
                found.push(drop);
            }
        }
    }
    found.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    found
}

fn peaks(b: &Blocks, motion: &[(f64, f64)], half: usize) -> Vec<Drop> {
    let n = b.len();
    if n < 2 * half + 2 {
        return Vec::new();
    }
    let mut steps = vec![(0.0, f64::INFINITY, f64::INFINITY); n];
    for k in half..n - half {
        let gap = (k - half + 1..=k + half).any(|i| b.restart[i] && b.used[i] && b.used[i - 1]);
        if !gap {
            steps[k] = step(b, motion, k, half);
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
            scores[k] > LEAST_SD
                && (lo..hi).all(|j| if j < k { scores[j] < scores[k] } else { scores[j] <= scores[k] })
        })
        .map(|k| Drop {
            time_s: 0.5 * (b.from_s[k] + b.to_s[k]),
            position_m: motion[k].0,
            size_n: -steps[k].0,
            score: scores[k],
        })
        .collect()
}

/// Step at block `k`: its size, its standard deviation for unit noise, the noise.
fn step(b: &Blocks, motion: &[(f64, f64)], k: usize, half: usize) -> (f64, f64, f64) {
    let (from, to) = (k - half, k + half + 1);
    let v0 = motion[k].1;
    let scale = (from..to).map(|i| (motion[i].1 - v0).abs()).fold(1e-7, f64::max);
    let mut h = Symmetric::zeros(N);
    let mut g = [0.0; N];
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
        let y = b.f[i];
        yy += y * y;
        count += 1.0;
        for p in 0..N {
            g[p] += row[p] * y;
            for q in 0..=p {
                h.add(p, q, row[p] * row[q]);
            }
        }
    }
    if sides[0] < 4 || sides[1] < 4 {
        return (0.0, f64::INFINITY, f64::INFINITY);
    }
    // Friction that hardly changes is not sought for.
    h.add(3, 3, 1e-3 * count);
    h.add(4, 4, 1e-3 * count);
    let factor = h.factor();
    let x = factor.solve(&g);
    let left = yy - x.iter().zip(&g).map(|(x, g)| x * g).sum::<f64>();
    let noise = (left.max(0.0) / (count - N as f64).max(1.0)).sqrt();
    (x[5], factor.inverse_diagonal()[5].sqrt(), noise)
}
