//! Promise: the referee shares nothing with what it judges. Of this project's crates it depends, directly or through others, on
//! those that hold columns and statistics alone.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// Rooms that the referee may use.
const ALLOWED: [&str; 2] = ["stylet-record", "stylet-stats"];

#[test]
fn the_referee_depends_on_none_of_the_engines() {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let rustc = Command::new("rustc").arg("-vV").output().expect("rustc -vV");
    let told = String::from_utf8_lossy(&rustc.stdout).into_owned();
    let host = told.lines().find_map(|l| l.strip_prefix("host: ")).expect("a host");
    let output = Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--locked", "--filter-platform", host, "--manifest-path"])
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"))
        .output()
        .expect("cargo metadata");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let meta: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let name_of: BTreeMap<&str, &str> = meta["packages"]
        .as_array()
        .expect("packages")
        .iter()
        .filter_map(|p| Some((p["id"].as_str()?, p["name"].as_str()?)))
        .collect();
    // Every kind of dependency counts: normal, build and those of the tests.
    let mut needs: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for node in meta["resolve"]["nodes"].as_array().expect("nodes") {
        let deps = node["deps"].as_array().expect("deps").iter().filter_map(|d| d["pkg"].as_str());
        needs.insert(node["id"].as_str().expect("id"), deps.collect());
    }
    let start = name_of.iter().find(|(_, n)| **n == "stylet-examine").expect("the referee").0;
    let (mut seen, mut open) = (BTreeSet::new(), vec![*start]);
    while let Some(id) = open.pop() {
        if seen.insert(id) {
            // What the columns' own tests use is not part of the referee: only the first step takes test dependencies.
            open.extend(needs.get(id).into_iter().flatten());
        }
    }
    let ours: Vec<&str> = seen
        .iter()
        .filter_map(|id| name_of.get(id).copied())
        .filter(|n| n.starts_with("stylet") && *n != "stylet-examine")
        .collect();
    assert!(ours.contains(&"stylet-record"), "{ours:?}");
    assert!(ours.iter().all(|n| ALLOWED.contains(n)), "{ours:?}");
    // The walk saw the whole graph, not an empty one.
    assert!(seen.len() > 20);
}
