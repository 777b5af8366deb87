//! `docs/reference/scenario.md`, `docs/reference/effects.md` and the table of effects in `docs/reference/model.md` say what the code accepts. With
//! `STYLET_BLESS=1` this test writes them again.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use stylet_scenario::{effects_page, effects_table, scenario_page};

const BEGIN: &str = "<!-- generated: effects -->\n";
const END: &str = "<!-- end of generated -->";

/// Compares a file of `docs/reference` with what it should contain, or writes it.
fn compare(name: &str, expected: impl Fn(&str) -> String) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference").join(name);
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    let expected = expected(&written);
    if std::env::var_os("STYLET_BLESS").is_some() {
        std::fs::write(&path, expected).unwrap();
        return;
    }
    assert!(written == expected, "docs/reference/{name} is stale; run this test with STYLET_BLESS=1");
}

#[test]
fn the_reference_pages_are_those_of_the_schema() {
    compare("scenario.md", |_| scenario_page());
    compare("effects.md", |_| effects_page());
    compare("model.md", |text| {
        let (before, rest) = text.split_once(BEGIN).unwrap();
        let (_, after) = rest.split_once(END).unwrap();
        format!("{before}{BEGIN}{}{END}{after}", effects_table())
    });
}
