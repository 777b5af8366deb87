//! Wall time and memory of `stylet diagnose` on simulated cases of the plain world, a quarter each with no hidden effect, one, two, and an
//! effect that the library lacks; reading and report included.
//!
//! Run with `cargo bench --bench diagnose_command`; `STYLET_BENCH_CASES` sets the number of cases (default 24).

use nix::sys::resource::{UsageWho, getrusage};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use stylet_examine::{Case, Hide, Plan};
use stylet_stats::order_statistics::{median_of, quantile_of};

const SEED: u64 = 51;

/// A number from the environment.
fn set<T: std::str::FromStr>(name: &str) -> Option<T> {
    std::env::var(name).ok().and_then(|s| s.parse().ok())
}

/// Writes a case as files: the assumed scenario first, then the recordings.
fn write(case: &Case, folder: &Path) -> Vec<PathBuf> {
    std::fs::create_dir_all(folder).expect("a folder for the recordings");
    let assumed = folder.join("assumed.ron");
    let assumed_ron = case.question.assumed_ron.as_deref().expect("a scenario");
    std::fs::write(&assumed, assumed_ron).expect("written");
    let mut files = vec![assumed];
    for (k, named) in case.question.recordings.iter().enumerate() {
        let file = folder.join(format!("{k}.csv"));
        let mut csv = Vec::new();
        stylet_record::write_csv(&named.recording, None, &[], &mut csv).expect("a table");
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
    let hide = vec![Hide::Clean, Hide::One, Hide::Two, Hide::Outside];
    let plan = Plan { hide, cases, seed: SEED, ..Plan::default() };
    let folder = std::env::temp_dir().join(format!("stylet-bench-diagnose-{}", std::process::id()));
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("load of the machine before: {}", load.trim());
    let mut seconds = Vec::new();
    for (index, id) in plan.cases().iter().enumerate() {
        let case = stylet_examine::make_case(id).expect("a case");
        let files = write(&case, &folder);
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
        println!("{index:>3}  {took:.2} s  {:.0} MB so far  {}", most_megabytes(), id.name());
        seconds.push(took);
    }
    let _ = std::fs::remove_dir_all(&folder);
    let megabytes = most_megabytes();
    let of = |q: f64| quantile_of(seconds.iter().copied(), q);
    println!(
        "stylet diagnose: {:.2} s (median of {cases} cases; nine of ten within {:.2}, fastest {:.2}, slowest {:.2}), at most {megabytes:.0} MB",
        median_of(seconds.iter().copied()),
        of(0.9),
        of(0.0),
        of(1.0)
    );
}
