//! Promise: no input makes a reader or an inspection panic or run away, and what is read is valid.
//! `STYLET_MUTATIONS_EACH=1000000 cargo test --release -p stylet-record --all-features --test promises mutated_files` sets the number per
//! parser.

#[allow(clippy::panic, dead_code)] // with the mutation; all parsers are fast
#[path = "../../../tests/mutated/mutate.rs"]
mod mutate;

mod support {
    use std::path::{Path, PathBuf};

    /// Root of the repository.
    pub fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
    }
}

use mutate::{Target, fuzz, fuzz_any};
use std::path::Path;
use stylet_record::inspect::{InspectOptions, inspect_bytes};
use stylet_record::{ColumnMap, ReadOptions, read_csv_bytes};

fn table(header: &str, separator: &str, comma: bool, time: impl Fn(usize) -> String) -> Vec<u8> {
    let mut text = header.to_owned();
    for k in 0..40 {
        let number = |x: f64| if comma { format!("{x:.4}").replace('.', ",") } else { format!("{x:.4}") };
        text += &[time(k), number(0.3 * k as f64), number(0.05 * (k * k) as f64)].join(separator);
        text += "\n";
    }
    text.into_bytes()
}

fn corpus() -> Vec<Vec<u8>> {
    let seconds = |k: usize| format!("{:.2}", 0.01 * k as f64);
    let utf16 = table("Time [s]\tPosition [mm]\tForce [kN]\n", "\t", false, seconds);
    let utf16 = String::from_utf8(utf16).expect("text").encode_utf16().flat_map(u16::to_le_bytes).collect();
    vec![
        table("Probe;7\n\nZeit;Weg;Kraft\ns;mm;N\n", ";", true, |k| format!("{:.2}", 0.01 * k as f64).replace('.', ",")),
        table("# time_s position_mm force_n\n", " ", false, seconds),
        table("stamp,position_mm,force_n\n", ",", false, |k| format!("2026-01-01T10:00:{:05.2}", 0.01 * k as f64)),
        table("stamp_ns|position_mm|force_n\n", "|", false, |k| format!("{}", 1_700_000_000_000_000_000_u64 + 10_000_000 * k as u64)),
        utf16,
        b"time_s,position_m,force_n\n0,0,\n0.001,,0\n0.01,0.001,\n0.011,,0.1\n0.02,0.002,\n0.021,,0.2\n0.03,0.003,\n".to_vec(),
    ]
}

#[test]
fn mutated_tables_are_read_or_refused() {
    let corpus = corpus();
    for repair in [false, true] {
        let options = ReadOptions { columns: None, repair };
        fuzz(
            if repair { "tables.repaired" } else { "tables" },
            10_000,
            &corpus,
            |bytes| match read_csv_bytes(bytes, Path::new("a.csv"), &options) {
                Ok((recording, _)) => {
                    recording.check().expect("a recording that was read is valid");
                    true
                }
                Err(error) => {
                    assert!(error.to_string().contains("a.csv"), "{error}");
                    false
                }
            },
        );
    }
}

#[test]
fn mutated_tables_are_inspected_and_a_proposed_map_is_valid() {
    fuzz_any("inspect", (10_000, Target::Text), &corpus(), |bytes| {
        let Ok(found) = inspect_bytes(bytes, Path::new("a.csv"), &InspectOptions::default()) else {
            return false;
        };
        let map: ColumnMap = ron::from_str(&found.to_ron()).expect("the proposed map is RON");
        map.check().expect("the proposed map is valid");
        if found.is_readable() {
            // What an inspection calls readable is read, or refused for a value that only the whole recording shows.
            let _ = read_csv_bytes(bytes, Path::new("a.csv"), &ReadOptions::default());
        }
        true
    });
}

/// Name of the parser, mutations, files, columns.
type Format = (&'static str, u64, &'static [&'static str], &'static str);

const MATLAB: [Format; 2] = [
    ("matlab5", 10_000, &["scipy_v5_plain.mat"], ""),
    (
        "matlab5.struct",
        2_000,
        &["scipy_v5.mat"],
        r#"Columns(time: (name: "log.t"), position: (name: "log.pz"), force: (name: "log.wrench.3"))"#,
    ),
];

#[cfg(feature = "formats")]
const FORMATS: [Format; 6] = [
    ("sheets", 2_000, &["machine.xlsx", "machine.ods", "machine.xls"], ""),
    (
        "bag",
        600,
        &["bag.db3"],
        r#"Columns(position: (name: "/tip.pose.position.z"), force: (name: "/ft/wrench.wrench.force.z"))"#,
    ),
    (
        "hdf5",
        2_000,
        &["matrices.h5"],
        r#"Columns(position: (name: "tip"), force: (name: "wrench.3"), axis: (0, 6, 8))"#,
    ),
    ("parquet", 2_000, &["table.parquet", "timestamp.parquet", "timestamp96.parquet"], ""),
    (
        "mcap.json",
        1_000,
        &["json.mcap"],
        r#"Columns(time: (name: "/ft.sensor.log_time"), position: (name: "/pose.position.z"), force: (name: "/ft.sensor.f.2"))"#,
    ),
    (
        "mcap.ros2",
        1_000,
        &["ros2.mcap"],
        r#"Columns(time: (name: "/insertion.header.stamp"), position: (name: "/insertion.position"), force: (name: "/insertion.wrench.force.z"))"#,
    ),
];

fn are_read_or_refused(formats: &[Format]) {
    for (format, count, files, map) in formats {
        let columns = (!map.is_empty()).then(|| ron::from_str(map).expect("a map"));
        let options = ReadOptions { columns, repair: false };
        let file = |name: &&str| {
            std::fs::read(support::root().join("crates/record/tests/foreign").join(name)).expect(name)
        };
        let corpus: Vec<Vec<u8>> = files.iter().map(file).collect();
        fuzz_any(format, (*count, Target::Text), &corpus, |bytes| {
            read_csv_bytes(bytes, Path::new("mutated"), &options).is_ok_and(|(read, _)| read.check().is_ok())
        });
    }
}

#[test]
fn mutated_matlab_files_are_read_or_refused() {
    are_read_or_refused(&MATLAB);
}

#[cfg(feature = "formats")]
#[test]
fn mutated_files_of_other_programs_are_read_or_refused() {
    are_read_or_refused(&FORMATS);
}
