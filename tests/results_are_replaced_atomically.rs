//! Promise: the files of a result are replaced as one set. A command that fails, is killed or meets another
//! one in its folder leaves the old set or the new one, never a mixture; the files with inputs and results
//! always belong together.

use crate::support;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use support::{Scratch, root, scenario, stderr_text, stylet, text};

/// All files of a folder, including hidden ones.
fn folder_contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = fs::read_dir(folder).expect("a folder").flatten().filter(|e| e.path().is_file());
    files
        .map(|e| (e.file_name().to_string_lossy().into_owned(), fs::read(e.path()).expect("a file")))
        .collect()
}

fn noise() -> String {
    text(&root().join("scenarios/sweeps/noise.ron"))
}

/// A sweep that runs until it is killed, after its first shard is written.
fn start_sweep(out: &str, seed: &str) -> Child {
    let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .args(["sweep", &noise(), "--trials", "200000", "--seed", seed, "--threads", "1", "--out", out])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("it starts");
    let deadline = Instant::now() + Duration::from_secs(120);
    let shards = || fs::read_dir(Path::new(out).join("shards")).map_or(0, Iterator::count);
    while shards() == 0 && Instant::now() < deadline && child.try_wait().expect("a state").is_none() {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(child.try_wait().expect("a state").is_none(), "it is still running");
    child
}

#[test]
fn a_full_disk_leaves_the_old_results_unchanged() {
    let scratch = Scratch::new("set-full");
    let out = scratch.path().join("out");
    let file = text(&scenario("three_layer_latex_constant"));
    let first = stylet(&["run", &file, "--seed", "1", "--quiet", "--out", &text(&out)]);
    assert!(first.status.success(), "{}", stderr_text(&first));
    let old = folder_contents(&out);
    assert!(old.contains_key("manifest.json") && old.contains_key("report.html"), "{:?}", old.keys());
    // Space for the small files, not for the large ones.
    let command = format!(
        "trap '' XFSZ; ulimit -f 64; '{}' run '{file}' --seed 2 --out '{}'",
        env!("CARGO_BIN_EXE_stylet"),
        out.display()
    );
    let output = Command::new("bash").args(["-c", &command]).env("NO_COLOR", "1").output().expect("bash");
    assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
    assert!(
        stderr_text(&output).contains("cannot be written")
            && stderr_text(&output).contains("nothing was changed"),
        "{}",
        stderr_text(&output)
    );
    assert!(folder_contents(&out) == old, "a file changed");
    let third = stylet(&["run", &file, "--seed", "2", "--quiet", "--out", &text(&out)]);
    assert!(third.status.success() && folder_contents(&out) != old);
}

#[test]
fn a_killed_sweep_leaves_the_old_results_unchanged() {
    let scratch = Scratch::new("set-killed");
    let out = scratch.path().join("out");
    let folder = text(&out);
    let first = stylet(&["sweep", &noise(), "--trials", "20", "--seed", "1", "--quiet", "--out", &folder]);
    assert!(first.status.success(), "{}", stderr_text(&first));
    let old = folder_contents(&out);
    let mut killed = start_sweep(&folder, "2");
    killed.kill().expect("it is ours");
    killed.wait().expect("it ends");
    assert!(folder_contents(&out) == old, "tables and sweep file belong together");
    let replayed = stylet(&["replay", &folder, "3", "--quiet"]);
    assert!(replayed.status.success(), "{}", stderr_text(&replayed));
    let seed = |csv: &[u8]| {
        let text = String::from_utf8_lossy(csv).into_owned();
        text.lines().nth(4).and_then(|row| row.split(',').nth(1)).expect("trial 3").to_owned()
    };
    let drawn = fs::read_to_string(out.join("trial-3/scenario.ron")).expect("its scenario");
    assert!(drawn.contains(&seed(&old["trials.csv"])), "trial 3 has the seed of its row");
}

#[test]
fn two_sweeps_cannot_share_a_folder() {
    let scratch = Scratch::new("set-two");
    let folder = text(&scratch.path().join("out"));
    let mut first = start_sweep(&folder, "1");
    let second = stylet(&["sweep", &noise(), "--trials", "20", "--seed", "2", "--out", &folder]);
    let merge = stylet(&["sweep", "merge", &noise(), "--trials", "20", "--out", &folder]);
    let run = stylet(&["run", &text(&scenario("three_layer_latex_constant")), "--out", &folder]);
    first.kill().expect("it is ours");
    first.wait().expect("it ends");
    for other in [second, merge, run] {
        assert_eq!(other.status.code(), Some(2), "{}", stderr_text(&other));
        assert!(
            stderr_text(&other).contains("another stylet") && stderr_text(&other).contains("--out"),
            "{}",
            stderr_text(&other)
        );
    }
    // The lock ends with its holder.
    let run = stylet(&["run", &text(&scenario("three_layer_latex_constant")), "--quiet", "--out", &folder]);
    assert!(run.status.success(), "{}", stderr_text(&run));
}

#[test]
fn a_modified_sweep_file_is_not_replayed() {
    let scratch = Scratch::new("set-exchanged");
    let out = scratch.path().join("out");
    let folder = text(&out);
    let first = stylet(&["sweep", &noise(), "--trials", "20", "--quiet", "--out", &folder]);
    assert!(first.status.success(), "{}", stderr_text(&first));
    let draw = fs::read_to_string(out.join("sweep.ron")).expect("the draw");
    assert!(draw.contains("seed: 1"), "{draw}");
    fs::write(out.join("sweep.ron"), draw.replace("seed: 1", "seed: 2")).expect("it can be written");
    let output = stylet(&["replay", &folder, "3", "--quiet"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
    assert!(
        stderr_text(&output).contains("sweep.ron") && stderr_text(&output).contains("same set"),
        "{}",
        stderr_text(&output)
    );
}
