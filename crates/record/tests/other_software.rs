//! Promise: files that other software wrote (`foreign/make_tables.py`) give the insertion that they hold, and damaged ones an
//! error; `inspect` proposes a map with which they are read.
#![allow(clippy::panic)] // with the name of the case
#![cfg(feature = "formats")]

use std::path::{Path, PathBuf};
use stylet_record::inspect::{InspectOptions, inspect, inspect_bytes};
use stylet_record::{ColumnMap, ReadOptions, Recording, read_csv, read_csv_bytes};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign").join(name)
}

fn options(map: &str) -> ReadOptions {
    let columns = if map.is_empty() { None } else { Some(ron::from_str::<ColumnMap>(map).expect("a map")) };
    ReadOptions { columns, repair: false }
}

/// Position 1 mm + 4 mm/s and force 0.5 N + 2 N/s; the first sample may lie `first` samples later.
fn is_the_insertion(name: &str, read: &Recording, samples: usize, first: usize) {
    assert_eq!(read.len(), samples, "{name}");
    for k in 0..read.len() {
        let t = (k + first) as f64 / 100.0;
        let off = read.time_s[k] - read.time_s[0] - k as f64 / 100.0;
        assert!(off.abs() < 1e-6, "{name}: time {k} is off by {off}");
        assert!(
            (read.position_m[k] - (1e-3 + 4e-3 * t)).abs() < 1e-8,
            "{name}: {} at {k}",
            read.position_m[k]
        );
        assert!((read.force_n[k] - (0.5 + 2.0 * t)).abs() < 1e-8, "{name}: {} at {k}", read.force_n[k]);
    }
}

/// File, map, samples, samples that are missing at the beginning.
const FILES: [(&str, &str, usize, usize); 15] = [
    ("machine.xlsx", "", 60, 0),
    ("machine.ods", "", 60, 0),
    ("machine.xls", "", 60, 0),
    ("machine.xlsx", r#"Columns(sheet: "Data", header_line: 2)"#, 60, 0),
    ("pandas.csv", "", 60, 0),
    ("savetxt.txt", "", 60, 0),
    ("scipy_v5_plain.mat", "", 60, 0),
    (
        "scipy_v5.mat",
        r#"Columns(time: (name: "log.t"), position: (name: "log.pz", scale: 1e-3), force: (name: "log.wrench.3", scale: -1))"#,
        60,
        0,
    ),
    ("matrices.h5", r#"Columns(position: (name: "tip"), force: (name: "wrench.3"), axis: (0, 6, 8))"#, 60, 0),
    (
        "matrices.h5",
        r#"Columns(position: (names: ["tip.1", "tip.2", "tip.3"]), force: (name: "wrench.3"))"#,
        60,
        0,
    ),
    ("timestamp.parquet", "", 60, 0),
    ("timestamp96.parquet", "", 60, 0),
    (
        "bag.db3",
        r#"Columns(time: (name: "/ft/wrench.header.stamp"), position: (name: "/tip.pose.position.z"), force: (name: "/ft/wrench.wrench.force.z"))"#,
        60,
        0,
    ),
    (
        "ros2_echo.csv",
        r#"Columns(time: (columns: [1, 2]), position: (file: "pose.csv"), force: (column: 6))"#,
        60,
        0,
    ),
    (
        "rostopic_echo.txt",
        r#"Columns(position: (file: "pose.csv"), force: (name: "field.wrench.force.z"))"#,
        60,
        0,
    ),
];

#[test]
fn every_file_of_other_software_gives_its_insertion() {
    for (name, map, samples, first) in FILES {
        let (read, _) = read_csv(file(name), &options(map)).unwrap_or_else(|error| panic!("{name}: {error}"));
        is_the_insertion(name, &read, samples, first);
    }
}

#[test]
fn an_inspection_finds_time_position_and_force_in_every_file() {
    for (name, ..) in FILES {
        let found =
            inspect(file(name), &InspectOptions::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
        let sampling = found.sampling.as_ref().unwrap_or_else(|| panic!("{name} has a time"));
        assert!((sampling.rate_hz - 100.0).abs() < 0.1, "{name}: {} Hz", sampling.rate_hz);
        let map: ColumnMap = ron::from_str(&found.map.to_ron()).expect(name);
        assert_eq!(map, found.map, "{name}");
        if name.contains("echo") {
            assert!(!found.is_readable(), "{name} lacks a position");
            continue;
        }
        // With the proposed map the file is read, in the sign and scale of the file.
        let read = read_csv(file(name), &ReadOptions { columns: Some(map), repair: false });
        let (read, _) = read.unwrap_or_else(|error| panic!("{name}: {error}\n{}", found.to_ron()));
        assert_eq!(read.len(), 60, "{name}");
    }
}

#[test]
fn a_refusal_names_all_obstacles_and_the_command_that_helps() {
    let error = read_csv(file("matrices.h5"), &ReadOptions::default()).expect_err("no names").to_string();
    for words in ["tip.2", "wrench.3", "stylet inspect", "--write-map map.ron"] {
        assert!(error.contains(words), "{words} is missing in {error}");
    }
    let error = read_csv(file("machine.xlsx"), &options(r#"Columns(sheet: "Other")"#))
        .expect_err("no sheet")
        .to_string();
    assert!(error.contains("\"Notes\"") && error.contains("\"Data\""), "{error}");
}

/// Ten damaged copies of every file, and many more: cut, and with bytes changed.
#[test]
fn damaged_files_are_read_or_refused_without_a_panic() {
    let mut seed = 11_u64;
    let mut random = move |below: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % below.max(1)
    };
    for (name, map, ..) in FILES {
        let whole = std::fs::read(file(name)).expect(name);
        for round in 0..30 {
            let mut bytes = whole.clone();
            if round % 3 == 0 {
                bytes.truncate(random(whole.len()));
            }
            for _ in 0..(round % 5 + 1) {
                let at = random(bytes.len());
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = random(256) as u8;
                }
            }
            let path = file(name);
            match read_csv_bytes(&bytes, &path, &options(map)) {
                Ok((read, _)) => read.check().expect(name),
                Err(error) => assert!(!error.to_string().is_empty()),
            }
            let _ = inspect_bytes(&bytes, &path, &InspectOptions::default());
        }
    }
}
