//! What a challenge hides, for who has its key and tunes on it: case number -> what a right answer says, as JSON.
//! `cargo run --release -p stylet-examine --example truth -- CHALLENGE > truth.json`

use std::collections::BTreeMap;
use std::path::PathBuf;
use stylet_examine::challenge_export::{AnswerKey, key_path};
use stylet_examine::make_case;
use stylet_examine::scoring::expected_answer::expected_answer;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("truth CHALLENGE")?);
    let key: AnswerKey = serde_json::from_slice(&std::fs::read(key_path(&folder))?)?;
    let mut out = BTreeMap::new();
    for (number, id) in &key.cases {
        out.insert(number, expected_answer(id, &make_case(id)?.setup));
    }
    println!("{}", serde_json::to_string_pretty(&out)?);
    Ok(())
}
