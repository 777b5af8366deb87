//! Time of a sweep's trial: ns per sample and the share of law, noise, core and score; one
//! against two threads; the cost per insertion from 100 to 100 000 trials, 10 000 among them; memory; and
//! the pure NumPy version of the same trial for comparison. The load of the machine is printed first.
//!
//! Run with `cargo bench --bench sweep` (NumPy: `bash benches/peers/setup.sh` once before);
//! `STYLET_BENCH_TRIALS` sets the largest sweep (default 100 000). The best of several passes is printed,
//! so that other load on the machine counts little.

mod support {
    pub mod peers;
}

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;
use stylet_core::{Enhancer, Sample};
use stylet_scenario::{MotionPlan, Scenario};
use stylet_score::{EnhancedSample, Scorer, TrueSample};
use stylet_sweep::{Columns, Overrides, Sweep, run_trials_with_threads, trial_simulation};
use stylet_testbed::SensorNoise;
use stylet_tissue::{ForceLaw, ForceLawState};
use support::peers;

fn sweep(trials: u64) -> Sweep {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/sweeps/noise.ron");
    Sweep::load(&file, Overrides { trials: Some(trials), seed: None }).expect("the shipped sweep")
}

/// Fastest of several passes, in seconds.
fn best(passes: usize, mut work: impl FnMut()) -> f64 {
    (0..passes)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

/// The parts of a trial, each alone over the same samples.
struct Parts {
    scenario: Scenario,
    plan: MotionPlan,
    law: ForceLaw,
    count: usize,
    samples: Vec<Sample>,
    tips: Vec<f64>,
}

impl Parts {
    fn new(scenario: Scenario) -> Self {
        let plan = scenario.motion.plan().expect("a motion");
        let law = ForceLaw::new(&scenario.tissue, &scenario.effects).expect("a law");
        let count = (plan.duration_s() * scenario.sample_hz) as usize;
        let mut parts = Self { scenario, plan, law, count, samples: Vec::new(), tips: Vec::new() };
        let mut noise = SensorNoise::new(1, 1, 0.02, 0.0);
        let mut state = ForceLawState::default();
        for k in 0..count {
            let t = k as f64 / parts.scenario.sample_hz;
            let at = parts.plan.at(t);
            let force = parts.law.step(&mut state, t, at.position_m, at.velocity_mps, |_| {});
            parts.tips.push(force.tip_n);
            parts.samples.push(Sample {
                time_s: t,
                position_m: at.position_m,
                velocity_mps: at.velocity_mps,
                force_n: force.total_n + noise.draw(),
            });
        }
        parts
    }

    fn law(&self) -> f64 {
        let moments = (0..self.count).map(|k| {
            let t = k as i64 as f64 / self.scenario.sample_hz;
            let at = self.plan.at(t);
            [t, at.position_m, at.velocity_mps]
        });
        let mut sum = 0.0;
        self.law.run(&mut ForceLawState::default(), moments, |_| {}, |force| sum += force.total_n);
        sum
    }

    fn noise(&self) -> f64 {
        let mut noise = SensorNoise::new(1, 1, 0.02, 0.0);
        (0..self.count).map(|_| noise.draw()).sum()
    }

    fn core(&self, storage: &mut [Sample]) -> Vec<EnhancedSample> {
        let mut core = Enhancer::new(self.scenario.enhance.clone(), 0.0, storage);
        let mut enhanced = Vec::with_capacity(self.count);
        core.run(&self.samples, |out| enhanced.push(out.into()));
        enhanced
    }

    fn score(&self, enhanced: &[EnhancedSample]) {
        let mut scorer = self.scorer();
        for ((s, tip_n), enhanced) in self.samples.iter().zip(&self.tips).zip(enhanced) {
            let sample_truth = TrueSample {
                position_m: s.position_m,
                force_n: s.force_n,
                tip_n: *tip_n,
                total_n: s.force_n,
            };
            scorer.add_sample(&sample_truth, enhanced);
        }
        black_box(scorer.finish());
    }

    fn scorer(&self) -> Scorer {
        Scorer::new(stylet_testbed::true_layers(self.law.slabs()), self.scenario.enhance.model)
    }
}

fn shares(sweep: &Sweep) -> f64 {
    let parts = Parts::new(sweep.template.clone());
    let mut storage = vec![Sample::default(); parts.count];
    let per_sample = |seconds: f64| seconds / parts.count as f64 * 1e9;
    let law = per_sample(best(300, || {
        black_box(parts.law());
    }));
    let noise = per_sample(best(300, || {
        black_box(parts.noise());
    }));
    let core = per_sample(best(300, || {
        black_box(parts.core(&mut storage));
    }));
    let enhanced = parts.core(&mut storage);
    let score = per_sample(best(300, || parts.score(&enhanced)));
    let mut workspace = trial_simulation::Workspace::default();
    let whole =
        per_sample(best(300, || drop(black_box(trial_simulation::run(&parts.scenario, &mut workspace)))));
    println!("one trial of {} samples, each part alone:", parts.count);
    for (name, ns) in [("law and motion", law), ("noise", noise), ("core", core), ("score", score)] {
        println!("  {name:<15} {ns:>6.1} ns per sample, {:>4.0} % of the whole", 100.0 * ns / whole);
    }
    println!("  {:<15} {whole:>6.1} ns per sample", "whole trial");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/three_layer_latex_sinusoidal.ron");
    let swinging = Scenario::load(&file).expect("the shipped scenario");
    let samples = swinging.motion.plan().expect("a motion").duration_s() * swinging.sample_hz;
    let seconds = best(300, || drop(black_box(trial_simulation::run(&swinging, &mut workspace))));
    println!("  {:<15} {:>6.1} ns per sample", "on a sinusoid", seconds / samples * 1e9);
    whole
}

/// Processor time of this process so far, in seconds: what other load on the machine does not count in.
fn cpu_s() -> f64 {
    use nix::sys::resource::{UsageWho, getrusage};
    getrusage(UsageWho::RUSAGE_SELF).map_or(f64::NAN, |usage| {
        let (user, system) = (usage.user_time(), usage.system_time());
        (user.tv_sec() + system.tv_sec()) as f64 + (user.tv_usec() + system.tv_usec()) as f64 * 1e-6
    })
}

/// What `work` gives, and the processor time in s that it took.
fn with_cpu<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let before = cpu_s();
    (work(), cpu_s() - before)
}

fn timed(trials: u64, threads: usize, passes: usize) -> f64 {
    let sweep = sweep(trials);
    let columns = Columns::new(&sweep);
    best(passes, || {
        let rows = run_trials_with_threads(&sweep, &columns, 0..trials, threads, &|_| {}).expect("it runs");
        assert_eq!(rows.len() as u64, trials);
    })
}

fn main() {
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("load of the machine before: {}", load.trim());
    let one = sweep(1);
    let whole_ns = shares(&one);
    let samples = 10_000.0;

    let (single, single_cpu) = with_cpu(|| timed(1000, 1, 5));
    let (double, double_cpu) = with_cpu(|| timed(1000, 2, 5));
    println!(
        "1000 trials: {single:.3} s on one thread, {double:.3} s on two, ratio {:.2}; {:.1} ns per sample and thread",
        single / double,
        single / 1000.0 / samples * 1e9
    );
    // On a machine with other load two threads do not get two cores; what the threads cost each other
    // shows in the processor time all the same.
    println!(
        "  processor time of five passes: {single_cpu:.3} s on one thread, {double_cpu:.3} s on two: \
         with a core for each thread the ratio would be {:.2}",
        2.0 * single_cpu / double_cpu
    );
    let most: u64 = std::env::var("STYLET_BENCH_TRIALS").ok().and_then(|n| n.parse().ok()).unwrap_or(100_000);
    for trials in [100, 1000, 10_000, 100_000_u64].into_iter().filter(|n| *n <= most) {
        let passes = (20_000 / trials).clamp(1, 10) as usize;
        let (seconds, cpu) = with_cpu(|| timed(trials, 2, passes));
        let cpu = cpu / (passes as f64 * trials as f64);
        println!(
            "{trials:>7} trials on 2 threads: {seconds:>7.3} s, {:.1} us per insertion, {:.1} ns per sample; \
             processor time {:.1} us per insertion, {:.1} ns per sample",
            seconds / trials as f64 * 1e6,
            seconds / trials as f64 / samples * 1e9,
            cpu * 1e6,
            cpu / samples * 1e9
        );
    }
    if let Ok(usage) = nix::sys::resource::getrusage(nix::sys::resource::UsageWho::RUSAGE_SELF) {
        println!("memory: at most {:.0} MB", usage.max_rss() as f64 / 1024.0);
    }
    if let Some(seconds) = peers::number("trial_numpy.py", &[]) {
        let ns = seconds / samples * 1e9;
        println!("pure NumPy trial: {ns:.0} ns per sample, {:.0} times ours", ns / whole_ns);
    }
}
