//! The sensor's noise, learned while the needle is in the air and kept up to date in the tissue: a first-order
//! autoregression, `n_k = rho n_(k-1) + w_k`, `w` white with standard deviation `sigma`.

use super::gaussian::{at_least, at_most};

/// Longest memory in the tissue, in samples: 3 % of `sigma`, enough for the false-alarm rate to be right within
/// a factor two.
const MEMORY: f64 = 2000.0;
/// Largest correlation from sample to sample that is believed.
const RHO_LIMIT: f64 = 0.98;
/// Squared standardised innovation that counts at most: one event says little about the noise.
const CLIP: f64 = 16.0;
/// Samples in the air that are the first to count.
const FIRST: f64 = 40.0;

#[derive(Clone, Copy, Debug)]
pub(crate) struct NoiseEstimator {
    /// Correlation from sample to sample at the usual sampling step.
    pub(crate) rho: f64,
    /// Variance of `w` in N².
    pub(crate) variance: f64,
    /// Usual sampling step in s.
    pub(crate) interval_s: f64,
    /// Samples that it was learned from.
    pub(crate) sample_count: f64,
    first_n: f64,
    /// Sums of `f`, `f²`, products with the sample before, and count: those that count, those that wait, those that come in.
    sums: [f64; 4],
    waiting: [f64; 4],
    coming: [f64; 4],
    last_n: f64,
    last_z: f64,
    least: f64,
    /// What follows from the above and is asked for with every sample: mean in the air, `1/(1 - rho)²`, `variance/(1 - rho²)`.
    bias_n: f64,
    slow: f64,
    marginal: f64,
}

impl NoiseEstimator {
    /// Never below a standard deviation of `least_n`.
    pub(crate) fn new(least_n: f64) -> Self {
        Self {
            rho: 0.0,
            variance: least_n * least_n,
            interval_s: 0.0,
            sample_count: 0.0,
            first_n: 0.0,
            sums: [0.0; 4],
            waiting: [0.0; 4],
            coming: [0.0; 4],
            last_n: 0.0,
            last_z: 0.0,
            least: least_n * least_n,
            bias_n: 0.0,
            slow: 1.0,
            marginal: least_n * least_n,
        }
    }

    /// Mean force in the air in N: what the sensor shows without load.
    #[inline(always)]
    pub(crate) fn bias_n(&self) -> f64 {
        self.bias_n
    }

    /// How well that is known, in N².
    pub(crate) fn bias_variance(&self) -> f64 {
        if self.sums[3] > 0.0 { self.variance * self.slow / self.sums[3] } else { self.variance }
    }

    /// Samples in the air that counted.
    pub(crate) fn air_sample_count(&self) -> f64 {
        self.sums[3]
    }

    #[inline]
    pub(crate) fn update_interval(&mut self, dt_s: f64) {
        if self.interval_s == 0.0 {
            self.interval_s = dt_s;
        } else {
            let bounded = dt_s.clamp(0.5 * self.interval_s, 2.0 * self.interval_s);
            self.interval_s += 0.02 * (bounded - self.interval_s);
        }
    }

    /// A sample in the air. A slow load must not pass for noise: samples count only when at least twice as many have come
    /// after them without a contact.
    pub(crate) fn update_in_air(&mut self, force_n: f64) {
        if self.sums[3] + self.coming[3] == 0.0 {
            self.first_n = force_n;
            self.last_n = 0.0;
        }
        let f = force_n - self.first_n;
        for (sum, x) in self.coming.iter_mut().zip([f, f * f, f * self.last_n, 1.0]) {
            *sum += x;
        }
        self.last_n = f;
        let first = self.sums[3] == 0.0;
        if first && self.coming[3] >= FIRST {
            self.sums = core::mem::take(&mut self.coming);
            self.learn();
        } else if !first && self.coming[3] >= self.sums[3] + self.waiting[3] {
            for (sum, x) in self.sums.iter_mut().zip(self.waiting) {
                *sum += x;
            }
            self.waiting = core::mem::take(&mut self.coming);
            self.learn();
        }
    }

    fn learn(&mut self) {
        let [sum, square, product, n] = self.sums;
        self.sample_count = n;
        let mean = sum / n;
        let variance = (square / n - mean * mean).max(0.0);
        let covariance = product / n - mean * mean;
        // Bartlett: the estimate is low by (1 + 4 rho)/n. What is within two standard errors of none is none.
        let raw = if variance > 0.0 { covariance / variance } else { 0.0 };
        let rho = raw + (1.0 + 4.0 * raw.max(0.0)) / n;
        self.rho = if rho * rho * n < 4.0 { 0.0 } else { rho.clamp(0.0, RHO_LIMIT) };
        let unbiased = variance * n / (n - (1.0 + self.rho) / (1.0 - self.rho)).max(0.5 * n);
        self.variance = (unbiased * (1.0 - self.rho * self.rho)).max(self.least);
        self.bias_n = self.first_n + mean;
        self.follow();
    }

    /// Colour that is within two standard errors of none, `1/sqrt(count)`, is none.
    #[inline(always)]
    fn colour(&self) -> f64 {
        if self.rho * self.rho * self.sample_count < 4.0 { 0.0 } else { self.rho }
    }

    #[inline(always)]
    fn follow(&mut self) {
        let rho = self.colour();
        (self.slow, self.marginal) = (1.0, self.variance);
        if rho != 0.0 {
            let d = 1.0 - rho;
            self.slow = 1.0 / (d * d);
            self.marginal = self.variance / (1.0 - rho * rho);
        }
    }

    /// A whitened innovation `e` whose variance was `s` times the noise's.
    #[inline(always)]
    pub(crate) fn update_in_tissue(&mut self, e: f64, s: f64) {
        let z2 = e * e / (s * self.variance);
        let young = self.sample_count < 50.0;
        if self.sample_count < MEMORY {
            self.sample_count += 1.0;
        }
        let gain = 1.0 / self.sample_count;
        let counted = if young { z2 } else { at_most(CLIP, z2) };
        self.variance = at_least(self.least, self.variance * (1.0 + gain * (counted - 1.0)));
        let z = libm::copysign(libm::sqrt(counted), e);
        let rho = self.rho + gain * z * self.last_z * (1.0 - self.rho * self.rho);
        self.rho = at_most(RHO_LIMIT, at_least(0.0, rho));
        self.last_z = z;
        self.follow();
    }

    /// Correlation over a step of `dt_s`: `rho^(dt/step)` to first order.
    #[inline(always)]
    pub(crate) fn rho_over(&self, dt_s: f64) -> f64 {
        let rho = self.colour();
        if rho == 0.0 {
            return 0.0;
        }
        let weighed = rho * self.interval_s;
        weighed / (weighed + (1.0 - rho) * dt_s)
    }

    /// Variance of the noise itself in N².
    #[inline(always)]
    pub(crate) fn marginal_variance(&self) -> f64 {
        self.marginal
    }

    /// What intervals grow by, as a factor of the variance, because the level of slow noise was learned from few samples: with
    /// `var rho = (1 - rho²)/n` its relative variance is `4 (1 + rho)/((1 - rho) n)`, of which half is above.
    pub(crate) fn interval_inflation(&self) -> f64 {
        let n = self.sums[3].max(40.0);
        1.0 + 2.0 * (1.0 + self.rho) / ((1.0 - self.rho) * n)
    }

    /// How much more slow noise weighs than white noise of the same innovations: `1/(1 - rho)²`.
    #[inline(always)]
    pub(crate) fn long_run_factor(&self) -> f64 {
        self.slow
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// `bias + n_k` with `n_k = rho n_(k-1) + sigma w`.
    fn forces(seed: u64, count: usize, bias_n: f64, rho: f64, sigma_n: f64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut n = 0.0;
        (0..count + 1000)
            .map(|_| {
                let w: f64 = StandardNormal.sample(&mut rng);
                n = rho * n + sigma_n * w;
                bias_n + n
            })
            .skip(1000)
            .collect()
    }

    fn in_air(forces_n: &[f64]) -> NoiseEstimator {
        let mut noise = NoiseEstimator::new(1e-4);
        forces_n.iter().for_each(|f| noise.update_in_air(*f));
        noise
    }

    #[test]
    fn bias_and_colour_and_strength_of_the_noise_are_learned_in_the_air() {
        for (rho, sigma_n) in [(0.0, 0.02), (0.5, 0.02), (0.9, 0.005)] {
            let noise = in_air(&forces(1, 20_000, 0.7, rho, sigma_n));
            assert!((noise.rho - rho).abs() < 0.03, "{noise:?}");
            assert!((noise.variance.sqrt() / sigma_n - 1.0).abs() < 0.03, "{noise:?}");
            let marginal = sigma_n * sigma_n / (1.0 - rho * rho);
            assert!((noise.marginal_variance() / marginal - 1.0).abs() < 0.15, "{noise:?}");
            assert!((noise.long_run_factor() * (1.0 - rho) * (1.0 - rho) - 1.0).abs() < 0.4, "{noise:?}");
            // The mean of slow noise is known as well as its spread divided by the samples that count.
            let sd = noise.bias_variance().sqrt();
            assert!((noise.bias_n() - 0.7).abs() < 4.0 * sd, "{noise:?}");
            let known = sigma_n / (1.0 - rho) / noise.air_sample_count().sqrt();
            assert!((sd / known - 1.0).abs() < 0.25, "{sd} {known}");
        }
    }

    #[test]
    fn white_noise_has_no_colour_and_few_samples_are_not_biased() {
        // 80 samples, of which 40 count: over many runs the mean square is that of the noise.
        let (mut sum, mut coloured) = (0.0, 0);
        for seed in 0..400 {
            let noise = in_air(&forces(seed, 40, -0.3, 0.0, 0.01));
            assert_eq!(noise.air_sample_count(), 40.0);
            sum += noise.variance / 1e-4;
            coloured += usize::from(noise.rho_over(0.005) != 0.0);
        }
        assert!((sum / 400.0 - 1.0).abs() < 0.06, "{}", sum / 400.0);
        assert!(coloured < 40, "{coloured} of 400 have a colour at two standard errors");
    }

    #[test]
    fn a_load_counts_as_noise_only_when_twice_as_many_samples_have_followed() {
        let mut forces_n = forces(2, 400, 0.0, 0.0, 0.01);
        let before = in_air(&forces_n);
        let counted = before.air_sample_count();
        assert!((100.0..=200.0).contains(&counted), "{counted}");
        forces_n.extend(forces(3, 100, 0.2, 0.0, 0.01));
        let after = in_air(&forces_n);
        assert!(after.bias_n().abs() < 0.005, "a quarter more samples with a load leave the bias: {after:?}");
        assert!(after.variance.sqrt() < 0.013, "and the strength: {after:?}");
    }

    #[test]
    fn noise_is_never_weaker_than_the_least() {
        let mut noise = in_air(&[0.25; 500]);
        assert_eq!((noise.variance.sqrt(), noise.bias_n()), (1e-4, 0.25));
        for _ in 0..5000 {
            noise.update_in_tissue(0.0, 1.0);
        }
        assert!((noise.variance.sqrt() - 1e-4).abs() < 1e-12);
    }

    #[test]
    fn in_the_tissue_the_noise_is_followed() {
        let mut noise = in_air(&forces(4, 2000, 0.0, 0.0, 0.01));
        // Innovations of twice the strength whose variance is 1.5 times that of the noise.
        for e in forces(5, 12_000, 0.0, 0.0, 0.02 * 1.5_f64.sqrt()) {
            noise.update_in_tissue(e, 1.5);
        }
        assert!((noise.variance.sqrt() / 0.02 - 1.0).abs() < 0.05, "{noise:?}");
        assert!(noise.rho < 0.08, "{noise:?}");
        // One event says little.
        let before = noise.variance;
        noise.update_in_tissue(5.0, 1.0);
        assert!(noise.variance < 1.01 * before, "{before} to {}", noise.variance);
    }

    #[test]
    fn in_the_tissue_the_colour_is_followed_to_what_leaves_the_innovations_white() {
        for (from, to) in [(0.0, 0.6), (0.8, 0.3)] {
            let mut noise = in_air(&forces(8, 2000, 0.0, from, 0.01));
            let (mut last_n, mut mean, mut count) = (0.0, 0.0, 0.0);
            for (k, n) in forces(9, 40_000, 0.0, to, 0.01).into_iter().enumerate() {
                noise.update_in_tissue(n - noise.rho * last_n, 1.0);
                last_n = n;
                if k >= 20_000 {
                    mean += noise.rho;
                    count += 1.0;
                }
            }
            assert!((mean / count - to).abs() < 0.03, "{} for {to}", mean / count);
            assert!((noise.variance.sqrt() / 0.01 - 1.0).abs() < 0.05, "{noise:?}");
        }
    }

    #[test]
    fn correlation_fades_with_the_interval() {
        let mut noise = in_air(&forces(6, 20_000, 0.0, 0.8, 0.01));
        noise.update_interval(0.005);
        let rho = noise.rho;
        assert!((noise.rho_over(0.005) - rho).abs() < 1e-12);
        // To first order in the rate (1 - rho)/rho per step.
        for steps in [0.5, 2.0, 10.0] {
            let expected = 1.0 / (1.0 + steps * (1.0 - rho) / rho);
            assert!((noise.rho_over(steps * 0.005) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn the_usual_step_follows_the_clock_and_a_gap_hardly_moves_it() {
        let mut noise = NoiseEstimator::new(1e-4);
        noise.update_interval(0.005);
        assert_eq!(noise.interval_s, 0.005);
        noise.update_interval(10.0);
        assert!((noise.interval_s - 0.0051).abs() < 1e-12, "as if twice as long: {}", noise.interval_s);
        noise.update_interval(1e-9);
        assert!(
            (noise.interval_s - (0.0051 - 0.02 * 0.00255)).abs() < 1e-12,
            "as if half: {}",
            noise.interval_s
        );
        for _ in 0..1000 {
            noise.update_interval(0.002);
        }
        assert!((noise.interval_s - 0.002).abs() < 1e-6, "{}", noise.interval_s);
    }

    #[test]
    fn intervals_are_wider_the_slower_the_noise_and_the_fewer_the_samples() {
        for (rho, count) in [(0.0, 20_000), (0.5, 20_000), (0.9, 1000)] {
            let noise = in_air(&forces(7, count, 0.0, rho, 0.01));
            // Half of the relative variance of the level, 4 (1 + rho)/((1 - rho) n).
            let expected = 2.0 * (1.0 + noise.rho) / ((1.0 - noise.rho) * noise.air_sample_count());
            assert!((noise.interval_inflation() - 1.0 - expected).abs() < 1e-12);
        }
        assert_eq!(NoiseEstimator::new(1e-4).interval_inflation(), 1.05, "no samples count as forty");
    }

    impl NoiseEstimator {
        /// Known to be so from as many samples in the air, at 200 Hz: for the tests of what is built on it.
        pub(crate) fn known(rho: f64, variance: f64, bias_n: f64, count: f64) -> Self {
            let mut noise = Self::new(1e-9);
            (noise.rho, noise.variance, noise.bias_n, noise.sample_count) = (rho, variance, bias_n, count);
            (noise.sums[3], noise.interval_s) = (count, 0.005);
            noise.follow();
            noise
        }
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-11 * expected.abs(), "{found} for {expected}");
    }

    /// Colour, variance of what is new, and mean by the moments of a batch about its first value.
    fn by_moments(forces_n: &[f64], least: f64) -> (f64, f64, f64) {
        let n = forces_n.len() as f64;
        let f: Vec<f64> = forces_n.iter().map(|x| x - forces_n[0]).collect();
        let mean = f.iter().sum::<f64>() / n;
        let variance = f.iter().map(|x| x * x).sum::<f64>() / n - mean * mean;
        let covariance = f.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n - mean * mean;
        let raw = covariance / variance;
        let rho = (raw + (1.0 + 4.0 * raw.max(0.0)) / n).clamp(0.0, 0.98);
        let rho = if rho * rho * n < 4.0 { 0.0 } else { rho };
        let unbiased = variance * n / (n - (1.0 + rho) / (1.0 - rho)).max(0.5 * n);
        (rho, (unbiased * (1.0 - rho * rho)).max(least), forces_n[0] + mean)
    }

    #[test]
    fn what_counts_in_the_air_are_the_first_forty_samples_and_then_a_half_to_a_quarter_of_all() {
        let mut noise = NoiseEstimator::new(1e-4);
        let forces_n = forces(11, 700, 0.7, 0.5, 0.02);
        let mut counts = Vec::new();
        for (k, f) in forces_n.iter().enumerate() {
            let before = (noise.bias_n(), noise.variance, noise.rho);
            noise.update_in_air(*f);
            let count = noise.air_sample_count();
            if counts.last().is_none_or(|(_, c)| *c != count) {
                counts.push((k + 1, count));
            } else if counts.len() > 2 || k < 39 {
                let changed = (noise.bias_n(), noise.variance, noise.rho) != before;
                assert!(!changed, "at {k} nothing new counts");
            }
        }
        assert_eq!(counts, [(1, 0.0), (40, 40.0), (160, 80.0), (320, 160.0), (640, 320.0)]);
    }

    #[test]
    fn the_noise_in_the_air_is_that_of_the_moments_of_the_samples_that_count() {
        for (seed, rho, sigma_n) in [(1, 0.0, 0.02), (2, 0.5, 0.02), (3, 0.9, 0.005), (4, 0.995, 0.003)] {
            let forces_n = forces(seed, 1279, 0.7, rho, sigma_n);
            for (count, counted) in [(40, 40), (159, 40), (160, 80), (320, 160), (1279, 320)] {
                let noise = in_air(&forces_n[..count]);
                let (rho, variance, mean) = by_moments(&forces_n[..counted], 1e-8);
                assert!((noise.rho - rho).abs() < 1e-9, "{} for {rho}", noise.rho);
                assert!((noise.variance / variance - 1.0).abs() < 1e-7, "{} for {variance}", noise.variance);
                near(noise.bias_n(), mean);
                near(noise.sample_count, counted as f64);
                near(noise.bias_variance(), noise.variance * noise.long_run_factor() / counted as f64);
            }
        }
    }

    #[test]
    fn nothing_is_known_of_the_bias_but_the_least_noise_before_the_first_samples_have_counted() {
        let mut noise = NoiseEstimator::new(0.03);
        near(noise.bias_variance(), 9e-4);
        assert_eq!((noise.bias_n(), noise.air_sample_count(), noise.long_run_factor()), (0.0, 0.0, 1.0));
        near(noise.marginal_variance(), 9e-4);
        (0..39).for_each(|_| noise.update_in_air(5.0));
        assert_eq!((noise.bias_n(), noise.air_sample_count()), (0.0, 0.0));
        noise.update_in_air(5.0);
        assert_eq!((noise.bias_n(), noise.air_sample_count()), (5.0, 40.0));
    }

    #[test]
    fn forces_that_go_up_and_down_from_sample_to_sample_have_no_colour() {
        let forces_n: Vec<f64> = (0..40).map(|k| if k % 2 == 0 { 0.1 } else { -0.1 }).collect();
        let noise = in_air(&forces_n);
        assert_eq!(noise.rho, 0.0);
        // Of forty samples with one mean.
        near(noise.variance, 0.01 * 40.0 / 39.0);
    }

    #[test]
    fn an_innovation_moves_strength_and_colour_by_its_share_of_the_memory() {
        // Variance 0.04 N², colour 0.3, from 99 samples; an innovation of 0.5 N, 1.25 times as wide as the noise: its square is five.
        let mut noise = NoiseEstimator::known(0.3, 0.04, 0.0, 99.0);
        noise.last_z = -0.7;
        noise.update_in_tissue(0.5, 1.25);
        near(noise.sample_count, 100.0);
        near(noise.variance, 0.04 * 1.04);
        near(noise.rho, 0.3 - 0.01 * 5.0_f64.sqrt() * 0.7 * 0.91);
        near(noise.last_z, 5.0_f64.sqrt());
        near(noise.long_run_factor(), 1.0 / (1.0 - noise.rho).powi(2));
        near(noise.marginal_variance(), noise.variance / (1.0 - noise.rho * noise.rho));
        noise.update_in_tissue(-0.1, 1.0);
        near(noise.last_z, -0.1 / 0.0416_f64.sqrt());
        // At most sixteen counts of a square, but not while the noise itself is young.
        for (count, counted) in [(49.0, 100.0), (50.0, 16.0), (400.0, 16.0)] {
            let mut noise = NoiseEstimator::known(0.0, 0.04, 0.0, count);
            noise.update_in_tissue(-2.0, 1.0);
            near(noise.variance, 0.04 * (1.0 + (counted - 1.0) / (count + 1.0)));
            near(noise.last_z, -f64::sqrt(counted));
        }
        // The memory is two thousand samples long, and colour neither negative nor above its limit.
        let mut noise = NoiseEstimator::known(0.0, 0.04, 0.0, 2000.0);
        noise.last_z = 1.5;
        noise.update_in_tissue(-0.3, 1.0);
        near(noise.sample_count, 2000.0);
        near(noise.variance, 0.04 * (1.0 + 1.25 / 2000.0));
        assert_eq!(noise.rho, 0.0);
        let mut noise = NoiseEstimator::known(0.9799, 0.04, 0.0, 60.0);
        noise.last_z = 4.0;
        noise.update_in_tissue(0.8, 1.0);
        assert_eq!(noise.rho, 0.98);
    }

    #[test]
    fn colour_that_may_be_chance_is_none() {
        // Two standard errors of none, 2/sqrt(n), are 0.2 for a hundred samples.
        let none = NoiseEstimator::known(0.19, 0.04, 0.0, 100.0);
        assert_eq!(
            (none.rho_over(0.005), none.long_run_factor(), none.marginal_variance()),
            (0.0, 1.0, 0.04)
        );
        for (rho, count) in [(0.21, 100.0), (0.5, 16.0)] {
            let some = NoiseEstimator::known(rho, 0.04, 0.0, count);
            near(some.rho_over(0.005), rho);
            near(some.rho_over(0.015), rho / (rho + 3.0 * (1.0 - rho)));
            near(some.long_run_factor(), 1.0 / ((1.0 - rho) * (1.0 - rho)));
            near(some.marginal_variance(), 0.04 / (1.0 - rho * rho));
            near(some.bias_variance(), 0.04 * some.long_run_factor() / count);
        }
    }

    #[test]
    fn doubt_about_slow_noise_is_by_its_colour_and_the_samples_in_the_air() {
        // 2 (1 + 0.6)/(0.4 n).
        near(NoiseEstimator::known(0.6, 0.04, 0.0, 160.0).interval_inflation(), 1.05);
        near(NoiseEstimator::known(0.6, 0.04, 0.0, 10.0).interval_inflation(), 1.2);
    }

    #[test]
    fn of_a_force_that_does_not_change_no_colour_is_known() {
        let noise = in_air(&[0.25; 40]);
        assert_eq!((noise.rho, noise.rho_over(0.005), noise.long_run_factor()), (0.0, 0.0, 1.0));
    }
}
