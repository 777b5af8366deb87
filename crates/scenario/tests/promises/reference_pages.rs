//! `docs/reference/scenario.md`, `docs/reference/effects.md` and the generated tables in `docs/reference/model.md` and `docs/how-to/custom_effects.md`
//! say what the code accepts. With `STYLET_BLESS=1` this test writes them again.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use stylet_scenario::{custom_variables, effects_by_stage, effects_page, scenario_page};

const BEGIN: &str = "<!-- generated -->\n";
const END: &str = "<!-- end of generated -->";

/// The text of a file of the repository; empty if there is none.
fn read(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name))
        .unwrap_or_default()
}

/// Compares a file of `docs` with what it should contain, or writes it.
fn compare(name: &str, expected: impl Fn(&str) -> String) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(name);
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    let expected = expected(&written);
    if std::env::var_os("STYLET_BLESS").is_some() {
        std::fs::write(&path, expected).unwrap();
        return;
    }
    assert!(written == expected, "docs/{name} is stale; run this test with STYLET_BLESS=1");
}

/// A page with this table between its marks.
fn with_table(page: &str, table: &str) -> String {
    let (before, rest) = page.split_once(BEGIN).unwrap();
    let (_, after) = rest.split_once(END).unwrap();
    format!("{before}{BEGIN}{table}{END}{after}")
}

#[test]
fn the_reference_pages_are_those_of_the_schema() {
    compare("reference/scenario.md", |_| scenario_page());
    compare("reference/effects.md", |_| effects_page(&read("scenarios/effects/examples.ron")));
    compare("reference/model.md", |page| with_table(page, &effects_by_stage()));
    compare("how-to/custom_effects.md", |page| with_table(page, &custom_variables()));
}
