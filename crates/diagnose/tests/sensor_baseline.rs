//! Promise: what the sensor adds in air too is named at any size and sign, alone, and a clock is not named where the
//! commanded motion hides it.

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use stylet_diagnose::{Diagnosis, NamedRecording, Options, Verdict, diagnose};
use stylet_record::Recording;
use stylet_scenario::Scenario;
use stylet_tissue::{ForceLaw, replay};

const ASSUMED: &str = r#"Scenario(name: "two gels", motion: Recorded, tolerance: 0.3, tissue: (layers: [
    (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: Some(0.8)),
    (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0)]))"#;

/// An insertion with a hold, a ripple and a retraction; `added_n(t, z)` is what the sensor adds.
fn insertion(seed: u64, added_n: impl Fn(f64, f64) -> f64) -> NamedRecording {
    let scenario = Scenario::parse("assumed.ron", ASSUMED).expect("a scenario");
    let law = ForceLaw::new(&scenario.tissue, &[]).expect("a law");
    // The velocity changes between samples.
    let speed = |t: f64| match t - 0.0025 {
        t if t < 15.0 => 0.002,
        t if t < 18.0 => 0.0,
        t if t < 33.0 => 0.003 + 0.001 * libm::sin(core::f64::consts::PI * t),
        _ => -0.004,
    };
    let (mut z, mut columns) = (-0.01, Vec::new());
    for k in 0..38 * 200 {
        let t = f64::from(k) * 0.005;
        columns.push((t, z, speed(t)));
        z += (0..10).map(|i| 5e-4 * speed(t + 5e-4 * (f64::from(i) + 0.5))).sum::<f64>();
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut force = Vec::new();
    replay(&law, columns.iter().copied(), |_| {}, |f| force.push(f.total_n));
    let noisy = columns.iter().zip(&force).map(|((t, z, _), f)| {
        let noise: f64 = StandardNormal.sample(&mut rng);
        f + 0.02 * noise + added_n(*t, *z)
    });
    let f = noisy.collect();
    let (t, z) = columns.iter().map(|c| (c.0, c.1)).unzip();
    let recording = Recording::new(t, z, f).expect("a recording");
    NamedRecording { name: format!("{seed}.csv"), recording, notes: Vec::new() }
}

fn diagnosed(data: &[NamedRecording]) -> Diagnosis {
    let scenario = Scenario::parse("assumed.ron", ASSUMED).expect("a scenario");
    diagnose(&scenario, data, &Options { brief: true, ..Options::default() }, |_| {})
        .expect("a diagnosis")
        .diagnosis
}

fn names(d: &Diagnosis) -> Vec<&str> {
    d.causes.iter().map(|c| c.effect.as_str()).collect()
}

fn value(d: &Diagnosis, path: &str) -> f64 {
    d.causes[0].parameters[path].value
}

#[test]
fn an_offset_is_named_with_its_value_at_any_size_and_sign() {
    for offset in [-45.0, -0.3, 20.0] {
        let d = diagnosed(&[insertion(1, |_, _| offset)]);
        assert_eq!((d.verdict, names(&d)), (Verdict::Named, vec!["force_bias"]), "{offset} N");
        assert!((value(&d, "force_n") - offset).abs() < 0.01, "{offset} N");
        let stiffness = &d.base_parameters[0];
        assert!((stiffness.value / 50.0 - 1.0).abs() < 0.05, "{offset} N: {stiffness:?}");
    }
}

#[test]
fn a_drift_and_a_force_linear_in_position_are_named_with_their_slopes() {
    let d = diagnosed(&[insertion(2, |t, _| -0.026 * t)]);
    assert_eq!((d.verdict, names(&d)), (Verdict::Named, vec!["force_drift"]));
    assert!((value(&d, "rate_n_per_s") + 0.026).abs() < 5e-4);
    let d = diagnosed(&[insertion(3, |_, z| 12.0 * (z + 0.01))]);
    assert_eq!((d.verdict, names(&d)), (Verdict::Named, vec!["position_dependent_force"]));
    assert!((value(&d, "stiffness_n_per_m") - 12.0).abs() < 0.3);
}

#[test]
fn steps_of_the_zero_are_named_with_time_and_size_in_air_and_in_tissue() {
    for (at, size) in [(2.0, -1.0), (9.0, -0.3), (23.7, 4.0)] {
        let d = diagnosed(&[insertion(4, |t, _| if t >= at { size } else { 0.0 })]);
        assert_eq!((d.verdict, names(&d)), (Verdict::Named, vec!["zero_step"]), "{size} N at {at} s");
        assert!((value(&d, "step_n") - size).abs() < 0.02 && (value(&d, "time_s") - at).abs() < 0.01);
    }
}

#[test]
fn recordings_may_have_steps_at_different_times_and_other_offsets() {
    let step = |at: f64, size: f64| move |t: f64, _: f64| if t >= at { size } else { 0.0 };
    let d = diagnosed(&[insertion(5, step(6.0, 0.5)), insertion(6, step(21.0, -0.7))]);
    assert_eq!((d.verdict, names(&d)), (Verdict::Named, vec!["zero_step"]));
    assert!((value(&d, "step_n") + 0.7).abs() < 0.02);
    let d = diagnosed(&[insertion(7, |_, _| 0.4), insertion(8, |_, _| -3.0)]);
    assert_eq!((d.verdict, names(&d)), (Verdict::Named, vec!["force_bias"]));
    assert!((value(&d, "force_n") + 3.0).abs() < 0.05);
}

#[test]
fn held_out_recordings_are_predicted_with_their_own_steps() {
    let data = [5, 6].map(|seed| insertion(seed, |t, _| if t >= 6.0 { 0.5 } else { 0.0 }));
    let scenario = Scenario::parse("assumed.ron", ASSUMED).expect("a scenario");
    let found = diagnose(&scenario, &data, &Options::default(), |_| {}).expect("a diagnosis").diagnosis;
    assert_eq!(names(&found), ["zero_step"]);
    let gain = &found.gain;
    assert!(gain.rmse_before_n > 5.0 * gain.floor_n && gain.rmse_after_n < 1.2 * gain.floor_n, "{gain:?}");
}

#[test]
fn a_clean_insertion_has_no_baseline() {
    let d = diagnosed(&[insertion(9, |_, _| 0.0)]);
    assert_eq!((d.verdict, names(&d)), (Verdict::None, vec![]));
}
