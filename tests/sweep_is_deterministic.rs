//! Promise: a sweep gives the same bytes for any number of threads, for any split into shards, and when resumed after SIGKILL or
//! Ctrl-C. Repeating one trial gives the scores of its row.

use crate::support;

use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use support::{Scratch, root, stderr_text, stylet, text};

const FILES: [&str; 5] = ["trials.csv", "summary.json", "report.html", "sweep.ron", "scenario.ron"];

fn noise() -> PathBuf {
    root().join("scenarios/sweeps/noise.ron")
}

fn files(folder: &Path) -> Vec<Vec<u8>> {
    FILES.iter().map(|f| fs::read(folder.join(f)).expect("a result")).collect()
}

fn sweep(out: &Path, extra: &[&str]) -> Vec<Vec<u8>> {
    let (file, folder) = (text(&noise()), text(out));
    let mut arguments = vec!["sweep", &file, "--quiet", "--out", &folder];
    arguments.extend(extra);
    let output = stylet(&arguments);
    assert!(output.status.success(), "{}", stderr_text(&output));
    files(out)
}

fn assert_same(a: &[Vec<u8>], b: &[Vec<u8>], what: &str) {
    for (name, (a, b)) in FILES.iter().zip(a.iter().zip(b)) {
        assert!(a == b, "{name} differs {what}");
    }
}

#[test]
fn one_two_three_and_seven_threads_give_the_same_bytes_and_another_seed_does_not() {
    let scratch = Scratch::new("sweep-threads");
    let run = |name: &str, extra: &[&str]| {
        let mut all = vec!["--trials", "60"];
        all.extend(extra);
        sweep(&scratch.path().join(name), &all)
    };
    let one = run("1", &["--threads", "1"]);
    for threads in ["2", "3", "7"] {
        assert_same(&one, &run(threads, &["--threads", threads]), &format!("with {threads} threads"));
    }
    assert_ne!(one[0], run("seed", &["--seed", "2"])[0]);
    let lines = String::from_utf8(one[0].clone()).expect("text").lines().count();
    assert_eq!(lines, 61);
}

#[test]
fn any_split_into_shards_in_any_order_gives_the_bytes_of_the_sequential_run() {
    let scratch = Scratch::new("sweep-shards");
    let whole = sweep(&scratch.path().join("whole"), &["--trials", "50"]);
    for of in [1, 3, 8, 50] {
        let out = scratch.path().join(format!("{of}"));
        for shard in (1..=of).rev() {
            let arguments =
                ["sweep", "run-shard", &format!("{shard}/{of}"), &text(&noise()), "--trials", "50"];
            let folder = text(&out);
            let output = stylet(&[&arguments[..], &["--threads", "1", "--out", &folder]].concat());
            assert!(output.status.success(), "{}", stderr_text(&output));
        }
        let output =
            stylet(&["sweep", "merge", &text(&noise()), "--trials", "50", "--quiet", "--out", &text(&out)]);
        assert!(output.status.success(), "{}", stderr_text(&output));
        assert_same(&whole, &files(&out), &format!("in {of} shards"));
        assert!(!out.join("shards").exists());
    }
}

/// Number of kills: `STYLET_KILLS` (20 in `tests/kill_twenty_times.sh`), 3 by default.
#[test]
fn a_killed_sweep_resumes_to_the_same_bytes() {
    let kills: u64 = std::env::var("STYLET_KILLS").ok().and_then(|k| k.parse().ok()).unwrap_or(3);
    let scratch = Scratch::new("sweep-kill");
    let trials = ["--trials", "4000"];
    let whole = sweep(&scratch.path().join("whole"), &trials);
    let out = scratch.path().join("killed");
    let (file, folder) = (text(&noise()), text(&out));
    let mut killed = 0;
    for k in 0..kills {
        let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
            .args(["sweep", &file, "--resume", "--threads", "1", "--out", &folder])
            .args(trials)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        // From before the first shard to after the third, spread by the golden ratio.
        std::thread::sleep(Duration::from_millis((k * 618_034 % 1_000_000) / 1400));
        // SIGKILL leaves no time for cleanup.
        killed += u32::from(child.try_wait().expect("a state").is_none());
        let _ = child.kill();
        let _ = child.wait();
    }
    assert!(killed > 0, "no kill met a running sweep");
    let resumed = sweep(&out, &[&trials[..], &["--resume"]].concat());
    assert_same(&whole, &resumed, "after kills");
}

#[test]
fn a_sweep_interrupted_by_ctrl_c_resumes_to_the_same_bytes() {
    let scratch = Scratch::new("sweep-ctrl-c");
    let trials = ["--trials", "6000"];
    let whole = sweep(&scratch.path().join("whole"), &trials);
    let out = scratch.path().join("ended");
    // `env` restores SIGINT, which a shell without a terminal ignores.
    let mut child = Command::new("env")
        .args(["--default-signal=INT", env!("CARGO_BIN_EXE_stylet"), "sweep", &text(&noise())])
        .args(["--threads", "1", "--out", &text(&out)])
        .args(trials)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("it starts");
    let shards = || fs::read_dir(out.join("shards")).map_or(0, Iterator::count);
    let deadline = Instant::now() + Duration::from_secs(120);
    while shards() < 2 && Instant::now() < deadline && child.try_wait().expect("a state").is_none() {
        std::thread::sleep(Duration::from_millis(2));
    }
    let pid = nix::unistd::Pid::from_raw(i32::try_from(child.id()).expect("a process id"));
    nix::sys::signal::kill(pid, nix::sys::signal::Signal::SIGINT).expect("it is running");
    let status = child.wait().expect("it ends");
    assert_eq!(status.signal(), Some(2), "ended by SIGINT: {status}");
    assert!(shards() >= 1 && !out.join("trials.csv").exists(), "in the middle, with whole shards left");
    let resumed = sweep(&out, &[&trials[..], &["--resume"]].concat());
    assert_same(&whole, &resumed, "after Ctrl-C");
}

#[test]
fn an_unfinished_sweep_is_not_overwritten_by_default() {
    let scratch = Scratch::new("sweep-unfinished");
    let out = text(scratch.path());
    let shard = ["sweep", "run-shard", "1/2", &text(&noise()), "--trials", "8", "--out", &out];
    assert!(stylet(&shard).status.success());
    let output = stylet(&["sweep", &text(&noise()), "--trials", "8", "--out", &out]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr_text(&output).contains("--resume"), "{}", stderr_text(&output));
    assert!(scratch.path().join("shards").exists());
}

#[test]
fn a_trial_replayed_alone_has_the_scores_of_its_row() {
    let scratch = Scratch::new("sweep-replay");
    let effects = root().join("scenarios/sweeps/effects.ron");
    let out = text(scratch.path());
    let output = stylet(&["sweep", &text(&effects), "--trials", "40", "--quiet", "--out", &out]);
    assert!(output.status.success(), "{}", stderr_text(&output));
    let csv = fs::read_to_string(scratch.path().join("trials.csv")).expect("a table");
    let names: Vec<&str> = csv.lines().next().expect("a header").split(',').collect();
    let column = |name: &str| names.iter().position(|n| *n == name).expect("a column");
    let mut compared = 0;
    for trial in [0, 7, 23, 39] {
        let row: Vec<&str> = csv.lines().nth(trial + 1).expect("a row").split(',').collect();
        let output = stylet(&["replay", &out, &trial.to_string(), "--quiet"]);
        assert!(output.status.success(), "{}", stderr_text(&output));
        let score = scratch.path().join(format!("trial-{trial}/score.json"));
        let score: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(score).expect("a score")).expect("JSON");
        for (name, value) in [
            ("missed", &score["missed"]),
            ("false", &score["false"]),
            ("enhancement.rms_relative", &score["enhancement"]["rms_relative"]),
            ("reconstruction_rms_n", &score["reconstruction_rms_n"]),
            (
                "layers[1].stiffness_n_per_m.relative_error",
                &score["layers"][1]["stiffness_n_per_m"]["relative_error"],
            ),
        ] {
            let found: f64 = row[column(name)].parse().unwrap_or(f64::NAN);
            let expected = value.as_f64().unwrap_or(f64::NAN);
            // The JSON reader rounds the last bit; the rest is the same.
            let same =
                (found - expected).abs() <= 1e-15 * found.abs() || (found.is_nan() && expected.is_nan());
            assert!(same, "trial {trial}, {name}: {found} and {expected}");
            compared += usize::from(!found.is_nan());
        }
    }
    assert!(compared > 10);
}
