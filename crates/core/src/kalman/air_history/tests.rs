use super::*;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Two seconds and more of air at 2 mm/s and 200 Hz with autoregressive noise of 20 mN, and what is added to it over the count.
fn history(seed: u64, count: u32, rho: f64, added: impl Fn(f64) -> f64) -> AirHistory {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut history, mut noise) = (AirHistory::new(1e-8), 0.0);
    for k in 0..count + 100 {
        let w: f64 = StandardNormal.sample(&mut rng);
        noise = rho * noise + 0.02 * (1.0_f64 - rho * rho).sqrt() * w;
        if let Some(k) = k.checked_sub(100).map(f64::from) {
            let sample = Sample {
                time_s: 0.005 * k,
                position_m: 1e-5 * k,
                velocity_mps: 0.002,
                force_n: 0.7 + noise + added(k),
            };
            history.push(&sample);
        }
    }
    history
}

#[test]
fn the_noise_follows_from_differences_whatever_the_baseline_does() {
    let shapes: [fn(f64) -> f64; 3] = [|_| 0.0, |k| 2e-4 * k, |k| if k < 700.0 { 0.0 } else { -4.0 }];
    for rho in [0.0, 0.5, 0.9] {
        for (n, shape) in shapes.into_iter().enumerate() {
            let found = history(1, 4000, rho, shape);
            assert!((found.rho() - rho).abs() < 0.05, "{} for {rho} with {n}", found.rho());
            let sd = found.noise_variance().sqrt();
            assert!((sd / 0.02 - 1.0).abs() < 0.2, "{sd} for {rho} with {n}");
        }
    }
}
