//! What remains: is the residual of a model still predictable?
//!
//! Residuals are averaged in bins of depth, time, speed, phase and travel since reversal; what is the same in several
//! recordings is no noise. The cross-recording statistic `T = sum_bins sum_(r<s) z_rb z_sb` has mean zero whatever the noise's
//! colour, since the noises of two recordings know nothing of each other; how far it strays depends on the colour, for slow
//! noise makes neighbouring bins alike: its variance is `sum_(r<s) sum_(b,b') C_r(b,b') C_s(b,b')`, `C_r` from the
//! autocovariance of what is left of a recording when the others' means are taken away (Bartlett 1935 for two series).

use rayon::prelude::*;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;

/// Structure that a model leaves.
#[derive(Clone, Debug, Default)]
pub struct ResidualStructure {
    /// Smallest p-value over the features, times their number.
    pub p_value: f64,
    /// Features by which the residual is predictable, strongest first, with their p-values.
    pub depends_on: Vec<(String, f64)>,
    /// Nats of the strongest.
    pub nats: f64,
}

/// What a model leaves, as slow noise and as none.
#[derive(Clone, Debug, Default)]
pub struct ResidualTests {
    /// Held against noise of the colour that the residual has: what is sure.
    pub coloured_noise: ResidualStructure,
    /// Held against noise of the data's own colour: slow noise of each recording's own shows too.
    pub white_noise: ResidualStructure,
}

/// Features with their binning.
const FEATURES: [&str; 7] = [
    "depth",
    "time",
    "velocity",
    "phase_and_depth",
    "travel_since_reversal",
    "depth_and_velocity",
    "acceleration_and_velocity",
];
/// Bins at most.
const BINS: usize = 800;
/// Fewest blocks of a recording in a bin.
const LEAST: f64 = 3.0;
/// Features with a p-value below this are reported.
const REPORTED: f64 = 1e-3;

/// Upper tail of the normal distribution.
fn tail(z: f64) -> f64 {
    stylet_stats::normal::sf(z)
}

/// Bin of every block of a recording by a feature.
fn bins(feature: usize, b: &BlockAverages, deepest: f64) -> Vec<usize> {
    let depth = |z: f64, n: f64| ((z / deepest.max(1e-9) * n).floor().clamp(-1.0, n) + 1.0) as usize;
    let speed = |v: f64| ((v * 1e3 * 2.0).round().clamp(-16.0, 16.0) + 16.0) as usize;
    let phase = |v: f64| if v > 1e-5 { 2 } else { usize::from(v < -1e-5) };
    let (mut since, mut sign, mut before) = (0.0, 0.0, (f64::NAN, 0.0));
    let first = b.start_s.first().copied().unwrap_or(0.0);
    (0..b.len())
        .map(|i| {
            let t = 0.5 * (b.start_s[i] + b.end_s[i]);
            let (z, v) = b.motion.at(t);
            let a = if before.0.is_finite() { (v - before.1) / (b.end_s[i] - b.start_s[i]) } else { 0.0 };
            let travelled = if before.0.is_finite() { (z - before.0).abs() } else { 0.0 };
            before = (z, v);
            match feature {
                0 => depth(z, 80.0),
                1 => ((t - first) / 0.5) as usize,
                2 => speed(v),
                3 => phase(v) * 32 + depth(z, 30.0),
                4 => {
                    let s = stylet_tissue::effect::sgn(v);
                    if s != 0.0 && s != sign {
                        (sign, since) = (s, 0.0);
                    }
                    since += travelled;
                    (if sign < 0.0 { 64 } else { 0 }) + ((since * 2e3) as usize).min(63)
                }
                5 => speed(v) / 2 * 24 + depth(z, 20.0),
                _ => {
                    let bent = (a * 400.0).round().clamp(-10.0, 10.0) + 10.0;
                    bent as usize * 24 + speed(v) / 2
                }
            }
        })
        .collect()
}

/// Tests what a model leaves under the noise of the data.
#[must_use]
pub fn test_residuals(fit: &Fit, data: &FitData) -> ResidualTests {
    let deepest =
        data.recordings.iter().flat_map(|b| b.pieces.iter()).fold(0.0_f64, |m, p| m.max(p.position_m));
    let all: Vec<Structure> = (0..FEATURES.len())
        .into_par_iter()
        .map(|feature| structure(feature, data, &fit.residuals.innovations, deepest))
        .collect();
    ResidualTests { coloured_noise: sum_up(&all, |s| s.coloured), white_noise: sum_up(&all, |s| s.white) }
}

fn sum_up(all: &[Structure], p: impl Fn(&Structure) -> f64) -> ResidualStructure {
    let mut found: Vec<(String, f64, f64)> = FEATURES
        .iter()
        .zip(all)
        .map(|(name, s)| ((*name).to_owned(), (p(s) * FEATURES.len() as f64).min(1.0), s.nats))
        .collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1).then(b.2.total_cmp(&a.2)));
    let p_value = found.first().map_or(1.0, |f| f.1);
    found.retain(|f| f.1 < REPORTED);
    let nats = found.iter().fold(0.0_f64, |m, f| m.max(f.2));
    ResidualStructure { p_value, depends_on: found.into_iter().map(|f| (f.0, f.1)).collect(), nats }
}

/// What a recording, or half of one, has in the bins of a feature.
struct Part {
    /// Sum and count of every bin.
    sums: Vec<(f64, f64)>,
    /// The bin of every block, where it is compared.
    bins: Vec<Option<usize>>,
    /// Normalised residuals, outlying ones cut.
    w: Vec<f64>,
}

/// The parts that are compared: the recordings, or every other half second of a single one.
fn parts(feature: usize, data: &FitData, w: &[Vec<f64>], deepest: f64) -> Vec<Part> {
    let mut parts = Vec::new();
    let halves = if data.recording_count() == 1 { 2 } else { 1 };
    for (b, w) in data.recordings.iter().zip(w) {
        let first = b.start_s.first().copied().unwrap_or(0.0);
        let all = bins(feature, b, deepest);
        for half in 0..halves {
            let own = |i: usize| halves == 1 || ((b.start_s[i] - first) / 0.5) as usize % 2 == half;
            let mut part = Part {
                sums: vec![(0.0, 0.0); BINS],
                bins: Vec::with_capacity(b.len()),
                w: w.iter().map(|w| w.clamp(-4.0, 4.0)).collect(),
            };
            for (i, bin) in all.iter().enumerate() {
                let bin = Some(*bin).filter(|bin| b.used[i] && own(i) && *bin < BINS);
                if let Some(bin) = bin {
                    part.sums[bin].0 += part.w[i];
                    part.sums[bin].1 += 1.0;
                }
                part.bins.push(bin);
            }
            parts.push(part);
        }
    }
    parts
}

/// The cross-recording statistic and what white noise would make of it.
struct Statistic {
    t: f64,
    variance: f64,
    skewness: f64,
    nats: f64,
}

fn statistic(parts: &[Part]) -> Statistic {
    let (mut t, mut variance, mut third, mut pooled, mut used) = (0.0, 0.0_f64, 0.0, 0.0, 0.0);
    for bin in 0..BINS {
        let z: Vec<(f64, f64)> = parts.iter().map(|p| p.sums[bin]).filter(|s| s.1 >= LEAST).collect();
        let all: (f64, f64) = z.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        if all.1 > 0.0 {
            pooled += all.0 * all.0 / all.1;
            used += 1.0;
        }
        // Third cumulant of the pairs of so many standard normal numbers.
        let others = z.len().saturating_sub(1) as f64;
        third += others.powi(3) - others;
        for (k, a) in z.iter().enumerate() {
            for b in &z[..k] {
                t += a.0 * b.0 / (a.1 * b.1).sqrt();
                // Under the null a product of independent values of unit variance.
                variance += 1.0;
            }
        }
    }
    let skewness = if variance > 0.0 { third / variance.powf(1.5) } else { 0.0 };
    Statistic { t, variance, skewness, nats: 0.5 * (pooled - used) }
}

/// p-values and nats of one feature.
struct Structure {
    /// As if neighbouring blocks knew nothing of each other.
    white: f64,
    /// With the colour of what is left.
    coloured: f64,
    nats: f64,
}

fn structure(feature: usize, data: &FitData, w: &[Vec<f64>], deepest: f64) -> Structure {
    let parts = parts(feature, data, w, deepest);
    let s = statistic(&parts);
    if s.variance == 0.0 {
        return Structure { white: 1.0, coloured: 1.0, nats: 0.0 };
    }
    let white = skewed_tail(s.t / s.variance.sqrt(), s.skewness);
    if white > REPORTED || data.recording_count() < 2 {
        return Structure { white, coloured: white, nats: s.nats };
    }
    let (told, fewer) = coloured(&parts);
    let coloured = skewed_tail(s.t / told.max(s.variance).sqrt(), s.skewness * fewer.max(1.0).sqrt());
    Structure { white, coloured, nats: s.nats }
}

/// Lags in blocks at which an autocovariance is looked at, each for so many of them.
fn lags() -> impl Iterator<Item = (usize, f64)> {
    const NEAR: usize = 25;
    const FAR: usize = 500;
    const STEP: usize = 5;
    (0..NEAR).map(|k| (k, 1.0)).chain((NEAR..FAR).step_by(STEP).map(|k| (k + STEP / 2, STEP as f64)))
}

/// Variance of the cross-recording statistic for noise of the colour that the recordings have, and by which factor the bins
/// count as fewer, since they go together.
fn coloured(parts: &[Part]) -> (f64, f64) {
    let mut total = vec![(0.0, 0.0); BINS];
    for p in parts {
        for (t, s) in total.iter_mut().zip(&p.sums) {
            *t = (t.0 + s.0, t.1 + s.1);
        }
    }
    let kept: Vec<usize> =
        (0..BINS).filter(|b| parts.iter().filter(|p| p.sums[*b].1 >= LEAST).count() > 1).collect();
    let n = kept.len();
    let covariances: Vec<Vec<f64>> = parts.par_iter().map(|p| covariance(p, &total, &kept)).collect();
    let (mut variance, mut apart) = (0.0, 0.0);
    for (k, a) in covariances.iter().enumerate() {
        for b in &covariances[..k] {
            variance += a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            apart += (0..n).map(|i| a[i * (n + 1)] * b[i * (n + 1)]).sum::<f64>();
        }
    }
    (variance, variance / apart.max(1e-300))
}

/// Covariances of a part's standardised sums in the bins kept, row by row; zero where it has too few blocks.
fn covariance(part: &Part, total: &[(f64, f64)], kept: &[usize]) -> Vec<f64> {
    let left: Vec<f64> = part
        .w
        .iter()
        .zip(&part.bins)
        .map(|(w, bin)| {
            let Some(bin) = *bin else { return 0.0 };
            let others = (total[bin].0 - part.sums[bin].0, total[bin].1 - part.sums[bin].1);
            if others.1 >= LEAST { w - others.0 / others.1 } else { *w }
        })
        .collect();
    let mut place = vec![usize::MAX; BINS];
    for (k, bin) in kept.iter().enumerate().filter(|(_, b)| part.sums[**b].1 >= LEAST) {
        place[*bin] = k;
    }
    let of = |i: usize| part.bins[i].map_or(usize::MAX, |b| place[b]);
    let n = kept.len();
    let mut c = vec![0.0; n * n];
    for (lag, weight) in lags() {
        let pairs = || (0..left.len().saturating_sub(lag)).map(|i| (i, i + lag));
        let both = || pairs().filter(|(i, j)| part.bins[*i].is_some() && part.bins[*j].is_some());
        let (sum, count) = both().fold((0.0, 0.0), |(s, n), (i, j)| (s + left[i] * left[j], n + 1.0));
        let gamma = weight * sum / f64::max(count, 1.0);
        for (a, b) in both().map(|(i, j)| (of(i), of(j))).filter(|(a, b)| *a < n && *b < n) {
            c[a * n + b] += gamma;
            if lag > 0 {
                c[b * n + a] += gamma;
            }
        }
    }
    for (a, x) in kept.iter().enumerate() {
        for (b, y) in kept.iter().enumerate() {
            let both = part.sums[*x].1 * part.sums[*y].1;
            c[a * n + b] /= both.max(1.0).sqrt();
        }
    }
    c
}

/// Upper tail at `z` of a standardised variable of this skewness: a sum of few products has far longer tails than a
/// normal one. A gamma distribution of the same skewness, by Wilson and Hilferty (1931), to a quarter.
#[must_use]
pub fn skewed_tail(z: f64, skewness: f64) -> f64 {
    if skewness < 1e-6 {
        return tail(z);
    }
    let k = 4.0 / (skewness * skewness);
    let ratio = (1.0 + z / k.sqrt()).max(0.0);
    tail(3.0 * k.sqrt() * (libm::cbrt(ratio) - 1.0 + 1.0 / (9.0 * k)))
}

#[cfg(test)]
mod tests {
    use super::{
        BINS, FEATURES, Part, Structure, bins, coloured, covariance, lags, parts, skewed_tail, statistic,
        structure, sum_up, tail,
    };
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::likelihood::FitData;
    use stylet_identify::noise::Noise;
    use stylet_record::Recording;

    /// Four insertions with holds, at speeds of their own.
    fn insertions() -> FitData {
        let one = |speed: f64| {
            let t: Vec<f64> = (0..8000).map(|k| f64::from(k) / 200.0).collect();
            let (mut at, mut z) = (0.0, Vec::new());
            for t in &t {
                at += if (t * 0.35).sin() > -0.6 { speed / 200.0 } else { 0.0 };
                z.push(at);
            }
            let f = vec![0.0; t.len()];
            let r = Recording::new(t, z, f).expect("a recording");
            BlockAverages::new(&r, &vec![false; r.time_s.len()], BLOCK_S)
        };
        let blocks = [1.2e-3, 1.5e-3, 1.9e-3, 2.3e-3].map(one).to_vec();
        FitData::new(Arc::new(blocks), Noise::white(1.0), 0.0)
    }

    /// White noise of unit variance and a wander of each recording's own, twice as large, that lasts some seconds.
    fn wandering(data: &FitData, seed: u64) -> Vec<Vec<f64>> {
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
    fn a_slow_wander_of_each_recordings_own_is_no_structure() {
        let data = insertions();
        let (mut seen, mut by_white) = (0, 0);
        for seed in 0..40 {
            let w = wandering(&data, seed);
            for feature in 0..FEATURES.len() {
                seen += usize::from(structure(feature, &data, &w, 0.09).coloured < 1e-4);
                // As if neighbouring blocks knew nothing of each other.
                let s = statistic(&parts(feature, &data, &w, 0.09));
                by_white += usize::from(tail(s.t / s.variance.sqrt()) < 1e-4);
            }
        }
        assert!(seen <= 1, "{seen} of 280");
        assert!(by_white >= 30, "the noise would not have misled anybody: {by_white} of 280");
    }

    #[test]
    fn what_is_the_same_at_every_depth_is_structure_under_a_slow_wander_too() {
        let data = insertions();
        for seed in 100..104 {
            let mut w = wandering(&data, seed);
            for (b, w) in data.recordings.iter().zip(&mut w) {
                for (p, w) in b.pieces.iter().zip(w) {
                    *w += 5.0 * (p.position_m * 1.5e3).sin();
                }
            }
            let p = structure(0, &data, &w, 0.09).coloured;
            assert!(p < 1e-6, "seed {seed}: {p:e}");
        }
    }

    /// Against the exact upper tails of chi-square with 2 and 8 degrees of freedom (`exp(-x/2)` and its series).
    #[test]
    fn the_tail_of_a_skewed_sum_is_that_of_its_gamma_distribution() {
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

    /// In, a rest, further in and back, at 100 Hz.
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
        let r = Recording::new(t, z, vec![0.0; 1600]).expect("a recording");
        FitData::new(Arc::new(vec![BlockAverages::new(&r, &[], BLOCK_S)]), Noise::white(1.0), 0.0)
    }

    /// By depth 80 bins to the deepest and one on either side, by time half seconds, by speed steps of half a mm/s up to 8 mm/s, by phase
    /// (rest, back, advance) with 30 bins of depth, by travel half mm up to 31.5 mm on either way.
    #[test]
    fn bins_are_those_of_depth_time_speed_phase_and_travel() {
        let data = there_and_back();
        let b = &data.recordings[0];
        let deepest = 0.021;
        let of = |feature: usize| bins(feature, b, deepest);
        let middle = |i: usize| 0.5 * (b.start_s[i] + b.end_s[i]);
        let into = |z: f64, n: i64| ((z / deepest * n as f64).floor() as i64).clamp(-1, n) + 1;
        let steps = |v: f64| ((v / 5e-4).round() as i64).clamp(-16, 16) + 16;
        let (mut travel, mut way, mut last) = (0.0, 0.0, None);
        let mut seen = std::collections::BTreeSet::new();
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
            let bent = ((bend * 400.0).round() as i64).clamp(-10, 10) + 10;
            let wanted = [
                into(z, 80),
                ((middle(i) - b.start_s[0]) * 2.0) as i64,
                steps(v),
                phase * 32 + into(z, 30),
                half_mm,
                steps(v) / 2 * 24 + into(z, 20),
                bent * 24 + steps(v) / 2,
            ];
            seen.insert((phase, steps(v), bent));
            for feature in 0..7 {
                assert_eq!(all[feature][i] as i64, wanted[feature], "{} of block {i}", FEATURES[feature]);
            }
        }
        assert!(seen.len() > 25, "the motion shows too little: {}", seen.len());
        assert!(all[0].contains(&0) && all[0].contains(&81), "before the surface and beyond the deepest");
    }

    /// Parts with some sums: the statistic is the sum over bins and pairs of what both have in them, as standard normal numbers.
    #[test]
    fn the_statistic_is_the_sum_over_pairs_of_recordings_that_both_have_enough_in_a_bin() {
        let part = |sums: &[(usize, (f64, f64))]| {
            let mut p = Part { sums: vec![(0.0, 0.0); BINS], bins: Vec::new(), w: Vec::new() };
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
        // Third cumulant of the pairs of three numbers: 2^3 - 2; of two: none.
        assert!((s.skewness - 6.0 / 5.0_f64.powf(1.5)).abs() < 1e-12, "{}", s.skewness);
        let pooled = [(6.0, 18.0), (-1.0, 8.0), (1.0, 6.0), (-7.0, 18.0)];
        let chi: f64 = pooled.iter().map(|(s, n): &(f64, f64)| s * s / n).sum();
        assert!((s.nats - 0.5 * (chi - 4.0)).abs() < 1e-12, "{}", s.nats);
        let none = statistic(&three[..1]);
        assert_eq!((none.t, none.variance, none.skewness), (0.0, 0.0, 0.0));
    }

    #[test]
    fn a_recording_alone_is_compared_with_itself_every_other_half_second() {
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
    fn lags_are_every_near_one_and_every_fifth_far_one_for_five() {
        let all: Vec<(usize, f64)> = lags().collect();
        assert_eq!(all.len(), 25 + 95);
        assert_eq!((all[0], all[24], all[25], all[26]), ((0, 1.0), (24, 1.0), (27, 5.0), (32, 5.0)));
        assert_eq!(all[119], (497, 5.0));
        assert_eq!(all.iter().map(|l| l.1).sum::<f64>(), 500.0);
    }

    /// Two short parts, three bins: what every pair of blocks adds, added up one by one.
    fn small() -> [Part; 2] {
        let made = |shift: usize| {
            let n = 36;
            let w: Vec<f64> =
                (0..n).map(|i| (0.9 * (i + shift) as f64).sin() + 0.2 * (i % 3) as f64).collect();
            let bins: Vec<Option<usize>> = (0..n)
                .map(|i| match (i + shift) % 9 {
                    0..=3 => Some(4),
                    4..=6 => Some(11),
                    7 => Some(30),
                    _ => None,
                })
                .collect();
            let mut sums = vec![(0.0, 0.0); BINS];
            for (w, bin) in w.iter().zip(&bins) {
                if let Some(bin) = bin {
                    sums[*bin] = (sums[*bin].0 + w, sums[*bin].1 + 1.0);
                }
            }
            Part { sums, bins, w }
        };
        let mut other = made(5);
        // A bin that one of them hardly has.
        other.bins[2] = Some(50);
        other.sums[50] = (other.w[2], 1.0);
        [made(0), other]
    }

    #[test]
    fn covariances_are_those_of_an_autocovariance_of_what_the_others_leave() {
        let two = small();
        let mut total = vec![(0.0, 0.0); BINS];
        for (k, t) in total.iter_mut().enumerate() {
            *t = (two[0].sums[k].0 + two[1].sums[k].0, two[0].sums[k].1 + two[1].sums[k].1);
        }
        let kept = [4, 11, 30, 50];
        let mut all = Vec::new();
        for (own, other) in [(0, 1), (1, 0)] {
            let (p, o) = (&two[own], &two[other]);
            let n = p.w.len();
            let left: Vec<f64> = (0..n)
                .map(|i| match p.bins[i] {
                    Some(b) if o.sums[b].1 >= 3.0 => p.w[i] - o.sums[b].0 / o.sums[b].1,
                    Some(_) => p.w[i],
                    None => 0.0,
                })
                .collect();
            let gamma = |lag: usize| {
                let pairs: Vec<f64> = (0..n - lag)
                    .filter(|i| p.bins[*i].is_some() && p.bins[i + lag].is_some())
                    .map(|i| left[i] * left[i + lag])
                    .collect();
                pairs.iter().sum::<f64>() / pairs.len().max(1) as f64
            };
            // 36 blocks have lags up to 35: every one to 24, then 27 for 25 to 29 and 32 for 30 to 34.
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
        // Together: over the bins that both have enough in.
        let both = |f: &dyn Fn(usize, usize) -> bool| -> f64 {
            (0..3)
                .flat_map(|a| (0..3).map(move |b| (a, b)))
                .filter(|(a, b)| f(*a, *b))
                .map(|(a, b)| all[0][a][b] * all[1][a][b])
                .sum()
        };
        let (variance, fewer) = coloured(&two);
        let (whole, apart) = (both(&|_, _| true), both(&|a, b| a == b));
        assert!((variance - whole).abs() < 1e-9 * whole.abs(), "{variance} for {whole}");
        assert!(
            (fewer - whole / apart).abs() < 1e-9 * (whole / apart).abs(),
            "{fewer} for {}",
            whole / apart
        );
    }

    #[test]
    fn the_strongest_structure_comes_first_and_pays_for_the_others_looked_at() {
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
        let told = sum_up(&all, |s| s.white);
        assert!((told.p_value - 2.1e-8).abs() < 1e-20, "{}", told.p_value);
        let names: Vec<&str> = told.depends_on.iter().map(|d| d.0.as_str()).collect();
        // Where the chance is the same the one of more nats; 7 times 2e-4 is not worth a word.
        assert_eq!(names, ["phase_and_depth", "acceleration_and_velocity", "time"]);
        assert!((told.depends_on[1].1 - 1.4e-4).abs() < 1e-15);
        assert_eq!(told.nats, 8.0);
        let none = sum_up(&all, |s| s.coloured);
        assert_eq!((none.p_value, none.depends_on.len(), none.nats), (1.0, 0, 0.0));
    }

    /// What is the same in every recording shows; the p-value is that of the statistic, of white noise and of coloured.
    #[test]
    fn the_chance_of_a_structure_is_that_of_its_statistic() {
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
        let (variance, fewer) = coloured(&all);
        let told = skewed_tail(s.t / variance.max(s.variance).sqrt(), s.skewness * fewer.max(1.0).sqrt());
        assert_eq!((found.coloured, found.nats), (told, s.nats));
        // Noise without anything in common is judged as white, and that is all.
        let plain: Vec<Vec<f64>> =
            wandering(&data, 4).iter().map(|w| w.iter().map(|_| 0.0).collect()).collect();
        let none = structure(0, &data, &plain, 0.09);
        assert!(none.white > 0.3 && none.white == none.coloured, "{}", none.white);
        // With one recording the colour is not asked for.
        let alone = data.subset(&[0]);
        let mut one = vec![w[0].clone()];
        one[0]
            .iter_mut()
            .zip(alone.recordings[0].pieces.iter())
            .for_each(|(w, p)| *w += 2.0 * (p.position_m * 900.0).sin());
        let found = structure(0, &alone, &one, 0.09);
        assert!(found.white < 1e-6 && found.white == found.coloured, "{}", found.white);
    }

    /// Wilson and Hilferty's cube root, worked out for a skewness of 1.25 at 2.5: k = 2.56, ratio 2.5625, 3 * 1.6 * (1.36845 - 1 + 0.0434028).
    #[test]
    fn the_cube_root_of_a_gamma_variable_is_nearly_normal() {
        let ratio: f64 = 1.0 + 2.5 / 2.56_f64.sqrt();
        let u = 3.0 * 1.6 * (ratio.powf(1.0 / 3.0) - 1.0 + 1.0 / (9.0 * 2.56));
        assert!((skewed_tail(2.5, 1.25) / tail(u) - 1.0).abs() < 1e-9);
        // Below the lowest value that such a variable has nothing lies, and where it is hardly skewed it is normal.
        assert!(skewed_tail(-9.0, 1.25) > 0.99 && skewed_tail(-9.0, 1.25) == skewed_tail(-90.0, 1.25));
        assert_eq!(skewed_tail(1.3, 9e-7), tail(1.3));
        assert!(skewed_tail(1.3, 1.1e-6) != tail(1.3));
    }
}
