//! Promise: no input makes a reader or an inspection panic or run away, and what is read is valid.
//! `STYLET_MUTATIONS_EACH=1000000 cargo test --release -p stylet-record --all-features --test mutated_files` sets the number per
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

fn foreign(name: &str) -> Vec<u8> {
    std::fs::read(support::root().join("crates/record/tests/foreign").join(name)).expect(name)
}

#[test]
fn mutated_matlab_files_are_read_or_refused() {
    let corpus = [foreign("scipy_v5_plain.mat")];
    fuzz_any("matlab5", (10_000, Target::Text), &corpus, |bytes| {
        read_csv_bytes(bytes, Path::new("a.mat"), &ReadOptions::default())
            .is_ok_and(|(recording, _)| recording.check().is_ok())
    });
    let map =
        "Columns(time: (name: \"log.t\"), position: (name: \"log.pz\"), force: (name: \"log.wrench.3\"))";
    let options = ReadOptions { columns: Some(ron::from_str(map).expect("a map")), repair: false };
    fuzz_any("matlab5.struct", (2_000, Target::Text), &[foreign("scipy_v5.mat")], |bytes| {
        read_csv_bytes(bytes, Path::new("a.mat"), &options)
            .is_ok_and(|(recording, _)| recording.check().is_ok())
    });
}

#[cfg(feature = "formats")]
#[test]
fn mutated_sheets_and_bags_are_read_or_refused() {
    let sheets = [foreign("machine.xlsx"), foreign("machine.ods"), foreign("machine.xls")];
    fuzz_any("sheets", (2_000, Target::Text), &sheets, |bytes| {
        read_csv_bytes(bytes, Path::new("a.xlsx"), &ReadOptions::default())
            .is_ok_and(|(recording, _)| recording.check().is_ok())
    });
    let map =
        "Columns(position: (name: \"/tip.pose.position.z\"), force: (name: \"/ft/wrench.wrench.force.z\"))";
    let options = ReadOptions { columns: Some(ron::from_str(map).expect("a map")), repair: false };
    fuzz_any("bag", (600, Target::Text), &[foreign("bag.db3")], |bytes| {
        read_csv_bytes(bytes, Path::new("a.db3"), &options)
            .is_ok_and(|(recording, _)| recording.check().is_ok())
    });
}
