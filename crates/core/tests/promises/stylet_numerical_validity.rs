//! Promise of `algorithm: Stylet`: for any log its outputs stay finite, its covariances positive definite and its work bounded, and
//! it does not allocate.

use crate::support::{constant, stylet};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use stylet_core::config::Algorithm;
use stylet_core::{EnhanceConfig, Enhancer, Sample};

fn core() -> Enhancer<[Sample; 0]> {
    let config = stylet();
    Enhancer::new(config, 0.0, [])
}

/// A corrupted insertion: NaN, infinities, jumps of position, stalls, reversals, jitter of 30 %, repeated and backward time stamps,
/// 10 N spikes, forces from 1 mN to 1 kN.
fn corrupted(seed: u64, samples: usize, mut each: impl FnMut(Sample)) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let scale = [1e-3, 1.0, 1.0, 1.0, 1e3][(seed % 5) as usize];
    let noise = [0.0, 0.01, 0.1][(seed % 3) as usize];
    let (mut t, mut z, mut v, mut stiffness) = (0.0, -0.005, 0.002, 60.0);
    for k in 0..samples {
        let dt = 0.005 * (0.7 + 0.6 * rng.random::<f64>());
        t += dt;
        match rng.random_range(0..4000) {
            0..4 => v = 0.0,
            4..8 => v = 0.012 * rng.random::<f64>() - 0.004,
            8 => z += 0.02 * (rng.random::<f64>() - 0.5),
            9..16 => v = 0.002,
            16..18 => stiffness = 100.0 * rng.random::<f64>(),
            _ => {}
        }
        z += v * dt;
        if z > 0.12 {
            v = -0.004;
        } else if z < -0.01 {
            v = 0.003;
        }
        let elastic = stiffness * (z.max(0.0) % 0.03);
        let mut sample = Sample {
            time_s: t,
            position_m: z,
            velocity_mps: v,
            force_n: scale * (elastic + 300.0 * v * z.max(0.0) + noise * (rng.random::<f64>() - 0.5)),
        };
        match rng.random_range(0..700) {
            0 => sample.force_n = f64::NAN,
            1 => sample.force_n = f64::INFINITY,
            2 => sample.position_m = f64::NAN,
            3 => sample.velocity_mps = f64::NEG_INFINITY,
            4 => sample.time_s = f64::NAN,
            5 => sample.time_s -= 0.02,
            6 => sample.time_s -= dt,
            7 => sample.force_n += 10.0,
            8 => sample.force_n -= 10.0,
            9 => t += 0.5,
            10 if k % 7 == 0 => sample.velocity_mps = 900.0,
            11 if k % 7 == 0 => sample.force_n = 9e5,
            _ => {}
        }
        each(sample);
    }
}

/// Number of corrupted insertions of 12 000 samples; `STYLET_CORRUPTED=8400` makes 10^8 samples.
fn insertion_count(usual: u64) -> u64 {
    std::env::var("STYLET_CORRUPTED").ok().and_then(|n| n.parse().ok()).unwrap_or(usual)
}

#[test]
fn the_papers_algorithm_continues_after_corrupted_samples() {
    for seed in 0..insertion_count(30) {
        let config = EnhanceConfig { algorithm: Algorithm::Paper, ..EnhanceConfig::default() };
        let mut core = Enhancer::new(config, 0.0, vec![Sample::default(); 4096]);
        let mut used = 0;
        corrupted(seed, 12_000, |sample| {
            let out = core.step(sample);
            let numbers = [out.enhanced_n, out.reconstructed_n, out.error_n, out.theta[0], out.theta[1]];
            assert!(numbers.iter().all(|x| x.is_finite()), "seed {seed} at {sample:?}: {out:?}");
            used += usize::from(out.used);
        });
        assert!(used > 10_000, "seed {seed}: {used} samples used");
    }
}

#[test]
fn corrupted_logs_leave_the_state_valid() {
    // A regression: a slope of 10^8 N/m with a noise of 0.1 mN.
    for seed in (0..insertion_count(60)).chain([4374]) {
        let mut core = core();
        let (mut used, mut bounded, mut last) = (0, 0, None);
        corrupted(seed, 12_000, |sample| {
            let out = core.step(sample);
            assert!(
                core.is_numerically_valid(),
                "seed {seed} at {sample:?}, before it {last:?}: {}",
                core.debug_state()
            );
            last = Some(sample);
            let numbers = [
                out.enhanced_n,
                out.reconstructed_n,
                out.error_n,
                out.theta[0],
                out.theta[1],
                out.cumulative_friction_ns_per_m,
            ];
            assert!(numbers.iter().all(|x| x.is_finite()), "seed {seed}: {out:?}");
            if let Some([low, high]) = out.band_n {
                assert!(low <= high && low.is_finite() && high.is_finite(), "seed {seed}: {out:?}");
                bounded += 1;
            }
            if let Some(e) = out.estimate {
                assert!(e.drop_n > 0.0 && e.drop_n.is_finite() && e.stiffness_sd.is_finite(), "{e:?}");
            }
            used += usize::from(out.used);
        });
        assert!(used > 10_000 && bounded > 1000, "seed {seed}: {used} samples used, {bounded} with a band");
    }
}

#[test]
fn no_step_needs_more_than_ten_times_the_median_operations() {
    let mut all = Vec::new();
    for seed in 0..10 {
        let mut core = core();
        corrupted(seed, 12_000, |sample| {
            core.step(sample);
            all.push(core.operation_count());
        });
    }
    for sample in constant(0.02, 1).samples {
        let mut core = core();
        core.step(sample);
    }
    all.sort_unstable();
    let (median, most) = (all[all.len() / 2], all[all.len() - 1]);
    println!("operations per step: median {median}, maximum {most}");
    assert!(median > 100 && most <= 10 * median, "median {median}, most {most}");
}

#[test]
fn ten_million_steps_allocate_nothing() {
    let samples = constant(0.02, 3).samples;
    let steps = if cfg!(debug_assertions) { 1_000_000 } else { 10_000_000 };
    let info = allocation_counter::measure(|| {
        let mut core = core();
        let length = samples.len();
        let mut ruptures = 0;
        for k in 0..steps {
            if k % length == 0 {
                core = self::core();
            }
            let out = core.step(samples[k % length]);
            ruptures += usize::from(out.detection.is_some());
        }
        assert!(ruptures >= 3 * (steps / length), "{ruptures} ruptures");
    });
    assert_eq!(info.count_total, 0, "{info:?}");
}

#[test]
fn a_sample_picoseconds_after_the_last_is_ignored() {
    // A regression: 20 ps and 15 um after the last sample.
    let (mut undisturbed, mut disturbed) = (core(), core());
    for sample in constant(0.02, 3).samples {
        let (left, right) = (undisturbed.step(sample), disturbed.step(sample));
        assert_eq!(left.enhanced_n.to_bits(), right.enhanced_n.to_bits(), "at {} s", sample.time_s);
        let again = Sample { time_s: sample.time_s + 2e-11, position_m: sample.position_m - 15e-6, ..sample };
        assert!(!disturbed.step(again).used);
        assert!(disturbed.is_numerically_valid());
    }
}
