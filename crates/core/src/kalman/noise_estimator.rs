//! Sensor noise as a first-order autoregression, `n_k = rho n_(k-1) + w_k` with white `w` of standard deviation `sigma`:
//! estimated in air, tracked in the tissue.

use crate::bounds::{at_least, at_most};

/// Longest memory in tissue, in samples: `sigma` to within 3 %, and so the false-alarm rate to within a factor of two.
const MEMORY_SAMPLES: f64 = 2000.0;
/// Largest lag-one correlation.
pub(super) const MAX_RHO: f64 = 0.98;
/// Clip of squared standardised innovations, so that single events do not bias the noise level.
const MAX_SQUARED_INNOVATION: f64 = 16.0;
/// Range of the smallest standard deviation in N: from below the resolution of any force sensor, so that the variance is positive, to a
/// tenth of the largest force that is accepted.
const SD_RANGE_N: [f64; 2] = [1e-9, 1e5];
/// Samples in air before the first estimate.
const MIN_AIR_SAMPLES: f64 = 40.0;
/// Below this many samples innovations are not clipped.
const MIN_CLIPPED_SAMPLES: f64 = 50.0;

#[derive(Clone, Copy, Debug)]
pub(crate) struct NoiseEstimator {
    /// Correlation from sample to sample at the usual sampling interval.
    pub(crate) rho: f64,
    /// Variance of `w` in N².
    pub(crate) variance: f64,
    /// Usual sampling interval in s.
    pub(crate) interval_s: f64,
    /// Number of samples of the estimate.
    pub(crate) sample_count: f64,
    first_n: f64,
    /// Sums of `f`, `f²`, `f_k f_(k-1)` and 1 over the samples in air: accepted, waiting, incoming.
    sums: [f64; 4],
    waiting: [f64; 4],
    incoming: [f64; 4],
    last_n: f64,
    last_z: f64,
    min_variance: f64,
    /// Derived values that every sample needs: mean in air, `1/(1 - rho)²`, `variance/(1 - rho²)`.
    bias_n: f64,
    long_run_factor: f64,
    marginal_variance: f64,
}

impl NoiseEstimator {
    /// The standard deviation is never estimated below `min_sd_n`, limited to [`SD_RANGE_N`].
    pub(crate) fn new(min_sd_n: f64) -> Self {
        let [low, high] = SD_RANGE_N;
        let min_sd_n = at_least(low, at_most(high, min_sd_n));
        Self {
            rho: 0.0,
            variance: min_sd_n * min_sd_n,
            interval_s: 0.0,
            sample_count: 0.0,
            first_n: 0.0,
            sums: [0.0; 4],
            waiting: [0.0; 4],
            incoming: [0.0; 4],
            last_n: 0.0,
            last_z: 0.0,
            min_variance: min_sd_n * min_sd_n,
            bias_n: 0.0,
            long_run_factor: 1.0,
            marginal_variance: min_sd_n * min_sd_n,
        }
    }

    /// Sensor bias in N: mean force in air.
    #[inline(always)]
    pub(crate) fn bias_n(&self) -> f64 {
        self.bias_n
    }

    /// Variance of the estimated bias in N².
    pub(crate) fn bias_variance(&self) -> f64 {
        if self.sums[3] > 0.0 { self.variance * self.long_run_factor / self.sums[3] } else { self.variance }
    }

    /// Samples in air that counted.
    pub(crate) fn air_sample_count(&self) -> f64 {
        self.sums[3]
    }

    #[inline]
    pub(crate) fn update_interval(&mut self, dt_s: f64) {
        if self.interval_s == 0.0 {
            self.interval_s = dt_s;
        } else {
            let bounded = at_least(0.5 * self.interval_s, at_most(2.0 * self.interval_s, dt_s));
            self.interval_s += 0.02 * (bounded - self.interval_s);
        }
    }

    /// Re-initialises from the mean of `count` samples in air, their marginal variance and correlation, and the last force
    /// `last_n`.
    #[cold]
    pub(crate) fn restart_in_air(&mut self, mean_n: f64, variance: f64, rho: f64, count: f64, last_n: f64) {
        self.first_n = mean_n;
        self.sums = [0.0, count * variance, count * rho * variance, count];
        (self.waiting, self.incoming) = ([0.0; 4], [0.0; 4]);
        self.last_n = last_n - mean_n;
        self.sample_count = count;
        self.rho = rho;
        self.variance = (variance * (1.0 - rho * rho)).max(self.min_variance);
        self.bias_n = mean_n;
        self.update_derived();
    }

    /// Lower bound on the variance in N².
    pub(crate) fn min_variance(&self) -> f64 {
        self.min_variance
    }

    /// Adds a sample in air. Samples are accepted only when at least twice as many have followed without a contact, so that
    /// a slowly rising load is not learned as noise.
    pub(crate) fn update_in_air(&mut self, force_n: f64) {
        if self.sums[3] + self.incoming[3] == 0.0 {
            self.first_n = force_n;
            self.last_n = 0.0;
        }
        let f = force_n - self.first_n;
        for (sum, x) in self.incoming.iter_mut().zip([f, f * f, f * self.last_n, 1.0]) {
            *sum += x;
        }
        self.last_n = f;
        let first = self.sums[3] == 0.0;
        if first && self.incoming[3] >= MIN_AIR_SAMPLES {
            self.sums = core::mem::take(&mut self.incoming);
            self.estimate_from_sums();
        } else if !first && self.incoming[3] >= self.sums[3] + self.waiting[3] {
            for (sum, x) in self.sums.iter_mut().zip(self.waiting) {
                *sum += x;
            }
            self.waiting = core::mem::take(&mut self.incoming);
            self.estimate_from_sums();
        }
    }

    fn estimate_from_sums(&mut self) {
        let [sum, square, product, n] = self.sums;
        self.sample_count = n;
        let mean = sum / n;
        let variance = (square / n - mean * mean).max(0.0);
        let covariance = product / n - mean * mean;
        // Bartlett: the estimate is biased by -(1 + 4 rho)/n. Within two standard errors of zero it is taken as zero.
        let raw = if variance > 0.0 { covariance / variance } else { 0.0 };
        let rho = raw + (1.0 + 4.0 * raw.max(0.0)) / n;
        self.rho = if rho * rho * n < 4.0 { 0.0 } else { rho.clamp(0.0, MAX_RHO) };
        let unbiased = variance * n / (n - (1.0 + self.rho) / (1.0 - self.rho)).max(0.5 * n);
        self.variance = (unbiased * (1.0 - self.rho * self.rho)).max(self.min_variance);
        self.bias_n = self.first_n + mean;
        self.update_derived();
    }

    /// The correlation, or zero where it lies within two standard errors of zero (`1/sqrt(count)` each).
    #[inline(always)]
    fn significant_rho(&self) -> f64 {
        if self.rho * self.rho * self.sample_count < 4.0 { 0.0 } else { self.rho }
    }

    #[inline(always)]
    fn update_derived(&mut self) {
        let rho = self.significant_rho();
        (self.long_run_factor, self.marginal_variance) = (1.0, self.variance);
        if rho != 0.0 {
            let d = 1.0 - rho;
            self.long_run_factor = 1.0 / (d * d);
            self.marginal_variance = self.variance / (1.0 - rho * rho);
        }
    }

    /// Updates the noise with a whitened innovation `e`, whose variance is `s` times the noise variance.
    #[inline(always)]
    pub(crate) fn update_in_tissue(&mut self, e: f64, s: f64) {
        let z2 = e * e / (s * self.variance);
        let young = self.sample_count < MIN_CLIPPED_SAMPLES;
        if self.sample_count < MEMORY_SAMPLES {
            self.sample_count += 1.0;
        }
        let gain = 1.0 / self.sample_count;
        let counted = if young { z2 } else { at_most(MAX_SQUARED_INNOVATION, z2) };
        self.variance = at_least(self.min_variance, self.variance * (1.0 + gain * (counted - 1.0)));
        let z = libm::copysign(libm::sqrt(counted), e);
        let rho = self.rho + gain * z * self.last_z * (1.0 - self.rho * self.rho);
        self.rho = at_most(MAX_RHO, at_least(0.0, rho));
        self.last_z = z;
        self.update_derived();
    }

    /// Correlation over `dt_s`: `rho^(dt/interval)` to first order.
    #[inline(always)]
    pub(crate) fn rho_over(&self, dt_s: f64) -> f64 {
        let rho = self.significant_rho();
        if rho == 0.0 {
            return 0.0;
        }
        let weighted = rho * self.interval_s;
        weighted / (weighted + (1.0 - rho) * dt_s)
    }

    /// Variance of the noise `n` in N².
    #[inline(always)]
    pub(crate) fn marginal_variance(&self) -> f64 {
        self.marginal_variance
    }

    /// Factor on interval variances for the noise level being estimated from few samples: with `var rho = (1 - rho²)/n` its
    /// relative variance is `4 (1 + rho)/((1 - rho) n)`, half of which lies above.
    pub(crate) fn interval_inflation(&self) -> f64 {
        let n = self.sums[3].max(MIN_AIR_SAMPLES);
        1.0 + 2.0 * (1.0 + self.rho) / ((1.0 - self.rho) * n)
    }

    /// Long-run variance over innovation variance, `1/(1 - rho)²`.
    #[inline(always)]
    pub(crate) fn long_run_factor(&self) -> f64 {
        self.long_run_factor
    }
}

#[cfg(test)]
mod tests;
