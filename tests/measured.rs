//! Promise: on measured insertions the core detects the puncture of the skin at the force drop, and nothing
//! in air.
//!
//! The recordings have no licence and stay outside the repository, in the folder that `STYLET_MEASURED`
//! names; without it these tests are skipped.

use crate::support;

use std::path::PathBuf;
use support::{Scratch, stderr_text, stylet};

const MAP: &str = r#"Columns(
    time: (name: "time", scale: 1e-6),
    position: (name: "pz", scale: 1e-3),
    force: (name: "fz", scale: 1.0),
)"#;

fn measured(test: &str) -> Option<PathBuf> {
    support::measured::measured(test, "needle_phantom").map(|folder| folder.join("needle_phantom"))
}

fn enhance(scratch: &Scratch, data: &std::path::Path) -> serde_json::Value {
    let map = scratch.file("map.ron", MAP);
    let out = scratch.path().join("out");
    let path = |p: &std::path::Path| p.to_str().expect("a path").to_owned();
    let output = stylet(&["enhance", &path(data), "--columns", &path(&map), "--out", &path(&out)]);
    assert!(output.status.success(), "{}", stderr_text(&output));
    assert!(out.join("report.html").exists());
    let json = std::fs::read_to_string(out.join("enhance.json")).expect("results");
    serde_json::from_str(&json).expect("JSON")
}

#[test]
fn the_skin_puncture_is_found_in_every_recording() {
    let Some(folder) = measured("the_skin_puncture_is_found_in_every_recording") else { return };
    let scratch = Scratch::new("measured");
    let mut recordings = 0;
    for speed in 1..=3 {
        for run in 1..=5 {
            let result = enhance(&scratch, &folder.join(format!("skin-on-muscle_{speed}mmps_run{run}.csv")));
            let ruptures = result["found"][0]["ruptures"].as_array().expect("ruptures");
            let depths: Vec<f64> = ruptures.iter().filter_map(|r| r["located_m"].as_f64()).collect();
            println!("{speed} mm/s run {run}: ruptures at {depths:.4?} m");
            assert!(depths.iter().any(|z| (0.012..0.020).contains(z)), "{speed} mm/s run {run}: {depths:?}");
            assert!(depths.len() <= 4, "{speed} mm/s run {run}: {depths:?}");
            recordings += 1;
        }
    }
    assert_eq!(recordings, 15);
}

#[test]
fn nothing_is_found_in_air() {
    let Some(folder) = measured("nothing_is_found_in_air") else { return };
    let result = enhance(&Scratch::new("air"), &folder.join("air_blank.csv"));
    assert_eq!(result["found"][0]["ruptures"].as_array().map(Vec::len), Some(0));
    assert!(result["found"][0]["contact_m"].is_null());
}
