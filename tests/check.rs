//! `stylet check` says before a diagnosis what recordings can show, and `diagnose` labels what they determined.

use crate::support;

use std::fs;
use support::{Scratch, stderr_text, stylet, text};

/// Two gels, the second without a puncture force, pierced along `segments`.
fn scenario(segments: &str) -> String {
    format!(
        "Scenario(name: \"two gels\", tissue: (layers: [
            (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
            (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0)]),
            motion: Program(start_m: -0.005, segments: [{segments}]), sensor: ForceTorque(noise_n: 0.01, ar1: 0.5))"
    )
}

const ONE_SPEED: &str = "Move(velocity_mps: 0.002, duration_s: 20.0)";
const VARIED: &str = "Move(velocity_mps: 0.002, duration_s: 15.0), Hold(duration_s: 3.0),
    Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 8.0), Move(velocity_mps: -0.004, duration_s: 5.0)";

/// Scenario and recording of these segments.
fn recorded(scratch: &Scratch, name: &str, segments: &str) -> (String, String) {
    let assumed = text(&scratch.file(&format!("{name}.ron"), scenario(segments)));
    let out = text(&scratch.path().join(name));
    let output = stylet(&["run", &assumed, "--quiet", "--out", &out]);
    assert!(output.status.success(), "{}", stderr_text(&output));
    (assumed, format!("{out}/recording.csv"))
}

fn label(file: &str, layer: u64, name: &str) -> (String, String) {
    let json: serde_json::Value = serde_json::from_str(&fs::read_to_string(file).expect(file)).expect("JSON");
    let parameters = json["parameters"].as_array().expect("parameters");
    let is_it = |p: &&serde_json::Value| p["layer"] == layer && p["name"] == name && p["effect"].is_null();
    let p = parameters.iter().find(is_it).expect("the parameter");
    let of = |key: &str| p[key].as_str().unwrap_or_default().to_owned();
    (of("label"), of("trades_with"))
}

#[test]
fn one_constant_speed_leaves_stiffness_and_friction_trading_and_check_and_diagnose_say_so() {
    let scratch = Scratch::new("check-one-speed");
    let (assumed, recording) = recorded(&scratch, "one", ONE_SPEED);
    let out = text(&scratch.path().join("out"));
    for command in ["check", "diagnose"] {
        let out = format!("{out}-{command}");
        let output = stylet(&[command, &assumed, "--data", &recording, "--out", &out]);
        assert!(output.status.success(), "{}", stderr_text(&output));
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("trades with friction_ns_per_m2 of layer 2"), "{said}");
        let file = format!("{out}/{}", if command == "check" { "check.json" } else { "diagnosis.json" });
        assert_eq!(
            label(&file, 2, "stiffness_n_per_m"),
            ("trades_with".to_owned(), "friction_ns_per_m2 of layer 2".to_owned())
        );
        if command == "diagnose" {
            assert!(said.contains("grade C: one recording"), "{said}");
        }
        assert_eq!(label(&file, 1, "stiffness_n_per_m").0, "determined");
        assert_eq!(label(&file, 2, "thickness_m").0, "not_identifiable");
    }
}

#[test]
fn a_varied_speed_determines_both_and_shows_more_effects() {
    let scratch = Scratch::new("check-varied");
    let hidden = |name: &str, segments: &str| {
        let (assumed, recording) = recorded(&scratch, name, segments);
        let out = text(&scratch.path().join(format!("{name}-out")));
        let output = stylet(&["check", &assumed, "--data", &recording, "--out", &out]);
        assert!(output.status.success(), "{}", stderr_text(&output));
        let file = format!("{out}/check.json");
        let json: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(&file).expect("a file")).expect("JSON");
        let effects = json["effects"].as_array().expect("effects").clone();
        let hidden = |id: &str| effects.iter().any(|e| e["effect"] == id && e["visible"] == false);
        (file, ["coulomb_friction", "stress_relaxation", "power_law_friction"].map(hidden))
    };
    let (file, of_varied) = hidden("varied", VARIED);
    for parameter in ["stiffness_n_per_m", "friction_ns_per_m2"] {
        assert_eq!(label(&file, 2, parameter).0, "determined", "{parameter}");
    }
    assert_eq!(of_varied, [false; 3]);
    let (_, of_one) = hidden("one", ONE_SPEED);
    assert!(of_one[0] && of_one[2], "{of_one:?}");
}

#[test]
fn check_reports_recordings_that_are_no_insertion_and_diagnose_refuses_them_unless_forced() {
    let scratch = Scratch::new("check-unusable");
    let (assumed, recording) = recorded(&scratch, "one", ONE_SPEED);
    let changed = |name: &str, change: fn([f64; 3]) -> [f64; 3]| {
        let csv = fs::read_to_string(&recording).expect("a recording");
        let rows = csv.lines().skip(1).map(|line| {
            let mut columns = line.split(',').map(|x| x.parse::<f64>().expect("a number"));
            let row = std::array::from_fn(|_| columns.next().expect("a column"));
            let [t, z, f] = change(row);
            format!("{t},{z},{f}\n")
        });
        text(&scratch.file(name, format!("time_s,position_m,force_n\n{}", rows.collect::<String>())))
    };
    let cases = [
        (changed("mm.csv", |[t, z, f]| [t, 1e3 * z, f]), "millimetres", 2),
        (changed("air.csv", |[t, z, _]| [t, z, 0.01 * (1e3 * t).sin()]), "never touches", 1),
    ];
    for (file, reason, code) in cases {
        let out = format!("{file}-out");
        let output = stylet(&["check", &assumed, "--data", &file, "--out", &out]);
        assert_eq!(output.status.code(), Some(1), "{}", stderr_text(&output));
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("unusable") && said.contains(reason), "{said}");
        assert!(fs::exists(format!("{out}/report.html")).expect("a folder"));
        let out = format!("{file}-diagnosis");
        let arguments = ["diagnose", &assumed, "--data", &file, "--out", &out];
        let refused = stylet(&arguments);
        assert_eq!(refused.status.code(), Some(code), "{}", stderr_text(&refused));
        assert!(!fs::exists(&out).expect("a folder"));
        let forced = stylet(&[&arguments[..], &["--force"]].concat());
        assert!(forced.status.success(), "{}", stderr_text(&forced));
        let json = fs::read_to_string(format!("{out}/diagnosis.json")).expect("a file");
        let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        assert_eq!(
            (&json["agrees"], &json["findings"][0]["kind"]),
            (&serde_json::json!(false), &serde_json::json!("unusable"))
        );
    }
}

#[test]
fn two_sessions_of_one_tissue_are_one_model_and_a_softer_layer_is_found() {
    let scratch = Scratch::new("check-sessions");
    let assumed = text(&scratch.file("assumed.ron", scenario(VARIED)));
    let softer = scenario(VARIED).replace("stiffness_n_per_m: 90.0", "stiffness_n_per_m: 88.0");
    let softer = text(&scratch.file("softer.ron", softer));
    let session = |name: &str, real: &str, seeds: [&str; 2]| {
        let data = seeds.map(|seed| {
            let out = text(&scratch.path().join(format!("{name}-{seed}")));
            let output = stylet(&["run", real, "--quiet", "--seed", seed, "--out", &out]);
            assert!(output.status.success(), "{}", stderr_text(&output));
            format!("{out}/recording.csv")
        });
        let out = text(&scratch.path().join(name));
        let output = stylet(&["diagnose", &assumed, "--data", &data[0], &data[1], "--quiet", "--out", &out]);
        assert!(output.status.success(), "{}", stderr_text(&output));
        out
    };
    let monday = session("monday", &assumed, ["1", "2"]);
    let compared = |other: &str| {
        let out = text(&scratch.path().join("compared"));
        let output = stylet(&["compare-models", &monday, other, "--out", &out]);
        assert!(output.status.success(), "{}", stderr_text(&output));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let said = compared(&session("tuesday", &assumed, ["3", "4"]));
    assert!(said.starts_with("Both are one model"), "{said}");
    let said = compared(&session("wednesday", &softer, ["5", "6"]));
    assert!(said.starts_with("The models differ: they differ in stiffness_n_per_m of layer 2."), "{said}");
}

#[test]
fn recordings_of_different_stiffness_are_found_to_differ_and_those_of_one_are_not() {
    let scratch = Scratch::new("check-by-recording");
    let (assumed, first) = recorded(&scratch, "first", VARIED);
    let warning = |name: &str, stiffness: &str| {
        let file = text(&scratch.file(
            &format!("{name}.ron"),
            scenario(VARIED).replace("stiffness_n_per_m: 90.0", &format!("stiffness_n_per_m: {stiffness}")),
        ));
        let out = text(&scratch.path().join(name));
        let run = stylet(&["run", &file, "--seed", "7", "--quiet", "--out", &out]);
        assert!(run.status.success(), "{}", stderr_text(&run));
        let second = format!("{out}/recording.csv");
        let found =
            stylet(&["diagnose", &assumed, "--data", &first, &second, "--out", &format!("{out}-diagnosis")]);
        assert!(found.status.success(), "{}", stderr_text(&found));
        String::from_utf8_lossy(&found.stdout)
            .contains("the recordings differ in stiffness_n_per_m of layer 2")
    };
    assert_eq!((warning("one", "90.0"), warning("other", "93.0")), (false, true));
}
