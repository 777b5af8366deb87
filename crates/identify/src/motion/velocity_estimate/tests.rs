use super::*;

fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-9 * expected.abs().max(1e-6), "{actual} for {expected}");
}

fn even(n: usize) -> Vec<f64> {
    (0..n).map(|k| k as f64 / 200.0).collect()
}

#[test]
fn the_parabola_is_the_least_squares_fit() {
    let t = [1.0, 1.2, 1.3, 1.9, 2.4];
    let exact = t.map(|t: f64| 4.0 - 3.0 * (t - 1.5) + 7.0 * (t - 1.5).powi(2));
    let (actual, off) = fit_parabola(&t, &exact, 1.5);
    [4.0, -3.0, 7.0].iter().zip(actual).for_each(|(expected, actual)| assert_close(actual, *expected));
    assert!(off < 1e-20);
    // A residual pattern that no parabola contains: the third difference of five regular values, (1, -2, 0,
    // 2, -1).
    let five = [0.0, 1.0, 2.0, 3.0, 4.0];
    let added = [1.0, -2.0, 0.0, 2.0, -1.0];
    let z: Vec<f64> = five.iter().zip(added).map(|(t, a)| 2.0 + 0.5 * t - t * t + 0.3 * a).collect();
    let (actual, off) = fit_parabola(&five, &z, 0.0);
    [2.0, 0.5, -1.0].iter().zip(actual).for_each(|(expected, actual)| assert_close(actual, *expected));
    assert_close(off, 0.09 * 10.0);
}

#[test]
fn a_slope_is_that_of_a_parabola_or_of_two_samples() {
    assert_close(slope_at(&[1.0, 2.0, 4.0], &[1.0, 4.0, 16.0], 3.0), 6.0);
    assert_close(slope_at(&[1.0, 4.0], &[1.0, 16.0], 3.0), 5.0);
    assert_eq!((slope_at(&[1.0], &[3.0], 1.0), slope_at(&[], &[], 1.0)), (0.0, 0.0));
}

#[test]
fn the_encoder_step_is_detected_unless_velocity_is_constant() {
    let rounded = |n: usize, speed: f64, step: f64| -> Vec<f64> {
        even(n).iter().map(|t| (speed * t / step).round() * step).collect()
    };
    assert_close(encoder_step(&rounded(1000, 0.003, 5e-5)), 5e-5);
    assert_close(encoder_step(&rounded(1000, 0.013, 5e-5)), 5e-5);
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
    assert_close(encoder_step(&paced(7)), 1e-4);
    // One difference in a hundred may be fractional.
    let broken = |count: usize| {
        let mut z = rounded(1000, 0.013, 5e-5);
        (0..count).for_each(|k| z[50 * k + 7..].iter_mut().for_each(|z| *z += 2e-5));
        encoder_step(&z)
    };
    assert_close(broken(10), 5e-5);
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
    let actual = position_noise(&even(200), &z);
    assert!((actual / (8e-6 * 1.4826 / 20.0_f64.sqrt()) - 1.0).abs() < 1e-4, "{actual}");
    // A rest does not count; at least the quantisation noise.
    let rests: Vec<f64> = (0..200).map(|k| if k < 40 { rough(1e-6, k) } else { 1e-6 }).collect();
    assert!((position_noise(&even(200), &rests) / actual - 1.0).abs() < 1e-3);
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
        let z: Vec<f64> =
            t.iter().map(|t| 0.004 * (t - 0.4031).max(0.0) - 0.004 * (t - 0.4031 - apart).max(0.0)).collect();
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
            let expected = if k <= 200 { 0.003 } else { -0.002 };
            assert!((v - expected).abs() < 1e-7, "{v} at {k}");
        }
        found.jumps
    };
    for steps in [5.0, 6.0, 19.0] {
        let actual = of(steps, 1.01);
        assert_eq!(actual.len(), 1);
        assert_eq!(actual[0].next_sample, 201);
        assert!(
            (actual[0].time_s - 1.01).abs() < 1e-6 && (actual[0].position_m - 0.00303).abs() < 1e-8,
            "{actual:?}"
        );
        assert!(
            (actual[0].velocity_mps[0] - 0.003).abs() < 1e-7
                && (actual[0].velocity_mps[1] + 0.002).abs() < 1e-7
        );
        assert!(actual[0].position_sd_m <= 1e-6);
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
        let (actual, noise_m) = of(0.999 * 5e-6 / gain(m) / unit);
        assert_close(actual, noise_m * gain(m.min(12.0)));
        let (actual, noise_m) = of(1.001 * 5e-6 / gain(m) / unit);
        assert_close(actual, noise_m * gain((m + 1.0).min(12.0)));
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
fn trajectory(t: f64) -> (f64, f64) {
    let stop = 4.0013;
    let (w, a) = (core::f64::consts::TAU, 0.0015);
    if t < stop {
        (0.003 * t + a / w * (1.0 - (w * t).cos()), 0.003 + a * (w * t).sin())
    } else if t < 6.0 {
        (trajectory(stop - 1e-12).0, 0.0)
    } else {
        (trajectory(5.0).0 - 0.004 * (t - 6.0), -0.004)
    }
}

#[test]
fn exact_positions_give_exact_velocity_and_jump_times() {
    let t: Vec<f64> = (0..1600).map(|k| f64::from(k) / 200.0).collect();
    let z: Vec<f64> = t.iter().map(|t| trajectory(*t).0).collect();
    let found = estimate_velocity(&t, &z);
    let times: Vec<f64> = found.jumps.iter().map(|k| k.time_s).collect();
    assert_eq!(times.len(), 2, "{times:?}");
    assert!((times[0] - 4.0013).abs() < 1e-4, "{times:?}");
    assert!((times[1] - 6.0).abs() < 1e-4, "{times:?}");
    // At exactly six seconds the velocity is either.
    for (v, t) in found.velocity_mps.iter().zip(&t).filter(|(_, t)| **t != 6.0) {
        assert!((v - trajectory(*t).1).abs() < 4e-6, "{v} at {t}");
    }
}

#[test]
fn quantisation_of_1_um_gives_velocity_to_10_um_per_second() {
    let t: Vec<f64> = (0..1600).map(|k| f64::from(k) / 200.0).collect();
    let z: Vec<f64> = t.iter().map(|t| (trajectory(*t).0 * 1e6).round() / 1e6).collect();
    let found = estimate_velocity(&t, &z);
    assert_eq!(found.jumps.len(), 2, "{:?}", found.jumps);
    let mut off: Vec<f64> =
        found.velocity_mps.iter().zip(&t).map(|(v, t)| (v - trajectory(*t).1).abs()).collect();
    off.sort_unstable_by(f64::total_cmp);
    assert!(off[off.len() * 95 / 100] < 1e-5, "{}", off[off.len() * 95 / 100]);
    assert!(found.sd_mps < 1e-5, "{}", found.sd_mps);
}

#[test]
fn the_velocity_of_exact_positions_follows_a_ripple_of_two_hertz() {
    let omega = core::f64::consts::TAU * 2.0;
    let t: Vec<f64> = (0..600).map(|k| 0.005 * f64::from(k)).collect();
    let z: Vec<f64> = t.iter().map(|t| 0.004 * t + 0.002 / omega * (omega * t).sin()).collect();
    let found = estimate_velocity(&t, &z);
    for (v, t) in found.velocity_mps.iter().zip(&t).skip(2).take(596) {
        let expected = 0.004 + 0.002 * (omega * t).cos();
        assert!((v - expected).abs() < 1e-8, "{v} for {expected} m/s at {t} s");
    }
}
