//! Every constant of `identify` and `diagnose` is listed in `crates/diagnose/CONSTANTS.md` with value, unit, kind and reason; changes must be made
//! there too.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Constants by file and name.
type Constants = BTreeMap<(String, String), String>;

fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of the repository").flatten() {
        let path = entry.path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

/// Name and value of the constants of a source that are numbers, without its tests.
fn constants(text: &str) -> Vec<(String, String)> {
    let mut out = Vec::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if line == "#[cfg(test)]" && lines.peek().is_some_and(|l| l.contains("mod ") && l.ends_with('{')) {
            while lines.next().is_some_and(|l| l != "}") {}
            continue;
        }
        let code = line.trim_start();
        let code =
            code.strip_prefix("pub ").or_else(|| code.split_once("pub(super) ").map(|c| c.1)).unwrap_or(code);
        let code = code.strip_prefix("pub(crate) ").unwrap_or(code);
        let Some((name, rest)) = code.strip_prefix("const ").and_then(|c| c.split_once(": ")) else {
            continue;
        };
        if name.contains(|c: char| !c.is_ascii_uppercase() && !c.is_ascii_digit() && c != '_') {
            continue;
        }
        let mut whole = rest.to_owned();
        while !whole.trim_end().ends_with(';') {
            let Some(more) = lines.next() else { break };
            whole = format!("{whole} {}", more.trim());
        }
        let Some((kind, value)) = whole.split_once(" =") else { continue };
        if !["&str", "Kind", "[Self"].iter().any(|no_number| kind.contains(no_number)) {
            let value = value
                .trim()
                .trim_end_matches(';')
                .replace(", }", " }")
                .replace(", ]", "]")
                .replace("[ ", "[");
            out.push((name.to_owned(), value));
        }
    }
    out
}

fn in_sources(root: &Path) -> Constants {
    let mut out = Constants::new();
    for room in ["identify", "diagnose"] {
        let mut all = Vec::new();
        sources(&root.join("crates").join(room).join("src"), &mut all);
        for path in all {
            // What tests share is no part of the engine.
            if path.ends_with("tests.rs") || path.ends_with("test_fixtures.rs") {
                continue;
            }
            let place = path.strip_prefix(root.join("crates")).expect("a room").display().to_string();
            for (name, value) in constants(&std::fs::read_to_string(&path).expect("a source")) {
                out.insert((place.clone(), name), value);
            }
        }
    }
    out
}

/// The table's cells, row by row.
fn rows(page: &str) -> Vec<Vec<String>> {
    let cells = |line: &str| {
        line.trim_matches('|').split(" | ").map(|c| c.trim().trim_matches('`').to_owned()).collect()
    };
    page.lines().filter(|l| l.starts_with("| `")).map(cells).collect()
}

#[test]
fn every_constant_of_the_diagnosis_is_in_the_table_with_its_value_and_reason() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("crates/diagnose/CONSTANTS.md"))
        .expect("crates/diagnose/CONSTANTS.md");
    let (mut documented, mut faults) = (Constants::new(), Vec::new());
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    let (mut choices, mut of_sets) = (0, 0);
    for row in rows(&page) {
        let [place, name, value, unit, kind, reason] = row.as_slice() else {
            faults.push(format!("six cells are wanted: {row:?}"));
            continue;
        };
        if !["definition", "prior", "effort", "derived", "numerical"].contains(&kind.as_str()) {
            faults.push(format!("{place}: {name}: no kind `{kind}`"));
        }
        if unit.is_empty() || reason.len() < 8 {
            faults.push(format!("{place}: {name}: unit and reason are wanted"));
        }
        *kinds.entry(kind.clone()).or_default() += 1;
        if ["definition", "prior", "effort"].contains(&kind.as_str()) {
            choices += 1;
            of_sets += usize::from(place.starts_with("diagnose/src/repeated_insertions/"));
        }
        documented.insert((place.clone(), name.clone()), value.clone());
    }
    let there = in_sources(root);
    assert!(there.len() > 100, "{} constants", there.len());
    for ((place, name), value) in &there {
        match documented.get(&(place.clone(), name.clone())) {
            None => {
                faults.push(format!("missing: | `{place}` | `{name}` | `{value}` | unit | kind | reason |"))
            }
            Some(listed) if listed != value => {
                faults.push(format!("{place}: {name} is `{value}`, the table says `{listed}`"))
            }
            Some(_) => {}
        }
    }
    faults.extend(
        documented
            .keys()
            .filter(|k| !there.contains_key(*k))
            .map(|(p, n)| format!("{p}: there is no {n} any more")),
    );
    let sums = format!(
        "{} in all, {choices} of them choices (definitions, priors, effort): {} of these serve single recordings, {of_sets} sets of repeats",
        documented.len(),
        choices - of_sets
    );
    if !page.contains(&sums) {
        faults.push(format!("the page has to say `{sums}`"));
    }
    for (kind, count) in kinds {
        if !page.contains(&format!("| {kind} | {count} |")) {
            faults.push(format!("the page has to say `| {kind} | {count} |`"));
        }
    }
    assert!(faults.is_empty(), "crates/diagnose/CONSTANTS.md:\n{}", faults.join("\n"));
}

#[test]
fn constants_are_read_with_values_of_several_lines_and_without_tests() {
    let text = "/// So.\npub(crate) const A_M: f64 = 1e-3;\nconst GRID: [f64; 2] =\n    [1.0, 2.0];\nconst fn f() {}\nconst WORD: &str = \"w\";\n#[cfg(test)]\nmod tests {\n    const B: f64 = 2.0;\n}\n    const C: usize = 3;\n";
    let documented = constants(text);
    let documented: Vec<(&str, &str)> = documented.iter().map(|(n, v)| (n.as_str(), v.as_str())).collect();
    assert_eq!(documented, [("A_M", "1e-3"), ("GRID", "[1.0, 2.0]"), ("C", "3")]);
}
