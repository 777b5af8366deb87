//! `stylet identify` finds the layers of a phantom without a scenario and writes them as one; it replaces no file that is not its
//! own. `diagnose` without a scenario starts from the same layers.

use crate::support;

use std::fs;
use stylet::Scenario;
use support::{Scratch, stderr_text, stylet, text};

#[test]
fn the_space_behind_the_tissue_is_no_layer_and_dry_friction_is_named_whatever_layers_are_assumed() {
    let scratch = Scratch::new("behind");
    let scenario = |layers: &str, effects: &str| {
        format!(
            "Scenario(name: \"two gels\", tissue: (layers: [{layers}]), {effects} motion: Program(start_m: -0.005, segments: [
                Move(velocity_mps: 0.002, duration_s: 15.0), Hold(duration_s: 3.0),
                Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 15.0),
                Move(velocity_mps: -0.004, duration_s: 5.0)]), sensor: ForceTorque(noise_n: 0.01, ar1: 0.5))"
        )
    };
    let layer = |thickness_m: f64, stiffness: f64, friction: f64, puncture: &str| {
        format!(
            "(thickness_m: {thickness_m:?}, stiffness_n_per_m: {stiffness:?}, friction_ns_per_m2: {friction:?}{puncture}),"
        )
    };
    let two = layer(0.02, 50.0, 9e3, ", puncture_n: 0.8") + &layer(0.04, 90.0, 14e3, "");
    let three = two.clone() + &layer(0.03, 60.0, 10e3, "");
    let real = scratch.file("real.ron", scenario(&two, "effects: [CoulombFriction(c_n_per_m: 3.0)],"));
    let recordings: Vec<String> = ["1", "2"]
        .iter()
        .map(|seed| {
            let out = text(&scratch.path().join(seed));
            let output = stylet(&["run", &text(&real), "--quiet", "--seed", seed, "--out", &out]);
            assert!(output.status.success(), "{}", stderr_text(&output));
            format!("{out}/recording.csv")
        })
        .collect();
    let out = text(&scratch.path().join("out"));
    let said = |arguments: &[&str]| {
        let more = ["--data", &recordings[0], &recordings[1], "--out", &out];
        let output = stylet(&[arguments, &more].concat());
        assert!(output.status.success(), "{}", stderr_text(&output));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let found = said(&["identify"]);
    assert!(found.contains("2 layers,") && found.contains("lacks coulomb_friction."), "{found}");
    let assumed = text(&scratch.file("assumed.ron", scenario(&three, "")));
    let found = said(&["diagnose", &assumed]);
    assert!(found.contains("the recordings show 2 layers, not 3"), "{found}");
    assert!(found.contains("lacks coulomb_friction."), "{found}");
}

#[test]
fn the_layers_of_a_simulated_insertion_are_found_without_a_scenario() {
    let scratch = Scratch::new("identify");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/three_layers.ron");
    let made = scratch.path().join("made");
    let output = stylet(&["run", source, "--quiet", "--out", &text(&made)]);
    assert!(output.status.success(), "{}", stderr_text(&output));
    let recording = text(&made.join("recording.csv"));
    let phantom = scratch.path().join("phantom.ron");

    let output = stylet(&["identify", "--data", &recording, "--out", &text(&phantom)]);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", stderr_text(&output));
    assert!(printed.contains("3 layers, surface at"), "{printed}");
    let (found, truth) =
        (Scenario::load(&phantom).expect("a scenario"), Scenario::load(source.as_ref()).expect("a scenario"));
    for k in 0..3 {
        let (is, was) = (&found.tissue.layers[k], &truth.tissue.layers[k]);
        assert!((found.tissue.front_m(k) - truth.tissue.front_m(k)).abs() < 3e-4, "layer {}", k + 1);
        assert!((is.stiffness_n_per_m / was.stiffness_n_per_m - 1.0).abs() < 0.05, "layer {}", k + 1);
    }
    // The same again replaces its own file, and no other.
    assert!(
        stylet(&["identify", "--quiet", "--data", &recording, "--out", &text(&phantom)]).status.success()
    );
    let other = scratch.file("notes.ron", "mine");
    let output = stylet(&["identify", "--data", &recording, "--out", &text(&other)]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(fs::read_to_string(&other).expect("unchanged"), "mine");

    let folder = text(&scratch.path().join("diagnosis"));
    let output = stylet(&["diagnose", "--data", &recording, "--out", &folder]);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", stderr_text(&output));
    assert!(printed.contains("No scenario was given"), "{printed}");
    // The command of the report repeats it.
    let assumed = format!("{folder}/assumed.ron");
    let again =
        stylet(&["diagnose", &assumed, "--data", &recording, "--quiet", "--out", &format!("{folder}-again")]);
    assert!(again.status.success(), "{}", stderr_text(&again));
}
