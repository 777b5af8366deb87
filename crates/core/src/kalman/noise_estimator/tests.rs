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

fn estimated(forces_n: &[f64]) -> NoiseEstimator {
    let mut noise = NoiseEstimator::new(1e-4);
    forces_n.iter().for_each(|f| noise.update_in_air(*f));
    noise
}

#[test]
fn bias_correlation_and_variance_are_estimated_in_air() {
    for (rho, sigma_n) in [(0.0, 0.02), (0.5, 0.02), (0.9, 0.005)] {
        let noise = estimated(&forces(1, 20_000, 0.7, rho, sigma_n));
        assert!((noise.rho - rho).abs() < 0.03, "{noise:?}");
        assert!((noise.variance.sqrt() / sigma_n - 1.0).abs() < 0.03, "{noise:?}");
        let marginal = sigma_n * sigma_n / (1.0 - rho * rho);
        assert!((noise.marginal_variance() / marginal - 1.0).abs() < 0.15, "{noise:?}");
        assert!((noise.long_run_factor() * (1.0 - rho) * (1.0 - rho) - 1.0).abs() < 0.4, "{noise:?}");
        // Standard error of the mean of autocorrelated noise.
        let sd = noise.bias_variance().sqrt();
        assert!((noise.bias_n() - 0.7).abs() < 4.0 * sd, "{noise:?}");
        let known = sigma_n / (1.0 - rho) / noise.air_sample_count().sqrt();
        assert!((sd / known - 1.0).abs() < 0.25, "{sd} {known}");
    }
}

#[test]
fn white_noise_has_no_correlation_and_few_samples_are_unbiased() {
    // Averaged over many seeds, the variance is unbiased.
    let (mut sum, mut correlated) = (0.0, 0);
    for seed in 0..400 {
        let noise = estimated(&forces(seed, 40, -0.3, 0.0, 0.01));
        assert_eq!(noise.air_sample_count(), 40.0);
        sum += noise.variance / 1e-4;
        correlated += usize::from(noise.rho_over(0.005) != 0.0);
    }
    assert!((sum / 400.0 - 1.0).abs() < 0.06, "{}", sum / 400.0);
    assert!(correlated < 40, "{correlated} of 400 have a correlation at two standard errors");
}

#[test]
fn a_load_counts_as_noise_only_after_twice_as_many_samples() {
    let mut forces_n = forces(2, 400, 0.0, 0.0, 0.01);
    let before = estimated(&forces_n);
    let counted = before.air_sample_count();
    assert!((100.0..=200.0).contains(&counted), "{counted}");
    forces_n.extend(forces(3, 100, 0.2, 0.0, 0.01));
    let after = estimated(&forces_n);
    assert!(after.bias_n().abs() < 0.005, "a load on a quarter more samples keeps the bias: {after:?}");
    assert!(after.variance.sqrt() < 0.013, "and the variance: {after:?}");
}

#[test]
fn the_noise_variance_has_a_lower_bound() {
    let mut noise = estimated(&[0.25; 500]);
    assert_eq!((noise.variance.sqrt(), noise.bias_n()), (1e-4, 0.25));
    for _ in 0..5000 {
        noise.update_in_tissue(0.0, 1.0);
    }
    assert!((noise.variance.sqrt() - 1e-4).abs() < 1e-12);
}

#[test]
fn in_tissue_the_noise_variance_is_tracked() {
    let mut noise = estimated(&forces(4, 2000, 0.0, 0.0, 0.01));
    // Innovations for twice the standard deviation, with s = 1.5.
    for e in forces(5, 12_000, 0.0, 0.0, 0.02 * 1.5_f64.sqrt()) {
        noise.update_in_tissue(e, 1.5);
    }
    assert!((noise.variance.sqrt() / 0.02 - 1.0).abs() < 0.05, "{noise:?}");
    assert!(noise.rho < 0.08, "{noise:?}");
    // A single outlier is clipped.
    let before = noise.variance;
    noise.update_in_tissue(5.0, 1.0);
    assert!(noise.variance < 1.01 * before, "{before} to {}", noise.variance);
}

#[test]
fn in_tissue_the_correlation_is_tracked() {
    for (from, to) in [(0.0, 0.6), (0.8, 0.3)] {
        let mut noise = estimated(&forces(8, 2000, 0.0, from, 0.01));
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
fn correlation_decreases_with_the_interval() {
    let mut noise = estimated(&forces(6, 20_000, 0.0, 0.8, 0.01));
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
fn the_usual_interval_is_tracked_and_a_gap_is_clipped() {
    let mut noise = NoiseEstimator::new(1e-4);
    noise.update_interval(0.005);
    assert_eq!(noise.interval_s, 0.005);
    noise.update_interval(10.0);
    assert!((noise.interval_s - 0.0051).abs() < 1e-12, "clipped at twice the interval: {}", noise.interval_s);
    noise.update_interval(1e-9);
    assert!(
        (noise.interval_s - (0.0051 - 0.02 * 0.00255)).abs() < 1e-12,
        "clipped at half the interval: {}",
        noise.interval_s
    );
    for _ in 0..1000 {
        noise.update_interval(0.002);
    }
    assert!((noise.interval_s - 0.002).abs() < 1e-6, "{}", noise.interval_s);
}

impl NoiseEstimator {
    /// An estimate from `count` samples in air at 200 Hz.
    pub(crate) fn known(rho: f64, variance: f64, bias_n: f64, count: f64) -> Self {
        let mut noise = Self::new(1e-9);
        (noise.rho, noise.variance, noise.bias_n, noise.sample_count) = (rho, variance, bias_n, count);
        (noise.sums[3], noise.interval_s) = (count, 0.005);
        noise.update_derived();
        noise
    }
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-11 * expected.abs(), "{found} for {expected}");
}

/// Correlation, innovation variance and mean from the moments of a batch.
fn by_moments(forces_n: &[f64], min_variance: f64) -> (f64, f64, f64) {
    let n = forces_n.len() as f64;
    let f: Vec<f64> = forces_n.iter().map(|x| x - forces_n[0]).collect();
    let mean = f.iter().sum::<f64>() / n;
    let variance = f.iter().map(|x| x * x).sum::<f64>() / n - mean * mean;
    let covariance = f.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n - mean * mean;
    let raw = covariance / variance;
    let rho = (raw + (1.0 + 4.0 * raw.max(0.0)) / n).clamp(0.0, 0.98);
    let rho = if rho * rho * n < 4.0 { 0.0 } else { rho };
    let unbiased = variance * n / (n - (1.0 + rho) / (1.0 - rho)).max(0.5 * n);
    (rho, (unbiased * (1.0 - rho * rho)).max(min_variance), forces_n[0] + mean)
}

#[test]
fn in_air_the_first_forty_samples_count_and_then_a_half_to_a_quarter() {
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
fn the_noise_in_air_follows_from_sample_moments() {
    for (seed, rho, sigma_n) in [(1, 0.0, 0.02), (2, 0.5, 0.02), (3, 0.9, 0.005), (4, 0.995, 0.003)] {
        let forces_n = forces(seed, 1279, 0.7, rho, sigma_n);
        for (count, counted) in [(40, 40), (159, 40), (160, 80), (320, 160), (1279, 320)] {
            let noise = estimated(&forces_n[..count]);
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
fn before_the_first_estimate_the_bias_is_zero() {
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
fn negative_correlation_counts_as_zero() {
    let forces_n: Vec<f64> = (0..40).map(|k| if k % 2 == 0 { 0.1 } else { -0.1 }).collect();
    let noise = estimated(&forces_n);
    assert_eq!(noise.rho, 0.0);
    // Unbiased variance of forty samples.
    near(noise.variance, 0.01 * 40.0 / 39.0);
}

#[test]
fn an_innovation_updates_variance_and_correlation_by_its_gain() {
    // Variance 0.04 N², correlation 0.3, 99 samples; an innovation of 0.5 N with s = 1.25: z² = 5.
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
    // Squares are clipped at sixteen, but not with few samples.
    for (count, counted) in [(49.0, 100.0), (50.0, 16.0), (400.0, 16.0)] {
        let mut noise = NoiseEstimator::known(0.0, 0.04, 0.0, count);
        noise.update_in_tissue(-2.0, 1.0);
        near(noise.variance, 0.04 * (1.0 + (counted - 1.0) / (count + 1.0)));
        near(noise.last_z, -f64::sqrt(counted));
    }
    // The memory is 2000 samples; the correlation stays between zero and its limit.
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
fn an_insignificant_correlation_counts_as_zero() {
    // Two standard errors, 2/sqrt(n), are 0.2 for a hundred samples.
    let none = NoiseEstimator::known(0.19, 0.04, 0.0, 100.0);
    assert_eq!((none.rho_over(0.005), none.long_run_factor(), none.marginal_variance()), (0.0, 1.0, 0.04));
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
fn interval_inflation_follows_from_correlation_and_air_samples() {
    // 2 (1 + 0.6)/(0.4 n).
    near(NoiseEstimator::known(0.6, 0.04, 0.0, 160.0).interval_inflation(), 1.05);
    near(NoiseEstimator::known(0.6, 0.04, 0.0, 10.0).interval_inflation(), 1.2);
}

#[test]
fn a_constant_force_has_no_correlation() {
    let noise = estimated(&[0.25; 40]);
    assert_eq!((noise.rho, noise.rho_over(0.005), noise.long_run_factor()), (0.0, 0.0, 1.0));
}
