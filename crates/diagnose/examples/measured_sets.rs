//! Tables of `docs/explanation/measured.md` for the measured sets.
//!
//! ```sh
//! STYLET_MEASURED=folder cargo run --release -p stylet-diagnose --example measured_sets
//! ```
//!
//! Files are `needle_phantom/{skin-on-muscle,skin,muscle}_*.csv`; arguments select sets, `shifted` adds the
//! stack with the recordings of its second speed moved by 1.5 mm. Prints tables and the processor time of
//! one fit, writes nothing.

mod assumed_tissue;

use assumed_tissue::assumed_tissue;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use std::error::Error;
use std::path::{Path, PathBuf};
use stylet_diagnose::repeated_insertions::cross_validation::{
    PHASE_NAMES, PredictionScore, leave_one_out_scores, leave_speed_out, repeatability_floor,
};
use stylet_diagnose::repeated_insertions::multistart_fit::{draw_starts, multistart_fit};
use stylet_diagnose::repeated_insertions::{SegmentedRecording, segmented_recording, stick_slip_fit};
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_record::{ColumnMap, ReadOptions, read_csv};

/// Seed of the start values.
const SEED: u64 = 15;
/// Shift of the recordings of one speed in m.
const SHIFT_M: f64 = 1.5e-3;
/// Columns of the recordings.
const COLUMNS: &str =
    r#"(time: (name: "time", scale: 1e-6), position: (name: "pz", scale: 1e-3), force: (name: "fz"))"#;

fn main() -> Result<(), Box<dyn Error>> {
    let folder =
        std::env::var_os("STYLET_MEASURED").ok_or("set STYLET_MEASURED to the folder of recordings")?;
    let folder = PathBuf::from(folder).join("needle_phantom");
    let chosen: Vec<String> = std::env::args().skip(1).collect();
    for (name, layers, shift_m) in
        [("skin-on-muscle", 2, 0.0), ("skin", 1, 0.0), ("muscle", 1, 0.0), ("shifted", 2, SHIFT_M)]
    {
        if chosen.iter().any(|c| c == name) || (chosen.is_empty() && name != "shifted") {
            let files = if name == "shifted" { "skin-on-muscle" } else { name };
            print_set(name, &read(&folder, files, layers)?, layers, shift_m)?;
        }
    }
    Ok(())
}

fn read(folder: &Path, name: &str, layers: usize) -> Result<Vec<SegmentedRecording>, Box<dyn Error>> {
    let columns: ColumnMap = stylet_scenario::parse("columns", COLUMNS)?;
    let options = ReadOptions { columns: Some(columns), ..ReadOptions::default() };
    let start = format!("{name}_");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)?.flatten().map(|e| e.path()).collect();
    files.retain(|f| f.file_name().is_some_and(|n| n.to_string_lossy().starts_with(&start)));
    files.sort();
    let mut out = Vec::new();
    for file in files {
        let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        out.push(SegmentedRecording::new(name, read_csv(&file, &options)?.0, layers));
    }
    Ok(out)
}

/// Processor time (s) of all threads of this process so far, independent of other load.
fn cpu_s() -> f64 {
    use nix::sys::resource::{UsageWho, getrusage};
    getrusage(UsageWho::RUSAGE_SELF).map_or(f64::NAN, |usage| {
        let (user, system) = (usage.user_time(), usage.system_time());
        (user.tv_sec() + system.tv_sec()) as f64 + 1e-6 * (user.tv_usec() + system.tv_usec()) as f64
    })
}

fn print_set(
    name: &str,
    all: &[SegmentedRecording],
    layers: usize,
    shift_m: f64,
) -> Result<(), Box<dyn Error>> {
    let plain: Vec<&SegmentedRecording> = all.iter().collect();
    let groups = segmented_recording::group_by_speed_and_stroke(&plain);
    let moved: Vec<SegmentedRecording> = all
        .iter()
        .enumerate()
        .map(|(i, run)| {
            let mut recording = run.recording.clone();
            if shift_m != 0.0 && groups.get(1).is_some_and(|g| g.contains(&i)) {
                recording.position_m.iter_mut().for_each(|z| *z += shift_m);
            }
            SegmentedRecording::new(run.name.clone(), recording, layers)
        })
        .collect();
    let recordings: Vec<&SegmentedRecording> = moved.iter().collect();
    println!("\n# {name}: {} recordings", recordings.len());
    let starts = draw_starts(&assumed_tissue(layers), &recordings, 1, &mut ChaCha8Rng::seed_from_u64(SEED));
    let before = cpu_s();
    let one = multistart_fit(&starts, &recordings, &SensorArtefacts::default());
    println!(
        "one multi-start fit: {:.1} s of processor time, RMS residual {:.3} N",
        cpu_s() - before,
        one.first().map_or(f64::NAN, |f| f.rms_n())
    );
    let stick_slip = stick_slip_fit::fit_stick_slip(
        &assumed_tissue(layers),
        &recordings,
        &SensorArtefacts::default(),
        &mut ChaCha8Rng::seed_from_u64(SEED),
    );
    let fit = stick_slip.ok_or("no model could be fitted")?.set_fit;
    println!("RMS residual {:.3} N; {} of {} starts agree", fit.rms_n(), fit.starts.1, fit.starts.0);
    let model = &fit.fit.model;
    println!("surface {:.2} mm", 1e3 * model.tissue.surface_m);
    for (layer, term) in model.tissue.layers.iter().zip(0..) {
        println!("layer {}: {:.1} mm, {:.0} N/m", term + 1, 1e3 * layer.thickness_m, layer.stiffness_n_per_m);
    }
    for term in &model.effects {
        let numbers =
            term.info.parameters.iter().zip(&term.values).map(|(p, v)| format!("{} {v:.4}", p.path));
        println!("{}: {}", term.info.id, numbers.collect::<Vec<_>>().join(", "));
    }
    let s = &model.scatter;
    println!(
        "between recordings: surface {:.2} mm, friction {:.1} %, puncture {:.1} %; between days: surface {:.2} mm, friction {:.1} %",
        1e3 * s.surface_m,
        1e2 * s.ln_friction,
        1e2 * s.rupture_force,
        1e3 * s.day_surface_m,
        1e2 * s.day_ln_friction
    );
    for (day, g) in model.days.iter().zip(&groups) {
        let speed = 1e3 * recordings[g[0]].speed_mps;
        println!(
            "day of {speed:.2} mm/s: surface {:+.2} mm, friction {:+.3}",
            1e3 * day.surface_m,
            day.ln_friction
        );
    }
    let (floors, one, day) = (
        repeatability_floor(&recordings),
        leave_one_out_scores(&fit, &recordings),
        leave_speed_out(&fit, &recordings),
    );
    println!("| mm/s | floor | unbiased floor | held out | coverage | speed held out | coverage |");
    let mean = |g: &[usize], f: &dyn Fn(usize) -> Option<f64>| {
        let known: Vec<f64> = g.iter().filter_map(|i| f(*i)).collect();
        if known.is_empty() {
            "-".to_owned()
        } else {
            format!("{:.3}", known.iter().sum::<f64>() / known.len() as f64)
        }
    };
    let line = |name: String, g: &[usize]| {
        let inflated = |i: usize| floors[i].as_ref().map(|f| f.0.rmse_n);
        let bare = |i: usize| floors[i].as_ref().map(|f| f.0.rmse_n * (f.1 as f64 / (f.1 + 1) as f64).sqrt());
        println!(
            "| {name} | {} | {} | {} | {} | {} | {} |",
            mean(g, &inflated),
            mean(g, &bare),
            mean(g, &|i| Some(one[i].rmse_n)),
            mean(g, &|i| Some(one[i].coverage)),
            mean(g, &|i| day.get(i).map(|s| s.rmse_n)),
            mean(g, &|i| day.get(i).map(|s| s.coverage))
        );
    };
    for g in &groups {
        line(format!("{:.2}", 1e3 * recordings[g[0]].speed_mps), g);
    }
    line("all".to_owned(), &(0..recordings.len()).collect::<Vec<_>>());
    println!("| phase | floor | held out | ratio to the floor |");
    let pooled = |scores: &mut dyn Iterator<Item = &PredictionScore>, k: usize| {
        let (sum, n) =
            scores.fold((0.0, 0.0), |(s, n), x| (s + x.phase_squares[k].0, n + x.phase_squares[k].1));
        (sum / f64::max(n, 1.0)).sqrt()
    };
    for (k, name) in PHASE_NAMES.iter().enumerate() {
        let (f, o) = (pooled(&mut floors.iter().flatten().map(|f| &f.0), k), pooled(&mut one.iter(), k));
        println!("| {name} | {f:.3} | {o:.3} | {:.2} |", o / f.max(1e-9));
    }
    Ok(())
}
