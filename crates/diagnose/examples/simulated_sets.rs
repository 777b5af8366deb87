//! Simulated sets with other parameters than the phantoms, and with another model.
//!
//! ```sh
//! cargo run --release -p stylet-diagnose --example simulated_sets -- 12 1
//! ```
//!
//! Arguments are the number of sets, the seed, and optionally the index of a single set. Even sets follow
//! the stick-slip model with parameters up to a factor of 2.5 from those of the phantoms; odd ones the
//! independent simulator (bristle friction, foundation springs, damage, tearing in steps). Five to fifteen
//! recordings at one to three speeds, each speed on a day of its own; one or two layers; strokes, holds and
//! noise differ between sets. Prints the held-out error over the repeatability floor, with and without the
//! empirical discrepancy.

mod assumed_tissue;

use assumed_tissue::assumed_tissue;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};
use std::error::Error;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::diagnose_set::diagnose_set;
use stylet_diagnose::repeated_insertions::instrument_faults::ReferenceRecordings;
use stylet_examine::simulator::force_sensor::SensorModel;
use stylet_examine::simulator::insertion::simulate_insertion;
use stylet_examine::simulator::motion_path::{MotionPath, MotionPiece};
use stylet_examine::simulator::rich_world::{Bristles, Damage, Foundation, RichEffects, RichWorld, Tearing};
use stylet_examine::simulator::tissue as real;
use stylet_record::Recording;
use stylet_tissue::{AnyEffect, DelayedPuncture, ForceLaw, ForceLawState, ReleaseDepth, ShaftSlip};

/// Largest factor between a parameter and that of the phantoms.
const FACTOR: f64 = 2.5;
/// Sampling rate in Hz.
const SAMPLE_HZ: f64 = 50.0;
/// Largest step of the independent simulator (s).
const STEP_S: f64 = 1e-3;
/// Standard deviations between recordings: surface (m), friction, strength.
const RUN: [f64; 3] = [2e-4, 0.04, 0.05];
/// Standard deviations between days: surface (m), friction.
const DAY: [f64; 2] = [3e-4, 0.03];
/// Correlated noise: share of the largest force, correlation time (s).
const SLOW: (f64, f64) = (0.03, 0.5);
/// Sensor noise (N).
const NOISE_N: f64 = 0.012;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let sets: u64 = words.next().map_or(Ok(12), |w| w.parse())?;
    let seed: u64 = words.next().map_or(Ok(1), |w| w.parse())?;
    let only: Option<u64> = words.next().map(|w| w.parse()).transpose()?;
    let (mut model_ratios, mut corrected_ratios) = (Vec::new(), Vec::new());
    for k in (0..sets).filter(|k| only.is_none_or(|only| *k == only)) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed * 1000 + k);
        let (layers, recordings) = set(k % 2 == 1, &mut rng)?;
        let refs: Vec<&SegmentedRecording> = recordings.iter().collect();
        let what = format!(
            "{k}: {}, {layers} layer(s), {} recordings at {:?} mm/s",
            if k % 2 == 1 { "independent simulator" } else { "stick-slip" },
            recordings.len(),
            stylet_diagnose::repeated_insertions::segmented_recording::mean_speeds(&refs)
                .iter()
                .map(|s| (1e5 * s.0).round() / 100.0)
                .collect::<Vec<_>>()
        );
        let Some(s) = diagnose_set(
            "other",
            &assumed_tissue(layers),
            None,
            &refs,
            &ReferenceRecordings::default(),
            &mut |_| {},
        ) else {
            println!("{what}: no model");
            continue;
        };
        let m = &s.report.mean;
        let floor_n = m.floor_n.unwrap_or(f64::NAN);
        model_ratios.push(m.model_n / floor_n);
        corrected_ratios.push(m.with_discrepancy_n / floor_n);
        let names: Vec<&str> = s.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
        println!(
            "{what}: floor {floor_n:.3} N, model {:.2} of it, with the empirical discrepancy {:.2}, coverage {:.0} %; speed held out {:.3} N, coverage {:.0} %; {:?} {}",
            m.model_n / floor_n,
            m.with_discrepancy_n / floor_n,
            100.0 * m.coverage,
            m.held_out_speed_n.unwrap_or(f64::NAN),
            100.0 * m.held_out_speed_coverage.unwrap_or(f64::NAN),
            s.diagnosis.verdict,
            names.join(", ")
        );
    }
    for (name, of) in [("model", &model_ratios), ("with the empirical discrepancy", &corrected_ratios)] {
        let worst = of.iter().copied().fold(f64::NAN, f64::max);
        println!(
            "{name}: {:.2} of the floor in the median, {worst:.2} in the worst of {} sets",
            stylet_stats::median_of(of.iter().copied()),
            of.len()
        );
    }
    Ok(())
}

/// A motion.
#[derive(Clone, Copy)]
struct Motion {
    stroke_m: f64,
    speed_mps: f64,
    rest_s: f64,
}

/// Random effects of a recording: surface (m), logarithm of friction, strength.
type Differs = [f64; 3];

/// Number of layers and recordings of a set.
fn set(rich: bool, rng: &mut ChaCha8Rng) -> Result<(usize, Vec<SegmentedRecording>), Box<dyn Error>> {
    let layers = 1 + usize::from(rng.random::<f64>() < 0.4);
    let speeds = 1 + (rng.random::<f64>() * 3.0) as usize;
    let each = (5 + (rng.random::<f64>() * 11.0) as usize).max(3 * speeds) / speeds;
    let slowest = 1e-3 * times(rng, 2.0);
    let (stroke_m, rest_s) = (0.02 + 0.015 * rng.random::<f64>(), 2.0 + 6.0 * rng.random::<f64>());
    let stick_slip: Vec<Vec<AnyEffect>> = (1..=layers).map(|l| stick_slip_effects(l, rng)).collect();
    let with = ingredients(rng);
    let strength_n = [2.0 * times(rng, FACTOR), 2.0 * times(rng, FACTOR)];
    let thick_m = 0.011 * (0.8 + 0.4 * rng.random::<f64>());
    let mut recordings = Vec::new();
    for speed in 0..speeds {
        let motion = Motion { stroke_m, speed_mps: slowest * (1.0 + speed as f64), rest_s };
        let [day_m, day] = DAY.map(|sd| sd * normal(rng));
        for k in 0..each {
            let [mut surface_m, mut friction, tough] = RUN.map(|sd| sd * normal(rng));
            (surface_m, friction) = (surface_m + day_m, friction + day);
            let differs = [surface_m, friction, tough];
            let (time_s, position_m, mut force_n) = if rich {
                rich_run(layers, thick_m, strength_n, &with, motion, differs)
            } else {
                slip_run(&stick_slip, thick_m, motion, differs)?
            };
            add_noise(&time_s, &mut force_n, rng);
            let recording = Recording::new(time_s, position_m, force_n)?;
            recordings.push(SegmentedRecording::new(format!("{speed} {k}"), recording, layers));
        }
    }
    Ok((layers, recordings))
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A random factor between `1 / most` and `most`.
fn times(rng: &mut ChaCha8Rng, most: f64) -> f64 {
    most.powf(2.0 * rng.random::<f64>() - 1.0)
}

/// Stick-slip effects of a layer.
fn stick_slip_effects(layer: usize, rng: &mut ChaCha8Rng) -> Vec<AnyEffect> {
    let mut by = |x: f64| x * times(rng, FACTOR);
    let slip = ShaftSlip {
        layer,
        push_n: by(2.0),
        pull_n: by(1.2),
        exponent: by(9.0).clamp(4.0, 16.0),
        wear_per_m: by(30.0),
        curvature_n_per_m2: by(4e4),
        fractions: [by(0.1).min(0.3), by(0.2).min(0.4)],
        time_constants_s: [by(0.8), by(9.0)],
        retained_share: by(0.6).min(1.0),
        rate: 0.1 * normal(rng),
    };
    let waits = DelayedPuncture { layer, force_n: 4.0 * times(rng, FACTOR), exponent: 10.0 };
    vec![slip.into(), waits.into(), ReleaseDepth { layer, depth_m: 1e-3 * times(rng, FACTOR) }.into()]
}

/// RichEffects of the independent simulator.
fn ingredients(rng: &mut ChaCha8Rng) -> RichEffects {
    let bristles = Bristles {
        share: 0.5 + 0.5 * rng.random::<f64>(),
        delta_m: 5e-4 * times(rng, FACTOR),
        dry_mps: 3e-3 * times(rng, FACTOR),
        creep_s: 10.0 * times(rng, FACTOR),
    };
    let foundation = Foundation { softness: 0.5 * times(rng, FACTOR), lag_s: 0.5 * times(rng, FACTOR) };
    let damage = Damage { exponent: 10.0, time_s: times(rng, FACTOR) };
    let tearing =
        Tearing { steps: 1 + (rng.random::<f64>() * 3.0) as u32, travel_m: 1e-3 * times(rng, FACTOR) };
    RichEffects {
        bristles: Some(bristles),
        foundation: Some(foundation),
        damage: Some(damage),
        tearing: Some(tearing),
        ..RichEffects::default()
    }
}

type Columns = (Vec<f64>, Vec<f64>, Vec<f64>);

fn path(m: Motion) -> MotionPath {
    let travel_s = m.stroke_m / m.speed_mps;
    MotionPath::new(
        0.0,
        vec![
            MotionPiece::constant(0.0, 0.5),
            MotionPiece::constant(m.speed_mps, travel_s),
            MotionPiece::constant(0.0, m.rest_s),
            MotionPiece::constant(-m.speed_mps, travel_s),
            MotionPiece::constant(0.0, 0.5),
        ],
    )
}

fn rich_run(
    layers: usize,
    thick_m: f64,
    strength_n: [f64; 2],
    with: &RichEffects,
    m: Motion,
    by: Differs,
) -> Columns {
    let layer = |thickness_m: f64, strength_n: f64| real::Layer {
        thickness_m,
        stiffness_n_per_m: 150.0 * strength_n,
        friction_ns_per_m2: 1.5e4 * strength_n * by[1].exp(),
        puncture_n: Some(strength_n * (1.0 + by[2]).max(0.2)),
    };
    let thick = if layers > 1 {
        vec![layer(thick_m, strength_n[0]), layer(0.08, strength_n[1])]
    } else {
        vec![layer(0.08, strength_n[0])]
    };
    let tissue = real::Tissue { surface_m: 0.004 + by[0], layers: thick };
    let path = path(m);
    let at: Vec<f64> = (0..(path.duration_s() * SAMPLE_HZ) as usize).map(|k| k as f64 / SAMPLE_HZ).collect();
    let done = simulate_insertion(
        &mut RichWorld::new(&tissue, with),
        &SensorModel::new(&[], 0.0),
        None,
        &path,
        &at,
        STEP_S,
    );
    (done.time_s, done.position_m, done.force_n)
}

fn slip_run(
    stick_slip: &[Vec<AnyEffect>],
    thick_m: f64,
    m: Motion,
    by: Differs,
) -> Result<Columns, Box<dyn Error>> {
    let mut tissue = assumed_tissue(stick_slip.len());
    tissue.surface_m += by[0];
    if stick_slip.len() > 1 {
        tissue.layers[0].thickness_m = thick_m;
    }
    for layer in &mut tissue.layers {
        (layer.stiffness_n_per_m, layer.puncture_n) = (100.0, None);
    }
    let mut effects: Vec<AnyEffect> = stick_slip.iter().flatten().cloned().collect();
    for effect in &mut effects {
        match effect {
            AnyEffect::ShaftSlip(s) => {
                (s.push_n, s.pull_n) = (s.push_n * by[1].exp(), s.pull_n * by[1].exp())
            }
            AnyEffect::DelayedPuncture(d) => d.force_n *= (1.0 + by[2]).max(0.2),
            _ => {}
        }
    }
    let law = ForceLaw::new(&tissue, &effects)?;
    let path = path(m);
    let (mut state, mut piece) = (ForceLawState::default(), 0);
    let mut out: Columns = Default::default();
    for k in 0..(path.duration_s() * SAMPLE_HZ) as usize {
        let t = k as f64 / SAMPLE_HZ;
        while t > path.piece_end_s(piece) {
            piece += 1;
        }
        let at = path.at(piece, t);
        out.0.push(t);
        out.1.push(at.z);
        out.2.push(law.step(&mut state, t, at.z, at.v, |_| {}).total_n);
    }
    Ok(out)
}

fn add_noise(time_s: &[f64], force_n: &mut [f64], rng: &mut ChaCha8Rng) {
    let largest = force_n.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    let (mut slow, mut last_s) = (normal(rng), 0.0);
    for (t, f) in time_s.iter().zip(force_n) {
        let keep = libm::exp(-(t - last_s) / SLOW.1);
        slow = keep * slow + (1.0 - keep * keep).max(0.0).sqrt() * normal(rng);
        last_s = *t;
        *f += SLOW.0 * largest * slow + NOISE_N * normal(rng);
    }
}
