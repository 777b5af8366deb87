//! Time per sample: mean over whole insertions, and percentiles of single steps, at 200 Hz.
//!
//! ```sh
//! cargo run --release -p stylet-core --example speed
//! cargo run --release -p stylet-core --example speed -- samples.bin    # the default algorithm over given samples
//! ```
//! `samples.bin`: four little-endian doubles a sample: s, m, m/s, N. Used by `crates/python/speed.py`.
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Instant;
use stylet_core::config::Algorithm;
use stylet_core::{EnhanceConfig, Enhancer, Sample};
use stylet_tissue::{ForceLaw, ForceLawState, Tissue};

/// Seconds per sample: the minimum over many whole insertions.
fn min_time_s(samples: &[Sample], mut one: impl FnMut(&mut Enhancer<Vec<Sample>>) -> f64) -> (f64, f64) {
    let (mut least, mut sum) = (f64::INFINITY, 0.0);
    for _ in 0..100 {
        let mut core = Enhancer::new(EnhanceConfig::default(), 0.0, vec![Sample::default(); 16_384]);
        let start = Instant::now();
        sum += one(&mut core);
        least = least.min(start.elapsed().as_secs_f64() / samples.len() as f64);
    }
    (least, sum)
}

fn time_file(path: &str) -> std::io::Result<()> {
    let bytes = std::fs::read(path)?;
    let numbers: Vec<f64> =
        bytes.chunks_exact(8).filter_map(|b| b.try_into().ok().map(f64::from_le_bytes)).collect();
    let samples: Vec<Sample> = numbers
        .chunks_exact(4)
        .map(|n| Sample { time_s: n[0], position_m: n[1], velocity_mps: n[2], force_n: n[3] })
        .collect();
    let (step, a) = min_time_s(&samples, |core| samples.iter().map(|s| core.step(*s).enhanced_n).sum());
    let (run, b) = min_time_s(&samples, |core| {
        let mut sum = 0.0;
        core.run(&samples, |out| sum += out.enhanced_n);
        sum
    });
    println!("step_ns {:.1} run_ns {:.1} ({a:.0}, {b:.0})", 1e9 * step, 1e9 * run);
    Ok(())
}

fn main() -> std::io::Result<()> {
    if let Some(path) = std::env::args().nth(1) {
        return time_file(&path);
    }
    let law = ForceLaw::base(&Tissue::three_gels());
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut state = ForceLawState::default();
    let samples: Vec<Sample> = (0..10_000)
        .map(|k| {
            let (time_s, velocity_mps) = (0.005 * f64::from(k), 0.0023);
            let position_m = -0.005 + velocity_mps * time_s;
            let w: f64 = StandardNormal.sample(&mut rng);
            let force_n = law.step(&mut state, time_s, position_m, velocity_mps, |_| {}).total_n + 0.02 * w;
            Sample { time_s, position_m, velocity_mps, force_n }
        })
        .collect();
    for algorithm in [Algorithm::Paper, Algorithm::Stylet] {
        let config = EnhanceConfig { algorithm, ..EnhanceConfig::default() };
        let new = || Enhancer::new(config.clone(), 0.0, vec![Sample::default(); 10_000]);
        // Whole insertions exclude the cost of the clock; the minimum excludes other load.
        let mut least = f64::INFINITY;
        let mut sum = 0.0;
        for _ in 0..100 {
            let mut core = new();
            let start = Instant::now();
            for s in &samples {
                sum += core.step_brief(*s).enhanced_n;
            }
            least = least.min(start.elapsed().as_secs_f64() / samples.len() as f64);
        }
        let mut steps: Vec<u128> = Vec::with_capacity(100 * samples.len());
        for _ in 0..100 {
            let mut core = new();
            for s in &samples {
                let start = Instant::now();
                sum += core.step_brief(*s).enhanced_n;
                steps.push(start.elapsed().as_nanos());
            }
        }
        steps.sort_unstable();
        let q = |q: f64| steps[((steps.len() - 1) as f64 * q) as usize];
        println!(
            "{algorithm:?}: {:.0} ns per sample; single steps, clock included: median {} ns, p99 {} ns, p99.9 {} ns ({sum:.0})",
            1e9 * least,
            q(0.5),
            q(0.99),
            q(0.999)
        );
    }
    Ok(())
}
