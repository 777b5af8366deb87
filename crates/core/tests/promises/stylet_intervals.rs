//! What `algorithm: Stylet` promises of its intervals where a drop lasts or the noise is slow: they hold what is true as often as they say.

use crate::support::{Insertion, enhance, gels, insertion, last_estimates, lasting, stylet};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Of how many numbers (stiffness, friction and the friction behind, of three layers) the interval holds the truth, and the worst error in
/// standard deviations.
fn held(insertions: impl Iterator<Item = Insertion>) -> (u32, u32, f64) {
    let (mut inside, mut of, mut worst) = (0, 0, 0.0);
    for data in insertions {
        let layers = last_estimates(&enhance(&stylet(), &data.samples));
        assert_eq!(layers.len(), 3);
        let mut behind = 0.0;
        for (e, layer) in layers.iter().zip(&gels().layers) {
            behind += layer.friction_ns_per_m2 * layer.thickness_m;
            for (off, sd) in [
                (e.stiffness_n_per_m - layer.stiffness_n_per_m, e.stiffness_sd),
                (e.friction - layer.friction_ns_per_m2, e.friction_sd),
                (e.cumulative_ns_per_m - behind, e.cumulative_sd),
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
fn a_drop_that_lasts_is_dated_where_it_began() {
    // What is told of the layers hangs on where each began: a tenth of a millimetre is an N s/m of friction.
    for drop_s in [0.3, 0.9] {
        let (inside, of, worst) =
            held((0..30).map(|seed| {
                lasting(insertion(&gels(), -0.005, 50.0, 200.0, 0.02, seed, |_| 0.0023), drop_s)
            }));
        assert!(inside * 100 >= of * 92, "{drop_s} s: {inside} of {of}");
        assert!(worst < 6.0, "{drop_s} s: {worst} standard deviations");
    }
}

#[test]
fn the_first_sample_behind_a_drop_says_no_more_than_slow_noise_lets_it() {
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
    let (inside, of, worst) = held((0..60).map(slow));
    assert!(inside * 100 >= of * 93, "{inside} of {of}");
    assert!(worst < 6.0, "{worst} standard deviations");
}
