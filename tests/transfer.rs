//! Promise: `stylet diagnose --transfer MODEL` names the parameter in which another group of recordings differs from the group that made the
//! model, names none for a group with the same law, and recognises another law; `stylet plan --transfer MODEL` says how many recordings of
//! another group its prediction needs.

use crate::support;

use serde_json::Value;
use std::path::{Path, PathBuf};
use support::{Scratch, stderr_text, stylet};

/// Two gels with these factors of friction, and this thickness of the first.
fn scenario(friction: f64, thickness_m: f64) -> String {
    format!(
        r#"Scenario(
    name: "two gels",
    tissue: (surface_m: 0.0, layers: [
        (thickness_m: {thickness_m}, stiffness_n_per_m: 150.0, friction_ns_per_m2: {}, puncture_n: 1.4),
        (thickness_m: 0.04, stiffness_n_per_m: 220.0, friction_ns_per_m2: {}),
    ]),
    motion: Program(start_m: -0.005, segments: [
        Move(velocity_mps: 0.004, duration_s: 7.0), Hold(duration_s: 2.0), Move(velocity_mps: -0.004, duration_s: 7.0),
    ]),
    robot: Replay, sensor: ForceTorque(noise_n: 0.01), sample_hz: 100.0,
)"#,
        9000.0 * friction,
        12000.0 * friction
    )
}

fn run(arguments: &[&str]) -> String {
    let done = stylet(arguments);
    assert!(done.status.success(), "{arguments:?}: {}", stderr_text(&done));
    String::from_utf8_lossy(&done.stdout).into_owned()
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path")
}

/// Recordings of a scenario, one per seed.
fn recordings(scratch: &Scratch, name: &str, scenario: &str, seeds: std::ops::Range<u64>) -> Vec<String> {
    let file = scratch.file(&format!("{name}.ron"), scenario);
    seeds
        .map(|seed| {
            let out = scratch.path().join(format!("{name}-{seed}"));
            run(&["run", text(&file), "--seed", &seed.to_string(), "--out", text(&out), "--quiet"]);
            text(&out.join("recording.csv")).to_owned()
        })
        .collect()
}

/// Folder of the model of three recordings.
fn model(scratch: &Scratch) -> PathBuf {
    let data = recordings(scratch, "first", &scenario(1.0, 0.012), 1..4);
    let (assumed, folder) = (scratch.path().join("first.ron"), scratch.path().join("model"));
    let mut arguments = vec!["diagnose", text(&assumed), "--out", text(&folder), "--quiet", "--data"];
    arguments.extend(data.iter().map(String::as_str));
    run(&arguments);
    folder
}

fn json(file: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(file).expect("a result")).expect("JSON")
}

fn named(transfer: &Value) -> Vec<&str> {
    let all = transfer["parameters"].as_array().expect("parameters");
    all.iter().filter(|p| p["differs"] == true).filter_map(|p| p["parameter"].as_str()).collect()
}

#[test]
fn the_parameter_that_differs_is_named_and_no_other() {
    let scratch = Scratch::new("transfer");
    let model = model(&scratch);
    let compare = |name: &str, scenario: &str| {
        let data = recordings(&scratch, name, scenario, 11..14);
        let out = scratch.path().join(format!("transfer-{name}"));
        let mut arguments = vec!["diagnose", "--transfer", text(&model), "--out", text(&out), "--data"];
        arguments.extend(data.iter().map(String::as_str));
        (run(&arguments), json(&out.join("transfer.json")))
    };
    let (terminal, same) = compare("same", &scenario(1.0, 0.012));
    assert_eq!((&same["verdict"], named(&same)), (&"same".into(), vec![]), "{same}");
    assert!(terminal.starts_with("No difference"), "{terminal}");

    let off_zero = scenario(1.0, 0.012).replace("robot:", "effects: [ForceBias(force_n: 0.3)], robot:");
    let (terminal, off) = compare("zero", &off_zero);
    assert_eq!((&off["verdict"], named(&off)), (&"same".into(), vec![]), "{off}");
    let offset_n = off["recordings"][0]["zero_offset_n"].as_f64().expect("an offset");
    assert!((offset_n - 0.3).abs() < 0.005 && terminal.contains("off zero by 0."), "{offset_n}: {terminal}");
    assert!(same["recordings"][0]["zero_offset_n"].is_null(), "{same}");

    let (terminal, less) = compare("friction", &scenario(0.7, 0.012));
    assert_eq!((&less["verdict"], named(&less)), (&"differs".into(), vec!["friction"]), "{less}");
    let friction = &less["parameters"][2];
    let (low, high) = (friction["low"].as_f64().expect("low"), friction["high"].as_f64().expect("high"));
    assert!(low < 0.7 && 0.7 < high && high < 0.85, "{friction}");
    assert!(terminal.contains("friction x 0.") && terminal.contains("no difference found"), "{terminal}");
    let error = |key: &str| less[key].as_f64().expect("an error");
    assert!(error("after_n") < 0.5 * error("before_n"), "{less}");

    let (terminal, other) = compare("thicker", &scenario(1.0, 0.019));
    assert_eq!(other["verdict"], "another_law", "{other}");
    assert!(terminal.starts_with("Another law"), "{terminal}");

    let plan = scratch.path().join("plan.json");
    let terminal = run(&["plan", "--transfer", text(&model), "--out", text(&plan)]);
    assert!(terminal.contains("within 10 % of its floor with probability"), "{terminal}");
    let plan = json(&plan);
    let choices: Vec<(u64, f64)> = plan["choices"]
        .as_array()
        .expect("choices")
        .iter()
        .map(|c| (c["insertions"].as_u64().expect("a number"), c["probability"].as_f64().expect("a number")))
        .collect();
    assert!(choices.windows(2).all(|c| c[0].0 < c[1].0 && c[0].1 <= c[1].1 + 0.02), "{plan}");
    assert!(choices[0].1 < 0.2 && plan["recommended"]["probability"].as_f64() >= Some(0.9), "{plan}");
}

#[test]
fn wrong_inputs_are_refused_with_a_remedy() {
    let scratch = Scratch::new("transfer-refused");
    let file = scratch.file("gel.ron", scenario(1.0, 0.012));
    for (arguments, part) in [
        (vec!["diagnose", "--transfer", text(&file), "--data", "b.csv"], "diagnosis.json"),
        (vec!["diagnose", "--transfer", text(&file)], "--data"),
        (vec!["diagnose", "--transfer", text(&file), text(&file)], "is no data set"),
        (vec!["plan", "--transfer", text(&file)], "diagnosis.json"),
    ] {
        let done = stylet(&arguments);
        assert_eq!(done.status.code(), Some(2), "{arguments:?}: {}", stderr_text(&done));
        assert!(stderr_text(&done).contains(part), "{arguments:?}: {}", stderr_text(&done));
    }
}
