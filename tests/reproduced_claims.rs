//! Promise: what our testbed says of the paper's claims does not change unnoticed, and the page is the same
//! for any number of threads.
//!
//! `tests/expected_verdicts.json` holds the verdicts of `stylet reproduce` at its 50 seeds; here 12 are run. A
//! verdict that flips, or a condition that goes from holding to failing or back, fails the test: it is then to
//! be understood before the file is changed (`jq '[.[] | {id, verdict, conditions}]' DIR/claims.json`).

use serde_json::Value;
use std::collections::BTreeMap;
use stylet_reproduce::claims::{self, Claim};
use stylet_reproduce::reproduce;
use stylet_reproduce::study::Study;
use stylet_reproduce::verdict::{FAILS, HOLDS};

const SEEDS: u64 = 12;

/// `id` to verdict and the share of seeds by condition.
fn expected() -> BTreeMap<String, (String, BTreeMap<String, f64>)> {
    let list: Vec<Value> =
        serde_json::from_str(include_str!("expected_verdicts.json")).expect("the expected verdicts");
    let word = |v: &Value| v.as_str().expect("a text").to_owned();
    list.iter()
        .map(|claim| {
            let conditions = claim["conditions"].as_array().expect("conditions").iter().map(|c| {
                let share = c["holds"].as_f64().expect("a count") / c["of"].as_f64().expect("a count");
                (word(&c["name"]), share)
            });
            (word(&claim["id"]), (word(&claim["verdict"]), conditions.collect()))
        })
        .collect()
}

fn same_kind(a: &str, b: &str) -> bool {
    let kind = |words: &str| {
        if words.starts_with("depends on ") { "depends on".to_owned() } else { words.to_owned() }
    };
    kind(a) == kind(b)
}

#[test]
fn no_verdict_flips() {
    let study = Study::run(SEEDS, &|| {}).expect("shipped scenarios");
    let found: Vec<Claim> = claims::all(&study).expect("claims");
    let expected = expected();
    let ids: Vec<String> = found.iter().map(|c| c.id.to_string()).collect();
    assert_eq!(ids, expected.keys().cloned().collect::<Vec<_>>(), "the claims (a) to (j)");
    let mut flipped = Vec::new();
    for claim in &found {
        let (verdict, conditions) = &expected[&claim.id.to_string()];
        if !same_kind(verdict, &claim.verdict.words()) {
            flipped.push(format!("({}) was `{verdict}`, is `{}`", claim.id, claim.verdict.words()));
        }
        assert_eq!(conditions.len(), claim.conditions.len(), "({})", claim.id);
        for condition in &claim.conditions {
            assert_eq!(condition.of as u64, SEEDS, "({}) {}", claim.id, condition.name);
            let before = conditions.get(&condition.name).unwrap_or_else(|| panic!("new: {}", condition.name));
            if (*before >= HOLDS && condition.fails()) || (*before <= FAILS && condition.holds()) {
                flipped.push(format!(
                    "({}) {}: {} of {}",
                    claim.id, condition.name, condition.holds, condition.of
                ));
            }
        }
    }
    assert!(flipped.is_empty(), "{flipped:#?}");
}

#[test]
fn page_claims_and_pictures_are_the_same_for_any_number_of_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| reproduce(2, &|| {})).expect("shipped scenarios")
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one.claims_json, three.claims_json);
    assert_eq!(one.pictures, three.pictures);
    assert!(one.html == three.html, "the page differs");
    assert!(one.html.len() < 15_000_000, "{} bytes", one.html.len());
    assert!(
        !one.html.contains("src=\"http") && !one.html.contains("href=\"http"),
        "the page loads something"
    );
    for figure in 1..=15 {
        assert!(one.html.contains(&format!("<h2>S Fig. {figure}: ")), "S Fig. {figure}");
    }
    for figure in ["M Table I", "M Fig. 12", "M Fig. 13", "M Fig. 14"] {
        assert!(one.html.contains(&format!("<h2>{figure}: ")), "{figure}");
    }
}
