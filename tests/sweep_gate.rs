//! Promise: `stylet gate` has exit code 1 for a degraded algorithm and 0 for the shipped one with any seed; it reports changes against
//! the baseline and writes JUnit and JSON.

use crate::support;

use std::fs;
use support::{Scratch, root, stderr_text, stylet};

fn gates() -> String {
    root().join("scenarios/gates/ci.ron").to_str().expect("a path").to_owned()
}

#[test]
fn the_shipped_gates_pass_on_the_committed_baseline_and_on_ten_other_seeds() {
    let output = stylet(&["gate", &gates()]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{text}{}", stderr_text(&output));
    assert!(text.contains("No value differs"), "update the baseline with --update: {text}");
    // The bounds were set without these seeds.
    for seed in 21..=30 {
        let output = stylet(&["gate", &gates(), "--seed", &seed.to_string()]);
        assert!(output.status.success(), "seed {seed}: {}", String::from_utf8_lossy(&output.stdout));
    }
}

#[test]
fn the_gate_fails_without_cusum_and_names_the_score() {
    let scratch = Scratch::new("gate");
    // The shipped gates, over scenarios whose CUSUM is off.
    for folder in ["gates", "sweeps"] {
        fs::create_dir_all(scratch.path().join(folder)).expect("a folder");
    }
    let mut originals = Vec::new();
    for name in ["three_layer_latex_constant.ron", "three_layer_latex_sinusoidal.ron"] {
        let scenario = fs::read_to_string(root().join("scenarios").join(name)).expect("a scenario");
        // The scenario either configures the algorithm or uses its defaults.
        let off = "cusum: (enabled: false)";
        let mut worse = scenario.replace("enhance: (", &format!("enhance: ({off}, "));
        if worse == scenario {
            worse = scenario.replace("    sensor: ", &format!("    enhance: ({off}),\n    sensor: "));
        }
        assert_ne!(scenario, worse);
        scratch.file(name, worse);
        originals.push((name, scenario));
    }
    fs::copy(root().join("scenarios/sweeps/noise.ron"), scratch.path().join("sweeps/noise.ron"))
        .expect("a copy");
    let file = scratch.path().join("gates/ci.ron");
    fs::copy(gates(), &file).expect("a copy");
    let (file, junit, json) =
        (file.to_str().expect("a path"), scratch.path().join("j.xml"), scratch.path().join("j.json"));
    let output = stylet(&[
        "gate",
        file,
        "--update",
        "--junit",
        junit.to_str().expect("a path"),
        "--json",
        json.to_str().expect("a path"),
    ]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(1), "{text}{}", stderr_text(&output));
    assert!(text.contains("FAIL ruptures[0].delay_s"), "{text}");
    assert!(scratch.path().join("gates/ci.baseline.json").exists());
    let junit = fs::read_to_string(junit).expect("JUnit");
    assert!(junit.contains("<failure message=\"ruptures[0].delay_s"), "{junit}");
    let json: serde_json::Value = serde_json::from_slice(&fs::read(json).expect("JSON")).expect("JSON");
    assert!(json.as_array().is_some_and(|all| all.iter().any(|one| one["passed"] == false)));

    // The shipped algorithm differs from the baseline of the degraded one.
    for (name, scenario) in originals {
        scratch.file(name, scenario);
    }
    let output = stylet(&["gate", file]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{text}");
    let quiet = stylet(&["gate", file, "--quiet"]);
    assert!(
        quiet.status.success() && quiet.stdout.is_empty() && quiet.stderr.is_empty(),
        "{}",
        stderr_text(&quiet)
    );
    assert!(text.contains("ruptures[0].delay_s P95: ") && text.contains(" -> "), "{text}");
}

#[test]
fn invalid_gates_are_rejected_with_line_and_column() {
    let scratch = Scratch::new("bad-gates");
    let scenario = root().join("scenarios/three_layer_latex_constant.ron");
    let good = format!(
        "Gates([\n  (run: \"{}\", seeds: 4, expect: [\n    (score: \"missed\", at_most: 9.0),\n  ]),\n])",
        scenario.display()
    );
    for (from, to, words) in [
        ("\"missed\"", "\"mised\"", &["3:13", "did you mean `missed`"][..]),
        (", at_most: 9.0", "", &["3:5", "no bound"]),
        ("at_most: 9.0", "at_most: NaN", &["3:5", "finite"]),
        ("seeds: 4", "seeds: 0", &["2:", "between 1"]),
        ("seeds: 4", "seeds: 4, sweep: \"x.ron\"", &["2:3", "one of `run` and `sweep`"]),
    ] {
        let file = scratch.file("g.ron", good.replacen(from, to, 1));
        let output = stylet(&["gate", file.to_str().expect("a path")]);
        assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
        for word in words {
            assert!(stderr_text(&output).contains(word), "{to} lacks {word}: {}", stderr_text(&output));
        }
    }
}
