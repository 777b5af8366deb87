//! Promise: the three ruptures of the latex phantom are detected at constant and at sinusoidal velocity, with known or detected
//! contact, without false alarms.

use crate::support::{Insertion, constant, detections, enhance, sinusoid};
use stylet_core::config::{Contact, CusumConfig, DerivativeConfig, Model, Reset};
use stylet_core::{Cause, EnhanceConfig, State};

fn assert_found(data: &Insertion, config: &EnhanceConfig, latest_s: f64) {
    let found = detections(&enhance(config, &data.samples));
    let truth: Vec<f64> = data.ruptures.iter().map(|r| r.time_s).collect();
    assert_eq!(found.len(), truth.len(), "found {found:?}, true {truth:?}");
    for (f, t) in found.iter().zip(&truth) {
        assert!((-0.05..=latest_s).contains(&(f - t)), "found {found:?}, true {truth:?}");
    }
    assert_eq!(truth.len(), 3, "the insertion must cross three layers");
}

#[test]
fn constant_insertion_detects_all_three_ruptures() {
    for seed in 0..10 {
        assert_found(&constant(0.02, seed), &EnhanceConfig::paper(), 0.05);
    }
}

#[test]
fn sinusoidal_insertion_detects_all_three_ruptures() {
    for seed in 0..10 {
        assert_found(&sinusoid(0.02, seed), &EnhanceConfig::paper(), 0.05);
    }
}

#[test]
fn a_known_surface_works_as_well_as_a_detected_one() {
    let config = EnhanceConfig { contact: Contact::Known, ..EnhanceConfig::paper() };
    assert_found(&constant(0.02, 1), &config, 0.05);
    assert_found(&sinusoid(0.02, 1), &config, 0.05);
}

#[test]
fn contact_is_found_within_half_a_millimetre() {
    for (name, data) in [("constant", constant(0.02, 3)), ("sinusoid", sinusoid(0.02, 3))] {
        let outputs = enhance(&EnhanceConfig::paper(), &data.samples);
        let found = outputs.last().and_then(|o| o.contact_m).expect("contact");
        assert!(found.abs() < 5e-4, "{name}: surface at 0, found at {found} m");
    }
}

#[test]
fn without_cusum_the_trailing_edge_of_the_derivative_finds_the_ruptures_later() {
    let config = EnhanceConfig {
        cusum: CusumConfig { enabled: false, ..CusumConfig::default() },
        ..EnhanceConfig::paper()
    };
    assert_found(&constant(0.005, 1), &config, 1.0);
    let outputs = enhance(&config, &constant(0.005, 1).samples);
    assert!(
        outputs.iter().filter_map(|o| o.detection).all(|d| d.cause == Cause::DerivativeTrailingEdge),
        "by the derivative alone"
    );
}

#[test]
fn with_both_detectors_off_nothing_is_detected() {
    let config = EnhanceConfig {
        cusum: CusumConfig { enabled: false, ..CusumConfig::default() },
        derivative: DerivativeConfig { enabled: false, ..DerivativeConfig::default() },
        ..EnhanceConfig::paper()
    };
    assert!(detections(&enhance(&config, &constant(0.02, 1).samples)).is_empty());
}

#[test]
fn states_follow_the_transitions_of_the_papers_figure() {
    use State::*;
    let outputs = enhance(&EnhanceConfig::paper(), &constant(0.02, 1).samples);
    let mut visited = [false; 5];
    for pair in outputs.windows(2) {
        let (from, to) = (pair[0].state, pair[1].state);
        visited[State::ALL.iter().position(|s| *s == to).expect("a state")] = true;
        let allowed = from == to && from != DetectedRupture
            || matches!(
                (from, to),
                (NoRupture, ExpectedRupture)
                    | (ExpectedRupture, NoRupture)
                    | (NoRupture | ExpectedRupture, DetectedRupture)
                    | (DetectedRupture, ForceDropMeasuring)
                    | (ForceDropMeasuring, ForceCompensation)
                    | (ForceCompensation, NoRupture)
            );
        assert!(allowed, "{from:?} -> {to:?}");
    }
    assert!(visited.iter().all(|v| *v), "every state must have been visited: {visited:?}");
}

#[test]
fn every_reset_policy_and_model_runs_to_the_end_with_finite_numbers() {
    for model in [Model::KelvinVoigt, Model::MultiLayer] {
        for reset in [Reset::Frequency { hz: 6.66 }, Reset::Trace { below: 1.001e6 }, Reset::Ruptures] {
            let config = EnhanceConfig { model, reset, ..EnhanceConfig::paper() };
            for data in [constant(0.02, 1), sinusoid(0.02, 1)] {
                for out in enhance(&config, &data.samples) {
                    let numbers = [out.enhanced_n, out.error_n, out.theta[0], out.theta[1], out.cusum_n2];
                    assert!(numbers.iter().all(|x| x.is_finite()), "{model:?} {reset:?}: {out:?}");
                }
            }
        }
    }
}
