//! Promise: from repeats of an insertion whose law is known, the study finds that law's effects and numbers and the
//! scatter between the runs; where the base law is the truth it names nothing.

use stylet_diagnose::Verdict;
use stylet_record::Recording;
use stylet_repeats::instrument::Instrument;
use stylet_repeats::run::Run;
use stylet_repeats::stats::{PRIMES, halton, normal_quantile};
use stylet_repeats::study::{Study, study};
use stylet_tissue::*;

const NOISE_N: f64 = 0.01;

/// In at `speed` from 2 mm before the surface to 18 mm behind it, held for 5 s, back out. About 50 samples per
/// second, unevenly, with noise.
fn insertion(tissue: &Tissue, effects: &[AnyEffect], speed: f64, seed: usize) -> Recording {
    let law = Law::new(tissue, effects).expect("few effects");
    let mut state = LawState::default();
    let (stroke, hold) = (0.02, 5.0);
    let way = stroke / speed;
    let (mut t, mut time_s, mut position_m, mut force_n) = (0.0, Vec::new(), Vec::new(), Vec::new());
    let mut k = 0;
    while t < 2.0 * way + hold + 1.0 {
        let z = match t - 0.5 {
            t if t < 0.0 => 0.0,
            t if t < way => speed * t,
            t if t < way + hold => stroke,
            t => (stroke - speed * (t - way - hold)).max(0.0),
        };
        let v = match t - 0.5 {
            t if t < 0.0 => 0.0,
            t if t < way => speed,
            t if t < way + hold => 0.0,
            t if t < 2.0 * way + hold => -speed,
            _ => 0.0,
        };
        let force = law.step(&mut state, t, z - 0.002, v, |_| {}).total_n;
        k += 1;
        let noise = normal_quantile(halton(k + 7919 * seed, PRIMES[0]).clamp(1e-6, 1.0 - 1e-6));
        time_s.push(t);
        position_m.push(z);
        force_n.push(force + NOISE_N * noise);
        t += 0.016 + 0.008 * halton(k + 31 * seed, PRIMES[1]);
    }
    Recording::new(time_s, position_m, force_n).expect("a recording")
}

fn layer(thickness_m: f64, stiffness_n_per_m: f64, friction_ns_per_m2: f64, puncture_n: f64) -> Layer {
    Layer {
        name: "gel".to_owned(),
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n: Some(puncture_n),
    }
}

/// Runs of one layer at three speeds, three each; surface, puncture force and release scatter.
fn runs(effects: impl Fn(f64) -> Vec<AnyEffect>, stiffness: f64, friction: f64, thickness: f64) -> Vec<Run> {
    let mut out = Vec::new();
    for (i, speed) in [0.001, 0.002, 0.003].into_iter().enumerate() {
        for j in 0..3 {
            let k = 3 * i + j;
            let draw = |d: usize| normal_quantile(halton(k + 1, PRIMES[d]));
            let tissue = Tissue {
                surface_m: 2e-4 * draw(0),
                layers: vec![layer(thickness, stiffness, friction, 3.0 * (1.0 + 0.05 * draw(1)))],
            };
            let recording = insertion(&tissue, &effects(4e-4 * draw(2)), speed, k);
            out.push(Run::new(format!("{k}"), recording, Vec::new(), 1));
        }
    }
    out
}

fn look(runs: &[Run]) -> Study {
    let believed = Tissue { surface_m: 0.002, layers: vec![layer(0.05, 200.0, 1e4, 3.0)] };
    let refs: Vec<&Run> = runs.iter().collect();
    study("known", &believed, &refs, |_, _| Instrument::default(), |_| {}).expect("a study")
}

#[test]
fn the_effects_of_a_known_law_are_found_with_their_numbers_and_the_scatter_between_runs() {
    let branch = |share, time_constant_s, release_m| {
        ViscoelasticPresliding { layer: 1, share, delta_m: 4e-3, kept: 1.0, time_constant_s, release_m }
            .into()
    };
    let effects = |release_m: f64| -> Vec<AnyEffect> {
        vec![
            PowerLawFriction { exponent: 0.1 }.into(),
            NonlinearElasticity { kappa_per_m: 300.0 }.into(),
            StressRelaxation { terms: vec![PronyTerm { fraction: 0.2, time_constant_s: 2.0 }] }.into(),
            branch(0.4, 2.0, release_m),
            branch(0.6, 1e6, release_m),
        ]
    };
    let runs = runs(effects, 60.0, 1.2 / (0.08 * 1e-3), 0.08);
    assert!(runs.iter().all(|r| r.ruptures[0].is_some() && r.releases_m[0].is_some()));
    let s = look(&runs);
    let d = &s.diagnosis;
    assert_eq!(d.verdict, Verdict::Named);
    let named: Vec<&str> = d.causes.iter().map(|c| c.effect.as_str()).collect();
    println!("{named:?} {:?}", s.repeats.mean);
    for effect in
        ["nonlinear_elasticity", "stress_relaxation", "viscoelastic_presliding", "power_law_friction"]
    {
        assert!(named.contains(&effect), "{effect}: {named:?}");
    }
    let of = |effect: &str, path: &str| {
        let cause = d.causes.iter().find(|c| c.effect == effect).expect("named");
        cause.parameters[path].value
    };
    let near = |found: f64, truth: f64, share: f64| {
        assert!((found / truth - 1.0).abs() < share, "{found} against {truth}");
    };
    near(of("stress_relaxation", "terms.0.time_constant_s"), 2.0, 0.15);
    near(of("stress_relaxation", "terms.0.dragged_fraction"), 0.4, 0.15);
    near(of("viscoelastic_presliding", "0.delta_m"), 4e-3, 0.15);
    assert!((of("power_law_friction", "exponent") - 0.1).abs() < 0.05);
    // What was drawn is told apart from what is shared: 0.2 mm, 5 % of 3 N, 0.4 mm.
    let p = &s.population;
    near(p.shift_sd_m, 2e-4, 0.5);
    let layer = &p.layers[0];
    near(layer.puncture_log.expect("seen").exp(), 3.0, 0.05);
    near(layer.puncture_sd, 0.05, 0.5);
    near(layer.release_sd_m, 4e-4, 0.5);
    // A run that took no part is predicted as well as by its fellows, or better.
    let m = &s.repeats.mean;
    assert!(m.extended_n <= m.floor_n.expect("three of each speed"), "{m:?}");
    assert!(m.base_n > 2.0 * m.extended_n, "{m:?}");
    assert!((0.8..=0.99).contains(&m.covered), "{m:?}");
}

#[test]
fn where_the_base_law_is_the_truth_nothing_is_named() {
    let runs = runs(|_| Vec::new(), 250.0, 2e4, 0.05);
    let s = look(&runs);
    let named: Vec<&str> = s.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
    println!("{named:?} {:?}", s.repeats.mean);
    assert_eq!(s.diagnosis.verdict, Verdict::None, "{named:?}");
    let m = &s.repeats.mean;
    assert!(m.extended_n <= 1.1 * m.floor_n.expect("three of each speed"), "{m:?}");
}
