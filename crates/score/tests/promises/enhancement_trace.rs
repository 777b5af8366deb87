//! A trace holds the output of every sample and the events of the run.

use crate::support::{detection, detection_output, estimate_output};
use stylet_core::config::{Algorithm, Model};
use stylet_core::{EnhanceConfig, LayerEstimate, Output, State};
use stylet_record::Recording;
use stylet_score::{MAX_STORED_SAMPLES, Trace, algorithm_name, coefficients, model_name};

#[test]
fn every_output_is_a_column() {
    let out = Output {
        enhanced_n: 1.0,
        reconstructed_n: 2.0,
        error_n: 3.0,
        theta: [4.0, 5.0],
        cusum_n2: 6.0,
        derivative_n_per_s: 7.0,
        cumulative_friction_ns_per_m: 8.0,
        band_n: Some([9.0, 10.0]),
        state: State::ExpectedRupture,
        ..Output::default()
    };
    let mut trace = Trace::default();
    trace.push(&out);
    let expected = Trace {
        enhanced_n: vec![1.0],
        reconstructed_n: vec![2.0],
        error_n: vec![3.0],
        stiffness_n_per_m: vec![4.0],
        friction: vec![5.0],
        cusum_n2: vec![6.0],
        derivative_n_per_s: vec![7.0],
        cumulative_friction_ns_per_m: vec![8.0],
        low_n: vec![9.0],
        high_n: vec![10.0],
        state: vec![State::ExpectedRupture],
        unused_reason: vec![None],
        ..Trace::default()
    };
    assert_eq!(trace, expected);
    // Without a band its ends are NaN.
    trace.push(&Output::default());
    assert!(trace.low_n[1].is_nan() && trace.high_n[1].is_nan());
}

#[test]
fn there_are_no_coefficients_before_contact() {
    assert!(coefficients(&Output::default()).iter().all(|x| x.is_nan()));
    assert_eq!(coefficients(&Output { theta: [0.0, 3.0], ..Output::default() }), [0.0, 3.0]);
}

#[test]
fn a_later_estimate_of_a_layer_replaces_the_earlier_one() {
    let of =
        |layer, stiffness_n_per_m| LayerEstimate { layer, stiffness_n_per_m, ..LayerEstimate::default() };
    let mut trace = Trace::default();
    for estimate in [of(1, 40.0), of(2, 50.0), of(1, 41.0)] {
        trace.record_events(&estimate_output(estimate));
    }
    assert_eq!(trace.estimates, [of(2, 50.0), of(1, 41.0)]);
}

#[test]
fn ruptures_contact_and_ignored_samples_are_recorded() {
    let mut trace = Trace::default();
    trace.record_events(&detection_output(detection(1, 3.0)));
    trace.record_events(&Output { used: false, ..Output::default() });
    trace.record_events(&Output { used: false, contact_m: Some(0.01), ..Output::default() });
    assert_eq!(trace.detections, [detection(1, 3.0)]);
    assert_eq!((trace.unused, trace.contact_m), (2, Some(0.01)));
}

#[test]
fn the_contact_time_is_that_of_the_first_sample_at_the_contact_position() {
    // 5 mm of air, then a spring of 100 N/m, at 2.5 mm/s.
    let time_s: Vec<f64> = (0..1600).map(|i| 0.005 * f64::from(i)).collect();
    let position_m: Vec<f64> = time_s.iter().map(|t| 0.0025 * t - 0.005).collect();
    let force_n: Vec<f64> = position_m.iter().map(|z| 100.0 * z.max(0.0)).collect();
    let run =
        Recording::with_velocity(time_s, position_m, vec![0.0025; 1600], force_n.clone()).expect("columns");
    let mut received = Vec::new();
    let trace =
        Trace::run(&run, &force_n, &EnhanceConfig::default(), 0.0, |index, out| received.push((index, *out)));
    assert!(
        received
            .iter()
            .enumerate()
            .all(|(i, (index, out))| i == *index && out.enhanced_n == trace.enhanced_n[i])
    );
    assert_eq!((received.len(), trace.unused), (1600, 0));
    let (z, t) = (trace.contact_m.expect("contact"), trace.contact_s.expect("contact"));
    assert!(z.abs() < 1e-3, "{z}");
    assert!((0.0..0.0051).contains(&(t - (z + 0.005) / 0.0025)), "{z} at {t}");
}

#[test]
fn after_a_restart_the_contact_time_is_of_the_last_pass() {
    // Two insertions, a quarter of an hour apart; the second surface lies 2 mm deeper.
    let one: Vec<f64> = (0..1600).map(|i| 0.005 * f64::from(i)).collect();
    let time_s: Vec<f64> = one.iter().copied().chain(one.iter().map(|t| 900.0 + t)).collect();
    let position_m: Vec<f64> = one.iter().chain(&one).map(|t| 0.0025 * t - 0.005).collect();
    let surface_m = |t: f64| if t < 900.0 { 0.0 } else { 0.002 };
    let force_n: Vec<f64> =
        position_m.iter().zip(&time_s).map(|(z, t)| 100.0 * (z - surface_m(*t)).max(0.0)).collect();
    let run =
        Recording::with_velocity(time_s, position_m, vec![0.0025; 3200], force_n.clone()).expect("columns");
    let trace = Trace::run(&run, &force_n, &EnhanceConfig::default(), 0.0, |_, _| {});
    assert_eq!(trace.restarts, 1);
    let (z, t) = (trace.contact_m.expect("contact"), trace.contact_s.expect("contact"));
    assert!((z - 0.002).abs() < 1e-3, "{z}");
    assert!((-1e-9..0.0051).contains(&(t - 900.0 - (z + 0.005) / 0.0025)), "{z} at {t}");
}

#[test]
fn twenty_one_minutes_at_the_sensor_rate_are_stored() {
    let minutes = [MAX_STORED_SAMPLES].map(|n| n / (200 * 60));
    assert_eq!(minutes, [21]);
}

#[test]
fn algorithm_and_model_names_are_those_of_the_files() {
    assert_eq!(
        [Algorithm::Paper, Algorithm::Literal, Algorithm::Stylet].map(algorithm_name),
        ["paper", "literal", "stylet"]
    );
    assert_eq!([Model::KelvinVoigt, Model::MultiLayer].map(model_name), ["kv", "ml"]);
}
