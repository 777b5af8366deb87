//! `docs/reference/files.md` names every key and column of the files that `run`, `enhance`, `diagnose` and `identifiability` write.

use crate::support;

use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use support::{Scratch, root, stderr_text, stylet};

/// Objects whose keys are names of parameters or numbers.
const FREE_KEYS: [&str; 6] =
    ["parameters", "numbers", "typical", "smallest_detectable", "smallest", "hidden_below"];

fn collect(value: &Value, keys: &mut BTreeSet<String>) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| collect(item, keys)),
        Value::Object(fields) => {
            for (key, inner) in fields {
                keys.insert(key.clone());
                if !FREE_KEYS.contains(&key.as_str()) {
                    collect(inner, keys);
                }
            }
        }
        _ => {}
    }
}

fn run(arguments: &[&str]) {
    let output = stylet(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr_text(&output));
}

#[test]
fn every_key_and_column_is_documented() {
    let scratch = Scratch::new("reference-files");
    let folder = |name: &str| scratch.path().join(name).to_str().expect("a path").to_owned();
    let text =
        |path: &Path| std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let scenario = root().join("scenarios/three_layers.ron").to_str().expect("a path").to_owned();
    let [simulated, enhanced, diagnosed, shown] =
        ["run", "enhance", "diagnose", "identifiability"].map(folder);
    let recording = format!("{simulated}/recording.csv");
    run(&["run", &scenario, "--quiet", "--out", &simulated]);
    run(&["enhance", &recording, "--quiet", "--out", &enhanced]);
    run(&["diagnose", &scenario, "--data", &recording, "--quiet", "--out", &diagnosed]);
    run(&["identifiability", &scenario, "--quiet", "--out", &shown]);

    let mut names = BTreeSet::new();
    for file in [
        format!("{simulated}/score.json"),
        format!("{enhanced}/enhance.json"),
        format!("{enhanced}/events.json"),
        format!("{diagnosed}/diagnosis.json"),
        format!("{diagnosed}/inputs.json"),
        format!("{shown}/identifiability.json"),
    ] {
        let value = serde_json::from_str(&text(Path::new(&file))).expect("JSON");
        collect(&value, &mut names);
    }
    for file in [recording, format!("{enhanced}/enhanced.csv")] {
        let table = text(Path::new(&file));
        names.extend(table.lines().next().expect("a header").split(',').map(str::to_owned));
    }
    let page = text(&root().join("docs/reference/files.md"));
    let words: BTreeSet<&str> = page.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
    let missing: Vec<&String> = names.iter().filter(|name| !words.contains(name.as_str())).collect();
    assert!(names.len() > 100, "{names:?}");
    assert!(missing.is_empty(), "docs/reference/files.md does not name {missing:?}");
}
