//! Promise of `algorithm: Stylet` for its 95 % intervals with long drops or autocorrelated noise: they have their coverage.

use crate::support::{Insertion, enhance, gels, insertion, last_estimates, lasting, stylet};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Number of true values inside their intervals (stiffness, friction and cumulative friction of three layers), total, and the worst
/// error in standard deviations.
fn coverage(insertions: impl Iterator<Item = Insertion>) -> (u32, u32, f64) {
    let (mut inside, mut of, mut worst) = (0, 0, 0.0);
    for data in insertions {
        let layers = last_estimates(&enhance(&stylet(), &data.samples));
        assert_eq!(layers.len(), 3);
        let mut cumulative = 0.0;
        for (e, layer) in layers.iter().zip(&gels().layers) {
            cumulative += layer.friction_ns_per_m2 * layer.thickness_m;
            for (off, sd) in [
                (e.stiffness_n_per_m - layer.stiffness_n_per_m, e.stiffness_sd),
                (e.friction - layer.friction_ns_per_m2, e.friction_sd),
                (e.cumulative_ns_per_m - cumulative, e.cumulative_sd),
            ] {
                inside += u32::from(off.abs() <= 1.96 * sd);
                of += 1;
                worst = f64::max(worst, off.abs() / sd);
            }
        }
    }
    (inside, of, worst)
}

#[test]
fn a_long_drop_is_located_at_its_onset() {
    // An error of 0.1 mm in a layer's start is 1 N s/m of friction.
    for drop_s in [0.3, 0.9] {
        let (inside, of, worst) =
            coverage((0..30).map(|seed| {
                lasting(insertion(&gels(), -0.005, 50.0, 200.0, 0.02, seed, |_| 0.0023), drop_s)
            }));
        assert!(inside * 100 >= of * 92, "{drop_s} s: {inside} of {of}");
        assert!(worst < 6.0, "{drop_s} s: {worst} standard deviations");
    }
}

#[test]
fn the_first_sample_after_a_drop_is_weighted_by_the_slow_noise() {
    let slow = |seed: u64| {
        let mut data = insertion(&gels(), -0.005, 50.0, 200.0, 0.0, seed, |_| 0.0023);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut noise_n = 0.0;
        for sample in &mut data.samples {
            let w: f64 = StandardNormal.sample(&mut rng);
            noise_n = 0.9 * noise_n + 0.05 * (1.0_f64 - 0.81).sqrt() * w;
            sample.force_n += noise_n;
        }
        data
    };
    let (inside, of, worst) = coverage((0..60).map(slow));
    assert!(inside * 100 >= of * 93, "{inside} of {of}");
    assert!(worst < 6.0, "{worst} standard deviations");
}
