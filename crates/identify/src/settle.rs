//! Position and velocity from noisy or coarsely rounded positions: as wide a window as the course allows.
//!
//! Samples are averaged in cells of about 20 ms. Jumps of the speed are where parabolas on both sides of a gap between
//! cells meet with clearly different slopes. Between jumps every cell takes the widest of a ladder of windows whose
//! local parabola agrees with all narrower ones (intersection of confidence intervals: Goldenshluger and Nemirovski 1997).
//! A stretch between two jumps that does not move is at rest exactly.

use crate::velocity::{Kink, breaks, parabola, position_noise};
use stylet_stats::order::median;

/// Length of a cell in s.
const CELL_S: f64 = 0.02;
/// Cells on each side in the search for a jump.
const SIDE: usize = 15;
/// Half windows in cells.
const LADDER: [usize; 8] = [3, 5, 8, 12, 18, 27, 40, 60];
/// Width of the confidence intervals in standard deviations.
const GAMMA: f64 = 2.2;
/// A stretch is at rest when it moves less than this many standard deviations.
const REST_SD: f64 = 4.0;

/// A smoothed course at the times of the samples.
#[derive(Clone, Debug, Default)]
pub struct Settled {
    /// Position in m.
    pub z: Vec<f64>,
    /// Velocity in m/s.
    pub v: Vec<f64>,
    /// Jumps of the speed.
    pub kinks: Vec<Kink>,
    /// Typical standard deviation of the velocity in m/s.
    pub sd_mps: f64,
}

/// Smooths positions `z` (m) at times `t` (s).
#[must_use]
pub fn settle(t: &[f64], z: &[f64]) -> Settled {
    let n = t.len().min(z.len());
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let step = median(&mut steps).max(1e-9);
    let q = ((CELL_S / step).round() as usize).max(1);
    let mean =
        |x: &[f64]| -> Vec<f64> { x.chunks(q).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect() };
    let (tc, zc) = (mean(&t[..n]), mean(&z[..n]));
    let cells = tc.len();
    if cells < 2 * SIDE + 2 {
        let v = stylet_record::differentiate(t, z, 0.1);
        return Settled { z: z.to_vec(), v, kinks: Vec::new(), sd_mps: f64::INFINITY };
    }
    let noise_m =
        (position_noise(t, z) / (q as f64).sqrt()).max(rounding(z) / 12.0_f64.sqrt() / (q as f64).sqrt());
    let dt = step * q as f64;
    // Slope at the end of a parabola over `side` cells: sd = noise sqrt(192/side^3)/dt; six of the difference of two.
    let doubt = 6.0 * 2.0_f64.sqrt() * 13.9 * noise_m / (dt * (SIDE as f64).powf(1.5));
    let found = breaks(&tc, &zc, SIDE, 1.8 * dt, doubt);
    let mut edges: Vec<usize> = found.iter().map(|b| b.0).collect();
    edges.extend([0, cells]);
    edges.dedup();
    edges.sort_unstable();
    edges.dedup();
    let (mut zs, mut vs) = (vec![0.0; cells], vec![0.0; cells]);
    let mut sds = Vec::new();
    for piece in edges.windows(2) {
        let (from, to) = (piece[0], piece[1]);
        if at_rest(&tc[from..to], &zc[from..to], noise_m) {
            let rest = zc[from..to].iter().sum::<f64>() / (to - from) as f64;
            zs[from..to].fill(rest);
            continue;
        }
        for i in from..to {
            let (z, v, sd) = widest(&tc, &zc, i, (from, to), noise_m);
            (zs[i], vs[i]) = (z, v);
            sds.push(sd);
        }
    }
    let at = |i: usize| {
        let c = (i / q).min(cells - 1);
        // Towards the neighbour on the sample's side, not across a jump.
        let other = if t[i] < tc[c] { c.wrapping_sub(1) } else { c + 1 };
        let apart = other >= cells || edges.iter().any(|e| (*e > c.min(other)) && (*e <= c.max(other)));
        if apart {
            return (zs[c] + vs[c] * (t[i] - tc[c]), vs[c]);
        }
        let share = (t[i] - tc[c]) / (tc[other] - tc[c]);
        (zs[c] + share * (zs[other] - zs[c]), vs[c] + share * (vs[other] - vs[c]))
    };
    let (z, v): (Vec<f64>, Vec<f64>) = (0..n).map(at).unzip();
    let kinks = found
        .iter()
        .map(|&(c, left, _)| {
            let sample = t.partition_point(|t| *t < left.0).max(1);
            Kink { sample, t: left.0, z: left.1, v: [vs[c - 1], vs[c.min(cells - 1)]] }
        })
        .collect();
    Settled { z, v, kinks, sd_mps: median(&mut sds).max(1e-9) }
}

/// The step of rounded positions, zero when they take (nearly) as many values as there are samples.
fn rounding(z: &[f64]) -> f64 {
    let mut steps: Vec<f64> = z.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let still = steps.iter().filter(|s| **s == 0.0).count();
    if 5 * still < steps.len() {
        return 0.0;
    }
    steps.retain(|s| *s > 1e-12);
    steps.sort_unstable_by(f64::total_cmp);
    steps.get(steps.len() / 10).copied().unwrap_or(0.0)
}

/// Whether a stretch does not move: neither a slope nor a spread beyond the noise.
fn at_rest(t: &[f64], z: &[f64], noise_m: f64) -> bool {
    let n = t.len();
    if n < 4 {
        return false;
    }
    let middle = t[n / 2];
    let line = parabola(t, z, middle).0;
    let span = t[n - 1] - t[0];
    let travel_sd = noise_m * (12.0 / n as f64).sqrt();
    let mean = z.iter().sum::<f64>() / n as f64;
    let spread = (z.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / n as f64).sqrt();
    (line[1] * span).abs() < REST_SD * travel_sd + 2e-7 && spread < 1.6 * noise_m + 1e-7
}

/// Position, velocity and its standard deviation at cell `i` from the widest window that agrees with all narrower ones.
fn widest(t: &[f64], z: &[f64], i: usize, (from, to): (usize, usize), noise_m: f64) -> (f64, f64, f64) {
    let mut best = (z[i], 0.0, f64::INFINITY);
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for half in LADDER {
        let (lo, hi) = (i.saturating_sub(half).max(from), (i + half + 1).min(to));
        let n = hi - lo;
        if n < 4 {
            continue;
        }
        let span = (t[hi - 1] - t[lo]).max(1e-9);
        // Slope of a parabola over n cells: in the middle as of a line, at the end four times as uncertain.
        let off = ((2.0 * t[i] - t[lo] - t[hi - 1]) / span).abs().min(1.0);
        let sd = noise_m * (12.0 / n as f64).sqrt() / span * (1.0 + 15.0 * off * off).sqrt();
        let [value, slope, _] = parabola(&t[lo..hi], &z[lo..hi], t[i]).0;
        low = low.max(slope - GAMMA * sd);
        high = high.min(slope + GAMMA * sd);
        if low > high {
            break;
        }
        best = (value, slope, sd);
        if lo == from && hi == to {
            break;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::settle;

    /// Advance with ripple, a hold, a retraction.
    fn course(t: f64) -> (f64, f64) {
        let w = core::f64::consts::TAU * 0.4;
        let a = 0.001;
        if t < 6.0 {
            (0.003 * t + a / w * (1.0 - (w * t).cos()), 0.003 + a * (w * t).sin())
        } else if t < 9.0 {
            (course(6.0 - 1e-9).0, 0.0)
        } else {
            (course(7.0).0 - 0.004 * (t - 9.0), -0.004)
        }
    }

    fn error(noise: impl Fn(usize) -> f64, round_m: f64) -> (f64, usize) {
        let t: Vec<f64> = (0..2400).map(|k| k as f64 / 200.0).collect();
        let round = |z: f64| if round_m > 0.0 { (z / round_m).round() * round_m } else { z };
        let z: Vec<f64> = t.iter().enumerate().map(|(k, t)| round(course(*t).0 + noise(k))).collect();
        let found = settle(&t, &z);
        let mut off: Vec<f64> = found.v.iter().zip(&t).map(|(v, t)| (v - course(*t).1).abs()).collect();
        off.sort_unstable_by(f64::total_cmp);
        (off[off.len() * 9 / 10], found.kinks.len())
    }

    /// A fixed sequence that looks like noise of unit variance.
    fn rough(k: usize) -> f64 {
        let mut h = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut sum = 0.0;
        for _ in 0..12 {
            h ^= h >> 29;
            h = h.wrapping_mul(0xbf58_476d_1ce4_e5b9);
            sum += (h >> 40) as f64 / (1u64 << 24) as f64;
        }
        sum - 6.0
    }

    #[test]
    fn positions_with_20_um_of_noise_give_the_velocity_to_a_tenth_of_a_millimetre_per_second() {
        let (off, kinks) = error(|k| 2e-5 * rough(k), 0.0);
        assert!(off < 1e-4, "{off}");
        assert_eq!(kinks, 2);
    }

    #[test]
    fn so_do_positions_in_steps_of_50_um() {
        let (off, kinks) = error(|_| 0.0, 5e-5);
        assert!(off < 1e-4, "{off}");
        assert_eq!(kinks, 2);
    }
}
