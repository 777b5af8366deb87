//! Promise: nothing that happens to a disk or a process mixes results. Wherever a command is killed, terminated, or told by the system that
//! it cannot write, its folder holds the old set or the new one; what fails says what, where and why, and leaves the old one.
//!
//! `tests/faults/shim.c` brings the faults, at every single call that changes the disk. By default `run` and `sweep` stand them;
//! `tests/faults.sh` takes all commands, and a hundred kills at any instant.
#![cfg(target_os = "linux")]

#[path = "faults/server.rs"]
mod server;
mod support;

use server::{Ended, Server, preloaded, shim};
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use support::{ONE_GEL, Scratch, stderr_text, stylet, text};

const SWEEP: &str = r#"Sweep(scenario: "gel.ron", trials: 2060, vary: [(path: "sensor.noise_n", with: Uniform(0.01, 0.02))])"#;

const KILLED: i32 = 9;
const TERMINATED: i32 = 15;

type Files = BTreeMap<String, Vec<u8>>;

/// Every file of a folder but those of what lies in folders of it, and scratch, of which [`left_over`] tells.
fn held(folder: &Path) -> Files {
    let files = fs::read_dir(folder).into_iter().flatten().flatten().filter(|e| e.path().is_file());
    files
        .filter(|e| !e.file_name().to_string_lossy().starts_with('.'))
        .map(|e| (e.file_name().to_string_lossy().into_owned(), fs::read(e.path()).expect("a file")))
        .collect()
}

/// Files and folders that are none of a set.
fn left_over(folder: &Path) -> Vec<String> {
    let all = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = all.filter(|e| e.path().is_dir() || e.file_name().to_string_lossy().starts_with('.'));
    names.map(|e| e.file_name().to_string_lossy().into_owned()).collect()
}

/// The folder as it was before: with files, or not there at all.
fn restore(folder: &Path, files: &Files) {
    let _ = fs::remove_dir_all(folder);
    if files.is_empty() {
        return;
    }
    fs::create_dir_all(folder).expect("a folder");
    for (name, content) in files {
        fs::write(folder.join(name), content).expect("a file");
    }
}

/// A command as a test sees it: what it is called, how it makes an older set, and how the new one.
struct Case {
    name: &'static str,
    old: Vec<String>,
    new: Vec<String>,
}

fn case(name: &'static str, common: &[&str], old: &[&str], new: &[&str]) -> Case {
    let all = |own: &[&str]| common.iter().chain(own).map(|word| (*word).to_owned()).collect();
    Case { name, old: all(old), new: all(new) }
}

/// The commands over one another's results, in a folder with their inputs.
fn cases(scratch: &Scratch) -> Vec<Case> {
    let gel = text(&scratch.file("gel.ron", ONE_GEL));
    let stiff = text(&scratch.file("stiff.ron", ONE_GEL.replace("60.0", "75.0")));
    let sweep = text(&scratch.file("sweep.ron", SWEEP));
    let data = |seed: &str| {
        let out = scratch.path().join(format!("data-{seed}"));
        made(&["run", &gel, "--seed", seed].map(str::to_owned), &out);
        text(&out.join("recording.csv"))
    };
    let (one, two) = (data("1"), data("2"));
    vec![
        case("run", &["run", &gel], &["--seed", "1"], &["--seed", "2"]),
        case("sweep", &["sweep", &sweep, "--threads", "1", "--resume"], &["--seed", "1"], &["--seed", "2"]),
        case("enhance", &["enhance"], &[&one], &[&two, "--compare"]),
        case("diagnose", &["diagnose"], &[&gel, "--data", &one], &[&stiff, "--data", &two]),
        case("reproduce", &["reproduce", "--seeds", "2"], &["--first-seed", "1"], &["--first-seed", "3"]),
    ]
}

fn to(arguments: &[String], out: &Path) -> Vec<String> {
    arguments.iter().cloned().chain(["--quiet".to_owned(), "--out".to_owned(), text(out)]).collect()
}

/// What a command writes into a folder when nothing happens to it.
fn made(arguments: &[String], out: &Path) -> Files {
    let output = stylet(&to(arguments, out));
    assert!(output.status.success(), "{arguments:?}: {}", stderr_text(&output));
    held(out)
}

/// The two sets of a case, and a file of somebody's own that is in both.
fn sets(case: &Case, out: &Path) -> (Files, Files) {
    restore(out, &Files::new());
    let mut old = made(&case.old, out);
    old.insert("notes.txt".to_owned(), b"mine".to_vec());
    restore(out, &old);
    let new = made(&case.new, out);
    assert!(old != new && left_over(out).is_empty(), "{}: two sets", case.name);
    (old, new)
}

/// One fault, judged.
fn judge(case: &Case, ended: &Ended, mode: char, at: u64, out: &Path, (old, new): (&Files, &Files)) {
    let what = format!("{} with {mode} at call {at} ({}): {}", case.name, ended.hit, ended.stderr_text);
    let (code, signal) = (ended.status.code(), ended.status.signal());
    let now = held(out);
    match mode {
        _ if ended.hit.is_empty() => assert_eq!((code, &now == new), (Some(0), true), "{what}"),
        'k' | 'a' => assert_eq!(signal, Some(KILLED), "{what}"),
        't' => assert_eq!(signal, Some(TERMINATED), "{what}"),
        _ => {
            let why = if "eE".contains(mode) { "Input/output error" } else { "No space left on device" };
            match code {
                // What fails when the new set is in its places is only the tidying.
                Some(0) => assert!(&now == new, "{what}: it says nothing and this is not the new set"),
                Some(2) => {
                    assert!(
                        ended.stderr_text.contains(why) && ended.stderr_text.contains(&text(out)),
                        "{what}"
                    );
                    // A disk on which nothing can be changed any more does not let anything be put back either.
                    assert!(mode == 'E' || &now == old, "{what}: the old set is not what it was");
                }
                other => panic!("{what}: exit code {other:?}, signal {signal:?}"),
            }
        }
    }
    stylet::output_folder::recover(out).unwrap_or_else(|why| panic!("{what}: {why}"));
    let now = held(out);
    assert!(&now == old || &now == new, "{what}: a mixture of {:?}", now.keys());
}

/// Every fault of `modes` at every `step`-th call of a command that writes over what is in its folder. Returns how many there were.
fn every_fault(shim: &Path, case: &Case, out: &Path, modes: &str, step: usize) -> u64 {
    let (old, new) = sets(case, out);
    let mut faults = 0;
    let nothing = Files::new();
    let without_notes: Files =
        new.iter().filter(|(name, _)| *name != "notes.txt").map(|(n, c)| (n.clone(), c.clone())).collect();
    for (old, new) in [(&old, &new), (&nothing, &without_notes)] {
        restore(out, old);
        let mut server = Server::new(shim, out, &to(&case.new, out));
        for mode in modes.chars() {
            for at in (1..).step_by(step) {
                restore(out, old);
                let ended = server.strike(mode, at);
                if ended.calls < at {
                    break;
                }
                faults += u64::from(!ended.hit.is_empty());
                judge(case, &ended, mode, at, out, (old, new));
                // Whatever is left behind, the next command makes the whole set of it, and a sweep that goes on the same bytes.
                let again = server.strike('-', 0);
                let what = format!("{} after {mode} at call {at} ({})", case.name, ended.hit);
                assert_eq!(again.status.code(), Some(0), "{what}: {}", again.stderr_text);
                assert!(&held(out) == new && left_over(out).is_empty(), "{what}: {:?}", left_over(out));
            }
        }
    }
    faults
}

fn out_of(scratch: &Scratch) -> PathBuf {
    fs::canonicalize(scratch.path()).expect("a folder").join("out")
}

#[test]
fn a_run_and_a_sweep_stand_every_fault_at_every_call() {
    let scratch = Scratch::in_memory("faults");
    let Some(shim) = shim(scratch.path()) else { return };
    let cases = cases(&scratch);
    let run = every_fault(&shim, &cases[0], &out_of(&scratch), "kateEnNs", 1);
    let sweep = every_fault(&shim, &cases[1], &out_of(&scratch), "kes", 31);
    assert!(run > 500 && sweep > 20, "{run} and {sweep} faults");
}

#[test]
#[ignore = "minutes; tests/faults.sh"]
fn all_commands_stand_every_fault_at_every_call() {
    let scratch = Scratch::in_memory("faults-all");
    let Some(shim) = shim(scratch.path()) else { return };
    for case in cases(&scratch) {
        let begun = Instant::now();
        let faults = every_fault(&shim, &case, &out_of(&scratch), "kateEnNs", 1);
        println!("{}: {faults} faults in {:.0} s, no mixture", case.name, begun.elapsed().as_secs_f64());
    }
}

#[test]
fn clocks_that_jump_change_no_byte() {
    let scratch = Scratch::in_memory("faults-clocks");
    let Some(clock) = preloaded(scratch.path(), "clock") else { return };
    let out = out_of(&scratch);
    for case in cases(&scratch).iter().filter(|case| case.name != "reproduce") {
        let new = made(&case.new, &out);
        restore(&out, &Files::new());
        let mut command = Command::new(env!("CARGO_BIN_EXE_stylet"));
        let output = command.args(to(&case.new, &out)).env("LD_PRELOAD", &clock).output().expect("it starts");
        assert!(output.status.success(), "{}: {}", case.name, stderr_text(&output));
        assert!(
            held(&out) == new && left_over(&out).is_empty(),
            "{}: the clock is in its results",
            case.name
        );
        restore(&out, &Files::new());
    }
}

/// SplitMix64 to a number in 0..1.
fn drawn(seed: u64) -> f64 {
    let x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[test]
#[ignore = "minutes; tests/faults.sh"]
fn a_hundred_kills_at_any_instant_leave_one_set() {
    let scratch = Scratch::in_memory("faults-kills");
    let out = out_of(&scratch);
    let mut met = 0;
    for case in cases(&scratch) {
        let (old, new) = sets(&case, &out);
        let begun = Instant::now();
        restore(&out, &old);
        assert!(made(&case.new, &out) == new);
        let takes = begun.elapsed().as_secs_f64();
        // The paper takes half a minute, the others a tenth of a second.
        let kills = if case.name == "reproduce" { 4 } else { 24 };
        let (mut olds, mut news) = (0, 0);
        for k in 0..kills {
            restore(&out, &old);
            let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
                .args(to(&case.new, &out))
                .env("RAYON_NUM_THREADS", "1")
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .expect("it starts");
            std::thread::sleep(Duration::from_secs_f64(1.1 * takes * drawn(1000 + k)));
            met += u32::from(child.try_wait().expect("a state").is_none());
            let _ = child.kill();
            let _ = child.wait();
            stylet::output_folder::recover(&out).expect("it settles");
            let now = held(&out);
            assert!(now == old || now == new, "{} at kill {k}: a mixture of {:?}", case.name, now.keys());
            if now == old { olds += 1 } else { news += 1 }
        }
        println!("{}: {kills} kills, {olds} left the old set, {news} the new one", case.name);
        assert!(made(&case.new, &out) == new && left_over(&out).is_empty(), "{} after the kills", case.name);
    }
    println!("{met} of 100 kills met a command at work");
    assert!(met > 50);
}
