//! A recording that is streamed from disk gives the same files as one in memory, byte for byte; only the report of one that
//! is longer than a page can draw shows a selection, with a note.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use stylet_api::enhancement::{EnhancementResult, ResultSource, enhance_long_recording, enhance_recording};
use stylet_api::{EnhancerConfigFile, Error, IdentifiedModel, OutputLock, ReadOptions, Scenario};
use stylet_core::config::{Algorithm, EnhanceConfig, Model};
use stylet_record::{read_csv, read_long_csv};

struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("stylet-api-long-{}-{name}", std::process::id()));
        fs::create_dir_all(&folder).expect("a scratch folder");
        Self(folder)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Insertions of 10 s at 1 kHz through layers of 15 mm that rupture, one after the other.
fn log(samples: usize, velocity: bool) -> String {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut text = String::from("time_s,position_m,force_n,force_virtual_n");
    text.push_str(if velocity { ",velocity_mps\n" } else { "\n" });
    for k in 0..samples {
        let phase = (k % 10_000) as f64 * 1e-3;
        let (z, v) = if phase < 6.0 { (0.01 * phase, 0.01) } else { (0.06 - 0.015 * (phase - 6.0), -0.015) };
        let inside = (z - 0.015_f64).max(0.0);
        let force = if v > 0.0 { 60.0 * (inside % 0.015) } else { 0.0 } + 2000.0 * inside * v;
        let force = force + 0.02 * (uniform() + uniform() + uniform());
        write!(text, "{:.3},{z:.6},{force:.6},{k}", k as f64 * 1e-3).expect("a string");
        if velocity {
            write!(text, ",{v}").expect("a string");
        }
        text.push('\n');
    }
    text
}

fn of(config: EnhanceConfig) -> EnhancerConfigFile {
    EnhancerConfigFile { enhance: config, ..EnhancerConfigFile::default() }
}

/// Enhances a recording in memory and from disk and compares the files; returns the result from disk.
fn compare_outputs(
    name: &str,
    text: &str,
    config: &EnhancerConfigFile,
    models: &[Model],
    law: Option<&IdentifiedModel>,
    same: &[&str],
) -> Result<(), Error> {
    let scratch = Scratch::new(name);
    let path = scratch.0.join("log.csv");
    fs::write(&path, text).expect("a scratch file");
    let source =
        |path| ResultSource { data: path, config: None, command: "stylet enhance log.csv".to_owned() };
    let (here, there) = (scratch.0.join("here"), scratch.0.join("there"));

    let (recording, notes) = read_csv(&path, &ReadOptions::default())?;
    let enhanced = enhance_recording(recording, notes, config.clone(), models, law)?;
    let found = summary(&enhanced);
    assert!(found.contains("rupture"), "{name}: there was something to be found: {found}");
    enhanced.output_files(&source(&path))?.write(&here)?;

    let lock = OutputLock::new(&there)?;
    let (recording, notes) = read_long_csv(&path, &ReadOptions::default(), &there)?.expect("a plain file");
    let enhanced = enhance_long_recording(&recording, notes, config.clone(), models, law, &lock)?;
    assert_eq!(summary(&enhanced), found, "{name}");
    enhanced.output_files(&source(&path))?.write_locked(&lock)?;
    drop((recording, lock));

    for file in same {
        let read = |folder: &Path| fs::read(folder.join(file)).expect("a result");
        assert!(read(&here) == read(&there), "{name}: {file} differs");
    }
    let names = |folder: &Path| {
        let mut names: Vec<_> =
            fs::read_dir(folder).expect("results").flatten().map(|e| e.file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(names(&here), names(&there), "{name}: nothing else is left");
    let page = fs::read_to_string(there.join("report.html")).expect("a report");
    assert_eq!(page.contains("more than a page can draw"), !same.contains(&"report.html"), "{name}");
    Ok(())
}

fn summary(enhanced: &EnhancementResult) -> String {
    let mut text = format!("{:?} {}", enhanced.extent, enhanced.hash);
    for ran in &enhanced.algorithm_runs {
        let trace = &ran.trace;
        let _ = write!(text, "\n{} contact {:?} {:?}", ran.name, trace.contact_m, trace.contact_s);
        trace.detections.iter().for_each(|d| text += &format!("\nrupture {d:?}"));
        trace.estimates.iter().for_each(|e| text += &format!("\nlayer {e:?}"));
    }
    text
}

/// A model whose shaft friction depends on its ruptures.
fn law() -> IdentifiedModel {
    let text = r#"Scenario(name: "dry", tissue: (surface_m: 0.015, layers: [
        (thickness_m: 0.015, stiffness_n_per_m: 60.0, friction_ns_per_m2: 2000.0),
        (thickness_m: 0.015, stiffness_n_per_m: 60.0, friction_ns_per_m2: 2000.0)]),
        effects: [CoulombFriction(c_n_per_m: 2.0), TimeDelay(delay_s: 0.01)], motion: Recorded)"#;
    IdentifiedModel::new("law.ron", &Scenario::parse("law.ron", text).expect("a scenario")).expect("a law")
}

const BOTH: [Model; 2] = [Model::MultiLayer, Model::KelvinVoigt];
const TABLES: [&str; 3] = ["enhanced.csv", "enhance.json", "events.json"];
const ALL: [&str; 6] =
    ["enhanced.csv", "enhance.json", "events.json", "report.html", "figure.svg", "manifest.json"];

#[test]
fn a_recording_that_a_page_can_draw_gives_the_same_files_from_disk_and_from_memory() -> Result<(), Error> {
    let paper = EnhanceConfig { algorithm: Algorithm::Paper, ..EnhanceConfig::paper() };
    compare_outputs(
        "short",
        &log(20_000, true),
        &EnhancerConfigFile::default(),
        &[Model::MultiLayer],
        None,
        &ALL,
    )?;
    compare_outputs(
        "positions",
        &log(19_000, false),
        &EnhancerConfigFile::default(),
        &[Model::MultiLayer],
        None,
        &ALL,
    )?;
    let law = law();
    compare_outputs(
        "with a model",
        &log(18_000, true),
        &EnhancerConfigFile::default(),
        &[Model::MultiLayer],
        Some(&law),
        &ALL,
    )?;
    compare_outputs("compared", &log(17_000, true), &of(paper), &BOTH, None, &ALL)
}

#[test]
fn a_longer_recording_gives_the_same_tables_and_a_report_that_states_what_it_shows() -> Result<(), Error> {
    let paper = EnhanceConfig { algorithm: Algorithm::Paper, ..EnhanceConfig::paper() };
    compare_outputs(
        "long",
        &log(60_000, true),
        &EnhancerConfigFile::default(),
        &[Model::MultiLayer],
        None,
        &TABLES,
    )?;
    compare_outputs("long, compared", &log(50_000, false), &of(paper), &BOTH, None, &TABLES)
}

#[test]
fn after_a_restart_of_the_clock_the_contact_is_of_the_last_insertion() -> Result<(), Error> {
    // A quarter of an hour between two insertions of 10 s.
    let paused: String = log(20_000, true)
        .lines()
        .enumerate()
        .map(|(k, line)| match line.split_once(',') {
            Some((_, rest)) if k > 10_000 => format!("{:.3},{rest}\n", (k - 1) as f64 * 1e-3 + 900.0),
            _ => format!("{line}\n"),
        })
        .collect();
    let config = EnhancerConfigFile::default();
    compare_outputs("paused", &paused, &config, &[Model::MultiLayer], None, &ALL)
}
