use super::*;
use crate::block_averages::BLOCK_S;
use stylet_record::Recording;

fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-6 * expected.abs().max(1e-6), "{actual} for {expected}");
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
        assert_close(size, at_right - at_left);
        // Prediction of a line one step beyond n points.
        let n = half as f64;
        assert_close(sd, (2.0 * 2.0 * (2.0 * n + 1.0) / (n * (n - 1.0))).sqrt());
        assert_close(noise, ((off_left + off_right) / (2.0 * n - 6.0)).sqrt());
    }
}

#[test]
fn a_step_needs_four_compared_blocks_on_each_side() {
    let mut b = blocks(40, 99.0, |k| if k > 20 { 1.0 } else { 2.0 });
    for k in [13, 16, 24, 26] {
        b.used[k] = false;
        b.force_n[k] = 77.0;
    }
    let actual = |b: &BlockAverages| fit_step(b, &motion(b), 20, 7);
    assert_close(actual(&b).0, -1.0);
    for k in [14, 22] {
        let mut less = b.clone();
        less.used[k] = false;
        assert!(actual(&less).1.is_finite());
        less.used[k + 1] = false;
        assert_eq!(actual(&less), (0.0, f64::INFINITY, f64::INFINITY));
    }
}

#[test]
fn the_block_that_contains_the_step_is_excluded() {
    let actual = |blended: f64| {
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
    assert_close(actual(55.0).0, -1.0);
    assert_eq!(actual(55.0), actual(1.5));
}

/// The velocity oscillates twice per second; friction that follows it is not a step.
#[test]
fn velocity_dependent_friction_is_not_a_drop() {
    let t: Vec<f64> = (0..300).map(|k| f64::from(k) * 0.02).collect();
    let w = core::f64::consts::TAU * 2.0;
    let trajectory = |t: f64| (0.003 * t - 0.002 / w * (w * t).cos(), 0.003 + 0.002 * (w * t).sin());
    let of = |force: &dyn Fn(f64) -> f64| {
        let f = t.iter().map(|t| force(*t)).collect();
        let z = t.iter().map(|t| trajectory(*t).0).collect();
        let mut b = BlockAverages::new(&Recording::new(t.clone(), z, f).expect("a recording"), &[], BLOCK_S);
        b.used = vec![true; 300];
        b
    };
    let rubbed = of(&|t| 0.3 + 200.0 * trajectory(t).1);
    let actual = motion(&rubbed);
    let size = |k: usize| fit_step(&rubbed, &actual, k, 25).0.abs();
    let most = (25..275).map(size).fold(0.0, f64::max);
    // A tenth of the friction's own variation.
    assert!(most < 0.08, "{most} N");
    let fallen = of(&|t| 200.0 * trajectory(t).1 - if t > 2.01 { 0.5 } else { 0.0 });
    let size = fit_step(&fallen, &actual, 100, 25).0;
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
    let actual = detect_force_drops(&b);
    assert_eq!(actual.len(), 1, "{actual:?}");
    assert_close(actual[0].time_s, 3.0);
    assert_close(actual[0].position_m, 0.009);
    // From the window of 0.2 s, ten blocks on each side.
    let (size, sd, noise) = fit_step(&b, &motion(&b), 150, 10);
    assert_close(actual[0].size_n, -size);
    // No place is quieter than 0.7 times the median.
    let mut all: Vec<f64> = (10..290).map(|k| fit_step(&b, &motion(&b), k, 10).2).collect();
    let least = 0.7 * median(&mut all);
    assert_close(actual[0].score, -size / (sd * noise.max(least)));
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
    let b = |size_n: f64| blocks(300, 99.0, move |k| 0.01 * rough(k) - if k > 150 { size_n } else { 0.0 });
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
        let actual = at(150 + apart);
        assert_eq!(actual.len(), 2, "{actual:?}");
        assert!(
            (actual[0] - 2.99).abs() < 0.02 && (actual[1] - actual[0] - 0.02 * apart as f64).abs() < 0.03,
            "{actual:?}"
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
