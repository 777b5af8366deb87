//! Promise: files of other programs are read like their CSV export, and damaged files are refused with an error.
#![cfg(feature = "formats")]

use std::path::{Path, PathBuf};
use stylet_record::file_formats::{to_mcap, to_parquet};
use stylet_record::{Column, ColumnMap, ReadOptions, RecordError, Recording, read_csv, read_csv_bytes};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign").join(name)
}

fn mapped(time: Column, position: Column, force: Column) -> ReadOptions {
    let columns = ColumnMap { time, position, force, ..ColumnMap::default() };
    ReadOptions { columns: Some(columns), repair: false }
}

/// Position 1 mm + 4 mm/s and force 0.5 N + 2 N/s at 100 Hz: what `tests/foreign/make.py` wrote.
fn is_the_insertion(name: &str, options: &ReadOptions, samples: usize) {
    let (r, _) = read_csv(file(name), options).expect(name);
    assert_eq!(r.len(), samples, "{name}");
    for k in 0..r.len() {
        let t = k as f64 / 100.0;
        let off = (r.time_s[k] - r.time_s[0] - t).abs();
        assert!(off < 1e-9, "{name}: time {k} is {}", r.time_s[k]);
        assert!((r.position_m[k] - (1e-3 + 4e-3 * t)).abs() < 1e-12, "{name}: {}", r.position_m[k]);
        assert!((r.force_n[k] - (0.5 + 2.0 * t)).abs() < 1e-6, "{name}: {}", r.force_n[k]);
    }
}

#[test]
fn a_matlab_file_with_a_struct_and_a_matrix_is_read() {
    let options = mapped(
        Column::scaled("time", 1e-3),
        Column::scaled("pz", 1e-3),
        Column::scaled("log.wrench.3", -1.0),
    );
    is_the_insertion("matlab.mat", &options, 60);
}

#[test]
fn a_parquet_file_of_a_notebook_is_read() {
    is_the_insertion("table.parquet", &ReadOptions::default(), 60);
}

#[test]
fn an_mcap_file_with_position_and_force_on_separate_topics_is_read() {
    // The topic has a dot itself. Poses end 30 ms before the last force: behind them nothing is made up.
    let options = mapped(
        Column::si("/ft.sensor.log_time"),
        Column::scaled("/pose.position.z", 1e-3),
        Column::si("/ft.sensor.f.2"),
    );
    is_the_insertion("json.mcap", &options, 57);
}

#[test]
fn ros_2_messages_in_cdr_are_read_by_the_definition_in_the_file() {
    let options = mapped(
        Column::si("/insertion.header.stamp"),
        Column::si("/insertion.position"),
        Column::si("/insertion.wrench.force.z"),
    );
    is_the_insertion("ros2.mcap", &options, 60);
}

#[test]
fn a_dictionary_of_more_values_than_bytes_is_refused_before_it_is_allocated() {
    let mut bytes = std::fs::read(file("table.parquet")).expect("a file");
    // The dictionary's header, with 60 values.
    let head = [0x4C, 0x15, 0x78];
    let at = bytes.windows(3).position(|three| three == head).expect("a dictionary");
    bytes.splice(at..at + 3, [0x4C, 0x15, 0xFE, 0xFF, 0xFF, 0xFF, 0x0F]);
    let error = read_csv_bytes(&bytes, Path::new("a.parquet"), &ReadOptions::default()).expect_err("damaged");
    assert!(error.to_string().contains("a dictionary of 2147483647 values"), "{error}");
}

#[test]
fn round_trips_keep_every_sample() {
    let (mut r, _) = read_csv(file("table.parquet"), &ReadOptions::default()).expect("a recording");
    r.velocity_mps = r.time_s.iter().map(|t| 0.1 + t / 3.0).collect();
    r.velocity_measured = true;
    r.force_virtual_n = Some(r.force_n.iter().map(|f| -f * std::f64::consts::PI).collect());
    let path = Path::new("there_and_back");
    let (parquet, _) =
        read_csv_bytes(&to_parquet(&r, path).expect("written"), path, &ReadOptions::default()).expect("read");
    assert_eq!(parquet, r);
    let columns = ColumnMap {
        time: Column::si("/insertion.time_s"),
        position: Column::si("/insertion.position_m"),
        force: Column::si("/insertion.force_n"),
        velocity: Some(Column::si("/insertion.velocity_mps")),
        force_virtual: Some(Column::si("/insertion.force_virtual_n")),
        ..ColumnMap::open()
    };
    let options = ReadOptions { columns: Some(columns), repair: false };
    let (mcap, _) = read_csv_bytes(&to_mcap(&r, path).expect("written"), path, &options).expect("read");
    assert_eq!(mcap, r);
}

#[test]
fn a_missing_column_is_reported_with_the_existing_ones() {
    let options = mapped(Column::si("time"), Column::si("pz"), Column::si("log.wrinch"));
    let said = read_csv(file("matlab.mat"), &options).expect_err("no such column").to_string();
    assert!(said.contains("log.wrench.3") && said.contains("matlab.mat"), "{said}");
    let options = mapped(Column::si("time"), Column::si("pz"), Column::si("/insertion.wrench.force.q"));
    assert!(read_csv(file("ros2.mcap"), &options).is_err());
}

/// Cut at many places and with bytes changed: an error that names the file, or a recording; never a panic.
#[test]
fn damaged_files_are_refused_without_a_panic() {
    let whole: Vec<(&str, ReadOptions)> = vec![
        (
            "matlab.mat",
            mapped(Column::scaled("time", 1e-3), Column::scaled("pz", 1e-3), Column::si("log.wrench.3")),
        ),
        ("table.parquet", ReadOptions::default()),
        (
            "json.mcap",
            mapped(
                Column::si("/ft.sensor.log_time"),
                Column::si("/pose.position.z"),
                Column::si("/ft.sensor.f.2"),
            ),
        ),
        (
            "ros2.mcap",
            mapped(
                Column::si("/insertion.header.stamp"),
                Column::si("/insertion.position"),
                Column::si("/insertion.wrench.force.z"),
            ),
        ),
    ];
    for (name, options) in whole {
        let bytes = std::fs::read(file(name)).expect("a file");
        let path = Path::new(name);
        let judge = |bytes: &[u8]| {
            let read: Result<(Recording, _), RecordError> = read_csv_bytes(bytes, path, &options);
            if let Err(e) = read {
                assert!(e.to_string().contains(name), "{e}");
            }
        };
        for part in 1..40 {
            judge(&bytes[..bytes.len() * part / 40]);
        }
        let mut seed = 7_u64;
        for _ in 0..400 {
            let mut changed = bytes.clone();
            for _ in 0..4 {
                seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                let at = (seed >> 33) as usize % changed.len();
                changed[at] = (seed >> 20) as u8;
            }
            judge(&changed);
        }
    }
}
