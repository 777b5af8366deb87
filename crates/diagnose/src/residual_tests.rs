//! Tests whether the residual of a model depends on depth, time, speed, phase, travel since reversal or acceleration.
//!
//! Residuals are averaged in bins of a feature; structure common to several recordings is not noise. The cross-recording statistic
//! `T = sum_bins sum_(r<s) z_rb z_sb` has mean zero for any autocorrelation of the noise, because recordings are independent.
//! Its variance is `sum_(r<s) sum_(b,b') C_r(b,b') C_s(b,b')`, because slow noise correlates neighbouring bins; `C_r` follows from the
//! autocovariance of a recording's residual after subtraction of the means of the others (Bartlett 1935 for two series).

use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_stats::parallel::*;

/// Structure in the residual of a model.
#[derive(Clone, Debug, Default)]
pub struct ResidualStructure {
    /// Smallest p-value of the features, corrected for their number.
    pub p_value: f64,
    /// Features on which the residual depends, most significant first, with their p-values.
    pub depends_on: Vec<(String, f64)>,
    /// Gain (nats) of the strongest of them.
    pub nats: f64,
}

/// Residual tests against two noise models.
#[derive(Clone, Debug, Default)]
pub struct ResidualTests {
    /// Against noise with the autocorrelation of the residual: detects structure common to the recordings.
    pub coloured_noise: ResidualStructure,
    /// Against the noise of the data: detects slow noise of single recordings, too.
    pub white_noise: ResidualStructure,
}

/// Features that define the bins.
const FEATURES: [&str; 7] = [
    "depth",
    "time",
    "velocity",
    "phase_and_depth",
    "travel_since_reversal",
    "depth_and_velocity",
    "acceleration_and_velocity",
];
/// Largest number of bins of a feature; blocks in higher bins are ignored.
const MAX_BINS: usize = 800;
/// Smallest number of blocks of a recording in a bin.
const MIN_BLOCKS: f64 = 3.0;
/// p-value below which the dependence on a feature is reported.
const MAX_REPORTED_P_VALUE: f64 = 1e-3;

/// Upper tail probability of the standard normal distribution.
fn tail(z: f64) -> f64 {
    stylet_stats::normal::sf(z)
}

/// Bin of every block of a recording for a feature.
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
                    let acceleration = (a * 400.0).round().clamp(-10.0, 10.0) + 10.0;
                    acceleration as usize * 24 + speed(v) / 2
                }
            }
        })
        .collect()
}

/// Tests the residual of a fit.
pub fn test_residuals(fit: &Fit, data: &FitData) -> ResidualTests {
    let deepest =
        data.recordings.iter().flat_map(|b| b.pieces.iter()).fold(0.0_f64, |m, p| m.max(p.position_m));
    let all: Vec<Structure> = (0..FEATURES.len())
        .into_par_iter()
        .map(|feature| structure(feature, data, &fit.residuals.innovations, deepest))
        .collect();
    ResidualTests {
        coloured_noise: summarise(&all, |s| s.coloured),
        white_noise: summarise(&all, |s| s.white),
    }
}

/// Corrects the p-values for the number of features and keeps the significant features.
fn summarise(all: &[Structure], p: impl Fn(&Structure) -> f64) -> ResidualStructure {
    let mut found: Vec<(String, f64, f64)> = FEATURES
        .iter()
        .zip(all)
        .map(|(name, s)| ((*name).to_owned(), (p(s) * FEATURES.len() as f64).min(1.0), s.nats))
        .collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1).then(b.2.total_cmp(&a.2)));
    let p_value = found.first().map_or(1.0, |f| f.1);
    found.retain(|f| f.1 < MAX_REPORTED_P_VALUE);
    let nats = found.iter().fold(0.0_f64, |m, f| m.max(f.2));
    ResidualStructure { p_value, depends_on: found.into_iter().map(|f| (f.0, f.1)).collect(), nats }
}

/// Bin sums of one recording, or of half of a single recording.
struct Part {
    /// Sum and count of every bin.
    sums: Vec<(f64, f64)>,
    /// Bin of every compared block.
    bins: Vec<Option<usize>>,
    /// Normalised residuals, with outliers limited.
    w: Vec<f64>,
}

/// One part per recording; of a single recording, one part for even and one for odd half seconds.
fn parts(feature: usize, data: &FitData, w: &[Vec<f64>], deepest: f64) -> Vec<Part> {
    let mut parts = Vec::new();
    let halves = if data.recording_count() == 1 { 2 } else { 1 };
    for (b, w) in data.recordings.iter().zip(w) {
        let first = b.start_s.first().copied().unwrap_or(0.0);
        let all = bins(feature, b, deepest);
        for half in 0..halves {
            let in_half = |i: usize| halves == 1 || ((b.start_s[i] - first) / 0.5) as usize % 2 == half;
            let mut part = Part {
                sums: vec![(0.0, 0.0); MAX_BINS],
                bins: Vec::with_capacity(b.len()),
                w: w.iter().map(|w| w.clamp(-4.0, 4.0)).collect(),
            };
            for (i, bin) in all.iter().enumerate() {
                let bin = Some(*bin).filter(|bin| b.used[i] && in_half(i) && *bin < MAX_BINS);
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

/// The cross-recording statistic with its moments under white noise.
struct Statistic {
    t: f64,
    variance: f64,
    skewness: f64,
    nats: f64,
}

/// Computes the statistic of these parts.
fn statistic(parts: &[Part]) -> Statistic {
    let (mut t, mut variance, mut third, mut pooled, mut used) = (0.0, 0.0_f64, 0.0, 0.0, 0.0);
    for bin in 0..MAX_BINS {
        let z: Vec<(f64, f64)> = parts.iter().map(|p| p.sums[bin]).filter(|s| s.1 >= MIN_BLOCKS).collect();
        let all: (f64, f64) = z.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        if all.1 > 0.0 {
            pooled += all.0 * all.0 / all.1;
            used += 1.0;
        }
        // Third cumulant of the sum over pairs of standard normal values.
        let others = z.len().saturating_sub(1) as f64;
        third += others.powi(3) - others;
        for (k, a) in z.iter().enumerate() {
            for b in &z[..k] {
                t += a.0 * b.0 / (a.1 * b.1).sqrt();
                // Under the null hypothesis each product has unit variance.
                variance += 1.0;
            }
        }
    }
    let skewness = if variance > 0.0 { third / variance.powf(1.5) } else { 0.0 };
    Statistic { t, variance, skewness, nats: 0.5 * (pooled - used) }
}

/// p-values and nats of one feature.
struct Structure {
    /// Under white noise.
    white: f64,
    /// Under noise with the autocorrelation of the residual.
    coloured: f64,
    nats: f64,
}

/// Test of one feature.
fn structure(feature: usize, data: &FitData, w: &[Vec<f64>], deepest: f64) -> Structure {
    let parts = parts(feature, data, w, deepest);
    let s = statistic(&parts);
    if s.variance == 0.0 {
        return Structure { white: 1.0, coloured: 1.0, nats: 0.0 };
    }
    let white = skewed_tail(s.t / s.variance.sqrt(), s.skewness);
    if white > MAX_REPORTED_P_VALUE || data.recording_count() < 2 {
        return Structure { white, coloured: white, nats: s.nats };
    }
    let (coloured_variance, reduction) = coloured_moments(&parts);
    let coloured =
        skewed_tail(s.t / coloured_variance.max(s.variance).sqrt(), s.skewness * reduction.max(1.0).sqrt());
    Structure { white, coloured, nats: s.nats }
}

/// Lags in blocks at which the autocovariance is evaluated, with the number of lags that each represents.
fn lags() -> impl Iterator<Item = (usize, f64)> {
    /// Lags in blocks at which the autocovariance is evaluated one by one.
    const NEAR_LAGS: usize = 25;
    /// Largest lag in blocks.
    const MAX_LAG: usize = 500;
    /// Step in blocks of the lags beyond `NEAR_LAGS`.
    const LAG_STEP: usize = 5;
    let far = (NEAR_LAGS..MAX_LAG).step_by(LAG_STEP).map(|k| (k + LAG_STEP / 2, LAG_STEP as f64));
    (0..NEAR_LAGS).map(|k| (k, 1.0)).chain(far)
}

/// Variance of the statistic for noise with the autocorrelation of the recordings, and the factor by which correlation reduces the
/// effective number of bins.
fn coloured_moments(parts: &[Part]) -> (f64, f64) {
    let mut total = vec![(0.0, 0.0); MAX_BINS];
    for p in parts {
        for (t, s) in total.iter_mut().zip(&p.sums) {
            *t = (t.0 + s.0, t.1 + s.1);
        }
    }
    let kept: Vec<usize> =
        (0..MAX_BINS).filter(|b| parts.iter().filter(|p| p.sums[*b].1 >= MIN_BLOCKS).count() > 1).collect();
    let n = kept.len();
    let covariances: Vec<Vec<f64>> = parts.par_iter().map(|p| covariance(p, &total, &kept)).collect();
    let (mut variance, mut diagonal) = (0.0, 0.0);
    for (k, a) in covariances.iter().enumerate() {
        for b in &covariances[..k] {
            variance += a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            diagonal += (0..n).map(|i| a[i * (n + 1)] * b[i * (n + 1)]).sum::<f64>();
        }
    }
    (variance, variance / diagonal.max(1e-300))
}

/// Covariance matrix (row by row) of the standardised bin sums of a part; zero for bins with too few blocks.
fn covariance(part: &Part, total: &[(f64, f64)], kept: &[usize]) -> Vec<f64> {
    let residual: Vec<f64> = part
        .w
        .iter()
        .zip(&part.bins)
        .map(|(w, bin)| {
            let Some(bin) = *bin else { return 0.0 };
            let others = (total[bin].0 - part.sums[bin].0, total[bin].1 - part.sums[bin].1);
            if others.1 >= MIN_BLOCKS { w - others.0 / others.1 } else { *w }
        })
        .collect();
    let mut place = vec![usize::MAX; MAX_BINS];
    for (k, bin) in kept.iter().enumerate().filter(|(_, b)| part.sums[**b].1 >= MIN_BLOCKS) {
        place[*bin] = k;
    }
    let of = |i: usize| part.bins[i].map_or(usize::MAX, |b| place[b]);
    let n = kept.len();
    let mut c = vec![0.0; n * n];
    for (lag, weight) in lags() {
        let pairs = || (0..residual.len().saturating_sub(lag)).map(|i| (i, i + lag));
        let both = || pairs().filter(|(i, j)| part.bins[*i].is_some() && part.bins[*j].is_some());
        let (sum, count) = both().fold((0.0, 0.0), |(s, n), (i, j)| (s + residual[i] * residual[j], n + 1.0));
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

/// Upper tail probability at `z` of a standardised variable with this skewness: gamma distribution of equal skewness, by Wilson and
/// Hilferty (1931), with a relative error of a quarter. A sum of few products has longer tails than a normal variable.
pub fn skewed_tail(z: f64, skewness: f64) -> f64 {
    if skewness < 1e-6 {
        return tail(z);
    }
    let k = 4.0 / (skewness * skewness);
    let ratio = (1.0 + z / k.sqrt()).max(0.0);
    tail(3.0 * k.sqrt() * (libm::cbrt(ratio) - 1.0 + 1.0 / (9.0 * k)))
}

#[cfg(test)]
mod tests;
