//! Time per sample of an insertion: base law, noise and online algorithm, each compared with a plain scalar loop
//! that does the same arithmetic, in the same run; and a step of the rapier slide.
//!
//! Run with `cargo bench --bench insertion`. The last lines print ns per sample and the ratios,
//! measured in turns so that a drift of the machine's speed cancels.

mod support {
    pub mod bare;
    pub mod peers;
}

use criterion::{Criterion, Throughput};
use std::hint::black_box;
use std::time::Instant;
use stylet_core::{EnhanceConfig, Enhancer, Sample};
use stylet_testbed::{SensorNoise, Slide};
use stylet_tissue::{ForceLaw, ForceLawState, Tissue};
use support::bare::{BareCore, BareLaw};
use support::peers;

const SAMPLES: usize = 10_000;
const SAMPLE_HZ: f64 = 200.0;
const SPEED_MPS: f64 = 0.0023;
const START_M: f64 = -0.005;

fn motion(k: usize) -> (f64, f64) {
    let t = k as f64 / SAMPLE_HZ;
    (t, START_M + SPEED_MPS * t)
}

fn bare_law() -> f64 {
    let mut law = BareLaw {
        front: [0.0, 0.0282, 0.0659],
        thickness: [0.0282, 0.0377, 0.0322],
        stiffness: black_box([40.0, 60.0, 80.0]),
        friction: black_box([9000.0, 12000.0, 16000.0]),
        puncture: [f64::INFINITY, 2.2, f64::INFINITY],
        ruptured: 0,
    };
    let mut sum = 0.0;
    for k in 0..SAMPLES {
        sum += law.step(motion(k).1, SPEED_MPS);
    }
    sum
}

fn our_law(law: &ForceLaw) -> f64 {
    let mut state = ForceLawState::default();
    let mut sum = 0.0;
    let mut ruptures = 0;
    for k in 0..SAMPLES {
        let (t, z) = motion(k);
        sum += law.step(&mut state, t, z, SPEED_MPS, |_| ruptures += 1).total_n;
    }
    assert_eq!(ruptures, 3);
    sum
}

fn bare_core(samples: &[Sample]) -> f64 {
    let mut core = BareCore::new();
    let mut sum = 0.0;
    let mut ruptures = 0;
    for s in samples {
        let (enhanced, found) = core.step(1.0 / SAMPLE_HZ, s.position_m, s.velocity_mps, s.force_n);
        sum += enhanced;
        ruptures += usize::from(found);
    }
    assert_eq!(ruptures, 3);
    sum
}

fn our_core(samples: &[Sample], storage: &mut [Sample]) -> f64 {
    let mut core = Enhancer::new(EnhanceConfig::paper(), 0.0, storage);
    let mut sum = 0.0;
    let mut ruptures = 0;
    for s in samples {
        let out = core.step(*s);
        sum += out.enhanced_n;
        ruptures = out.ruptures;
    }
    assert_eq!(ruptures, 3);
    sum
}

fn noise() -> f64 {
    let mut noise = SensorNoise::new(1, 1, 0.02, 0.0);
    (0..SAMPLES).map(|_| noise.draw()).sum()
}

fn slide(steps: usize) -> f64 {
    let dt = 1e-3;
    let mut slide = Slide::new(START_M, SPEED_MPS, dt);
    let law = ForceLaw::base(&Tissue::three_gels());
    let mut state = ForceLawState::default();
    let mut sum = 0.0;
    for k in 0..steps {
        let t = k as f64 * dt;
        let (z, v) = slide.tip();
        let f = law.step(&mut state, t, z, v, |_| {}).total_n;
        sum += f;
        slide.step(START_M + SPEED_MPS * (t + dt), SPEED_MPS, f);
    }
    sum
}

fn samples() -> Vec<Sample> {
    let law = ForceLaw::base(&Tissue::three_gels());
    let mut state = ForceLawState::default();
    let mut noise = SensorNoise::new(1, 1, 0.02, 0.0);
    (0..SAMPLES)
        .map(|k| {
            let (time_s, position_m) = motion(k);
            let force = law.step(&mut state, time_s, position_m, SPEED_MPS, |_| {}).total_n;
            Sample { time_s, position_m, velocity_mps: SPEED_MPS, force_n: force + noise.draw() }
        })
        .collect()
}

/// Median ns per sample of both, measured in turns.
fn in_turns(mut ours: impl FnMut() -> f64, mut bare: impl FnMut() -> f64) -> (f64, f64) {
    let time = |f: &mut dyn FnMut() -> f64| {
        let start = Instant::now();
        black_box(f());
        start.elapsed().as_nanos() as f64 / SAMPLES as f64
    };
    let mut pairs: Vec<(f64, f64)> = (0..200).map(|_| (time(&mut ours), time(&mut bare))).collect();
    let mut median = |pick: fn(&(f64, f64)) -> f64| {
        pairs.sort_by(|a, b| pick(a).total_cmp(&pick(b)));
        pick(&pairs[pairs.len() / 2])
    };
    (median(|p| p.0), median(|p| p.1))
}

/// padasip's RLS on the samples of the first layer, compared with the whole online algorithm.
fn python_peer(data: &[Sample], core_ns: f64) {
    let file = std::env::temp_dir().join(format!("stylet-bench-{}.csv", std::process::id()));
    let rows: String = data
        .iter()
        .filter(|s| s.position_m > 0.0)
        .map(|s| format!("{},{},{}\n", s.position_m, s.velocity_mps, s.force_n))
        .collect();
    if std::fs::write(&file, rows).is_ok()
        && let Some(seconds) = peers::number("rls_padasip.py", &[&file])
    {
        let ns = seconds * 1e9;
        println!("padasip RLS alone: {ns:.0} ns per sample, {:.0} times the whole core", ns / core_ns);
    }
    let _ = std::fs::remove_file(&file);
}

fn main() {
    let law = ForceLaw::base(&Tissue::three_gels());
    let data = samples();
    let mut storage = vec![Sample::default(); 16384];

    let mut criterion = Criterion::default().configure_from_args();
    let mut group = criterion.benchmark_group("per_insertion_of_10000_samples");
    group.throughput(Throughput::Elements(SAMPLES as u64));
    group.bench_function("law", |b| b.iter(|| our_law(black_box(&law))));
    group.bench_function("law_bare", |b| b.iter(bare_law));
    group.bench_function("noise", |b| b.iter(noise));
    group.bench_function("core", |b| b.iter(|| our_core(black_box(&data), &mut storage)));
    group.bench_function("core_bare", |b| b.iter(|| bare_core(black_box(&data))));
    group.finish();
    let mut group = criterion.benchmark_group("slide");
    group.throughput(Throughput::Elements(2000));
    group.sample_size(20);
    group.bench_function("rapier_2000_steps", |b| b.iter(|| slide(2000)));
    group.finish();
    criterion.final_summary();

    let (ours, bare) = in_turns(|| our_law(black_box(&law)), bare_law);
    println!("base law: {ours:.1} ns per sample, bare loop {bare:.1} ns, ratio {:.2}", ours / bare);
    let (ours, bare) = in_turns(|| our_core(black_box(&data), &mut storage), || bare_core(black_box(&data)));
    println!("core: {ours:.1} ns per sample, bare loop {bare:.1} ns, ratio {:.2}", ours / bare);
    python_peer(&data, ours);
    let (ours, _) = in_turns(noise, || 0.0);
    println!("noise: {ours:.1} ns per sample");
    let start = Instant::now();
    black_box(slide(50_000));
    println!("rapier slide: {:.2} us per step", start.elapsed().as_secs_f64() / 50_000.0 * 1e6);
}
