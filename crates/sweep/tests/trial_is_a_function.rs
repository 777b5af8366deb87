//! Promise: a trial is a function of sweep, seed and trial number; a path sets exactly the field that it names; a trial has the same
//! scores as the ordinary run of its scenario.

use std::path::Path;
use stylet_scenario::{Motion, Robot, Scenario, Sensor};
use stylet_score::score_run;
use stylet_sweep::{
    Columns, Distribution, Sampling, Sweep, SweepFile, TrialSampler, VariedField, run_trials_with_threads,
    trial_simulation,
};
use stylet_testbed::simulate;

fn scenario() -> Scenario {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/three_layer_latex_constant.ron");
    Scenario::load(&file).expect("the shipped scenario")
}

fn sweep(paths: &[(&str, Distribution)], trials: u64) -> Sweep {
    let vary = paths
        .iter()
        .map(|(path, with)| VariedField { path: (*path).to_owned(), with: with.clone() })
        .collect();
    let file = SweepFile {
        scenario: "x.ron".into(),
        trials,
        sampling: Sampling::Random,
        seed: 3,
        vary,
        effects: Vec::new(),
    };
    Sweep::new("test".to_owned(), file, scenario()).expect("a good sweep")
}

#[test]
fn a_path_sets_its_field_and_no_other() {
    let exact = |x: f64| Distribution::Choice(vec![x]);
    let paths = [
        ("tissue.layers[1].stiffness_n_per_m", 61.5),
        ("tissue.layers[0].puncture_n", 1.25),
        ("tissue.surface_m", 0.001),
        ("motion.velocity_mps", 0.0031),
        ("sensor.noise_n", 0.013),
        ("sensor.range_n", 7.5),
        ("enhance.cusum.sigma_rupture_n", 0.11),
        ("enhance.cusum.enabled", 0.0),
        ("enhance.reset.hz", 20.0),
        ("enhance.contact_search.samples", 7.0),
        ("sample_hz", 100.0),
    ];
    let all: Vec<(&str, Distribution)> = paths.iter().map(|(p, x)| (*p, exact(*x))).collect();
    let sweep = sweep(&all, 1);
    let drawn = TrialSampler::new(&sweep).draw(0).expect("a valid draw");
    let mut expected = scenario();
    expected.robot = Robot::Replay;
    expected.seed = drawn.seed;
    expected.tissue.layers[1].stiffness_n_per_m = 61.5;
    expected.tissue.layers[0].puncture_n = Some(1.25);
    expected.tissue.surface_m = 0.001;
    if let Motion::Constant { velocity_mps, .. } = &mut expected.motion {
        *velocity_mps = 0.0031;
    }
    if let Sensor::ForceTorque(sensor) = &mut expected.sensor {
        sensor.noise_n = 0.013;
        sensor.range_n = Some(7.5);
    }
    expected.enhance.cusum.sigma_rupture_n = 0.11;
    expected.enhance.cusum.enabled = false;
    expected.enhance.reset = stylet_core::config::Reset::Frequency { hz: 20.0 };
    expected.enhance.contact_search.samples = 7;
    expected.sample_hz = 100.0;
    assert_eq!(drawn.scenario, expected);
    assert_eq!(drawn.values, paths.map(|(_, x)| x));
}

#[test]
fn a_trial_does_not_depend_on_the_others_nor_on_how_they_are_split() {
    let sweep = sweep(&[("sensor.noise_n", Distribution::LogUniform(0.005, 0.1))], 40);
    let columns = Columns::new(&sweep);
    let all = run_trials_with_threads(&sweep, &columns, 0..40, 2, &|_| {}).expect("it runs");
    let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(x, y)| x.to_bits() == y.to_bits());
    for range in [0..1, 7..8, 13..40, 39..40] {
        let part = run_trials_with_threads(&sweep, &columns, range.clone(), 1, &|_| {}).expect("it runs");
        for (row, whole) in part.iter().zip(&all[range.start as usize..range.end as usize]) {
            assert_eq!((row.trial, row.seed), (whole.trial, whole.seed));
            assert!(same(&row.values, &whole.values));
        }
    }
    let mut seeds: Vec<u64> = all.iter().map(|r| r.seed).collect();
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 40, "every trial has its own noise");
}

#[test]
fn a_trial_has_the_scores_of_the_ordinary_run() {
    let sweep = sweep(&[("sensor.noise_n", Distribution::Uniform(0.0, 0.05))], 4);
    let drawer = TrialSampler::new(&sweep);
    let mut workspace = trial_simulation::Workspace::default();
    for k in 0..4 {
        let scenario = drawer.draw(k).expect("a valid draw").scenario;
        let ours = trial_simulation::run(&scenario, &mut workspace).expect("it runs");
        let run = simulate(&scenario, scenario.seed).expect("it runs");
        let layers = run.true_layers();
        let (_, mut score) =
            score_run(&run.recording, &run.recording.force_n, &run.truth, &layers, &scenario.enhance);
        for layer in &mut score.layers {
            layer.offline_stiffness_n_per_m = None;
            layer.offline_friction_ns_per_m2 = None;
            layer.offline_separable = None;
        }
        assert_eq!(ours, score);
    }
}

/// Without a sampling phase every insertion would have its faces at the same places relative to the samples.
#[test]
fn the_sampling_phase_shifts_the_samples_relative_to_the_ruptures() {
    let sweep = sweep(&[("sensor.noise_n", Distribution::Uniform(0.0, 0.001))], 1);
    let scenario = TrialSampler::new(&sweep).draw(0).expect("a valid draw").scenario;
    let mut workspace = trial_simulation::Workspace::default();
    let mut delay_steps = |phase: f64| {
        let score =
            trial_simulation::run_with_sampling_phase(&scenario, phase, &mut workspace).expect("it runs");
        let delay_s = score.ruptures.first().and_then(|r| r.delay_s).expect("a rupture that is found");
        delay_s * scenario.sample_hz
    };
    let synchronous = delay_steps(0.0);
    for phase in [0.25, 0.5, 0.9] {
        let moved = (delay_steps(phase) - synchronous).rem_euclid(1.0);
        assert!((moved - phase).abs() < 0.01, "{moved} for {phase}");
    }
}
