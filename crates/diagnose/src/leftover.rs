//! What remains: is the residual of a model still predictable?
//!
//! Residuals are averaged in bins of depth, time, speed, phase and travel since reversal; what is the same in several
//! recordings is no noise. The cross-recording statistic `T = sum_bins sum_(r<s) z_rb z_sb` has mean zero whatever the noise's
//! colour, since the noises of two recordings know nothing of each other; how far it strays depends on the colour, for slow
//! noise makes neighbouring bins alike: its variance is `sum_(r<s) sum_(b,b') C_r(b,b') C_s(b,b')`, `C_r` from the
//! autocovariance of what is left of a recording when the others' means are taken away (Bartlett 1935 for two series).

use rayon::prelude::*;
use stylet_identify::blocks::Blocks;
use stylet_identify::fit::Fit;
use stylet_identify::objective::Data;

/// Structure that a model leaves.
#[derive(Clone, Debug, Default)]
pub struct Leftover {
    /// Smallest p-value over the features, times their number.
    pub p_value: f64,
    /// Features by which the residual is predictable, strongest first, with their p-values.
    pub depends_on: Vec<(String, f64)>,
    /// Nats of the strongest.
    pub nats: f64,
}

/// What a model leaves, as slow noise and as none.
#[derive(Clone, Debug, Default)]
pub struct Told {
    /// Held against noise of the colour that the residual has: what is sure.
    pub sure: Leftover,
    /// Held against noise of the data's own colour: slow noise of each recording's own shows too.
    pub at_sight: Leftover,
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
fn bins(feature: usize, b: &Blocks, deepest: f64) -> Vec<usize> {
    let depth = |z: f64, n: f64| ((z / deepest.max(1e-9) * n).floor().clamp(-1.0, n) + 1.0) as usize;
    let speed = |v: f64| ((v * 1e3 * 2.0).round().clamp(-16.0, 16.0) + 16.0) as usize;
    let phase = |v: f64| if v > 1e-5 { 2 } else { usize::from(v < -1e-5) };
    let (mut since, mut sign, mut before) = (0.0, 0.0, (f64::NAN, 0.0));
    let first = b.from_s.first().copied().unwrap_or(0.0);
    (0..b.len())
        .map(|i| {
            let t = 0.5 * (b.from_s[i] + b.to_s[i]);
            let (z, v) = b.motion.at(t);
            let a = if before.0.is_finite() { (v - before.1) / (b.to_s[i] - b.from_s[i]) } else { 0.0 };
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
pub fn test(fit: &Fit, data: &Data) -> Told {
    let deepest = data.blocks.iter().flat_map(|b| b.pieces.iter()).fold(0.0_f64, |m, p| m.max(p.z_m));
    let all: Vec<Structure> = (0..FEATURES.len())
        .into_par_iter()
        .map(|feature| structure(feature, data, &fit.residuals.w, deepest))
        .collect();
    Told { sure: sum_up(&all, |s| s.coloured), at_sight: sum_up(&all, |s| s.white) }
}

fn sum_up(all: &[Structure], p: impl Fn(&Structure) -> f64) -> Leftover {
    let mut found: Vec<(String, f64, f64)> = FEATURES
        .iter()
        .zip(all)
        .map(|(name, s)| ((*name).to_owned(), (p(s) * FEATURES.len() as f64).min(1.0), s.nats))
        .collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1).then(b.2.total_cmp(&a.2)));
    let p_value = found.first().map_or(1.0, |f| f.1);
    found.retain(|f| f.1 < REPORTED);
    let nats = found.iter().fold(0.0_f64, |m, f| m.max(f.2));
    Leftover { p_value, depends_on: found.into_iter().map(|f| (f.0, f.1)).collect(), nats }
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
fn parts(feature: usize, data: &Data, w: &[Vec<f64>], deepest: f64) -> Vec<Part> {
    let mut parts = Vec::new();
    let halves = if data.recordings() == 1 { 2 } else { 1 };
    for (b, w) in data.blocks.iter().zip(w) {
        let first = b.from_s.first().copied().unwrap_or(0.0);
        let all = bins(feature, b, deepest);
        for half in 0..halves {
            let own = |i: usize| halves == 1 || ((b.from_s[i] - first) / 0.5) as usize % 2 == half;
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

fn structure(feature: usize, data: &Data, w: &[Vec<f64>], deepest: f64) -> Structure {
    let parts = parts(feature, data, w, deepest);
    let s = statistic(&parts);
    if s.variance == 0.0 {
        return Structure { white: 1.0, coloured: 1.0, nats: 0.0 };
    }
    let white = skewed_tail(s.t / s.variance.sqrt(), s.skewness);
    if white > REPORTED || data.recordings() < 2 {
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
    use super::{FEATURES, parts, skewed_tail, statistic, structure, tail};
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};
    use std::sync::Arc;
    use stylet_identify::blocks::{BLOCK_S, Blocks};
    use stylet_identify::noise::Noise;
    use stylet_identify::objective::Data;
    use stylet_record::Recording;

    /// Four insertions with holds, at speeds of their own.
    fn insertions() -> Data {
        let one = |speed: f64| {
            let t: Vec<f64> = (0..8000).map(|k| f64::from(k) / 200.0).collect();
            let (mut at, mut z) = (0.0, Vec::new());
            for t in &t {
                at += if (t * 0.35).sin() > -0.6 { speed / 200.0 } else { 0.0 };
                z.push(at);
            }
            let f = vec![0.0; t.len()];
            let r = Recording::new(t, z, f).expect("a recording");
            Blocks::new(&r, &vec![false; r.time_s.len()], BLOCK_S)
        };
        let blocks = [1.2e-3, 1.5e-3, 1.9e-3, 2.3e-3].map(one).to_vec();
        Data::new(Arc::new(blocks), Noise::white(1.0), 0.0)
    }

    /// White noise of unit variance and a wander of each recording's own, twice as large, that lasts some seconds.
    fn wandering(data: &Data, seed: u64) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = move || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        data.blocks
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
            for (b, w) in data.blocks.iter().zip(&mut w) {
                for (p, w) in b.pieces.iter().zip(w) {
                    *w += 5.0 * (p.z_m * 1.5e3).sin();
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
}
