//! Velocity and its jumps from recorded positions with little noise.
//!
//! Friction turns a velocity error into a force error (0.01 mm/s are 5 mN at 500 Ns/m), so wide windows
//! (`stylet_record::differentiate`) would leave structure at every ripple and stop. Here the window is the
//! narrowest that the position noise allows, and none extends across a velocity jump, whose time is the
//! intersection of the parabolas on both sides.

use stylet_stats::linear_algebra::SymmetricMatrix;
use stylet_stats::order_statistics::median;

/// Target standard deviation of the velocity in m/s.
const TARGET_SD_MPS: f64 = 5e-6;
/// Largest half window in samples.
const MAX_HALF_WINDOW: usize = 12;
/// No window extends across a gap of more than this many sampling intervals.
const MAX_GAP_STEPS: f64 = 5.5;
/// Within a gap of at most this many s the velocity changes at most once: a jump is at the intersection of both
/// sides.
const MAX_JUMP_GAP_S: f64 = 0.1;
/// Smallest velocity jump in m/s.
pub const MIN_JUMP_MPS: f64 = 2e-5;

/// A velocity jump between two samples, located by the positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityJump {
    /// Index of the sample after it.
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

/// Velocities, their noise and jumps.
#[derive(Clone, Debug, Default)]
pub struct VelocityEstimate {
    /// Velocity in m/s at every sample.
    pub velocity_mps: Vec<f64>,
    /// Standard deviation in m/s due to position noise.
    pub sd_mps: f64,
    /// Velocity jumps.
    pub jumps: Vec<VelocityJump>,
}

/// Estimates the velocity from positions `z` (m) at times `t` (s).
#[must_use]
pub fn estimate_velocity(t: &[f64], z: &[f64]) -> VelocityEstimate {
    let n = t.len().min(z.len());
    if n < 8 {
        return VelocityEstimate { velocity_mps: vec![0.0; n], sd_mps: f64::INFINITY, jumps: Vec::new() };
    }
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let step = median(&mut steps).max(1e-9);
    let noise_m = position_noise(t, z);
    // Slope of a line over 2 m + 1 samples: sd = noise / (step sqrt(m (m+1) (2m+1) / 3)).
    let gain = |m: usize| 1.0 / (step * ((m * (m + 1) * (2 * m + 1)) as f64 / 3.0).sqrt());
    let half = (1..MAX_HALF_WINDOW).find(|m| noise_m * gain(*m) <= TARGET_SD_MPS).unwrap_or(MAX_HALF_WINDOW);
    let side = (2 * half + 2).max(6);
    // Slope at the end of a parabola over `side` samples: sd = noise sqrt(192/side^3)/step. Five of them.
    let doubt = 70.0 * noise_m / (step * (side as f64).powf(1.5));
    let mut edges: Vec<usize> = vec![0];
    edges.extend((1..n).filter(|i| t[*i] - t[i - 1] > MAX_GAP_STEPS * step));
    edges.push(n);
    let mut kinks = Vec::new();
    for (i, left, right) in
        slope_breaks(t, z, side, (MAX_GAP_STEPS * step, MAX_JUMP_GAP_S.max(MAX_GAP_STEPS * step)), doubt)
    {
        let v = [left.2, right];
        kinks.push(VelocityJump {
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
            let (lo, hi) = if reach == half {
                (i - half, i + half + 1)
            } else {
                // Next to an edge: one-sided, wider.
                let lo = i.saturating_sub(half.max(2)).max(from);
                let hi = (i + half.max(2) + 1).min(to);
                if hi - lo >= 3 { (lo, hi) } else { (from, to.min(from + 3)) }
            };
            v[i] = slope_at(&t[lo..hi], &z[lo..hi], t[i]);
        }
    }
    VelocityEstimate { velocity_mps: v, sd_mps: noise_m * gain(half), jumps: kinks }
}

/// Standard deviation of position noise from third divided differences, which are insensitive to irregular
/// sampling.
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
    // Quantised positions of a needle at rest do not differ at all.
    d.retain(|d| *d > 0.0);
    (median(&mut d) * stylet_stats::MAD_TO_SD).max(encoder_step(z) / 12.0_f64.sqrt())
}

/// Smallest plausible encoder step in m; smaller differences are floating-point rounding.
const MIN_ENCODER_STEP_M: f64 = 1e-9;
/// Positions are quantised when their differences are whole numbers of steps to within this share ...
const MAX_FRACTIONAL_STEP: f64 = 0.02;
/// ... and the differences change in at least this share of the samples: constant velocity with rests has equal
/// differences, too.
const MIN_CHANGED_SHARE: f64 = 0.005;

/// Encoder step in m to which positions are quantised; zero where they are not.
///
/// A needle slower than one step per sample rests in most samples and moves by a whole step in the others, so
/// differences do not show the noise.
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

/// Slope break: the sample after it, (time, position, slope before), slope after.
pub(super) type SlopeBreak = (usize, (f64, f64, f64), f64);

/// Finds where parabolas on both sides of a gap between two samples intersect with different slopes. Windows do
/// not extend across gaps longer than `gap_s`; gaps longer than `longest_s` are not bridged.
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
        // In a long gap the motion may have been more complex.
        if dt > gap_s && !(0.0..=dt).contains(&s) {
            continue;
        }
        let s = s.clamp(0.0, dt);
        found.push((off_left + off_right, (i, (t[i - 1] + s, left[0] + left[1] * s, left[1]), right[1])));
    }
    // Of neighbouring candidates the one with the smallest residual.
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
    let mut m = [[0.0; 3]; 3];
    let mut g = [0.0; 3];
    for (t, z) in t.iter().zip(z) {
        let s = (t - at) / span;
        let row = [1.0, s, s * s];
        for a in 0..3 {
            g[a] += row[a] * (z - base);
            for b in 0..3 {
                m[a][b] += row[a] * row[b];
            }
        }
    }
    let mut h = SymmetricMatrix::zeros(3);
    for (a, row) in m.iter().enumerate() {
        row.iter().enumerate().take(a + 1).for_each(|(b, x)| h.add(a, b, *x));
    }
    let x = h.cholesky().solve(&g);
    let left = |(t, z): (&f64, &f64)| {
        let s = (t - at) / span;
        (z - base - x[0] - (x[1] + x[2] * s) * s).powi(2)
    };
    let off = t.iter().zip(z).map(left).sum();
    ([x[0] + base, x[1] / span, x[2] / (span * span)], off)
}

/// Slope at `at`: of a parabola, or of a line through two samples.
fn slope_at(t: &[f64], z: &[f64], at: f64) -> f64 {
    match (t, z) {
        ([], _) | (_, []) | ([_], _) => 0.0,
        ([a, b], [y, x]) => (x - y) / (b - a),
        _ => fit_parabola(t, z, at).0[1],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-6), "{told} for {wanted}");
    }

    fn even(n: usize) -> Vec<f64> {
        (0..n).map(|k| k as f64 / 200.0).collect()
    }

    #[test]
    fn the_parabola_is_the_least_squares_fit() {
        let t = [1.0, 1.2, 1.3, 1.9, 2.4];
        let exact = t.map(|t: f64| 4.0 - 3.0 * (t - 1.5) + 7.0 * (t - 1.5).powi(2));
        let (told, off) = fit_parabola(&t, &exact, 1.5);
        [4.0, -3.0, 7.0].iter().zip(told).for_each(|(wanted, told)| near(told, *wanted));
        assert!(off < 1e-20);
        // A residual pattern that no parabola contains: the third difference of five regular values, (1, -2, 0,
        // 2, -1).
        let five = [0.0, 1.0, 2.0, 3.0, 4.0];
        let added = [1.0, -2.0, 0.0, 2.0, -1.0];
        let z: Vec<f64> = five.iter().zip(added).map(|(t, a)| 2.0 + 0.5 * t - t * t + 0.3 * a).collect();
        let (told, off) = fit_parabola(&five, &z, 0.0);
        [2.0, 0.5, -1.0].iter().zip(told).for_each(|(wanted, told)| near(told, *wanted));
        near(off, 0.09 * 10.0);
    }

    #[test]
    fn a_slope_is_that_of_a_parabola_or_of_two_samples() {
        near(slope_at(&[1.0, 2.0, 4.0], &[1.0, 4.0, 16.0], 3.0), 6.0);
        near(slope_at(&[1.0, 4.0], &[1.0, 16.0], 3.0), 5.0);
        assert_eq!((slope_at(&[1.0], &[3.0], 1.0), slope_at(&[], &[], 1.0)), (0.0, 0.0));
    }

    #[test]
    fn the_encoder_step_is_detected_unless_velocity_is_constant() {
        let rounded = |n: usize, speed: f64, step: f64| -> Vec<f64> {
            even(n).iter().map(|t| (speed * t / step).round() * step).collect()
        };
        near(encoder_step(&rounded(1000, 0.003, 5e-5)), 5e-5);
        near(encoder_step(&rounded(1000, 0.013, 5e-5)), 5e-5);
        // One step per sample throughout: constant velocity.
        assert_eq!(encoder_step(&rounded(1000, 0.01, 5e-5)), 0.0);
        // One velocity change in 200 samples still counts as constant velocity.
        let paced = |changes: usize| -> Vec<f64> {
            let mut z = 0.0;
            (0..1000)
                .map(|k| {
                    z += if k / 50 % 2 == 1 && k / 50 < changes { 2e-4 } else { 1e-4 };
                    z
                })
                .collect()
        };
        assert_eq!(encoder_step(&paced(5)), 0.0);
        near(encoder_step(&paced(7)), 1e-4);
        // One difference in a hundred may be fractional.
        let broken = |count: usize| {
            let mut z = rounded(1000, 0.013, 5e-5);
            (0..count).for_each(|k| z[50 * k + 7..].iter_mut().for_each(|z| *z += 2e-5));
            encoder_step(&z)
        };
        near(broken(10), 5e-5);
        assert_eq!(broken(11), 0.0);
        // Two hundredths of a step still count as a whole step.
        let off = |share: f64| {
            let bent = |(k, z): (usize, &f64)| z + if k % 3 == 0 { share * 5e-5 } else { 0.0 };
            let z: Vec<f64> = rounded(1000, 0.013, 5e-5).iter().enumerate().map(bent).collect();
            encoder_step(&z)
        };
        assert!(off(0.005) > 0.0 && off(0.03) == 0.0);
        assert_eq!((encoder_step(&[]), encoder_step(&[1.0]), encoder_step(&[0.4; 50])), (0.0, 0.0, 0.0));
        // Steps below a nanometre are floating-point rounding.
        assert_eq!(encoder_step(&rounded(1000, 0.003, 5e-10)), 0.0);
    }

    #[test]
    fn position_noise_is_estimated_from_third_divided_differences() {
        // Zero for a parabola at any times.
        let t: Vec<f64> = (0..200).map(|k| 0.005 * (f64::from(k) + 0.3 * f64::from(k % 3))).collect();
        let z: Vec<f64> = t.iter().map(|t| 0.003 * t + 0.02 * t * t).collect();
        assert!(position_noise(&t, &z) < 1e-14);
        // Alternating by one: third differences of eight, over the root of 1 + 9 + 9 + 1.
        let rough = |a: f64, k: usize| a * if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let z: Vec<f64> = (0..200).map(|k| 1e-3 * k as f64 + rough(1e-6, k)).collect();
        let told = position_noise(&even(200), &z);
        assert!((told / (8e-6 * 1.4826 / 20.0_f64.sqrt()) - 1.0).abs() < 1e-4, "{told}");
        // A rest does not count; at least the quantisation noise.
        let rests: Vec<f64> = (0..200).map(|k| if k < 40 { rough(1e-6, k) } else { 1e-6 }).collect();
        assert!((position_noise(&even(200), &rests) / told - 1.0).abs() < 1e-3);
        let z: Vec<f64> = even(2000).iter().map(|t| (0.0011 * t / 5e-5).round() * 5e-5).collect();
        assert!(position_noise(&even(2000), &z) >= 0.999 * 5e-5 / 12.0_f64.sqrt());
        // With irregular sampling: one sample ten times further away.
        let (t, z) = ([0.0, 1.0, 2.0, 12.0], [0.0, 0.0, 1.0, 0.0]);
        // Newton: weights 1/prod(t_i - t_j) are -1/24, 1/11, -1/20, 1/1320.
        let weights = [-1.0 / 24.0, 1.0 / 11.0, -1.0 / 20.0, 1.0 / 1320.0_f64];
        let size = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
        assert!((position_noise(&t, &z) / (1.4826 * 0.05 / size) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_slope_break_is_where_both_parabolas_intersect() {
        let t = even(200);
        let bent = |at_s: f64, change: f64| -> Vec<f64> {
            t.iter().map(|t| 0.003 * t + 0.01 * t * t + change * (t - at_s).max(0.0)).collect()
        };
        let one = |at_s: f64, change: f64, gap_s: f64, doubt: f64| {
            slope_breaks(&t, &bent(at_s, change), 8, (gap_s, gap_s), doubt)
        };
        // Between samples 100 and 101.
        let found = one(0.5031, -0.004, 0.01, 0.0);
        assert_eq!(found.len(), 1, "{found:?}");
        let (sample, (at, z, before), after) = found[0];
        assert_eq!(sample, 101);
        assert!((at - 0.5031).abs() < 2e-5 && (z - 0.003 * at - 0.01 * at * at).abs() < 2e-7, "{found:?}");
        // Slopes at the sample before and the one after.
        assert!(
            (before - 0.003 - 0.02 * 0.5).abs() < 1e-8 && (after - 0.003 - 0.02 * 0.505 + 0.004).abs() < 1e-8
        );
        // Not below the smallest jump, or the noise.
        assert_eq!(one(0.5031, 0.0, 0.01, 0.0), []);
        let straight = |change: f64| {
            let z: Vec<f64> = t.iter().map(|t| change * (t - 0.5031).max(0.0)).collect();
            slope_breaks(&t, &z, 8, (0.01, 0.01), 0.0).len()
        };
        assert_eq!((straight(1.9e-5), straight(2.1e-5)), (0, 1));
        // Nor below twice the change of the slope due to curvature between samples, here 0.2 mm/s.
        assert_eq!((one(0.5031, 1.5e-4, 0.01, 0.0).len(), one(0.5031, 6e-4, 0.01, 0.0).len()), (0, 1));
        assert_eq!(one(0.5031, 0.004, 0.01, 0.0038).len(), 1);
        assert_eq!(one(0.5031, 0.004, 0.01, 0.0041), []);
        // Not across a gap.
        assert_eq!(one(0.5031, 0.004, 0.0049, 0.0), []);
        assert_eq!(one(0.0381, 0.004, 0.01, 0.0).len(), 1);
        // Two breaks further apart than a side are separate.
        let two = |apart: f64| {
            let z: Vec<f64> = t
                .iter()
                .map(|t| 0.004 * (t - 0.4031).max(0.0) - 0.004 * (t - 0.4031 - apart).max(0.0))
                .collect();
            slope_breaks(&t, &z, 8, (0.01, 0.01), 0.0).iter().map(|b| b.0).collect::<Vec<_>>()
        };
        assert_eq!(two(0.1), [81, 101]);
        assert_eq!(two(0.05), [81, 91]);
    }

    #[test]
    fn a_smooth_curve_has_no_break() {
        let t = even(200);
        let z: Vec<f64> = t.iter().map(|t| 0.05 * (6.0 * t).sin()).collect();
        assert_eq!(slope_breaks(&t, &z, 6, (0.01, 0.01), 0.0), []);
    }

    #[test]
    fn windows_do_not_span_gaps_and_jumps_in_short_gaps_are_located() {
        // Samples are missing after sample 200; retraction from then on.
        let of = |steps: f64, turns_s: f64| {
            let t: Vec<f64> =
                even(400).iter().map(|t| if *t < 1.0025 { *t } else { t + 0.005 * (steps - 1.0) }).collect();
            let z: Vec<f64> = t
                .iter()
                .map(|t| if *t < 1.01 { 0.003 * t } else { 0.003 * turns_s - 0.002 * (t - turns_s) })
                .collect();
            let found = estimate_velocity(&t, &z);
            for (k, v) in found.velocity_mps.iter().enumerate() {
                let wanted = if k <= 200 { 0.003 } else { -0.002 };
                assert!((v - wanted).abs() < 1e-7, "{v} at {k}");
            }
            found.jumps
        };
        for steps in [5.0, 6.0, 19.0] {
            let told = of(steps, 1.01);
            assert_eq!(told.len(), 1);
            assert_eq!(told[0].next_sample, 201);
            assert!(
                (told[0].time_s - 1.01).abs() < 1e-6 && (told[0].position_m - 0.00303).abs() < 1e-8,
                "{told:?}"
            );
            assert!(
                (told[0].velocity_mps[0] - 0.003).abs() < 1e-7
                    && (told[0].velocity_mps[1] + 0.002).abs() < 1e-7
            );
            assert!(told[0].position_sd_m <= 1e-6);
        }
        // In a longer gap the needle may have rested; an intersection outside of the gap shows that it did.
        assert_eq!(of(21.0, 1.01), []);
        assert_eq!(of(19.0, 1.11), []);
    }

    #[test]
    fn window_width_follows_the_noise_up_to_twelve_samples() {
        // A line over 2 m + 1 samples has sd = noise / (step sqrt(m (m + 1) (2 m + 1) / 3)).
        let gain = |m: f64| 200.0 / (m * (m + 1.0) * (2.0 * m + 1.0) / 3.0).sqrt();
        let t = even(600);
        let of = |noise_m: f64| {
            let z: Vec<f64> = t
                .iter()
                .enumerate()
                .map(|(k, t)| 0.003 * t + noise_m * if k % 2 == 0 { 1.0 } else { -1.0 })
                .collect();
            (estimate_velocity(&t, &z).sd_mps, position_noise(&t, &z))
        };
        // The noise for which `m` suffices.
        for m in [1.0, 2.0, 5.0, 11.0, 12.0, 13.0_f64] {
            let unit = of(1e-9).1 / 1e-9;
            let (told, noise_m) = of(0.999 * 5e-6 / gain(m) / unit);
            near(told, noise_m * gain(m.min(12.0)));
            let (told, noise_m) = of(1.001 * 5e-6 / gain(m) / unit);
            near(told, noise_m * gain((m + 1.0).min(12.0)));
        }
    }

    #[test]
    fn windows_at_edges_are_exact_for_a_parabola() {
        let z: Vec<f64> = even(9).iter().map(|t| 0.003 * t + 0.5 * t * t).collect();
        for (v, t) in estimate_velocity(&even(9), &z).velocity_mps.iter().zip(even(9)) {
            assert!((v - 0.003 - t).abs() < 1e-9, "{v} at {t}");
        }
        let few = estimate_velocity(&even(7), &z[..7]);
        assert_eq!((few.velocity_mps, few.sd_mps), (vec![0.0; 7], f64::INFINITY));
        assert!(estimate_velocity(&even(8), &z[..8]).sd_mps.is_finite());
    }

    /// Ripple, a stop between two samples, a retraction.
    fn course(t: f64) -> (f64, f64) {
        let stop = 4.0013;
        let (w, a) = (core::f64::consts::TAU, 0.0015);
        if t < stop {
            (0.003 * t + a / w * (1.0 - (w * t).cos()), 0.003 + a * (w * t).sin())
        } else if t < 6.0 {
            (course(stop - 1e-12).0, 0.0)
        } else {
            (course(5.0).0 - 0.004 * (t - 6.0), -0.004)
        }
    }

    #[test]
    fn exact_positions_give_exact_velocity_and_jump_times() {
        let t: Vec<f64> = (0..1600).map(|k| f64::from(k) / 200.0).collect();
        let z: Vec<f64> = t.iter().map(|t| course(*t).0).collect();
        let found = estimate_velocity(&t, &z);
        let instants: Vec<f64> = found.jumps.iter().map(|k| k.time_s).collect();
        assert_eq!(instants.len(), 2, "{instants:?}");
        assert!((instants[0] - 4.0013).abs() < 1e-4, "{instants:?}");
        assert!((instants[1] - 6.0).abs() < 1e-4, "{instants:?}");
        // At exactly six seconds the velocity is either.
        for (v, t) in found.velocity_mps.iter().zip(&t).filter(|(_, t)| **t != 6.0) {
            assert!((v - course(*t).1).abs() < 4e-6, "{v} at {t}");
        }
    }

    #[test]
    fn quantisation_of_1_um_gives_velocity_to_10_um_per_second() {
        let t: Vec<f64> = (0..1600).map(|k| f64::from(k) / 200.0).collect();
        let z: Vec<f64> = t.iter().map(|t| (course(*t).0 * 1e6).round() / 1e6).collect();
        let found = estimate_velocity(&t, &z);
        assert_eq!(found.jumps.len(), 2, "{:?}", found.jumps);
        let mut off: Vec<f64> =
            found.velocity_mps.iter().zip(&t).map(|(v, t)| (v - course(*t).1).abs()).collect();
        off.sort_unstable_by(f64::total_cmp);
        assert!(off[off.len() * 95 / 100] < 1e-5, "{}", off[off.len() * 95 / 100]);
        assert!(found.sd_mps < 1e-5, "{}", found.sd_mps);
    }
}
