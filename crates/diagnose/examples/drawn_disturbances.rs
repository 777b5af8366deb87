//! Diagnoses of drawn insertions with one disturbance of the force sensor each, and of cyclic motions.
//!
//! ```sh
//! cargo run --release -p stylet-diagnose --example drawn_disturbances -- KIND CASES SEED RECORDINGS
//! ```
//!
//! `KIND` is `clean`, `offset` (0.05 to 45 N), `drift` (2 to 30 mN/s), `line` (5 to 20 N/m), `steps` (one or two of 0.2 to 5 N), `loaded` (begins inside the
//! tissue), `cyclic`, `cyclic_hysteresis` or `all`; signs and times are random. `RECORDINGS` of the four drawn motions are diagnosed
//! together (default 1, a program with ripple and holds). Insertions come from the independent simulator. With `STYLET_SHOW` set, the drawn
//! steps and cyclic motions are printed.

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use std::error::Error;
use stylet_diagnose::{Diagnosis, NamedRecording, Options, Verdict, diagnose};
use stylet_examine::{CaseId, Hide, Severity, Size, World, Wrong, make_case};
use stylet_record::Recording;
use stylet_scenario::Scenario;
use stylet_stats::wilson;
use stylet_tissue::{ForceBias, ForceDrift, PositionDependentForce, ZeroStep};

/// What is drawn, the name that a right answer has, and whether any name of an effect with a clock is wrong.
const KINDS: [(&str, Option<&str>); 8] = [
    ("clean", None),
    ("offset", Some(ForceBias::ID)),
    ("drift", Some(ForceDrift::ID)),
    ("line", Some(PositionDependentForce::ID)),
    ("steps", Some(ZeroStep::ID)),
    ("loaded", None),
    ("cyclic", None),
    ("cyclic_hysteresis", None),
];

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let word = |k: usize| args.get(k).map_or("", String::as_str);
    let (cases, seed) = (word(1).parse().unwrap_or(20), word(2).parse().unwrap_or(1));
    let recordings = word(3).parse().unwrap_or(1);
    for (kind, name) in KINDS.iter().filter(|k| word(0) == "all" || word(0).is_empty() || word(0) == k.0) {
        let (mut right, mut judged) = (0, 0);
        for index in 0..cases {
            let (scenario, data) = if kind.starts_with("cyclic") {
                cyclic_case(*kind == "cyclic_hysteresis", seed, index)?
            } else {
                disturbed_case(kind, seed, index, recordings)?
            };
            let d = match diagnose(&scenario, &data, &Options { brief: true, ..Options::default() }, |_| {}) {
                Ok(result) => result.diagnosis,
                Err(error) => {
                    println!("{kind} {index}: {error}");
                    judged += 1;
                    continue;
                }
            };
            let is_right =
                if kind.starts_with("cyclic") { names_no_clock(&d) } else { is_named_alone(&d, *name) };
            judged += 1;
            right += usize::from(is_right);
            if !is_right {
                println!("{kind} {index}: {:?} {}", d.verdict, summary(&d));
            }
        }
        let i = wilson(right, judged);
        println!("{kind}: {right} of {judged} right ({:.1} to {:.1} %)", 100.0 * i.low, 100.0 * i.high);
    }
    Ok(())
}

fn is_named_alone(d: &Diagnosis, name: Option<&str>) -> bool {
    let names: Vec<&str> = d.causes.iter().map(|c| c.effect.as_str()).collect();
    match name {
        Some(name) => d.verdict != Verdict::Unknown && names == [name],
        None => d.verdict == Verdict::None,
    }
}

fn names_no_clock(d: &Diagnosis) -> bool {
    d.causes
        .iter()
        .flat_map(|c| std::iter::once(&c.effect).chain(&c.equivalent))
        .all(|id| stylet_tissue::effect_info(id).is_none_or(|info| info.parameters.iter().all(|p| !p.clock)))
}

fn summary(d: &Diagnosis) -> String {
    let one = |c: &stylet_diagnose::diagnosis_json::Cause| {
        let values: Vec<String> = c.parameters.iter().map(|(p, e)| format!("{p} {:.4}", e.value)).collect();
        format!("{} ({})", c.effect, values.join(", "))
    };
    let notes: Vec<&str> = d.data_quality.iter().map(|n| n.note.message.as_str()).collect();
    format!("{} | {}", d.causes.iter().map(one).collect::<Vec<String>>().join(" + "), notes.join("; "))
}

type Drawn = (Scenario, Vec<NamedRecording>);

/// A drawn insertion with one disturbance.
fn disturbed_case(kind: &str, seed: u64, index: u64, recordings: usize) -> Result<Drawn, Box<dyn Error>> {
    let id = CaseId {
        world: World::Plain,
        wrong: Wrong::Nothing,
        severity: Severity::Small,
        hide: Hide::Clean,
        size: Size::Strong,
        seed,
        index,
    };
    let case = make_case(&id)?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ (index << 20) ^ 0xd15);
    let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
    let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let size = match kind {
        "offset" => sign * libm::exp(between(libm::log(0.05), libm::log(45.0))),
        "drift" => sign * between(2e-3, 30e-3),
        "line" => between(5.0, 20.0),
        _ => 0.0,
    };
    let steps = if between(0.0, 1.0) < 0.5 { 1 } else { 2 };
    let mut data = Vec::new();
    // The last motions are programs with ripple, holds and retractions.
    for file in case.question.recordings.iter().rev().take(recordings) {
        let r = &file.recording;
        let (t, x, mut f) = (&r.time_s, &r.position_m, r.force_n.clone());
        let end_s = t.last().copied().unwrap_or(0.0);
        let mut from = 0;
        match kind {
            "offset" => f.iter_mut().for_each(|f| *f += size),
            "drift" => f.iter_mut().zip(t).for_each(|(f, t)| *f += size * t),
            "line" => f.iter_mut().zip(x).for_each(|(f, z)| *f += size * (z - x[0])),
            "steps" => {
                for _ in 0..steps {
                    let (at, step) = (end_s * between(0.05, 0.95), between(0.2, 5.0));
                    let step = if between(0.0, 1.0) < 0.5 { step } else { -step };
                    if std::env::var_os("STYLET_SHOW").is_some() {
                        println!("  step of {step:.3} N at {at:.3} s of {end_s:.1} s");
                    }
                    f.iter_mut().zip(t).filter(|(_, t)| **t >= at).for_each(|(f, _)| *f += step);
                }
            }
            "loaded" => {
                let first_m = case.setup.truth.layers.first().map_or(0.01, |l| l.thickness_m);
                let depth_m = case.setup.truth.surface_m + first_m * between(0.1, 0.6);
                from = x.iter().position(|z| *z > depth_m).unwrap_or(0);
            }
            _ => {}
        }
        let first_s = t.get(from).copied().unwrap_or(0.0);
        let recording = Recording::new(
            t[from..].iter().map(|t| t - first_s).collect(),
            x[from..].to_vec(),
            f[from..].to_vec(),
        )?;
        data.push(NamedRecording { name: file.name.clone(), recording, notes: Vec::new() });
    }
    Ok((Scenario::parse("assumed.ron", &case.question.assumed_ron.unwrap_or_default())?, data))
}

/// Triangles or sines into one elastic layer, with or without a rate-independent hysteresis.
fn cyclic_case(hysteresis: bool, seed: u64, index: u64) -> Result<Drawn, Box<dyn Error>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ (index << 20) ^ 0xc1c);
    let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let hz = libm::exp(between(libm::log(0.05), 0.0));
    let seconds = (between(3.0, 8.0) / hz).clamp(10.0, 60.0);
    if std::env::var_os("STYLET_SHOW").is_some() {
        println!("  case {index}: {hz:.4} Hz for {seconds:.1} s");
    }
    let (amplitude_m, triangle) = (between(0.003, 0.009), between(0.0, 1.0) < 0.5);
    let stiffness = between(35.0, 130.0);
    let (loss_n, travel_m) = (between(0.05, 0.3), libm::exp(between(libm::log(1e-4), libm::log(2e-3))));
    let noise_n = between(0.005, 0.02);
    let (mut t, mut z, mut f) = (Vec::new(), Vec::new(), Vec::new());
    let mut xi = 0.0;
    for k in 0..(seconds * 200.0) as usize {
        let time = k as f64 * 0.005;
        let phase = (hz * time).fract();
        let x = if triangle {
            amplitude_m * (1.0 - (2.0 * phase - 1.0).abs())
        } else {
            0.5 * amplitude_m * (1.0 - libm::cos(core::f64::consts::TAU * phase))
        };
        let dx = x - z.last().copied().unwrap_or(x);
        xi = f64::clamp(xi + dx / travel_m * (1.0 - xi * dx.signum()), -1.0, 1.0);
        let noise: f64 = StandardNormal.sample(&mut rng);
        t.push(time);
        z.push(x);
        f.push(stiffness * x + if hysteresis { loss_n * xi } else { 0.0 } + noise_n * noise);
    }
    let text = r#"Scenario(name: "cyclic", motion: Recorded, tolerance: 0.3, tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 80.0, friction_ns_per_m2: 9000.0, puncture_n: Some(2.5)),
        (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0)]))"#;
    let recording = Recording::new(t, z, f)?;
    let data = vec![NamedRecording { name: "cyclic.csv".to_owned(), recording, notes: Vec::new() }];
    Ok((Scenario::parse("cyclic.ron", text)?, data))
}
