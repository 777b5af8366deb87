//! What `stylet diagnose` costs as a whole: wall time and memory of the command on drawn cases of four
//! recordings (clean, single effects, two at once, outside the library), reading and report included.
//!
//! Run with `cargo bench --bench diagnose_command`; `STYLET_BENCH_CASES` sets the number of cases
//! (default 24).

use nix::sys::resource::{UsageWho, getrusage};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use stylet_api::benchmark::own::aim;
use stylet_own_world::{self as hidden, Drawn, sketch};
use stylet_tissue::Effect;

const SEED: u64 = 51;

fn write(drawn: &Drawn, folder: &Path) -> Vec<PathBuf> {
    let case = hidden::case(drawn);
    std::fs::create_dir_all(folder).expect("a folder for the recordings");
    let believed = folder.join("believed.ron");
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

fn main() {
    let cases = std::env::var("STYLET_BENCH_CASES").ok().and_then(|s| s.parse().ok()).unwrap_or(24_u64);
    let folder = std::env::temp_dir().join(format!("stylet-bench-diagnose-{}", std::process::id()));
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("load of the machine before: {}", load.trim());
    let mut seconds = Vec::new();
    for index in 0..cases {
        let sketch = sketch(SEED, index);
        let drawn = aim(&sketch);
        let files = write(&drawn, &folder);
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
        println!("{index:>3}  {took:.2} s  {:?} {}", sketch.kind, hidden.join(" + "));
        seconds.push(took);
    }
    let _ = std::fs::remove_dir_all(&folder);
    seconds.sort_by(f64::total_cmp);
    let megabytes =
        getrusage(UsageWho::RUSAGE_CHILDREN).map_or(f64::NAN, |usage| usage.max_rss() as f64 / 1024.0);
    if let (Some(first), Some(last)) = (seconds.first(), seconds.last()) {
        println!(
            "stylet diagnose: {:.2} s (median of {cases} cases; nine of ten within {:.2}, fastest {first:.2}, slowest {last:.2}), at most {megabytes:.0} MB",
            seconds[seconds.len() / 2],
            seconds[(9 * seconds.len()).div_ceil(10) - 1]
        );
    }
}
