//! Export of streams for online detection: the second format holds the same bits, and recordings of a data set are a row of their own.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stylet_api::benchmark::{OnlineExport, TestedDetector, replay_streams, score_online};
use stylet_core::config::Algorithm;

/// A folder of its own, removed afterwards.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("stylet-online-export-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
        path
    }

    /// A data set of these files of the folder.
    fn data_set(&self, recordings: &str) -> PathBuf {
        let folder = self.0.display();
        let recordings =
            if recordings.is_empty() { String::new() } else { format!("\"{folder}/{recordings}\"") };
        self.write(
            "set.ron",
            &format!(
                r#"Dataset(
    name: "drawn",
    columns: (time: (name: "time", scale: 1e-6), position: (name: "pz", scale: 1e-3), force: (name: "fz")),
    tissue: (layers: [(thickness_m: 0.03, stiffness_n_per_m: 300.0, friction_ns_per_m2: 9000.0, puncture_n: 2.0)]),
    recordings: [{recordings}],
)"#
            ),
        )
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn export(rows: &[String]) -> OnlineExport<'_> {
    OnlineExport { world: "plain", rows, split: "judge", cases: 1, seed: 11, measured: None, parquet: false }
}

/// At 100 Hz: 2 mm/s for 8 s, a hold, and back. From 2 s on the force rises by 0.3 N/mm; it falls by 1.5 N at 5 s and by 0.2 N at 7 s.
/// Pulled back, the friction changes its sign over 1 mm.
fn recording() -> String {
    let mut text = String::from("time,fx,fy,fz,tx,ty,tz,px,py,pz\n");
    for k in 0..2000 {
        let t = 0.01 * f64::from(k);
        let mm = 2.0 * t.min(8.0).min(18.0 - t.max(10.0));
        let fallen = if t >= 5.0 { 1.5 } else { 0.0 } + if t >= 7.0 { 0.2 } else { 0.0 };
        let inside = 0.3 * (mm - 4.0).max(0.0);
        let back = ((t - 10.0) / 0.5).clamp(0.0, 1.0);
        let force = (1.0 - back) * (inside - fallen) - back * 0.1 * inside;
        // The last digit of the noise of a sensor.
        let noise = 0.002 * f64::from(k % 5 - 2);
        let _ = writeln!(text, "{},0,0,{},0,0,0,0,0,{mm}", 10_000 * k, force + noise);
    }
    text
}

#[cfg(feature = "formats")]
#[test]
fn parquet_holds_the_bits_of_the_csv() {
    use stylet_api::{ReadOptions, read_csv};
    let scratch = Scratch::new("parquet");
    scratch.write("run_1.csv", &recording());
    let data_set = scratch.data_set("run_*.csv");
    let rows = ["hold".to_owned(), "gaps".to_owned()];
    let folder = scratch.0.join("streams");
    let with_parquet = OnlineExport { parquet: true, measured: Some(&data_set), ..export(&rows) };
    assert_eq!(with_parquet.write(&folder).unwrap(), 3);
    for number in ["0001", "0002", "0003"] {
        let read = |ending: &str| {
            let path = folder.join("streams").join(format!("{number}.{ending}"));
            read_csv(&path, &ReadOptions::default()).unwrap().0
        };
        let (csv, parquet) = (read("csv"), read("parquet"));
        assert!(csv.time_s.len() > 500);
        let bits = |column: &[f64]| column.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&csv.time_s), bits(&parquet.time_s));
        assert_eq!(bits(&csv.position_m), bits(&parquet.position_m));
        assert_eq!(bits(&csv.force_n), bits(&parquet.force_n));
    }
}

#[cfg(not(feature = "formats"))]
#[test]
fn without_the_feature_parquet_is_refused_with_its_name() {
    let scratch = Scratch::new("no-parquet");
    let rows = ["hold".to_owned()];
    let folder = scratch.0.join("streams");
    let error = OnlineExport { parquet: true, ..export(&rows) }.write(&folder).unwrap_err().to_string();
    assert!(error.contains("--features formats") && !folder.exists(), "{error}");
}

#[test]
fn recordings_are_scored_by_the_falls_of_their_force_in_a_separate_row() {
    let scratch = Scratch::new("measured");
    scratch.write("run_1.csv", &recording());
    scratch.write("run_2.csv", &recording());
    let data_set = scratch.data_set("run_*.csv");
    let rows = ["hold".to_owned()];
    let folder = scratch.0.join("streams");
    let written = OnlineExport { measured: Some(&data_set), ..export(&rows) }.write(&folder).unwrap();
    assert_eq!(written, 3);
    assert!(!folder.join("truth.csv").exists());

    let key = std::fs::read_to_string(scratch.0.join("streams.key.json")).unwrap();
    let key: serde_json::Value = serde_json::from_str(&key).unwrap();
    assert!(key["measured"]["derivation"].as_str().is_some_and(|text| text.contains("0.3 N")));
    let measured = key["measured"]["streams"].as_object().unwrap();
    let mut events = String::from("stream,time_s\n");
    for (number, reference) in measured {
        let punctures = reference["punctures"].as_array().unwrap();
        assert_eq!(punctures.len(), 1, "{reference}");
        assert!((punctures[0]["time_s"].as_f64().unwrap() - 5.0).abs() < 1e-9);
        assert!((punctures[0]["drop_n"].as_f64().unwrap() - 1.5).abs() < 0.02);
        assert_eq!(reference["minor"].as_array().map(Vec::len), Some(1), "{reference}");
        // A hit, an event at the smaller fall, a false alarm.
        let _ = writeln!(events, "{number},5.02\n{number},7.02\n{number},15.0");
    }
    let answers = scratch.write("answers/events.csv", &events).parent().map(Path::to_owned).unwrap();
    let stylet = scratch.0.join("stylet");
    replay_streams(&folder, &TestedDetector::Core(Algorithm::Stylet), "Stylet", &stylet, 1, &|| {}).unwrap();
    let scores = score_online(&folder, &[answers, stylet]).unwrap();
    for score in &scores {
        assert_eq!(score.rows.iter().map(|r| r.row.as_str()).collect::<Vec<_>>(), ["hold", "measured"]);
        let row = &score.rows[1];
        assert_eq!((row.streams, row.punctures, row.missed), (2, 2, 0), "{}", score.entrant);
        assert_eq!(row.false_alarms, if score.entrant == "Stylet" { 0 } else { 2 }, "{}", score.entrant);
        assert!(row.delay_s[0].is_some_and(|delay_s| delay_s < 0.05));
        assert_eq!(row.enhancement_error, None);
    }
}

#[test]
fn a_data_set_without_recordings_or_for_choosing_settings_is_refused_and_leaves_nothing() {
    let scratch = Scratch::new("refused");
    let rows = ["hold".to_owned()];
    let folder = scratch.0.join("streams");
    for (recordings, split, expected) in [
        ("run_*.csv", "judge", "STYLET_MEASURED"),
        ("", "judge", "`recordings`"),
        ("run_*.csv", "make", "--measured"),
    ] {
        let data_set = scratch.data_set(recordings);
        let export = OnlineExport { measured: Some(&data_set), split, ..export(&rows) };
        let error = export.write(&folder).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
        assert!(!folder.exists() && !scratch.0.join("streams.key.json").exists());
    }
}
