//! Insertions for the tests: the tissue law on an ideal motion with white noise.
#![allow(dead_code)]

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use stylet_core::config::Algorithm;
use stylet_core::{EnhanceConfig, Enhancer, LayerEstimate, Output, Sample};
use stylet_tissue::{ForceLaw, ForceLawState, Rupture, Tissue, TissueForce};

/// Samples of an insertion with true forces and ruptures.
pub struct Insertion {
    pub samples: Vec<Sample>,
    pub truth: Vec<TissueForce>,
    pub ruptures: Vec<Rupture>,
}

/// Runs the base law over a velocity profile, integrated at `sample_hz` from `start_m`.
pub fn insertion(
    tissue: &Tissue,
    start_m: f64,
    duration_s: f64,
    sample_hz: f64,
    noise_n: f64,
    seed: u64,
    velocity_mps: impl Fn(f64) -> f64,
) -> Insertion {
    insertion_into(&ForceLaw::base(tissue), start_m, duration_s, sample_hz, noise_n, seed, velocity_mps)
}

/// As [`insertion`] for any law.
pub fn insertion_into(
    law: &ForceLaw,
    start_m: f64,
    duration_s: f64,
    sample_hz: f64,
    noise_n: f64,
    seed: u64,
    velocity_mps: impl Fn(f64) -> f64,
) -> Insertion {
    let mut state = ForceLawState::default();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut out = Insertion { samples: Vec::new(), truth: Vec::new(), ruptures: Vec::new() };
    let mut z = start_m;
    let dt = 1.0 / sample_hz;
    for k in 0..(duration_s * sample_hz) as usize {
        let t = k as f64 * dt;
        let v = velocity_mps(t);
        let force = law.step(&mut state, t, z, v, |r| out.ruptures.push(r));
        let w: f64 = StandardNormal.sample(&mut rng);
        out.samples.push(Sample {
            time_s: t,
            position_m: z,
            velocity_mps: v,
            force_n: force.total_n + noise_n * w,
        });
        out.truth.push(force);
        z += 0.5 * (v + velocity_mps(t + dt)) * dt;
    }
    out
}

/// The latex phantom at the paper's constant 2.3 mm/s.
pub fn constant(noise_n: f64, seed: u64) -> Insertion {
    insertion(&Tissue::three_gels(), -0.005, 50.0, 200.0, noise_n, seed, |_| 0.0023)
}

/// Spreads the drop at each rupture linearly over `drop_s`.
pub fn lasting(mut data: Insertion, drop_s: f64) -> Insertion {
    for rupture in &data.ruptures {
        for (sample, truth) in data.samples.iter_mut().zip(&mut data.truth) {
            let since_s = sample.time_s - rupture.time_s;
            if (0.0..drop_s).contains(&since_s) {
                let left_n = rupture.released_n * (1.0 - since_s / drop_s);
                sample.force_n += left_n;
                truth.total_n += left_n;
                truth.tip_n += left_n;
            }
        }
    }
    data
}

/// The latex phantom with the paper's sinusoid from rest.
pub fn sinusoid(noise_n: f64, seed: u64) -> Insertion {
    let omega = std::f64::consts::TAU * 0.0167;
    insertion(&Tissue::three_gels(), -0.005, 15.0, 200.0, noise_n, seed, move |t| {
        0.12 * omega * (omega * t).sin()
    })
}

/// Runs the core over samples.
pub fn enhance(config: &EnhanceConfig, samples: &[Sample]) -> Vec<Output> {
    let mut core = Enhancer::new(config.clone(), 0.0, vec![Sample::default(); 16384]);
    samples.iter().map(|s| core.step(*s)).collect()
}

/// Times of the detections.
pub fn detections(outputs: &[Output]) -> Vec<f64> {
    outputs.iter().filter_map(|o| o.detection).map(|d| d.time_s).collect()
}

/// The default configuration of `Stylet`.
pub fn stylet() -> EnhanceConfig {
    EnhanceConfig { algorithm: Algorithm::Stylet, ..EnhanceConfig::default() }
}

/// The paper's three layers without latex.
pub fn gels() -> Tissue {
    let mut tissue = Tissue::three_gels();
    for layer in &mut tissue.layers {
        layer.puncture_n = None;
    }
    tissue
}

/// The last estimate of each layer.
pub fn last_estimates(outputs: &[Output]) -> Vec<LayerEstimate> {
    let mut all: Vec<LayerEstimate> = Vec::new();
    for e in outputs.iter().filter_map(|o| o.estimate) {
        all.retain(|x| x.layer != e.layer);
        all.push(e);
    }
    all
}
