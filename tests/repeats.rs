//! Promise: `stylet diagnose --repeats` answers as a diagnosis of single recordings: wrong numbers of the scenario are named, and no cause;
//! a hidden effect is named; the extended model needs no other effect.

use crate::support;

use support::{Scratch, stderr_text, stylet, text};

fn scenario(friction: f64, effects: &str, surface_m: f64) -> String {
    format!(
        "Scenario(name: \"two gels\", sample_hz: 100.0, tissue: (surface_m: {surface_m:?}, layers: [
            (thickness_m: 0.014, stiffness_n_per_m: 80.0, friction_ns_per_m2: {friction:?}, puncture_n: 0.8),
            (thickness_m: 0.05, stiffness_n_per_m: 110.0, friction_ns_per_m2: 8e3)]), effects: [{effects}],
        motion: Program(start_m: -0.005, segments: [Move(velocity_mps: 0.003, duration_s: 7.0), Hold(duration_s: 3.0),
            Ripple(velocity_mps: 0.003, amplitude_mps: 0.0009, frequency_hz: 0.5, duration_s: 5.0),
            Move(velocity_mps: -0.006, duration_s: 4.0)]), sensor: ForceTorque(noise_n: 0.01, ar1: 0.3))"
    )
}

#[test]
fn repeats_are_diagnosed_as_single_recordings_are() {
    let scratch = Scratch::new("repeats");
    let recordings = |name: &str, effects: &str| -> Vec<String> {
        [-5e-5, 0.0, 1e-4, 4e-5]
            .iter()
            .enumerate()
            .map(|(k, surface_m)| {
                let file = scratch.file(&format!("{name}{k}.ron"), scenario(6e3, effects, *surface_m));
                let out = text(&scratch.path().join(format!("{name}{k}")));
                let output =
                    stylet(&["run", &text(&file), "--quiet", "--seed", &k.to_string(), "--out", &out]);
                assert!(output.status.success(), "{}", stderr_text(&output));
                format!("{out}/recording.csv")
            })
            .collect()
    };
    let said = |scenario: &str, recordings: &[String], out: &str| {
        let mut arguments = vec!["diagnose", scenario, "--repeats", "--out", out, "--data"];
        arguments.extend(recordings.iter().map(String::as_str));
        let output = stylet(&arguments);
        assert!(output.status.success(), "{}", stderr_text(&output));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let out = |name: &str| text(&scratch.path().join(name));

    let wrong = text(&scratch.file("wrong.ron", scenario(18e3, "", 0.0)));
    let found = said(&wrong, &recordings("clean", ""), &out("1"));
    assert!(
        found.starts_with("No effect of the library is missing, but numbers of the scenario are wrong"),
        "{found}"
    );
    assert!(found.contains("the assumed friction of layer 1 is 3 times too large"), "{found}");

    let assumed = text(&scratch.file("assumed.ron", scenario(6e3, "", 0.0)));
    let recordings = recordings("dry", "CoulombFriction(c_n_per_m: 4.0)");
    let found = said(&assumed, &recordings, &out("2"));
    assert!(found.starts_with("The simulation lacks coulomb_friction."), "{found}");
    let again = said(&format!("{}/extended.ron", out("2")), &recordings, &out("3"));
    assert!(again.starts_with("The assumed model predicts new insertions as well"), "{again}");
}
