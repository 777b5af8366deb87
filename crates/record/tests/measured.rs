//! Promise: every recording of the measured needle phantom reads through its column map. The data are not in the repository:
//! `STYLET_MEASURED` names their folder, and the test is skipped without it.

use std::path::PathBuf;

use stylet_record::{Column, ColumnMap, QualityKind, ReadOptions, RecordError, read_csv};

#[test]
fn every_measured_insertion_reads_with_its_column_map() -> Result<(), RecordError> {
    let Some(folder) = std::env::var_os("STYLET_MEASURED").map(|f| PathBuf::from(f).join("needle_phantom"))
    else {
        eprintln!("skipped: STYLET_MEASURED does not name the folder of the measured recordings");
        return Ok(());
    };
    let entries = std::fs::read_dir(&folder).expect("the folder of STYLET_MEASURED");
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "csv"))
        .collect();
    files.sort();
    let map = ColumnMap {
        time: Column::scaled("time", 1e-6),
        position: Column::scaled("pz", 1e-3),
        force: Column::si("fz"),
        ..ColumnMap::default()
    };
    let options = ReadOptions { columns: Some(map), repair: false };
    for file in &files {
        let (recording, notes) = read_csv(file, &options)?;
        let deepest_m = recording.position_m.iter().copied().fold(f64::MIN, f64::max);
        let fastest_mps = recording.velocity_mps.iter().copied().fold(f64::MIN, f64::max);
        println!(
            "{}: {} samples, {:.1} Hz, to {:.1} mm, at most {:.2} mm/s",
            file.file_name().unwrap_or_default().display(),
            recording.len(),
            recording.sample_hz(),
            deepest_m * 1e3,
            fastest_mps * 1e3
        );
        notes.iter().for_each(|note| println!("    {:?}: {}", note.kind, note.message));
        assert!(
            (70.0..=110.0).contains(&recording.sample_hz()),
            "nominally 100 Hz, a little slower on a busy machine"
        );
        assert!(deepest_m < 0.0255, "the protocol pushes by 25 mm");
        assert!(fastest_mps < 0.03, "slow insertions, fast retraction at most");
        assert!(
            notes
                .iter()
                .all(|note| note.kind != QualityKind::UnitMixUp && note.kind != QualityKind::Saturation)
        );
    }
    assert!(!files.is_empty(), "the folder {} has no CSV file", folder.display());
    Ok(())
}
