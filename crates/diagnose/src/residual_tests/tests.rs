use super::*;
use crate::test_fixtures::{blocks_of, data_of};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// Four insertions with holds, at different speeds.
fn insertions() -> FitData {
    let one = |speed: f64| {
        let t: Vec<f64> = (0..8000).map(|k| f64::from(k) / 200.0).collect();
        let (mut at, mut z) = (0.0, Vec::new());
        for t in &t {
            at += if (t * 0.35).sin() > -0.6 { speed / 200.0 } else { 0.0 };
            z.push(at);
        }
        let f = vec![0.0; t.len()];
        blocks_of(t, z, f)
    };
    let blocks = [1.2e-3, 1.5e-3, 1.9e-3, 2.3e-3].map(one).to_vec();
    data_of(blocks, 1.0)
}

/// White noise of unit variance plus a slow drift of twice its size per recording.
fn noise_with_drift(data: &FitData, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = move || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    data.recordings
        .iter()
        .map(|b| {
            let (mut slow, keep) = (2.0 * normal(), 0.995_f64);
            (0..b.len())
                .map(|_| {
                    slow = keep * slow + 2.0 * (1.0 - keep * keep).sqrt() * normal();
                    slow + normal()
                })
                .collect()
        })
        .collect()
}

#[test]
fn slow_drift_of_single_recordings_is_no_structure() {
    let data = insertions();
    let (mut significant, mut by_white) = (0, 0);
    for seed in 0..40 {
        let w = noise_with_drift(&data, seed);
        for feature in 0..FEATURES.len() {
            significant += usize::from(structure(feature, &data, &w, 0.09).coloured < 1e-4);
            // Under white noise.
            let s = statistic(&parts(feature, &data, &w, 0.09));
            by_white += usize::from(tail(s.t / s.variance.sqrt()) < 1e-4);
        }
    }
    assert!(significant <= 1, "{significant} of 280");
    assert!(by_white >= 30, "white noise would not have been rejected: {by_white} of 280");
}

#[test]
fn common_depth_dependence_is_detected_under_slow_drift() {
    let data = insertions();
    for seed in 100..104 {
        let mut w = noise_with_drift(&data, seed);
        for (b, w) in data.recordings.iter().zip(&mut w) {
            for (p, w) in b.pieces.iter().zip(w) {
                *w += 5.0 * (p.position_m * 1.5e3).sin();
            }
        }
        let p = structure(0, &data, &w, 0.09).coloured;
        assert!(p < 1e-6, "seed {seed}: {p:e}");
    }
}

/// Exact upper tails of chi-square with 2 and 8 degrees of freedom (`exp(-x/2)` and its series).
#[test]
fn skewed_tail_is_that_of_a_gamma_distribution() {
    for (z, exact) in [(1.0, (-2.0_f64).exp()), (3.0, (-4.0_f64).exp()), (6.0, (-7.0_f64).exp())] {
        assert!((skewed_tail(z, 2.0) / exact - 1.0).abs() < 0.25, "{z}: {}", skewed_tail(z, 2.0));
    }
    let eight = |z: f64| {
        let x = 0.5 * (8.0 + 4.0 * z);
        (-x).exp() * (1.0 + x + x * x / 2.0 + x * x * x / 6.0)
    };
    for z in [1.0, 3.0, 5.0] {
        assert!(
            (skewed_tail(z, 1.0) / eight(z) - 1.0).abs() < 0.25,
            "{z}: {}",
            skewed_tail(z, 1.0) / eight(z)
        );
    }
    assert!((skewed_tail(2.0, 0.0) - stylet_stats::normal::sf(2.0)).abs() < 1e-15);
}

/// Insertion, hold, further insertion and retraction, at 100 Hz.
fn there_and_back() -> FitData {
    let t: Vec<f64> = (0..1600).map(|k| 3.0 + f64::from(k) / 100.0).collect();
    let speed = |t: f64| match t {
        t if t < 6.0 => 0.0033 + 0.0017 * (2.1 * t).sin(),
        t if t < 8.0 => 0.0,
        t if t < 12.0 => 0.0041,
        t if t < 14.0 => -0.0072,
        t if t < 14.4 => 0.0,
        t if t < 16.0 => -0.0023,
        _ => 0.0095,
    };
    let (mut at, mut z) = (-0.004, Vec::new());
    for t in &t {
        at += speed(*t) / 100.0;
        z.push(at);
    }
    data_of(vec![blocks_of(t, z, vec![0.0; 1600])], 1.0)
}

/// 80 bins of depth plus one at each end, half seconds of time, steps of 0.5 mm/s up to 8 mm/s of speed, phase
/// (hold, retraction, insertion) with 30 bins of depth, and 0.5 mm of travel up to 31.5 mm in each direction.
#[test]
fn bins_follow_their_features() {
    let data = there_and_back();
    let b = &data.recordings[0];
    let deepest = 0.021;
    let of = |feature: usize| bins(feature, b, deepest);
    let middle = |i: usize| 0.5 * (b.start_s[i] + b.end_s[i]);
    let into = |z: f64, n: i64| ((z / deepest * n as f64).floor() as i64).clamp(-1, n) + 1;
    let steps = |v: f64| ((v / 5e-4).round() as i64).clamp(-16, 16) + 16;
    let (mut travel, mut way, mut last) = (0.0, 0.0, None);
    let mut significant = std::collections::BTreeSet::new();
    let all: Vec<Vec<usize>> = (0..7).map(of).collect();
    for i in 0..b.len() {
        let (z, v) = b.motion.at(middle(i));
        let phase = if v > 1e-5 {
            2
        } else if v < -1e-5 {
            1
        } else {
            0
        };
        let bend: f64 =
            last.map_or(0.0, |(_, before): (f64, f64)| (v - before) / (b.end_s[i] - b.start_s[i]));
        let sign = if v.abs() < 1e-9 { 0.0 } else { v.signum() };
        if sign != 0.0 && sign != way {
            (way, travel) = (sign, 0.0);
        }
        travel += last.map_or(0.0, |(before, _): (f64, f64)| (z - before).abs());
        last = Some((z, v));
        let half_mm = ((travel / 5e-4) as i64).min(63) + if way < 0.0 { 64 } else { 0 };
        let acceleration = ((bend * 400.0).round() as i64).clamp(-10, 10) + 10;
        let wanted = [
            into(z, 80),
            ((middle(i) - b.start_s[0]) * 2.0) as i64,
            steps(v),
            phase * 32 + into(z, 30),
            half_mm,
            steps(v) / 2 * 24 + into(z, 20),
            acceleration * 24 + steps(v) / 2,
        ];
        significant.insert((phase, steps(v), acceleration));
        for feature in 0..7 {
            assert_eq!(all[feature][i] as i64, wanted[feature], "{} of block {i}", FEATURES[feature]);
        }
    }
    assert!(significant.len() > 25, "the motion shows too little: {}", significant.len());
    assert!(all[0].contains(&0) && all[0].contains(&81), "before the surface and beyond the deepest");
}

/// The statistic sums products of standardised bin sums over bins and pairs of parts.
#[test]
fn statistic_sums_over_bins_and_pairs_with_enough_blocks() {
    let part = |sums: &[(usize, (f64, f64))]| {
        let mut p = Part { sums: vec![(0.0, 0.0); MAX_BINS], bins: Vec::new(), w: Vec::new() };
        sums.iter().for_each(|(bin, s)| p.sums[*bin] = *s);
        p
    };
    let three = [
        part(&[(2, (3.0, 4.0)), (5, (-2.5, 3.0)), (7, (9.0, 2.9))]),
        part(&[(2, (5.0, 9.0)), (5, (1.5, 5.0)), (7, (1.0, 6.0)), (799, (-3.0, 7.0))]),
        part(&[(2, (-2.0, 5.0)), (799, (-4.0, 11.0))]),
    ];
    let s = statistic(&three);
    let z = |s: f64, n: f64| s / n.sqrt();
    let (a, b, c) = (z(3.0, 4.0), z(5.0, 9.0), z(-2.0, 5.0));
    let t = a * b + a * c + b * c + z(-2.5, 3.0) * z(1.5, 5.0) + z(-3.0, 7.0) * z(-4.0, 11.0);
    assert!((s.t - t).abs() < 1e-12, "{} for {t}", s.t);
    assert_eq!(s.variance, 5.0);
    // Third cumulant of the pairs of three values: 2^3 - 2; of two: zero.
    assert!((s.skewness - 6.0 / 5.0_f64.powf(1.5)).abs() < 1e-12, "{}", s.skewness);
    let pooled = [(6.0, 18.0), (-1.0, 8.0), (1.0, 6.0), (-7.0, 18.0)];
    let chi: f64 = pooled.iter().map(|(s, n): &(f64, f64)| s * s / n).sum();
    assert!((s.nats - 0.5 * (chi - 4.0)).abs() < 1e-12, "{}", s.nats);
    let none = statistic(&three[..1]);
    assert_eq!((none.t, none.variance, none.skewness), (0.0, 0.0, 0.0));
}

#[test]
fn single_recording_is_split_into_alternating_half_seconds() {
    let data = there_and_back();
    let w: Vec<f64> = (0..data.recordings[0].len())
        .map(|k| {
            if k == 3 {
                9.0
            } else if k == 4 {
                -9.0
            } else {
                0.5
            }
        })
        .collect();
    let halves = parts(1, &data, &[w], 0.021);
    assert_eq!(halves.len(), 2);
    assert_eq!((halves[0].w[3], halves[0].w[4], halves[0].w[5]), (4.0, -4.0, 0.5));
    let b = &data.recordings[0];
    for (half, p) in halves.iter().enumerate() {
        for i in 0..b.len() {
            let own = ((b.start_s[i] - b.start_s[0]) / 0.5) as usize % 2 == half;
            assert_eq!(p.bins[i].is_some(), own && b.used[i], "{half} {i}");
        }
        let count: f64 = p.sums.iter().map(|s| s.1).sum();
        assert_eq!(count, p.bins.iter().flatten().count() as f64);
        let sum: f64 = p.sums.iter().map(|s| s.0).sum();
        let wanted: f64 = p.bins.iter().zip(&p.w).filter(|(b, _)| b.is_some()).map(|(_, w)| w).sum();
        assert!((sum - wanted).abs() < 1e-9);
    }
}

#[test]
fn far_lags_represent_five_each() {
    let all: Vec<(usize, f64)> = lags().collect();
    assert_eq!(all.len(), 25 + 95);
    assert_eq!((all[0], all[24], all[25], all[26]), ((0, 1.0), (24, 1.0), (27, 5.0), (32, 5.0)));
    assert_eq!(all[119], (497, 5.0));
    assert_eq!(all.iter().map(|l| l.1).sum::<f64>(), 500.0);
}

/// Two short parts with three bins, whose products are summed one by one.
fn small() -> [Part; 2] {
    let part = |shift: usize| {
        let n = 36;
        let w: Vec<f64> = (0..n).map(|i| (0.9 * (i + shift) as f64).sin() + 0.2 * (i % 3) as f64).collect();
        let bins: Vec<Option<usize>> = (0..n)
            .map(|i| match (i + shift) % 9 {
                0..=3 => Some(4),
                4..=6 => Some(11),
                7 => Some(30),
                _ => None,
            })
            .collect();
        let mut sums = vec![(0.0, 0.0); MAX_BINS];
        for (w, bin) in w.iter().zip(&bins) {
            if let Some(bin) = bin {
                sums[*bin] = (sums[*bin].0 + w, sums[*bin].1 + 1.0);
            }
        }
        Part { sums, bins, w }
    };
    let mut other = part(5);
    // A bin that one part hardly has.
    other.bins[2] = Some(50);
    other.sums[50] = (other.w[2], 1.0);
    [part(0), other]
}

#[test]
fn bin_covariances_follow_from_the_autocovariance() {
    let two = small();
    let mut total = vec![(0.0, 0.0); MAX_BINS];
    for (k, t) in total.iter_mut().enumerate() {
        *t = (two[0].sums[k].0 + two[1].sums[k].0, two[0].sums[k].1 + two[1].sums[k].1);
    }
    let kept = [4, 11, 30, 50];
    let mut all = Vec::new();
    for (own, other) in [(0, 1), (1, 0)] {
        let (p, o) = (&two[own], &two[other]);
        let n = p.w.len();
        let residual: Vec<f64> = (0..n)
            .map(|i| match p.bins[i] {
                Some(b) if o.sums[b].1 >= 3.0 => p.w[i] - o.sums[b].0 / o.sums[b].1,
                Some(_) => p.w[i],
                None => 0.0,
            })
            .collect();
        let gamma = |lag: usize| {
            let pairs: Vec<f64> = (0..n - lag)
                .filter(|i| p.bins[*i].is_some() && p.bins[i + lag].is_some())
                .map(|i| residual[i] * residual[i + lag])
                .collect();
            pairs.iter().sum::<f64>() / pairs.len().max(1) as f64
        };
        // 36 blocks have lags up to 35: each one to 24, then 27 for 25 to 29 and 32 for 30 to 34.
        let of = |lag: usize| match lag {
            0..25 => gamma(lag),
            27 | 32 => 5.0 * gamma(lag),
            _ => 0.0,
        };
        let mut wanted = [[0.0; 4]; 4];
        for i in 0..n {
            for j in 0..n {
                let (Some(a), Some(b)) = (p.bins[i], p.bins[j]) else { continue };
                let place = |b: usize| kept.iter().position(|k| *k == b).filter(|_| p.sums[b].1 >= 3.0);
                if let (Some(a), Some(b)) = (place(a), place(b)) {
                    wanted[a][b] += of(i.abs_diff(j)) / (p.sums[kept[a]].1 * p.sums[kept[b]].1).sqrt();
                }
            }
        }
        let c = covariance(p, &total, &kept);
        for a in 0..4 {
            for b in 0..4 {
                assert!(
                    (c[4 * a + b] - wanted[a][b]).abs() < 1e-9,
                    "{own} {a} {b}: {} for {}",
                    c[4 * a + b],
                    wanted[a][b]
                );
            }
        }
        all.push(wanted);
    }
    // Over the bins that both have.
    let both = |f: &dyn Fn(usize, usize) -> bool| -> f64 {
        (0..3)
            .flat_map(|a| (0..3).map(move |b| (a, b)))
            .filter(|(a, b)| f(*a, *b))
            .map(|(a, b)| all[0][a][b] * all[1][a][b])
            .sum()
    };
    let (variance, reduction) = coloured_moments(&two);
    let (whole, diagonal) = (both(&|_, _| true), both(&|a, b| a == b));
    assert!((variance - whole).abs() < 1e-9 * whole.abs(), "{variance} for {whole}");
    assert!(
        (reduction - whole / diagonal).abs() < 1e-9 * (whole / diagonal).abs(),
        "{reduction} for {}",
        whole / diagonal
    );
}

#[test]
fn most_significant_feature_comes_first_after_correction() {
    let one = |p: f64, nats: f64| Structure { white: p, coloured: 0.5, nats };
    let all = [
        one(0.3, 0.1),
        one(2e-5, 7.0),
        one(1.0, 0.0),
        one(3e-9, 4.0),
        one(2e-4, 90.0),
        one(0.9, 1.0),
        one(2e-5, 8.0),
    ];
    let coloured_variance = summarise(&all, |s| s.white);
    assert!((coloured_variance.p_value - 2.1e-8).abs() < 1e-20, "{}", coloured_variance.p_value);
    let names: Vec<&str> = coloured_variance.depends_on.iter().map(|d| d.0.as_str()).collect();
    // Equal p-values are ordered by nats; 7 times 2e-4 is not reported.
    assert_eq!(names, ["phase_and_depth", "acceleration_and_velocity", "time"]);
    assert!((coloured_variance.depends_on[1].1 - 1.4e-4).abs() < 1e-15);
    assert_eq!(coloured_variance.nats, 8.0);
    let none = summarise(&all, |s| s.coloured);
    assert_eq!((none.p_value, none.depends_on.len(), none.nats), (1.0, 0, 0.0));
}

/// A common structure is significant; p-values are those of the statistic under white and coloured noise.
#[test]
fn p_values_are_those_of_the_statistic() {
    let data = insertions();
    let w: Vec<Vec<f64>> = data
        .recordings
        .iter()
        .enumerate()
        .map(|(r, b)| {
            let mut rng = ChaCha8Rng::seed_from_u64(77 + r as u64);
            b.pieces
                .iter()
                .take(b.len())
                .map(|p| 0.25 * (p.position_m * 900.0).sin() + rng.random::<f64>() * 3.4 - 1.7)
                .collect()
        })
        .collect();
    let found = structure(0, &data, &w, 0.09);
    let all = parts(0, &data, &w, 0.09);
    let s = statistic(&all);
    assert!(found.white < 1e-3, "{}", found.white);
    assert_eq!(found.white, skewed_tail(s.t / s.variance.sqrt(), s.skewness));
    let (variance, reduction) = coloured_moments(&all);
    let coloured_variance =
        skewed_tail(s.t / variance.max(s.variance).sqrt(), s.skewness * reduction.max(1.0).sqrt());
    assert_eq!((found.coloured, found.nats), (coloured_variance, s.nats));
    // Without common structure only white noise is tested.
    let plain: Vec<Vec<f64>> =
        noise_with_drift(&data, 4).iter().map(|w| w.iter().map(|_| 0.0).collect()).collect();
    let none = structure(0, &data, &plain, 0.09);
    assert!(none.white > 0.3 && none.white == none.coloured, "{}", none.white);
    // With a single recording there is no coloured test.
    let alone = data.subset(&[0]);
    let mut one = vec![w[0].clone()];
    one[0]
        .iter_mut()
        .zip(alone.recordings[0].pieces.iter())
        .for_each(|(w, p)| *w += 2.0 * (p.position_m * 900.0).sin());
    let found = structure(0, &alone, &one, 0.09);
    assert!(found.white < 1e-6 && found.white == found.coloured, "{}", found.white);
}

/// Wilson and Hilferty's cube root for a skewness of 1.25 at 2.5: k = 2.56, ratio 2.5625, 3 * 1.6 * (1.36845 - 1 +
/// 0.0434028).
#[test]
fn wilson_hilferty_tail_matches_a_worked_example() {
    let ratio: f64 = 1.0 + 2.5 / 2.56_f64.sqrt();
    let u = 3.0 * 1.6 * (ratio.powf(1.0 / 3.0) - 1.0 + 1.0 / (9.0 * 2.56));
    assert!((skewed_tail(2.5, 1.25) / tail(u) - 1.0).abs() < 1e-9);
    // The lower tail ends, and without skewness the variable is normal.
    assert!(skewed_tail(-9.0, 1.25) > 0.99 && skewed_tail(-9.0, 1.25) == skewed_tail(-90.0, 1.25));
    assert_eq!(skewed_tail(1.3, 9e-7), tail(1.3));
    assert!(skewed_tail(1.3, 1.1e-6) != tail(1.3));
}
