//! What the first command costs as a whole: wall time and memory of `stylet run` on the constant
//! three-layer scenario, 50 s at 1 kHz with rapier, report and all.
//!
//! Run with `cargo bench --bench run_command`.

use nix::sys::resource::{UsageWho, getrusage};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

const RUNS: usize = 15;

fn main() {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/three_layer_latex_constant.ron");
    let out = std::env::temp_dir().join(format!("stylet-bench-run-{}", std::process::id()));
    let mut seconds: Vec<f64> = (0..RUNS)
        .map(|_| {
            let start = Instant::now();
            let status = Command::new(env!("CARGO_BIN_EXE_stylet"))
                .arg("run")
                .arg(&scenario)
                .arg("--out")
                .arg(&out)
                .stdout(Stdio::null())
                .status()
                .expect("the binary starts");
            assert!(status.success());
            start.elapsed().as_secs_f64()
        })
        .collect();
    let _ = std::fs::remove_dir_all(&out);
    seconds.sort_by(f64::total_cmp);
    let megabytes =
        getrusage(UsageWho::RUSAGE_CHILDREN).map_or(f64::NAN, |usage| usage.max_rss() as f64 / 1024.0);
    println!(
        "stylet run: {:.3} s (median of {RUNS}; fastest {:.3}, slowest {:.3}), at most {megabytes:.0} MB",
        seconds[RUNS / 2],
        seconds[0],
        seconds[RUNS - 1]
    );
}
