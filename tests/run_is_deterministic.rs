//! The same scenario and seed give the same bytes in every file, also in a second process, and the same hash in `score.json`; another
//! seed gives others.

use crate::support;

use std::fs;
use support::{Scratch, scenario, stylet};

const FILES: [&str; 5] = ["recording.csv", "score.json", "scenario.ron", "figure.svg", "report.html"];

fn run(scratch: &Scratch, name: &str, extra: &[&str]) -> Vec<Vec<u8>> {
    let folder = scratch.path().join(name);
    let file = scenario("three_layer_latex_constant");
    let mut arguments =
        vec!["run", file.to_str().expect("a path"), "--out", folder.to_str().expect("a path")];
    arguments.extend(extra);
    let output = stylet(&arguments);
    assert!(output.status.success(), "{output:?}");
    FILES.iter().map(|f| fs::read(folder.join(f)).expect("a result")).collect()
}

fn hash(score: &[u8]) -> String {
    let json: serde_json::Value = serde_json::from_slice(score).expect("JSON");
    json["hash"].as_str().expect("a hash").to_owned()
}

#[test]
fn the_same_seed_gives_the_same_bytes_in_a_second_process_and_another_seed_does_not() {
    let scratch = Scratch::new("same-bytes");
    let (first, second) = (run(&scratch, "a", &[]), run(&scratch, "b", &[]));
    for (name, (a, b)) in FILES.iter().zip(first.iter().zip(&second)) {
        assert!(a == b, "{name} differs between two processes");
    }
    assert_eq!(hash(&first[1]).len(), 32);
    let other = run(&scratch, "c", &["--seed", "2"]);
    assert_ne!(hash(&first[1]), hash(&other[1]), "another seed must give other results");
}

#[test]
fn the_resolved_scenario_repeats_the_run() {
    let scratch = Scratch::new("resolved");
    let first = run(&scratch, "a", &["--seed", "5"]);
    let resolved = scratch.path().join("a/scenario.ron");
    let again = scratch.path().join("again");
    let output =
        stylet(&["run", resolved.to_str().expect("a path"), "--out", again.to_str().expect("a path")]);
    assert!(output.status.success(), "{output:?}");
    let score = fs::read(again.join("score.json")).expect("score.json");
    assert_eq!(hash(&first[1]), hash(&score));
}
