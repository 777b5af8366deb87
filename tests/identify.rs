//! `stylet identify` finds the layers of a phantom without a scenario and writes them as one; it replaces no file that is not its
//! own. `diagnose` without a scenario starts from the same layers.

mod support;

use std::fs;
use stylet::Scenario;
use support::{Scratch, stderr_text, stylet, text};

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
