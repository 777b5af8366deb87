//! Estimates the noise model from residuals.

use super::detrend::detrended_residuals;
use super::force_bin::{AfterBreak, ForceBinNoise};
use super::long_memory::{AR_ORDER, ROW_LEN, SEARCH_STRETCHES, STRETCHES, regression_row, running_sums};
use super::{HUBER_K, Noise, huber_loss};
use crate::block_averages::BlockAverages;
use stylet_stats::order_statistics::{median, quantile_of_sorted};
use stylet_stats::parallel::*;
use stylet_stats::robust_linear_prediction::{prediction_residual, robust_linear_prediction};

/// Largest number of force ranges.
const MAX_FORCE_BINS: usize = 5;
/// Smallest number of blocks per range: its standard deviation is then known to 5 %.
const MIN_BLOCKS_PER_BIN: usize = 220;
/// Smallest noise (N): below the rounding of numbers in files.
const MIN_NOISE_N: f64 = 1e-6;
/// Iterations of iteratively reweighted least squares (IRLS).
const IRLS_ITERATIONS: usize = 4;

/// How the noise is estimated from residuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseSource {
    /// From all of the residuals; model discrepancy counts as noise.
    Residual,
    /// As `Residual`, with long memory; for confidence intervals.
    LongMemory,
    /// As `LongMemory`, for simulated (bootstrap) residuals, which are normal, so that one least-squares solution suffices.
    Bootstrap,
    /// From the residuals minus their trend over one second, without windows of high variance; model discrepancy does not count as noise.
    Detrended,
}

impl NoiseSource {
    /// Whether the noise model has a long memory, across breaks of a recording.
    fn has_long_memory(self) -> bool {
        matches!(self, Self::LongMemory | Self::Bootstrap)
    }
}

impl Noise {
    /// Noise model of residuals `e` (N, one column per recording), with standard deviations of at least `floor_n` (N).
    #[must_use]
    pub fn estimate(blocks: &[BlockAverages], e: &[Vec<f64>], from: NoiseSource, floor_n: f64) -> Self {
        let columns: Vec<Vec<f64>> = match from {
            NoiseSource::Residual | NoiseSource::LongMemory | NoiseSource::Bootstrap => e.to_vec(),
            NoiseSource::Detrended => {
                blocks.par_iter().zip(e).map(|(b, e)| detrended_residuals(b, e)).collect()
            }
        };
        let mut sizes: Vec<f64> = Vec::new();
        for b in blocks {
            sizes.extend(b.abs_force_n.iter().zip(&b.used).filter(|(_, u)| **u).map(|(s, _)| *s));
        }
        sizes.sort_unstable_by(f64::total_cmp);
        let count = (sizes.len() / MIN_BLOCKS_PER_BIN).clamp(1, MAX_FORCE_BINS);
        let edges_n: Vec<f64> =
            (1..count).map(|k| quantile_of_sorted(&sizes, k as f64 / count as f64)).collect();
        let mut noise = Self { edges_n, bins: Vec::new(), long_memory: from.has_long_memory() };
        noise.bins = (0..count)
            .into_par_iter()
            .map(|bin| noise.fit_bin(blocks, &columns, bin, from, floor_n.max(MIN_NOISE_N)))
            .collect();
        noise
    }

    /// Fits one force range by robust least squares. The autoregressive order minimises the BIC; with long memory it is the largest
    /// stationary one.
    fn fit_bin(
        &self,
        blocks: &[BlockAverages],
        columns: &[Vec<f64>],
        bin: usize,
        from: NoiseSource,
        floor_n: f64,
    ) -> ForceBinNoise {
        let mut rows: Vec<[f64; ROW_LEN]> = Vec::new();
        let mut all: Vec<f64> = Vec::new();
        for (b, e) in blocks.iter().zip(columns) {
            let sums =
                if self.long_memory { running_sums(e, |k| b.used[k]) } else { running_sums(e, |_| true) };
            let mut run = 0;
            for k in 0..b.len() {
                run = if b.memory_reset[k] { 0 } else { run + 1 };
                if !b.used[k] || !e[k].is_finite() || self.bin_index(b.abs_force_n[k]) != bin {
                    continue;
                }
                all.push(e[k].abs());
                if run >= AR_ORDER && (1..=AR_ORDER).all(|i| e[k - i].is_finite()) {
                    rows.push(regression_row(e, &sums, k, if self.long_memory { k } else { run }));
                }
            }
        }
        let sd_n = (median(&mut all) * stylet_stats::MAD_TO_SD).max(floor_n);
        if rows.len() < 40 {
            return ForceBinNoise::white(sd_n);
        }
        let n = rows.len() as f64;
        let mut best: Option<(f64, ForceBinNoise)> = None;
        // Detrended residuals have no long memory.
        let most = match from {
            NoiseSource::Detrended => AR_ORDER,
            NoiseSource::Residual => AR_ORDER + SEARCH_STRETCHES,
            NoiseSource::LongMemory | NoiseSource::Bootstrap => AR_ORDER + STRETCHES.len(),
        };
        // A slow drift that the data do not exclude widens confidence intervals, so the largest stationary order is used.
        let largest = from.has_long_memory();
        let iterations = if from == NoiseSource::Bootstrap { 1 } else { IRLS_ITERATIONS };
        for order in (0..=most).map(|k| if largest { most - k } else { k }) {
            let columns: Vec<usize> = (1..=order).collect();
            let (a, s) = robust_linear_prediction(&rows, &columns, (sd_n, floor_n), HUBER_K, iterations);
            let (ar, long_memory) = split(&a);
            if !stationary(&ar) || (order > AR_ORDER && a[1..].iter().sum::<f64>() > 0.999) {
                continue;
            }
            let loss: f64 = rows.iter().map(|row| huber_loss(prediction_residual(row, &a) / s)).sum::<f64>()
                + n * libm::log(s);
            let cost = loss + 0.5 * order as f64 * libm::log(n);
            if best.is_none_or(|b| cost < b.0) {
                let after_break = [AfterBreak::without_history(sd_n.max(s)); AR_ORDER];
                best = Some((cost, ForceBinNoise { ar, long_memory, innovation_sd_n: s, sd_n, after_break }));
            }
            if largest {
                break;
            }
        }
        let mut best = best.map_or_else(|| ForceBinNoise::white(sd_n), |b| b.1);
        if from.has_long_memory() {
            // Predictors of the first blocks after a break use the blocks since the break and those before it.
            for (run, first) in best.after_break.iter_mut().enumerate() {
                let columns: Vec<usize> = (1..=run).chain(AR_ORDER + 1..ROW_LEN).collect();
                let (a, s) = robust_linear_prediction(&rows, &columns, (sd_n, floor_n), HUBER_K, iterations);
                let (ar, long_memory) = split(&a);
                *first = AfterBreak { ar, long_memory, sd_n: s.max(best.innovation_sd_n) };
            }
        }
        best
    }
}

/// Coefficients of the predecessors and of the stretch means, from those of a regression row.
fn split(a: &[f64; ROW_LEN]) -> ([f64; AR_ORDER], [f64; STRETCHES.len()]) {
    (core::array::from_fn(|i| a[1 + i]), core::array::from_fn(|i| a[1 + AR_ORDER + i]))
}

/// Whether a process with these coefficients, newest first, is stationary (Schur-Cohn criterion by Levinson's recursion
/// downwards). Partial autocorrelations of 0.999 and more count as not stationary.
fn stationary(a: &[f64]) -> bool {
    let mut a = a.to_vec();
    while let Some(k) = a.pop() {
        if k.abs() >= 0.999 {
            return false;
        }
        let rest = a.clone();
        let m = rest.len();
        for i in 0..m {
            a[i] = (rest[i] + k * rest[m - 1 - i]) / (1.0 - k * k);
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::super::tests::still;
    use super::*;
    use crate::test_support::{assert_close, normal};

    /// Coefficients and standard deviations of force-dependent autoregressive noise are recovered.
    #[test]
    fn simulated_noise_is_recovered() {
        let n = 16_000;
        let mut b = still(n);
        let draw = normal(9, n);
        let mut e = vec![0.0; n];
        for k in 0..n {
            // Alternating stretches of constant force.
            let range = k / 800 % 2;
            b.abs_force_n[k] = [0.3, 1.7][range];
            let a = [[0.5, -0.2], [0.3, 0.25]][range];
            let before = |i: usize| if k >= i { e[k - i] } else { 0.0 };
            e[k] = a[0] * before(1) + a[1] * before(2) + [0.01, 0.04][range] * draw[k];
        }
        for from in [NoiseSource::Residual, NoiseSource::LongMemory, NoiseSource::Bootstrap] {
            let mut noise =
                Noise { edges_n: vec![1.0], bins: Vec::new(), long_memory: from.has_long_memory() };
            for range in 0..2 {
                noise.bins.push(noise.fit_bin(
                    std::slice::from_ref(&b),
                    std::slice::from_ref(&e),
                    range,
                    from,
                    1e-6,
                ));
            }
            for (bin, (a, sd)) in noise.bins.iter().zip([([0.5, -0.2], 0.01), ([0.3, 0.25], 0.04)]) {
                let whole: Vec<f64> = bin.ar.iter().chain(&bin.long_memory).copied().collect();
                assert!(
                    (whole[0] - a[0]).abs() < 0.04 && (whole[1] - a[1]).abs() < 0.04,
                    "{from:?}: {whole:?}"
                );
                assert!((bin.innovation_sd_n / sd - 1.0).abs() < 0.03, "{from:?}: {}", bin.innovation_sd_n);
                // Marginal variance: c0 = s^2 (1 - a2) / ((1 + a2) ((1 - a2)^2 - a1^2)).
                let ratio = (1.0 - a[1]) / ((1.0 + a[1]) * ((1.0 - a[1]).powi(2) - a[0] * a[0]));
                assert!((bin.sd_n / (sd * ratio.sqrt()) - 1.0).abs() < 0.05, "{from:?}: {}", bin.sd_n);
            }
        }
    }

    #[test]
    fn fewer_than_forty_blocks_give_white_noise() {
        let actual = |blocks: usize| {
            let b = still(blocks);
            let e: Vec<f64> = (0..blocks).map(|k| libm::sin(0.3 * k as f64)).collect();
            let noise = Noise::estimate(&[b], std::slice::from_ref(&e), NoiseSource::Residual, 0.0);
            let mut sizes: Vec<f64> = e.iter().map(|e| e.abs()).collect();
            (noise.bins[0], median(&mut sizes) * stylet_stats::MAD_TO_SD)
        };
        // The first four blocks have fewer than four predecessors.
        let (few, sd) = actual(43);
        assert_eq!(few, ForceBinNoise::white(sd));
        let (many, sd) = actual(44);
        assert_close(many.sd_n, sd);
        assert!(many.ar != [0.0; AR_ORDER] && many.innovation_sd_n < 0.25 * sd, "{many:?}");
        let none = Noise::estimate(&[still(10)], &[vec![f64::NAN; 10]], NoiseSource::Residual, 0.0);
        assert_eq!(none.bins[0], ForceBinNoise::white(1e-6));
        let floor = Noise::estimate(&[still(60)], &[vec![0.0; 60]], NoiseSource::Residual, 0.02);
        assert_eq!((floor.bins[0].sd_n, floor.bins[0].innovation_sd_n), (0.02, 0.02));
        let least = Noise::estimate(&[still(60)], &[vec![0.0; 60]], NoiseSource::Residual, 0.0);
        assert_eq!(least.bins[0].sd_n, 1e-6);
    }

    /// The roots of the characteristic polynomial all lie inside the unit circle.
    #[test]
    fn a_process_is_stationary_when_its_roots_are_inside_the_unit_circle() {
        // Coefficients of `(1 - p z)(1 - q z)(1 - r z)`.
        let product = |p: f64, q: f64, r: f64| [p + q + r, -(p * q + p * r + q * r), p * q * r];
        for (p, q, r, wanted) in [
            (0.5, 0.3, -0.4, true),
            (0.95, 0.9, 0.85, true),
            (0.95, -0.97, 0.3, true),
            (1.05, 0.4, 0.2, false),
            (0.5, -1.02, 0.1, false),
            (0.2, 1.2, 0.9, false),
            (0.2, 1.2, 0.7, false),
        ] {
            assert_eq!(stationary(&product(p, q, r)), wanted, "{p} {q} {r}");
        }
        // The triangle of two coefficients.
        for (a, b, wanted) in [
            (0.5, 0.45, true),
            (0.5, 0.55, false),
            (-1.4, -0.6, true),
            (-1.7, -0.6, false),
            (0.2, -0.998, true),
            (0.2, -0.9995, false),
            (1.5, -0.6, true),
        ] {
            assert_eq!(stationary(&[a, b]), wanted, "{a} {b}");
        }
        assert!(stationary(&[]) && stationary(&[0.998]) && !stationary(&[0.999]) && !stationary(&[-1.0]));
    }
}
