//! Promise: a hold, a reversal, a sudden change of the commanded speed and a rippled speed are no ruptures, and true ruptures are
//! still detected.

use crate::support::{detections, enhance, insertion};
use stylet_core::EnhanceConfig;
use stylet_tissue::Tissue;

/// Runs a velocity profile and returns true and detected rupture times.
fn run(duration_s: f64, seed: u64, velocity_mps: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
    let data = insertion(&Tissue::three_gels(), -0.005, duration_s, 200.0, 0.01, seed, velocity_mps);
    let found = detections(&enhance(&EnhanceConfig::paper(), &data.samples));
    (data.ruptures.iter().map(|r| r.time_s).collect(), found)
}

fn assert_same(name: &str, truth: &[f64], found: &[f64]) {
    let matches = truth.len() == found.len() && truth.iter().zip(found).all(|(t, f)| (f - t).abs() < 0.1);
    assert!(matches, "{name}: true {truth:?}, found {found:?}");
}

#[test]
fn a_hold_is_not_a_rupture() {
    for seed in 0..5 {
        let (truth, found) = run(60.0, seed, |t| if (8.0..13.0).contains(&t) { 0.0 } else { 0.0023 });
        assert_eq!(truth.len(), 3);
        assert_same("hold", &truth, &found);
    }
}

#[test]
fn reversal_and_retraction_are_not_ruptures() {
    for seed in 0..5 {
        let (truth, found) = run(30.0, seed, |t| if t < 20.0 { 0.0023 } else { -0.004 });
        assert_eq!(truth.len(), 1);
        assert_same("reversal", &truth, &found);
    }
}

#[test]
fn moving_back_and_forth_through_the_same_tissue_is_not_a_rupture() {
    for seed in 0..5 {
        let (truth, found) = run(60.0, seed, |t| if (10.0..14.0).contains(&t) { -0.002 } else { 0.0025 });
        assert_eq!(truth.len(), 3);
        assert_same("back and forth", &truth, &found);
    }
}

#[test]
fn a_sudden_change_of_the_commanded_speed_is_not_a_rupture() {
    for seed in 0..5 {
        for factor in [0.5, 2.0] {
            let (truth, found) =
                run(60.0, seed, |t| if (20.0..26.0).contains(&t) { 0.0023 * factor } else { 0.0023 });
            assert_eq!(truth.len(), 3);
            assert_same("speed change", &truth, &found);
        }
    }
}

#[test]
fn a_rippled_speed_is_not_a_rupture() {
    for seed in 0..5 {
        let (truth, found) = run(50.0, seed, |t| 0.0023 + 0.001 * (std::f64::consts::TAU * 0.5 * t).sin());
        assert_eq!(truth.len(), 3);
        assert_same("ripple", &truth, &found);
    }
}
