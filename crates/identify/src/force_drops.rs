//! Detects drops of the measured force by local regressions with a step.
//!
//! Around every block the force is regressed on `1, t, t after, v, sgn v` and a step, over 0.2 s and over 0.7 s
//! on each side; the block itself is excluded because a step inside it is averaged. Friction and stiffness are
//! smooth or follow the velocity; a remaining drop is a rupture of a layer or of an unmodelled structure.

use crate::block_averages::BlockAverages;
use stylet_stats::linear_algebra::SymmetricMatrix;
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
    /// Size in standard deviations.
    pub score: f64,
}

/// Half widths of the regression window in s.
const WINDOWS_S: [f64; 2] = [0.2, 0.7];
/// Smallest score of a drop.
const MIN_SCORE: f64 = 5.0;
/// Drops closer than this in s are one.
const MIN_SEPARATION_S: f64 = 0.12;
/// Number of regressors.
const REGRESSORS: usize = 6;

/// Force drops of a recording, in order of time.
#[must_use]
pub fn detect_force_drops(b: &BlockAverages) -> Vec<ForceDrop> {
    let length_s = b.sample_step_s * b.samples_per_block as f64;
    let mut found: Vec<ForceDrop> = Vec::new();
    let motion: Vec<(f64, f64)> =
        (0..b.len()).map(|k| b.motion.at(0.5 * (b.start_s[k] + b.end_s[k]))).collect();
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
            time_s: 0.5 * (b.start_s[k] + b.end_s[k]),
            position_m: motion[k].0,
            size_n: -steps[k].0,
            score: scores[k],
        })
        .collect()
}

/// Step at block `k`: size, standard deviation for unit noise, noise.
fn fit_step(b: &BlockAverages, motion: &[(f64, f64)], k: usize, half: usize) -> (f64, f64, f64) {
    let (from, to) = (k - half, k + half + 1);
    let v0 = motion[k].1;
    let scale = (from..to).map(|i| (motion[i].1 - v0).abs()).fold(1e-7, f64::max);
    let mut h = SymmetricMatrix::zeros(REGRESSORS);
    let mut g = [0.0; REGRESSORS];
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
        for p in 0..REGRESSORS {
            g[p] += row[p] * y;
            for q in 0..=p {
                h.add(p, q, row[p] * row[q]);
            }
        }
    }
    if sides[0] < 4 || sides[1] < 4 {
        return (0.0, f64::INFINITY, f64::INFINITY);
    }
    // Regularises friction that hardly changes.
    h.add(3, 3, 1e-3 * count);
    h.add(4, 4, 1e-3 * count);
    let factor = h.cholesky();
    let x = factor.solve(&g);
    let left = yy - x.iter().zip(&g).map(|(x, g)| x * g).sum::<f64>();
    let noise = (left.max(0.0) / (count - REGRESSORS as f64).max(1.0)).sqrt();
    (x[5], factor.inverse_diagonal()[5].sqrt(), noise)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block_averages::BLOCK_S;
    use stylet_record::Recording;

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-6 * wanted.abs().max(1e-6), "{told} for {wanted}");
    }

    /// Blocks of one sample each, every 20 ms; insertion at 3 mm/s up to `stop_s`, then a hold.
    fn blocks(n: usize, stop_s: f64, force: impl Fn(usize) -> f64) -> BlockAverages {
        let t: Vec<f64> = (0..n).map(|k| k as f64 * 0.02).collect();
        let z = t.iter().map(|t| 0.003 * t.min(stop_s)).collect();
        let f = (0..n).map(force).collect();
        BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
    }

    fn motion(b: &BlockAverages) -> Vec<(f64, f64)> {
        (0..b.len()).map(|k| b.motion.at(0.5 * (b.start_s[k] + b.end_s[k]))).collect()
    }

    /// A fixed zero-mean sequence without trend.
    fn rough(k: usize) -> f64 {
        (1.7 * (k * k % 101) as f64).sin()
    }

    /// Least-squares line through values at -1, -2, ... or 1, 2, ...: its value at zero and the residual sum of
    /// squares.
    fn line(x: &[f64]) -> (f64, f64) {
        let n = x.len() as f64;
        let (mt, mx) = (0.5 * (n + 1.0), x.iter().sum::<f64>() / n);
        let with_t = |f: &dyn Fn(f64, f64) -> f64| {
            x.iter().enumerate().map(|(k, x)| f(k as f64 + 1.0 - mt, x - mx)).sum::<f64>()
        };
        let slope = with_t(&|t, x| t * x) / with_t(&|t, _| t * t);
        (mx - slope * mt, with_t(&|t, x| (x - slope * t).powi(2)))
    }

    /// At constant velocity: two straight lines.
    #[test]
    fn a_step_is_the_distance_of_the_lines_on_both_sides() {
        let b = blocks(60, 99.0, |k| 0.02 * k as f64 - if k > 30 { 0.5 } else { 0.0 } + 0.01 * rough(k));
        for (k, half) in [(30, 10), (30, 25), (25, 10), (12, 8)] {
            let (size, sd, noise) = fit_step(&b, &motion(&b), k, half);
            let left: Vec<f64> = (1..=half).map(|i| b.force_n[k - i]).collect();
            let right: Vec<f64> = (1..=half).map(|i| b.force_n[k + i]).collect();
            let ((at_left, off_left), (at_right, off_right)) = (line(&left), line(&right));
            near(size, at_right - at_left);
            // Prediction of a line one step beyond n points.
            let n = half as f64;
            near(sd, (2.0 * 2.0 * (2.0 * n + 1.0) / (n * (n - 1.0))).sqrt());
            near(noise, ((off_left + off_right) / (2.0 * n - 6.0)).sqrt());
        }
    }

    #[test]
    fn a_step_needs_four_compared_blocks_on_each_side() {
        let mut b = blocks(40, 99.0, |k| if k > 20 { 1.0 } else { 2.0 });
        for k in [13, 16, 24, 26] {
            b.used[k] = false;
            b.force_n[k] = 77.0;
        }
        let told = |b: &BlockAverages| fit_step(b, &motion(b), 20, 7);
        near(told(&b).0, -1.0);
        for k in [14, 22] {
            let mut less = b.clone();
            less.used[k] = false;
            assert!(told(&less).1.is_finite());
            less.used[k + 1] = false;
            assert_eq!(told(&less), (0.0, f64::INFINITY, f64::INFINITY));
        }
    }

    #[test]
    fn the_block_that_contains_the_step_is_excluded() {
        let told = |blended: f64| {
            let force = |k: usize| {
                if k == 20 {
                    blended
                } else if k > 20 {
                    1.0
                } else {
                    2.0
                }
            };
            let b = blocks(40, 99.0, force);
            fit_step(&b, &motion(&b), 20, 7)
        };
        near(told(55.0).0, -1.0);
        assert_eq!(told(55.0), told(1.5));
    }

    /// The velocity oscillates twice per second; friction that follows it is not a step.
    #[test]
    fn velocity_dependent_friction_is_not_a_drop() {
        let t: Vec<f64> = (0..300).map(|k| f64::from(k) * 0.02).collect();
        let w = core::f64::consts::TAU * 2.0;
        let course = |t: f64| (0.003 * t - 0.002 / w * (w * t).cos(), 0.003 + 0.002 * (w * t).sin());
        let of = |force: &dyn Fn(f64) -> f64| {
            let f = t.iter().map(|t| force(*t)).collect();
            let z = t.iter().map(|t| course(*t).0).collect();
            let mut b =
                BlockAverages::new(&Recording::new(t.clone(), z, f).expect("a recording"), &[], BLOCK_S);
            b.used = vec![true; 300];
            b
        };
        let rubbed = of(&|t| 0.3 + 200.0 * course(t).1);
        let told = motion(&rubbed);
        let size = |k: usize| fit_step(&rubbed, &told, k, 25).0.abs();
        let most = (25..275).map(size).fold(0.0, f64::max);
        // A tenth of the friction's own variation.
        assert!(most < 0.08, "{most} N");
        let fallen = of(&|t| 200.0 * course(t).1 - if t > 2.01 { 0.5 } else { 0.0 });
        let size = fit_step(&fallen, &told, 100, 25).0;
        assert!((size + 0.5).abs() < 0.03, "{size}");
    }

    #[test]
    fn a_drop_is_detected_with_its_time_size_and_score() {
        // Half of it in block 150.
        let force = |k: usize| {
            let fallen = if k > 150 {
                0.4
            } else if k == 150 {
                0.2
            } else {
                0.0
            };
            0.01 * k as f64 - fallen + 0.01 * rough(k)
        };
        let b = blocks(300, 99.0, force);
        let told = detect_force_drops(&b);
        assert_eq!(told.len(), 1, "{told:?}");
        near(told[0].time_s, 3.0);
        near(told[0].position_m, 0.009);
        // From the window of 0.2 s, ten blocks on each side.
        let (size, sd, noise) = fit_step(&b, &motion(&b), 150, 10);
        near(told[0].size_n, -size);
        // No place is quieter than 0.7 times the median.
        let mut all: Vec<f64> = (10..290).map(|k| fit_step(&b, &motion(&b), k, 10).2).collect();
        let least = 0.7 * median(&mut all);
        near(told[0].score, -size / (sd * noise.max(least)));
        // A rise is not a drop.
        assert_eq!(detect_force_drops(&blocks(300, 99.0, |k| -force(k))), []);
        // Nor is one within half a window of the ends, or in a recording without room.
        assert_eq!(
            detect_force_drops(&blocks(21, 99.0, |k| if k > 10 { 0.0 } else { 1.0 } + 0.01 * rough(k))),
            []
        );
        assert_eq!(
            detect_force_drops(&blocks(22, 99.0, |k| if k > 10 { 0.0 } else { 1.0 } + 0.01 * rough(k))).len(),
            1
        );
    }

    #[test]
    fn a_drop_needs_five_standard_deviations() {
        let b =
            |size_n: f64| blocks(300, 99.0, move |k| 0.01 * rough(k) - if k > 150 { size_n } else { 0.0 });
        // The score grows with the size.
        let (large, small) = (detect_force_drops(&b(0.4))[0].score, detect_force_drops(&b(0.2))[0].score);
        assert!(large > small && small > 5.0, "{large}, {small}");
        // Smaller drops are detected by the wider window only.
        let weak = detect_force_drops(&b(0.03));
        assert_eq!(weak.len(), 1, "{weak:?}");
        let (size, sd, noise) = fit_step(&b(0.03), &motion(&b(0.03)), 150, 10);
        assert!(-size / (sd * noise) < 5.0);
        assert!((weak[0].time_s - 3.01).abs() < 0.05, "{weak:?}");
        assert_eq!(detect_force_drops(&b(0.015)), []);
    }

    #[test]
    fn drops_closer_than_the_window_are_merged_and_sorted_by_time() {
        let at = |second: usize| {
            let force = move |k: usize| {
                0.005 * rough(k) - if k >= 150 { 0.5 } else { 0.0 } - if k >= second { 0.8 } else { 0.0 }
            };
            detect_force_drops(&blocks(400, 99.0, force)).iter().map(|d| d.time_s).collect::<Vec<_>>()
        };
        // Within a tenth of a second only the larger one counts.
        assert_eq!(at(154).len(), 1, "{:?}", at(154));
        for apart in [25, 60, 150] {
            let told = at(150 + apart);
            assert_eq!(told.len(), 2, "{told:?}");
            assert!(
                (told[0] - 2.99).abs() < 0.02 && (told[1] - told[0] - 0.02 * apart as f64).abs() < 0.03,
                "{told:?}"
            );
        }
    }

    #[test]
    fn no_drop_is_detected_across_a_gap() {
        // Nothing for three seconds after sample 150; a lower force then.
        let t: Vec<f64> = (0..300).map(|k| f64::from(k) * 0.02 + if k > 150 { 3.0 } else { 0.0 }).collect();
        let z = t.iter().map(|t| 0.003 * t).collect();
        let f = (0..300).map(|k| if k > 150 { 0.0 } else { 1.0 } + 0.01 * rough(k)).collect();
        let b = BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S);
        assert_eq!(detect_force_drops(&b), []);
        // Across a single block that is not compared a drop is detected.
        let mut b = blocks(300, 99.0, |k| if k > 150 { 0.0 } else { 1.0 } + 0.01 * rough(k));
        b.used[145] = false;
        b.memory_reset[146] = true;
        assert_eq!(detect_force_drops(&b).len(), 1);
    }
}
