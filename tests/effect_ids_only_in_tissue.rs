//! An effect is described only by its file in `stylet-tissue`. No other source names an effect by its id, which would be a special rule for
//! one effect; exceptions are the independent simulator (`stylet-examine`) and tests.

use std::path::{Path, PathBuf};

/// Sources under a folder, without tests and build products.
fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of the repository").flatten() {
        let path = entry.path();
        let name = entry.file_name();
        if path.is_dir() {
            if !["tests", "target", "fuzz"].iter().any(|skip| name == *skip) {
                sources(&path, out);
            }
        } else if path.extension().is_some_and(|e| e == "rs") && name != "tests.rs" {
            out.push(path);
        }
    }
}

/// A source without its comments and its module of tests.
fn code(text: &str) -> String {
    let mut out = String::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if line == "#[cfg(test)]" && lines.peek().is_some_and(|l| l.contains("mod ") && l.ends_with('{')) {
            while lines.next().is_some_and(|l| l != "}") {}
        } else if !line.trim_start().starts_with("//") {
            out.push_str(line);
            out.push('\n');
        }
    }
    out
}

/// Ids in quotes that occur in a source.
fn named(text: &str) -> Vec<String> {
    let code = code(text);
    stylet_tissue::general_effects()
        .chain(stylet_tissue::per_layer_effects())
        .map(|info| format!("\"{}\"", info.id))
        .filter(|id| code.contains(id))
        .collect()
}

#[test]
fn no_source_outside_the_library_names_an_effect_by_its_id() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut all = Vec::new();
    for folder in ["src", "crates"] {
        sources(&root.join(folder), &mut all);
    }
    assert!(all.len() > 300, "{} sources", all.len());
    let own = ["crates/tissue", "crates/examine"].map(|room| root.join(room));
    let mut strays = Vec::new();
    let mut in_tissue = 0;
    for path in &all {
        let ids = named(&std::fs::read_to_string(path).expect("a source"));
        if path.starts_with(&own[0]) {
            in_tissue += ids.len();
        } else if !path.starts_with(&own[1]) {
            strays.extend(ids.into_iter().map(|id| format!("{}: {id}", path.display())));
        }
    }
    assert!(
        strays.is_empty(),
        "say it in the effect's file in crates/tissue/src/effects:\n{}",
        strays.join("\n")
    );
    // Each effect's own file does.
    let effects = stylet_tissue::general_effects().chain(stylet_tissue::per_layer_effects()).count();
    assert!(in_tissue >= effects, "{in_tissue} of {effects}");
}

#[test]
fn an_id_in_code_is_found_and_one_in_a_test_or_comment_is_not() {
    let rule = "fn f(id: &str) -> bool {\n    id == \"force_gain\"\n}\n";
    assert_eq!(named(rule), ["\"force_gain\""]);
    assert!(named("// as \"force_gain\" does\n").is_empty());
    assert!(named(&format!("#[cfg(test)]\nmod tests {{\n    {rule}}}\n")).is_empty());
    assert_eq!(named(&format!("#[cfg(test)]\nmod tests {{\n}}\n{rule}")).len(), 1);
}

/// Every effect type has its id as a constant.
#[test]
fn an_effects_constant_is_its_id() {
    use stylet_tissue::{CoulombFriction, Effect, ForceGain, Saturation};
    assert_eq!(CoulombFriction::default().info().id, CoulombFriction::ID);
    assert_eq!(ForceGain::default().info().id, ForceGain::ID);
    assert_eq!(Saturation::default().info().id, Saturation::ID);
}
