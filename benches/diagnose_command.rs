//! What `stylet diagnose` costs as a whole: wall time and memory of the command on drawn cases of four
//! recordings (clean, single effects, two at once, outside the library), reading and report included.
//!
//! Run with `cargo bench --bench diagnose_command`; `STYLET_BENCH_CASES` sets the number of cases (default 24), `STYLET_BENCH_HZ` how
//! often they are sampled (1000, 500, 200 Hz; default 200, about 45 000 samples a case).

use nix::sys::resource::{UsageWho, getrusage};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use stylet_api::benchmark::own::aim;
use stylet_own_world::{self as hidden, Drawn, SAMPLE_HZ, sketch};
use stylet_stats::order_statistics::{median_of, quantile_of};
use stylet_tissue::Effect;

const SEED: u64 = 51;

/// A number from the environment.
fn set<T: std::str::FromStr>(name: &str) -> Option<T> {
    std::env::var(name).ok().and_then(|s| s.parse().ok())
}

fn write(drawn: &Drawn, hz: f64, folder: &Path) -> Vec<PathBuf> {
    let case = hidden::case_sampled(drawn, (1000.0 / hz).round() as usize);
    std::fs::create_dir_all(folder).expect("a folder for the recordings");
    let believed = folder.join("assumed.ron");
    std::fs::write(&believed, case.believed.to_ron().expect("a scenario")).expect("written");
    let mut files = vec![believed];
    for (k, recording) in case.recordings.iter().enumerate() {
        let file = folder.join(format!("{k}.csv"));
        let mut csv = Vec::new();
        stylet_record::write_csv(recording, None, &[], &mut csv).expect("a table");
        std::fs::write(&file, csv).expect("written");
        files.push(file);
    }
    files
}

/// The most memory that any of the commands had at once, in MB.
fn most_megabytes() -> f64 {
    getrusage(UsageWho::RUSAGE_CHILDREN).map_or(f64::NAN, |usage| usage.max_rss() as f64 / 1024.0)
}

fn main() {
    let cases = set("STYLET_BENCH_CASES").unwrap_or(24_u64);
    let hz = set("STYLET_BENCH_HZ").unwrap_or(SAMPLE_HZ);
    let folder = std::env::temp_dir().join(format!("stylet-bench-diagnose-{}", std::process::id()));
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("load of the machine before: {}", load.trim());
    let mut seconds = Vec::new();
    for index in 0..cases {
        let sketch = sketch(SEED, index);
        let drawn = aim(&sketch);
        let files = write(&drawn, hz, &folder);
        let start = Instant::now();
        let status = Command::new(env!("CARGO_BIN_EXE_stylet"))
            .arg("diagnose")
            .arg(&files[0])
            .arg("--data")
            .args(&files[1..])
            .arg("--out")
            .arg(folder.join("out"))
            .arg("--quiet")
            .stdout(Stdio::null())
            .status()
            .expect("the binary starts");
        assert!(status.success());
        let took = start.elapsed().as_secs_f64();
        let hidden: Vec<&str> = drawn.effects.iter().map(|e| e.id()).collect();
        println!(
            "{index:>3}  {took:.2} s  {:.0} MB so far  {:?} {}",
            most_megabytes(),
            sketch.kind,
            hidden.join(" + ")
        );
        seconds.push(took);
    }
    let _ = std::fs::remove_dir_all(&folder);
    let megabytes = most_megabytes();
    let of = |q: f64| quantile_of(seconds.iter().copied(), q);
    println!(
        "stylet diagnose at {hz} Hz: {:.2} s (median of {cases} cases; nine of ten within {:.2}, fastest {:.2}, slowest {:.2}), at most {megabytes:.0} MB",
        median_of(seconds.iter().copied()),
        of(0.9),
        of(0.0),
        of(1.0)
    );
}
