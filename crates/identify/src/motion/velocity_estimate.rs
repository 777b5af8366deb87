//! Estimates velocity and its jumps from recorded positions with little noise.
//!
//! Friction turns a velocity error into a force error (0.01 mm/s are 5 mN at 500 Ns/m), so the wide windows of
//! `stylet_record::differentiate` would leave residuals at every ripple and stop. Here each window is as narrow as the position noise
//! allows and ends at velocity jumps, which are located at the intersection of the parabolas on both sides.

use stylet_stats::least_squares::NormalEquations;
use stylet_stats::order_statistics::median;

/// Target standard deviation of the velocity (m/s), which determines the window: 2.5 mN at 500 Ns/m.
const TARGET_SD_MPS: f64 = 5e-6;
/// Largest half window (samples); with more noise, positions are smoothed instead (`smooth_positions`).
const MAX_HALF_WINDOW: usize = 12;
/// A time step longer than this many sampling intervals is a gap, which no window crosses.
const MAX_GAP_STEPS: f64 = 5.5;
/// Longest gap (s) in which a velocity jump is located: within it the velocity is assumed to change once.
const MAX_JUMP_GAP_S: f64 = 0.1;
/// Smallest velocity jump (m/s): 10 mN at 500 Ns/m.
pub const MIN_JUMP_MPS: f64 = 2e-5;

/// A velocity jump between two samples, located at the intersection of both motions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityJump {
    /// Index of the sample after the jump.
    pub next_sample: usize,
    /// Time in s.
    pub time_s: f64,
    /// Recorded position in m.
    pub position_m: f64,
    /// Velocities in m/s before and after.
    pub velocity_mps: [f64; 2],
    /// Standard deviation of the intersection position in m.
    pub position_sd_m: f64,
}

/// Velocity at the samples, its noise, and jumps.
#[derive(Clone, Debug, Default)]
pub struct VelocityEstimate {
    /// Velocity in m/s at every sample.
    pub velocity_mps: Vec<f64>,
    /// Standard deviation in m/s due to position noise.
    pub sd_mps: f64,
    /// Whether positions are precise enough for higher-order derivatives: the difference of two neighbouring samples determines the
    /// velocity to 5e-6 m/s, as in simulated recordings.
    pub precise_positions: bool,
    /// Velocity jumps.
    pub jumps: Vec<VelocityJump>,
}

/// Estimates the velocity from positions `z` (m) at times `t` (s).
pub(crate) fn estimate_velocity(t: &[f64], z: &[f64]) -> VelocityEstimate {
    let n = t.len().min(z.len());
    if n < 8 {
        return VelocityEstimate {
            velocity_mps: vec![0.0; n],
            sd_mps: f64::INFINITY,
            ..VelocityEstimate::default()
        };
    }
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let step = median(&mut steps).max(1e-9);
    let noise_m = position_noise(t, z);
    // Standard error of the slope of a line over 2 m + 1 samples: noise / (step sqrt(m (m+1) (2m+1) / 3)).
    let gain = |m: usize| 1.0 / (step * ((m * (m + 1) * (2 * m + 1)) as f64 / 3.0).sqrt());
    let precise_positions = core::f64::consts::SQRT_2 * noise_m <= TARGET_SD_MPS * step;
    let half = (1..MAX_HALF_WINDOW).find(|m| noise_m * gain(*m) <= TARGET_SD_MPS).unwrap_or(MAX_HALF_WINDOW);
    let side = (2 * half + 2).max(6);
    // Five standard errors of the slope at the end of a parabola over `side` samples, noise sqrt(192/side^3)/step each.
    let jump_sd = 70.0 * noise_m / (step * libm::pow(side as f64, 1.5));
    let mut edges: Vec<usize> = vec![0];
    edges.extend((1..n).filter(|i| t[*i] - t[i - 1] > MAX_GAP_STEPS * step));
    edges.push(n);
    let mut jumps = Vec::new();
    for (i, left, right) in
        slope_breaks(t, z, side, (MAX_GAP_STEPS * step, MAX_JUMP_GAP_S.max(MAX_GAP_STEPS * step)), jump_sd)
    {
        let v = [left.2, right];
        jumps.push(VelocityJump {
            next_sample: i,
            time_s: left.0,
            position_m: left.1,
            velocity_mps: v,
            position_sd_m: noise_m.min(1e-6),
        });
        edges.push(i);
    }
    edges.sort_unstable();
    edges.dedup();
    let mut v = vec![0.0; n];
    for piece in edges.windows(2) {
        let (from, to) = (piece[0], piece[1]);
        for i in from..to {
            let reach = half.min(i - from).min(to - 1 - i);
            if i >= from + 2 && i + 2 < to && precise_positions {
                v[i] = quartic_slope(&t[i - 2..=i + 2], &z[i - 2..=i + 2]);
                continue;
            }
            let (lo, hi) = if reach == half {
                (i - half, i + half + 1)
            } else {
                // Next to an edge the window is one-sided and wider.
                let lo = i.saturating_sub(half.max(2)).max(from);
                let hi = (i + half.max(2) + 1).min(to);
                if hi - lo >= 3 { (lo, hi) } else { (from, to.min(from + 3)) }
            };
            v[i] = slope_at(&t[lo..hi], &z[lo..hi], t[i]);
        }
    }
    VelocityEstimate { velocity_mps: v, sd_mps: noise_m * gain(half), precise_positions, jumps }
}

/// Standard deviation (m) of the position noise from third divided differences, which vanish for smooth motion under irregular sampling,
/// and from the encoder step.
pub(super) fn position_noise(t: &[f64], z: &[f64]) -> f64 {
    let mut d: Vec<f64> = t
        .windows(4)
        .zip(z.windows(4))
        .map(|(t, z)| {
            let (mut sum, mut squares) = (0.0, 0.0);
            for i in 0..4 {
                let product: f64 = (0..4).filter(|j| *j != i).map(|j| t[i] - t[j]).product();
                sum += z[i] / product;
                squares += 1.0 / (product * product);
            }
            sum.abs() / squares.sqrt()
        })
        .collect();
    // Differences of quantised positions at rest are zero and give no information.
    d.retain(|d| *d > 0.0);
    (median(&mut d) * stylet_stats::MAD_TO_SD).max(encoder_step(z) / 12.0_f64.sqrt())
}

/// Smallest plausible encoder step in m; smaller differences are floating-point rounding.
const MIN_ENCODER_STEP_M: f64 = 1e-9;
/// Largest distance of the position differences from multiples of the encoder step, as a share of the step, in quantised positions.
const MAX_FRACTIONAL_STEP: f64 = 0.02;
/// Smallest share of samples in which the number of steps changes, in quantised positions; in exact positions at constant velocity with
/// rests it changes rarely.
const MIN_CHANGED_SHARE: f64 = 0.005;

/// Encoder step (m) of quantised positions; zero if they are not quantised.
///
/// A needle slower than one step per sample rests in most samples, so differences of neighbouring samples do not show the noise.
pub(super) fn encoder_step(z: &[f64]) -> f64 {
    let moves = || z.windows(2).map(|w| w[1] - w[0]).filter(|d| d.is_finite());
    let mut sizes: Vec<f64> = moves().map(f64::abs).filter(|d| *d > MIN_ENCODER_STEP_M).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let small = sizes.len() / 100;
    let step = *sizes.select_nth_unstable_by(small, f64::total_cmp).1;
    let count = |d: f64| libm::round(d / step);
    let broken = moves().filter(|d| (d / step - count(*d)).abs() > MAX_FRACTIONAL_STEP).count();
    if 100 * broken > z.len() {
        return 0.0;
    }
    let uneven = moves().zip(moves().skip(1)).filter(|(a, b)| count(*a) != count(*b)).count();
    if uneven as f64 > MIN_CHANGED_SHARE * z.len() as f64 { step } else { 0.0 }
}

/// Slope break: index of the sample after it, (time, position, slope before), slope after.
pub(super) type SlopeBreak = (usize, (f64, f64, f64), f64);

/// Finds gaps between two samples at which parabolas on both sides meet with slopes that differ by more than `doubt_mps` plus the smallest
/// jump. Windows do not cross gaps longer than `gap_s`; no jump is located in gaps longer than `longest_s`.
pub(super) fn slope_breaks(
    t: &[f64],
    z: &[f64],
    side: usize,
    (gap_s, longest_s): (f64, f64),
    doubt_mps: f64,
) -> Vec<SlopeBreak> {
    let n = t.len();
    let gaps: Vec<usize> = (1..n).filter(|i| t[*i] - t[i - 1] > gap_s).collect();
    let within =
        |from: usize, to: usize| gaps.get(gaps.partition_point(|g| *g <= from)).is_none_or(|g| *g >= to);
    let mut found: Vec<(f64, SlopeBreak)> = Vec::new();
    for i in side..n.saturating_sub(side) {
        if t[i] - t[i - 1] > longest_s || !within(i - side, i) || !within(i, i + side) {
            continue;
        }
        let (left, off_left) = fit_parabola(&t[i - side..i], &z[i - side..i], t[i - 1]);
        let (right, off_right) = fit_parabola(&t[i..i + side], &z[i..i + side], t[i]);
        let dt = t[i] - t[i - 1];
        // Slopes extrapolated to the middle of the gap.
        let (vl, vr) = (left[1] + left[2] * dt, right[1] - right[2] * dt);
        let jump = (vr - vl).abs();
        let curved = (left[2].abs() + right[2].abs()) * dt;
        if jump < MIN_JUMP_MPS + doubt_mps || jump < 2.0 * curved {
            continue;
        }
        // Solves z_left + v_left s = z_right - v_right (dt - s).
        let s = (right[0] - right[1] * dt - left[0]) / (left[1] - right[1]);
        // In a long gap, an intersection outside of it indicates more than one velocity change.
        if dt > gap_s && !(0.0..=dt).contains(&s) {
            continue;
        }
        let s = s.clamp(0.0, dt);
        found.push((off_left + off_right, (i, (t[i - 1] + s, left[0] + left[1] * s, left[1]), right[1])));
    }
    // Of neighbouring candidates, the one with the smallest residual is kept.
    let mut out: Vec<SlopeBreak> = Vec::new();
    let mut last = 0.0;
    for (off, at) in found {
        match out.last_mut() {
            Some(before) if at.0 - before.0 <= side => {
                if off < last {
                    *before = at;
                    last = off;
                }
            }
            _ => {
                out.push(at);
                last = off;
            }
        }
    }
    out
}

/// Least-squares parabola `a + b s + c s^2`, `s = t - at`, and its residual sum of squares.
pub(super) fn fit_parabola(t: &[f64], z: &[f64], at: f64) -> ([f64; 3], f64) {
    let span = t.last().zip(t.first()).map_or(1.0, |(b, a)| (b - a).max(1e-12));
    let base = z.first().copied().unwrap_or(0.0);
    let mut sums = NormalEquations::<3>::new(3);
    for (t, z) in t.iter().zip(z) {
        let s = (t - at) / span;
        sums.add(&[1.0, s, s * s], z - base);
    }
    let x = sums.solve();
    let left = |(t, z): (&f64, &f64)| {
        let s = (t - at) / span;
        (z - base - x[0] - (x[1] + x[2] * s) * s).powi(2)
    };
    let off = t.iter().zip(z).map(left).sum();
    ([x[0] + base, x[1] / span, x[2] / (span * span)], off)
}

/// Slope at the middle of five samples of the quartic through them; a parabola over the same samples has a larger bias (a thousandth of the
/// velocity for three samples at 2 Hz).
fn quartic_slope(t: &[f64], z: &[f64]) -> f64 {
    let at = t[2];
    (0..5)
        .filter(|j| *j != 2)
        .map(|j| {
            // Derivative of the Lagrange polynomial j at the middle.
            let others = (0..5).filter(|k| *k != 2 && *k != j);
            let weight: f64 = others.map(|k| (at - t[k]) / (t[j] - t[k])).product();
            (z[j] - z[2]) * weight / (t[j] - at)
        })
        .sum()
}

/// Slope at time `at` of a least-squares parabola, or of the line through two samples; zero for fewer.
fn slope_at(t: &[f64], z: &[f64], at: f64) -> f64 {
    match (t, z) {
        ([], _) | (_, []) | ([_], _) => 0.0,
        ([a, b], [y, x]) => (x - y) / (b - a),
        _ => fit_parabola(t, z, at).0[1],
    }
}

#[cfg(test)]
mod tests;
