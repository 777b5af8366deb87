//! Promise: the independent simulator shares no code with the diagnosis that it judges. Of this project's crates it depends, directly or through others, on
//! those that hold columns and statistics alone.

use std::collections::{BTreeMap, BTreeSet};

/// Crates that it may use.
const ALLOWED: [&str; 2] = ["stylet-record", "stylet-stats"];
const LOCK: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.lock");

#[test]
fn the_independent_simulator_does_not_depend_on_the_crates_it_tests() {
    // The lock file knows every kind of dependency, on every platform: normal, build and those of the tests.
    let text = std::fs::read_to_string(LOCK).expect("Cargo.lock");
    let lock: toml::Table = text.parse().expect("TOML");
    let mut needs: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for package in lock["package"].as_array().expect("packages") {
        let name = package["name"].as_str().expect("a name");
        let deps = package.get("dependencies").and_then(|d| d.as_array()).into_iter().flatten();
        // A version follows where there are several: all of one name count as one.
        let named = deps.filter_map(|d| d.as_str()?.split(' ').next());
        needs.entry(name).or_default().extend(named);
    }
    let (mut seen, mut open) = (BTreeSet::new(), vec!["stylet-examine"]);
    while let Some(name) = open.pop() {
        if seen.insert(name) {
            open.extend(&needs[name]);
        }
    }
    let ours: Vec<&str> =
        seen.iter().copied().filter(|n| n.starts_with("stylet") && *n != "stylet-examine").collect();
    assert!(ours.contains(&"stylet-record"), "{ours:?}");
    assert!(ours.iter().all(|n| ALLOWED.contains(n)), "{ours:?}");
    // The walk saw the whole graph, not an empty one.
    assert!(seen.len() > 20);
}
