//! Promise: all common CSV dialects give the same numbers, and repairs are reported.

use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

use proptest::prelude::*;
use stylet_record::{
    Column, ColumnMap, QualityKind, QualityNote, ReadOptions, RecordError, Recording, read_csv_bytes,
};

fn read_with(text: &[u8], options: &ReadOptions) -> Result<(Recording, Vec<QualityNote>), RecordError> {
    read_csv_bytes(text, Path::new("run.csv"), options)
}

fn read(text: &[u8]) -> Result<Recording, RecordError> {
    read_with(text, &ReadOptions::default()).map(|(recording, _)| recording)
}

#[test]
fn all_dialects_give_the_same_numbers() -> Result<(), RecordError> {
    let plain = read(b"time_s,position_m,force_n\n0,0.001,1\n0.5,0.002,2\n1,0.003,-3\n")?;
    assert_eq!(plain.time_s, [0.0, 0.5, 1.0]);
    assert_eq!(plain.position_m, [0.001, 0.002, 0.003]);
    assert_eq!(plain.force_n, [1.0, 2.0, -3.0]);
    let dialects: [&[u8]; 9] = [
        b"\xEF\xBB\xBFtime_s,position_m,force_n\r\n0,0.001,1\r\n0.5,0.002,2\r\n1,0.003,-3\r\n",
        b"time_s;position_m;force_n\n0;0.001;1\n0.5;0.002;2\n1;0.003;-3",
        b"time_s\tposition_m\tforce_n\n0\t0.001\t1\n0.5\t0.002\t2\n1\t0.003\t-3",
        b"  time_s , position_m ,force_n \n 0, 0.001 , 1\n0.5 ,0.002,2\n1,0.003,-3\n",
        b"\n \ntime_s,position_m,force_n\n\n0,0.001,1\n  \n0.5,0.002,2\n,,\n1,0.003,-3\n\n\n",
        b"\"time_s\",\"position_m\",\"force_n\"\n\"0\",\"0.001\",\"1\"\n0.5,0.002,2\n1,0.003,-3\n",
        b"time_s,position_m,force_n\r0,0.001,1\r0.5,0.002,2\r1,0.003,-3\r",
        b"force_n,note,time_s,position_m\n+1.0,\"a, b\nc\",0e0,1e-3\n2,,.5,2E-3\n-3.,x,1,0.003\n",
        b"note, with commas; time_s; position_m; force_n\na;0;0.001;1\nb;0.5;0.002;2\nc;1;0.003;-3\n",
    ];
    for dialect in dialects {
        assert_eq!(read(dialect)?, plain, "{}", String::from_utf8_lossy(dialect));
    }
    Ok(())
}

#[test]
fn optional_columns_are_read_when_present() -> Result<(), RecordError> {
    let mut text = String::from("time_s,position_m,force_n,velocity_mps,force_virtual_n");
    (1..=7).for_each(|joint| text.push_str(&format!(",joint_torque_{joint}_nm")));
    text.push_str("\n0,0,0,9,0.5,1,2,3,4,5,6,7\n1,1,1,9,0.6,1,2,3,4,5,6,7.5\n");
    let recording = read(text.as_bytes())?;
    assert!(recording.velocity_measured);
    assert_eq!(recording.velocity_mps, [9.0, 9.0]);
    assert_eq!(recording.force_virtual_n, Some(vec![0.5, 0.6]));
    assert_eq!(recording.joint_torque_nm[1], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5]);
    Ok(())
}

#[test]
fn a_column_map_converts_a_foreign_log_to_si_units() -> Result<(), RecordError> {
    let map = ColumnMap {
        time: Column::scaled("time", 1e-6),
        position: Column { offset: 0.25, ..Column::scaled("pz", -1e-3) },
        force: Column::si("fz"),
        ..ColumnMap::default()
    };
    let text = b"time,fx,fz,pz,velocity_mps\n0,9,1.5,250,7\n10000,9,2.5,249.98,7\n20000,9,3.5,249.96,7\n";
    let (recording, _) = read_with(text, &ReadOptions { columns: Some(map), repair: false })?;
    assert!((recording.sample_hz() - 100.0).abs() < 1e-9);
    assert_eq!(recording.position_m[0], 0.0);
    assert!((recording.position_m[2] - 4e-5).abs() < 1e-15);
    assert!(!recording.velocity_measured, "a map names everything that is read");
    assert!((recording.velocity_mps[1] - 0.002).abs() < 1e-12);
    Ok(())
}

#[test]
fn repair_drops_bad_time_stamps_and_names_their_lines() -> Result<(), RecordError> {
    let mut text =
        "time_s,position_m,force_n\n\n0,0,1\n0.1,0,2\n0.1,0,99\n\n0.2,0,3\n0.15,0,99\n0.3,0,4\n".to_owned();
    (4..300).for_each(|k| text += &format!("{},0,5\n", 0.1 * f64::from(k)));
    let options = ReadOptions { repair: true, ..ReadOptions::default() };
    let (recording, notes) = read_with(text.as_bytes(), &options)?;
    assert_eq!(recording.force_n[..5], [1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(notes[0].kind, QualityKind::RepairedRows);
    assert_eq!(notes[0].lines, [5, 8]);
    assert!(
        notes[0].message.contains("2 row(s) dropped") && notes[0].message.contains("5, 8"),
        "{}",
        notes[0].message
    );
    recording.check()
}

#[test]
fn repair_does_not_change_a_valid_recording() -> Result<(), RecordError> {
    let text = b"time_s,position_m,force_n\n0,0,1\n0.1,0,2\n0.2,0,3\n";
    let (recording, notes) = read_with(text, &ReadOptions { repair: true, ..ReadOptions::default() })?;
    assert_eq!((recording, notes), read_with(text, &ReadOptions::default())?);
    Ok(())
}

#[test]
fn a_million_rows_are_read_and_assessed_in_seconds() -> Result<(), RecordError> {
    let mut text = String::from("time_s,position_m,force_n\n");
    for i in 0..1_000_000 {
        let time_s = f64::from(i) * 1e-4;
        let _ = writeln!(
            text,
            "{time_s:.6},{:.9},{:.9}",
            time_s * 1e-3,
            (time_s * 3.0).sin() + (time_s * 7000.0).sin() * 0.01
        );
    }
    let begin = Instant::now();
    let recording = read(text.as_bytes())?;
    let took = begin.elapsed();
    println!("1e6 rows, {} MB: {took:?}", text.len() / 1_000_000);
    assert_eq!(recording.len(), 1_000_000);
    // Generous, since test machines are shared; a quadratic step would take hours.
    assert!(took.as_secs() < 20, "{took:?}");
    Ok(())
}

#[test]
fn a_million_rows_within_one_differentiation_window_take_linear_time() -> Result<(), RecordError> {
    let time_s: Vec<f64> = (0..1_000_000).map(|i| f64::from(i) * 1e-9).collect();
    let position_m = time_s.iter().map(|t| t * 0.01).collect();
    let begin = Instant::now();
    let recording = Recording::new(time_s, position_m, vec![0.0; 1_000_000])?;
    assert!((recording.velocity_mps[123_456] - 0.01).abs() < 1e-9);
    assert!(begin.elapsed().as_secs() < 10);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_bytes_are_read_or_refused_and_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = read(&bytes);
    }

    #[test]
    fn arbitrary_tables_are_read_or_refused_and_what_is_read_is_valid(
        body in "([-0-9.eE,;\t\" \r\nnaif]|,[0-9]|\n[0-9],){0,80}",
        repair: bool,
    ) {
        let text = format!("time_s,position_m,force_n\n{body}");
        if let Ok((recording, _)) = read_with(text.as_bytes(), &ReadOptions { repair, columns: None }) {
            prop_assert!(recording.check().is_ok());
        }
    }
}
