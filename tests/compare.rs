//! Promise: `stylet compare` runs several algorithms on the same insertions and writes the table as a page and as `compare.json`, with
//! the same bytes for any number of threads.

use crate::support;

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use support::{Scratch, root, stderr_text, stylet};

fn row(name: &str) -> String {
    root().join("scenarios/compare").join(name).to_str().expect("a path").to_owned()
}

fn rows(folder: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join("compare.json")).expect("compare.json");
    serde_json::from_str(&text).expect("a list of rows")
}

fn compare(scratch: &Scratch, name: &str, arguments: &[&str]) -> Vec<Value> {
    let folder = scratch.path().join(name);
    let mut all = vec!["compare", "--quiet", "--out", folder.to_str().expect("a path")];
    all.extend(arguments);
    let output = stylet(&all);
    assert!(output.status.success(), "{}", stderr_text(&output));
    rows(&folder)
}

#[test]
fn stylet_detects_every_rupture_of_every_row_and_the_paper_algorithm_does_not() {
    let scratch = Scratch::new("compare-rows");
    let mut files: Vec<PathBuf> = std::fs::read_dir(root().join("scenarios/compare"))
        .expect("the folder")
        .map(|entry| entry.expect("an entry").path())
        .collect();
    files.sort();
    let mut arguments: Vec<&str> = files.iter().filter_map(|f| f.to_str()).collect();
    arguments.extend(["--seeds", "3"]);
    let table = compare(&scratch, "all", &arguments);
    assert_eq!(table.len(), 2 * files.len());
    assert!(files.len() >= 16, "the rows of docs/explanation/enhancer_accuracy.md");
    let errors = |r: &Value| r["missed"].as_u64().expect("missed") + r["false"].as_u64().expect("false");
    let (stylet_rows, paper): (Vec<&Value>, Vec<&Value>) =
        table.iter().partition(|r| r["algorithm"] == "Stylet");
    for r in &stylet_rows {
        assert_eq!((r["ruptures"].as_u64(), errors(r)), (Some(9), 0), "{r}");
        for k in r["stiffness_error"].as_array().expect("layers") {
            assert!(k.as_f64().expect("an estimate") < 0.1, "{r}");
        }
        assert!(r["coverage"]["tip_force"].as_f64().expect("a band") > 0.85, "{r}");
    }
    assert!(
        paper.iter().map(|r| errors(r)).sum::<u64>() > 50,
        "the rows include failures of the paper's algorithm"
    );
    for pair in table.chunks_exact(2) {
        let off = |r: &Value| r["enhancement_rms_relative"].as_f64().expect("a number");
        assert!(off(&pair[1]) < off(&pair[0]), "{pair:?}");
    }
}

#[test]
fn a_row_has_errors_delays_and_estimates_with_intervals() {
    let scratch = Scratch::new("compare-fields");
    let table = compare(&scratch, "fields", &[&row("03_constant_high_noise.ron"), "--seeds", "6"]);
    for r in &table {
        assert_eq!(r["scenario"], "constant, 0.1 N");
        let [value, low, high] = [0, 1, 2].map(|i| r["errors_per_rupture"][i].as_f64().expect("a number"));
        assert!(low <= value && value <= high && low >= 0.0, "{r}");
        let errors = (r["missed"].as_u64().expect("a count") + r["false"].as_u64().expect("a count")) as f64;
        assert!((value - errors / r["ruptures"].as_f64().expect("a count")).abs() < 1e-12, "{r}");
    }
    let stylet_row = &table[1];
    let (median, p95) = (stylet_row["delay_s"]["median"].as_f64(), stylet_row["delay_s"]["p95"].as_f64());
    assert!(median.expect("a delay") <= p95.expect("a delay") && p95.expect("a delay") < 0.05);
    for (k, ends) in stylet_row["stiffness_error"]
        .as_array()
        .expect("layers")
        .iter()
        .zip(stylet_row["stiffness_error_interval"].as_array().expect("layers"))
    {
        let [low, high] = [0, 1].map(|i| ends[i].as_f64().expect("an end"));
        assert!((low..=high).contains(&k.as_f64().expect("a median")), "{stylet_row}");
    }
}

#[test]
fn one_two_and_three_threads_give_the_same_bytes() {
    let scratch = Scratch::new("compare-threads");
    let files = |threads: &str| {
        let folder = scratch.path().join(threads);
        let output = Command::new(env!("CARGO_BIN_EXE_stylet"))
            .args(["compare", &row("08_weak_drops_high_noise.ron"), "--world", "rich", "--hide", "one"])
            .args(["--seeds", "5", "--quiet", "--out"])
            .arg(&folder)
            .env("RAYON_NUM_THREADS", threads)
            .output()
            .expect("the binary starts");
        assert!(output.status.success(), "{}", stderr_text(&output));
        ["compare.json", "report.html"].map(|f| std::fs::read(folder.join(f)).expect("a result"))
    };
    let one = files("1");
    assert!(one == files("2") && one == files("3"));
    let table = rows(&scratch.path().join("1"));
    assert_eq!(table.len(), 4);
    assert!(table[2]["scenario"].as_str().expect("a name").contains("rich world"));
    assert!(table[2]["ruptures"].as_u64().expect("a count") >= 10);
}

#[test]
fn invalid_comparisons_are_reported() {
    for (arguments, expected) in [
        (vec!["compare"], "required"),
        (vec!["compare", "--world", "poor"], "there is no `poor`; there are plain, rich"),
        (
            vec!["compare", "--world", "rich", "--hide", "nothing"],
            "there is no `nothing`; there are clean, one",
        ),
        (vec!["compare", "nowhere.ron"], "nowhere.ron"),
        (vec!["compare", "nowhere.ron", "--algorithms", "Ours"], "Ours"),
    ] {
        let output = stylet(&arguments);
        assert!(
            !output.status.success() && stderr_text(&output).contains(expected),
            "{}",
            stderr_text(&output)
        );
    }
}
