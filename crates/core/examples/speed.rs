//! What a sample costs: mean, median and percentiles of a tick, each timed alone over insertions at 200 Hz.
//!
//! ```sh
//! cargo run --release -p stylet-core --example speed
//! ```
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Instant;
use stylet_core::config::Algorithm;
use stylet_core::{EnhanceConfig, Enhancer, Sample};
use stylet_tissue::{Law, LawState, Tissue};

fn main() {
    let law = Law::base(&Tissue::three_gels());
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut state = LawState::default();
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
        // Whole insertions: the mean without the clock's own cost. The least of many is what the others do not disturb.
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
        let mut ticks: Vec<u128> = Vec::with_capacity(100 * samples.len());
        for _ in 0..100 {
            let mut core = new();
            for s in &samples {
                let start = Instant::now();
                sum += core.step_brief(*s).enhanced_n;
                ticks.push(start.elapsed().as_nanos());
            }
        }
        ticks.sort_unstable();
        let q = |q: f64| ticks[((ticks.len() - 1) as f64 * q) as usize];
        println!(
            "{algorithm:?}: {:.0} ns per sample; a tick alone, clock included: median {} ns, p99 {} ns, p99.9 {} ns ({sum:.0})",
            1e9 * least,
            q(0.5),
            q(0.99),
            q(0.999)
        );
    }
}
