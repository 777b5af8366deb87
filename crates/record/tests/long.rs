//! Promise: reading a recording in pieces, with bounded memory, gives the same samples bit for bit, the same notes and the same
//! errors as reading it at once.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use stylet_record::{
    Column, ColumnMap, QualityNote, ReadOptions, RecordError, Recording, read_csv, read_long_csv, write_csv,
};

struct TempFolder(PathBuf);

impl TempFolder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("stylet-long-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder folder");
        Self(folder)
    }
}

impl Drop for TempFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Uniform numbers in -0.5 to 0.5 with a fixed seed.
fn scatter(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }
}

/// Insertions of 20 s at 1 kHz, one after the other: time, position, force, velocity.
fn insertions(samples: usize) -> Vec<[f64; 4]> {
    let mut noise = scatter(3);
    let row = |k: usize| {
        let t = k as f64 * 0.001;
        let phase = t % 20.0;
        let (z, v) =
            if phase < 15.0 { (0.004 * phase, 0.004) } else { (0.06 - 0.012 * (phase - 15.0), -0.012) };
        let load = if z > 0.01 { 60.0 * (z - 0.01) % 0.9 } else { 0.0 };
        [t, z, load + 0.02 * noise(), v + 1e-5 * noise()]
    };
    (0..samples).map(row).collect()
}

fn text(rows: &[[f64; 4]], velocity: bool) -> String {
    let mut text = String::from("time_s,position_m,force_n");
    text.push_str(if velocity { ",velocity_mps\n" } else { "\n" });
    for [t, z, f, v] in rows {
        write!(text, "{t:?},{z:?},{f:?}").expect("a string");
        if velocity {
            write!(text, ",{v:?}").expect("a string");
        }
        text.push('\n');
    }
    text
}

type Read = Result<(Vec<u8>, Vec<[u64; 4]>, Vec<QualityNote>), String>;

/// Results of a reader for comparison: the table it writes, the bits of the samples, the notes.
fn read_at_once(path: &Path, options: &ReadOptions) -> Read {
    let (recording, notes) = read_csv(path, options).map_err(|e| e.to_string())?;
    let mut table = Vec::new();
    write_csv(&recording, None, &[], &mut table).map_err(|e| e.to_string())?;
    Ok((table, bits(&recording), notes))
}

fn bits(recording: &Recording) -> Vec<[u64; 4]> {
    let bits =
        |s: stylet_record::Sample| [s.time_s, s.position_m, s.velocity_mps, s.force_n].map(f64::to_bits);
    recording.samples().map(bits).collect()
}

fn read_in_pieces(path: &Path, options: &ReadOptions, folder: &Path) -> Option<Read> {
    let (recording, notes) = match read_long_csv(path, options, folder) {
        Ok(read) => read?,
        Err(error) => return Some(Err(error.to_string())),
    };
    let mut table = recording.column_names().join(",") + "\n";
    let mut samples = Vec::new();
    let passed = recording.for_each_sample(|s, row| -> Result<(), RecordError> {
        samples.push([s.time_s, s.position_m, s.velocity_mps, s.force_n].map(f64::to_bits));
        table.push_str(&row.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(","));
        table.push('\n');
        Ok(())
    });
    Some(passed.map(|()| (table.into_bytes(), samples, notes)).map_err(|e| e.to_string()))
}

/// Compares both readers on one text; returns the kinds of the notes, or the message.
fn same_result(name: &str, text: &[u8], options: &ReadOptions) -> Result<Vec<String>, String> {
    let folder = TempFolder::new(name);
    let path = folder.0.join("log.csv");
    std::fs::write(&path, text).expect("a folder file");
    let expected = read_at_once(&path, options);
    let Some(read) = read_in_pieces(&path, options, &folder.0) else {
        // Left to the reader in memory, as every file out of order.
        assert!(expected.is_err(), "{name}: a good file is read in pieces");
        return Err(expected.err().unwrap_or_default());
    };
    match (&read, &expected) {
        (Ok(read), Ok(expected)) => {
            assert_eq!(read.2, expected.2, "{name}: the notes");
            assert_eq!(read.1, expected.1, "{name}: the samples");
            assert!(read.0 == expected.0, "{name}: the table");
        }
        (read, expected) => assert_eq!(
            read.as_ref().map(|_| ()).map_err(String::as_str),
            expected.as_ref().map(|_| ()).map_err(String::as_str),
            "{name}"
        ),
    }
    let left: Vec<_> = std::fs::read_dir(&folder.0).expect("the folder").flatten().collect();
    assert_eq!(left.len(), 1, "{name}: temporary files remain: {left:?}");
    read.map(|(_, _, notes)| notes.iter().map(|note| format!("{:?}", note.kind)).collect())
}

fn good(name: &str, text: &[u8], options: &ReadOptions, kinds: &[&str]) {
    let found = same_result(name, text, options).expect(name);
    for kind in kinds {
        assert!(found.iter().any(|found| found == kind), "{name}: {found:?} lacks {kind}");
    }
}

/// Name, rows, and the notes that must be among the results.
type Case = (&'static str, Vec<[f64; 4]>, &'static [&'static str]);

const PLAIN: ReadOptions = ReadOptions { columns: None, repair: false };
const REPAIR: ReadOptions = ReadOptions { columns: None, repair: true };

#[test]
fn all_notes_are_the_same_over_several_blocks() {
    let rows = insertions(40_000);
    let changed = |change: &dyn Fn(usize, &mut [f64; 4])| {
        let mut rows = rows.clone();
        rows.iter_mut().enumerate().for_each(|(k, row)| change(k, row));
        rows
    };
    good("clean", text(&rows, true).as_bytes(), &PLAIN, &[]);
    good("positions", text(&rows, false).as_bytes(), &PLAIN, &[]);
    let cases: [Case; 10] = [
        ("dead", changed(&|_, r| r[2] = 0.25), &["Dead"]),
        ("reversed", changed(&|_, r| r[2] = -r[2]), &["Reversed"]),
        ("scaled", changed(&|_, r| (r[1], r[3]) = (r[1] * 1e3, r[3] * 1e3)), &["UnitMixUp"]),
        ("other velocity", changed(&|_, r| r[3] *= -30.0), &["UnitMixUp"]),
        ("huge", changed(&|k, r| r[2] = if k == 30_000 { 1e300 } else { r[2] }), &["UnitMixUp"]),
        ("air", changed(&|k, r| r[2] = ((k * 7919) % 1009) as f64 * 1e-4), &["InAir"]),
        (
            "stuck, clipped",
            changed(&|k, r| r[2] = if (16_100..16_700).contains(&k) { 0.3 } else { r[2].min(0.5) }),
            &["Stuck", "Saturation"],
        ),
        ("spikes", changed(&|k, r| r[2] += if k % 16_384 < 2 { 9.0 } else { 0.0 }), &["Spikes"]),
        ("coarse", changed(&|_, r| r[2] = (r[2] / 0.05).round() * 0.05), &["Quantisation"]),
        (
            "clock",
            changed(&|k, r| r[0] += if k > 16_383 { 4.0 } else { 0.0 } + 3e-4 * (k % 3) as f64),
            &["Gaps", "Jitter"],
        ),
    ];
    for (name, rows, kinds) in &cases {
        good(name, text(rows, true).as_bytes(), &PLAIN, kinds);
        good(&format!("{name}, positions"), text(rows, false).as_bytes(), &PLAIN, &[]);
    }
}

#[test]
fn dialects_extra_columns_and_maps_give_the_same_result() {
    let plain = text(&insertions(17_000), true);
    good("windows", format!("\u{feff}{}", plain.replace('\n', "\r\n")).as_bytes(), &PLAIN, &[]);
    good("old mac", plain.replace('\n', "\r").as_bytes(), &PLAIN, &[]);
    good("bars", plain.replace(',', "|").as_bytes(), &PLAIN, &[]);
    good("blank lines", plain.replace('\n', "\n\n").as_bytes(), &PLAIN, &[]);
    let more: String = plain
        .lines()
        .enumerate()
        .map(|(k, line)| match k {
            0 => {
                let joints: Vec<String> = (1..=7).rev().map(|j| format!("joint_torque_{j}_nm")).collect();
                format!("note,{},{line},force_virtual_n\n", joints.join(","))
            }
            k => format!("\"é, \n{k}\",7,6,5,4,3,2,{k},{line},0.5\n"),
        })
        .collect();
    good("arm", more.as_bytes(), &PLAIN, &[]);
    let map = ColumnMap {
        time: Column::scaled("time_s", 1.0),
        position: Column::scaled("position_m", -1.0),
        force: Column::scaled("force_n", 2.0),
        ..ColumnMap::open()
    };
    good("map", plain.as_bytes(), &ReadOptions { columns: Some(map), repair: false }, &[]);
}

#[test]
fn rows_out_of_order_are_repaired_or_refused_by_both_readers() {
    let mut rows = insertions(40_000);
    rows[16_383][0] = 1e6;
    rows[20_000][0] = rows[19_999][0];
    rows.swap(30_000, 30_007);
    rows[39_999][0] = -1.0;
    for velocity in [true, false] {
        good("repaired", text(&rows, velocity).as_bytes(), &REPAIR, &["RepairedRows"]);
        assert!(same_result("refused", text(&rows, velocity).as_bytes(), &PLAIN).is_err());
    }
    let twice: Vec<[f64; 4]> = [&insertions(20_000)[..], &insertions(17_000)[..]].concat();
    let second = same_result("twice", text(&twice, true).as_bytes(), &REPAIR).expect_err("two recordings");
    assert!(second.contains("line 20002: a second recording begins here"), "{second}");
    let still = vec![[1.0, 0.0, 0.0, 0.0]; 5];
    assert!(same_result("one time", text(&still, true).as_bytes(), &REPAIR).is_err());
}

#[test]
fn errors_have_the_same_message() {
    let plain = text(&insertions(17_000), true);
    let at = |line: usize, new: &str| {
        let mut lines: Vec<&str> = plain.lines().collect();
        lines[line] = new;
        (lines.join("\n") + "\n").into_bytes()
    };
    let zero = |at: usize| {
        let mut bytes = plain.clone().into_bytes();
        bytes[at] = 0;
        bytes
    };
    let latin = |at: usize, with: &[u8]| {
        let mut bytes = plain.clone().into_bytes();
        bytes[at..at + with.len()].copy_from_slice(with);
        bytes
    };
    let end = plain.len();
    let cases: Vec<(&str, Vec<u8>)> = vec![
        ("text", at(16_500, "1,x,2,3")),
        ("comma", at(16_500, "1;5,0,2,3")),
        ("ragged", at(16_500, "1,2,3")),
        ("quote", at(16_500, "1,\"2,3,4")),
        ("back", at(16_500, "1,0,2,3")),
        ("zero", zero(end / 2)),
        ("zero on the seam", zero(1 << 18)),
        ("zero behind a wrong number", [at(50, "1,x,2,3"), vec![0]].concat()),
        ("latin", latin(end / 2, b"\xE9")),
        ("latin at the end", latin(end - 1, b"\xC3")),
        ("latin before zero", latin(end / 2, b"\xC3\0")),
        ("cut character on the seam", latin((1 << 18) - 1, b"\xC3\xA9\xC3")),
        ("utf-16", b"\xFF\xFEt\0i\0".iter().copied().chain(plain.bytes()).collect()),
        ("zip", b"PK\x03\x04".iter().copied().chain(plain.bytes()).collect()),
        ("no header", plain.lines().skip(1).flat_map(|l| l.bytes().chain([b'\n'])).collect()),
        ("other header", plain.replace("force_n", "fource_n").into_bytes()),
        ("twice the name", plain.replace("velocity_mps", "force_n").into_bytes()),
        ("header alone", b"time_s,position_m,force_n\n".to_vec()),
        ("one row", b"time_s,position_m,force_n\n0,0,0\n".to_vec()),
        ("no slope", b"time_s,position_m,force_n\n0,0,0\n1e-300,1e300,0\n1,1,1\n".to_vec()),
    ];
    for (name, bytes) in cases {
        assert!(same_result(name, &bytes, &PLAIN).is_err(), "{name}");
    }
}

#[test]
fn files_that_cannot_be_read_in_pieces_are_left_to_the_other_reader() {
    let folder = TempFolder::new("other");
    let blank = "\n".repeat(300_000) + &text(&insertions(100), true);
    for (name, bytes) in
        [("empty", b"".to_vec()), ("far", blank.into_bytes()), ("parquet", b"PAR1 and so on\n".to_vec())]
    {
        let path = folder.0.join(name);
        std::fs::write(&path, bytes).expect("a folder file");
        assert!(read_in_pieces(&path, &PLAIN, &folder.0).is_none(), "{name}");
    }
    let missing = read_in_pieces(&folder.0.join("missing"), &PLAIN, &folder.0).expect("an error");
    assert_eq!(missing.err(), read_at_once(&folder.0.join("missing"), &PLAIN).err());
}
