//! Promise: on measured repeated insertions `stylet diagnose` reports what the base law lacks, no fault
//! that the instrument checks exclude, and predicts held-out insertions at the repeatability floor.
//!
//! The recordings stay outside the repository; tests without them print that they were skipped.

use crate::support;

use std::path::Path;
use std::sync::OnceLock;
use support::measured::measured;
use support::{Scratch, root, stderr_text};

struct DiagnoseOutput {
    json: serde_json::Value,
    extended: Option<String>,
    page: String,
    stdout: String,
}

fn diagnose(folder: &Path, set: &str, threads: &str) -> DiagnoseOutput {
    let scratch = Scratch::new(&format!("repeats-{set}-{threads}"));
    diagnose_file(folder, &root().join("scenarios/measured").join(format!("{set}.ron")), threads, &scratch)
}

fn diagnose_file(folder: &Path, set: &Path, threads: &str, scratch: &Scratch) -> DiagnoseOutput {
    let out = scratch.path().join("out");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_stylet"))
        .args(["diagnose", set.to_str().expect("a path"), "--out", out.to_str().expect("a path")])
        .env("STYLET_MEASURED", folder)
        .env("RAYON_NUM_THREADS", threads)
        .output()
        .expect("stylet runs");
    assert!(output.status.success(), "{}", stderr_text(&output));
    let read = |name: &str| std::fs::read_to_string(out.join(name));
    DiagnoseOutput {
        json: serde_json::from_str(&read("diagnosis.json").expect("results")).expect("JSON"),
        extended: read("extended.ron").ok(),
        page: read("report.html").expect("a report"),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
    }
}

/// Diagnosis of the fifteen insertions into skin on muscle, shared by all tests.
fn skin_on_muscle(test: &str) -> Option<&'static DiagnoseOutput> {
    static DONE: OnceLock<DiagnoseOutput> = OnceLock::new();
    let folder = measured(test, "needle_phantom")?;
    Some(DONE.get_or_init(|| diagnose(&folder, "skin_on_muscle", "2")))
}

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn causes(json: &serde_json::Value) -> Vec<&str> {
    json["causes"].as_array().expect("causes").iter().filter_map(|c| c["effect"].as_str()).collect()
}

/// The only promise on sets that is short enough for continuous integration.
#[test]
#[ignore = "minutes; tests/measured_sets.sh runs it"]
fn three_insertions_predict_each_other_at_the_floor() {
    let Some(folder) = measured("three_insertions_predict_each_other_at_the_floor", "needle_phantom") else {
        return;
    };
    let scratch = Scratch::new("three-insertions");
    let whole = std::fs::read_to_string(root().join("scenarios/measured/muscle.ron")).expect("the set");
    let run = |k: u8| format!("\"needle_phantom/muscle_2mmps_run{k}.csv\"");
    let three = whole.replace("\"needle_phantom/muscle_2mmps_*.csv\"", &[1, 2, 3].map(run).join(", "));
    assert_ne!(whole, three);
    let set = scratch.path().join("three.ron");
    std::fs::write(&set, three).expect("written");
    let output = diagnose_file(&folder, &set, "2", &scratch);
    let mean = &output.json["repeats"]["mean"];
    assert_eq!(output.json["repeats"]["recordings"].as_array().map(Vec::len), Some(3));
    assert!((number(&mean["floor_n"]) - 0.267).abs() < 0.005, "{mean}");
    assert!(number(&mean["model_n"]) <= number(&mean["floor_n"]), "{mean}");
}

#[test]
#[ignore = "minutes; tests/measured_sets.sh runs it"]
fn held_out_insertions_are_predicted_near_the_floor() {
    let Some(output) = skin_on_muscle("held_out_insertions_are_predicted_near_the_floor") else {
        return;
    };
    println!("{}", output.stdout);
    let mean = &output.json["repeats"]["mean"];
    assert_eq!(output.json["repeats"]["recordings"].as_array().map(Vec::len), Some(15));
    assert_eq!(output.json["repeats"]["speeds"].as_array().map(Vec::len), Some(3));
    // The floor depends on the data only: guards against scoring other samples.
    assert!((number(&mean["floor_n"]) - 0.247).abs() < 0.005, "{mean}");
    assert!(number(&mean["with_discrepancy_n"]) <= 0.29, "{mean}");
    assert!(number(&mean["base_n"]) > 0.5, "{mean}");
    assert!((0.80..=0.97).contains(&number(&mean["coverage"])), "{mean}");
    assert!(number(&mean["held_out_speed_n"]) <= 0.35, "{mean}");
}

#[test]
#[ignore = "minutes; tests/measured_sets.sh runs it"]
fn the_causes_exclude_instrument_faults() {
    let Some(output) = skin_on_muscle("the_causes_exclude_instrument_faults") else {
        return;
    };
    assert_eq!(output.json["verdict"], "named");
    let named = causes(&output.json);
    // Nonlinear spring, relaxation, creep and nearly rate-independent friction are parameters of one
    // effect.
    for effect in ["shaft_slip", "delayed_puncture", "release_depth"] {
        assert!(named.contains(&effect), "{effect} is missing: {named:?}");
    }
    let ablation = output.json["repeats"]["ablation"].as_array().expect("a list");
    for part in ["shaft_slip: nonlinear spring", "shaft_slip: relaxation"] {
        let part = ablation.iter().find(|b| b["step"] == part).expect("an ablated term");
        assert_eq!(part["kept"], true, "{part}");
        assert!(number(&part["without_n"]) > number(&part["held_out_n"]), "{part}");
    }
    let excluded: Vec<&str> = output.json["repeats"]["instrument"]["excluded"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|e| e["effect"].as_str())
        .collect();
    for effect in ["force_gain", "force_bias", "force_drift", "periodic_interference"] {
        assert!(excluded.contains(&effect) && !named.contains(&effect), "{effect}: {excluded:?}, {named:?}");
    }
    // Rate exponent of the plateau plus one over the slip exponent; viscous friction would have 1.
    let slip = output.json["causes"].as_array().into_iter().flatten().find(|c| c["effect"] == "shaft_slip");
    let of = |path: &str| number(&slip.expect("named")["parameters"][path]["value"]);
    let plateau = of("0.rate") + 1.0 / of("0.exponent");
    println!("plateau: {plateau:.3}");
    assert!(plateau.abs() < 0.5, "{plateau}");
    let repeats = &output.json["repeats"];
    assert!(number(&repeats["starts"][0]) >= 8.0, "{}", repeats["starts"]);
    assert!(output.stdout.contains("starts of the fit agree") && output.page.contains("starts agree"));
    let parts = repeats["phases"].as_array().expect("a list");
    assert_eq!(parts.len(), 5, "{parts:?}");
}

#[test]
#[ignore = "minutes; tests/measured_sets.sh runs it"]
fn data_quality_reports_rates_gaps_and_strokes() {
    let Some(output) = skin_on_muscle("data_quality_reports_rates_gaps_and_strokes") else {
        return;
    };
    let remarks: Vec<&serde_json::Value> = output.json["data_quality"]
        .as_array()
        .expect("remarks")
        .iter()
        .filter(|q| q["recording"].as_str().is_some_and(|r| r.starts_with("all at")))
        .collect();
    let of = |what: &str| remarks.iter().map(|q| number(&q["numbers"][what])).collect::<Vec<f64>>();
    for (found, wanted) in of("sample_hz").iter().zip([99.4, 100.0, 90.5]) {
        assert!((found - wanted).abs() < 0.3, "{found} against {wanted}");
    }
    for (found, wanted) in of("stroke_m").iter().zip([0.0250, 0.0248, 0.0243]) {
        assert!((found - wanted).abs() < 6e-5, "{found} against {wanted}");
    }
    assert!(of("largest_gap_s").iter().any(|gap| (0.06..0.075).contains(gap)));
    assert!(output.page.contains("largest gap"));
}

#[test]
#[ignore = "minutes; tests/measured_sets.sh runs it"]
fn the_extended_scenario_can_be_simulated() {
    let Some(output) = skin_on_muscle("the_extended_scenario_can_be_simulated") else { return };
    let scratch = Scratch::new("repeats-extended");
    let file = scratch.file("extended.ron", output.extended.as_deref().expect("an extended scenario"));
    let out = scratch.path().join("run");
    let output =
        support::stylet(&["run", file.to_str().expect("a path"), "--out", out.to_str().expect("a path")]);
    assert!(output.status.success(), "{}", stderr_text(&output));
    let score: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("score.json")).expect("scores"))
            .expect("JSON");
    let depth = number(&score["ruptures"][0]["true_m"]);
    assert!(score["ruptures"].as_array().is_some_and(|r| r.len() == 2), "{score}");
    assert!(depth.is_nan() || (0.013..0.018).contains(&depth), "the skin ruptures at {depth} m");
}

#[test]
#[ignore = "minutes; tests/measured_sets.sh runs it"]
fn the_skin_alone_is_predicted_within_a_fifth_of_the_floor() {
    let name = "the_skin_alone_is_predicted_within_a_fifth_of_the_floor";
    let Some(folder) = measured(name, "needle_phantom") else { return };
    let (one, two) = (diagnose(&folder, "skin", "1"), diagnose(&folder, "skin", "2"));
    assert_eq!(one.json, two.json);
    assert_eq!(one.page, two.page);
    let mean = &one.json["repeats"]["mean"];
    let ratio = number(&mean["with_discrepancy_n"]) / number(&mean["floor_n"]);
    println!("skin alone: {ratio:.3} times the floor");
    assert!(ratio <= 1.2, "{mean}");
    // One speed cannot identify rate effects.
    assert!(
        one.json["not_identifiable"].as_array().expect("a list").iter().any(|e| e == "power_law_friction")
    );
}

#[test]
fn indented_tissue_relaxes_without_punctures() {
    let name = "indented_tissue_relaxes_without_punctures";
    let Some(folder) = measured(name, "indentation_relaxation") else { return };
    let output = diagnose(&folder, "indentation_relaxation", "2");
    println!("{}", output.stdout);
    let named = causes(&output.json);
    assert!(named.contains(&"stress_relaxation"), "{named:?}");
    assert_eq!(output.json["specimens"]["punctured"].as_array().map(Vec::len), Some(0));
    assert!(number(&output.json["specimens"]["used"]) >= 140.0);
    let relaxation = output.json["causes"]
        .as_array()
        .into_iter()
        .flatten()
        .find(|c| c["effect"] == "stress_relaxation")
        .cloned();
    let relaxation = relaxation.expect("named");
    for (term, range) in [(0, 0.1..1.5), (1, 1.5..10.0)] {
        let tau = &relaxation["parameters"][format!("terms.{term}.time_constant_s")];
        let (low, value, high) = (number(&tau["low"]), number(&tau["value"]), number(&tau["high"]));
        assert!(low < value && value < high && range.contains(&value), "{tau}");
        assert!(high / low < 1.5, "the interval is narrow: {tau}");
    }
    assert!(
        number(&output.json["gain"]["rmse_after_n"]) < 0.2 * number(&output.json["gain"]["rmse_before_n"])
    );
}
