//! No disk fault or kill mixes results. Wherever a command is killed, terminated or gets a write error, its folder holds the old or the new
//! set; a failed command reports what, where and why, and leaves the old set.
//!
//! `tests/disk_faults/shim.c` injects the faults at every call that changes the disk. By default into `run` and `sweep`;
//! `tests/disk_faults.sh` takes all commands, and a hundred kills at random times.
#![cfg(target_os = "linux")]

#[path = "disk_faults/server.rs"]
mod server;
use crate::support;

use server::{Outcome, Server, preloaded, shim};
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

/// The files of a folder, without subfolders and hidden files (see [`staging_files`]).
fn set_in(folder: &Path) -> Files {
    let files = fs::read_dir(folder).into_iter().flatten().flatten().filter(|e| e.path().is_file());
    files
        .filter(|e| !e.file_name().to_string_lossy().starts_with('.'))
        .map(|e| (e.file_name().to_string_lossy().into_owned(), fs::read(e.path()).expect("a file")))
        .collect()
}

/// Hidden files and subfolders.
fn staging_files(folder: &Path) -> Vec<String> {
    let all = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = all.filter(|e| e.path().is_dir() || e.file_name().to_string_lossy().starts_with('.'));
    names.map(|e| e.file_name().to_string_lossy().into_owned()).collect()
}

/// Restores a folder to these files, or removes it.
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

/// A command with the arguments for an old and a new set of results.
struct Case {
    name: &'static str,
    old: Vec<String>,
    new: Vec<String>,
}

fn case(name: &'static str, common: &[&str], old: &[&str], new: &[&str]) -> Case {
    let all = |own: &[&str]| common.iter().chain(own).map(|word| (*word).to_owned()).collect();
    Case { name, old: all(old), new: all(new) }
}

/// The commands, each overwriting its own results.
fn cases(scratch: &Scratch) -> Vec<Case> {
    let gel = text(&scratch.file("gel.ron", ONE_GEL));
    let stiff = text(&scratch.file("stiff.ron", ONE_GEL.replace("60.0", "75.0")));
    let sweep = text(&scratch.file("sweep.ron", SWEEP));
    let data = |seed: &str| {
        let out = scratch.path().join(format!("data-{seed}"));
        written(&["run", &gel, "--seed", seed].map(str::to_owned), &out);
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

/// The files that a command writes without a fault.
fn written(arguments: &[String], out: &Path) -> Files {
    let output = stylet(&to(arguments, out));
    assert!(output.status.success(), "{arguments:?}: {}", stderr_text(&output));
    set_in(out)
}

/// The two sets of a case, with a file of the user in both.
fn sets(case: &Case, out: &Path) -> (Files, Files) {
    restore(out, &Files::new());
    let mut old = written(&case.old, out);
    old.insert("notes.txt".to_owned(), b"mine".to_vec());
    restore(out, &old);
    let new = written(&case.new, out);
    assert!(old != new && staging_files(out).is_empty(), "{}: two sets", case.name);
    (old, new)
}

/// Checks the outcome of one fault.
fn check_outcome(
    case: &Case,
    outcome: &Outcome,
    mode: char,
    at: u64,
    out: &Path,
    (old, new): (&Files, &Files),
) {
    let what = format!("{} with {mode} at call {at} ({}): {}", case.name, outcome.hit, outcome.stderr_text);
    let (code, signal) = (outcome.status.code(), outcome.status.signal());
    let now = set_in(out);
    match mode {
        _ if outcome.hit.is_empty() => assert_eq!((code, &now == new), (Some(0), true), "{what}"),
        'k' | 'a' => assert_eq!(signal, Some(KILLED), "{what}"),
        't' => assert_eq!(signal, Some(TERMINATED), "{what}"),
        _ => {
            let why = if "eE".contains(mode) { "Input/output error" } else { "No space left on device" };
            match code {
                // The fault hit only the cleanup after the new set was in place.
                Some(0) => assert!(&now == new, "{what}: success, but not the new set"),
                Some(2) => {
                    assert!(
                        outcome.stderr_text.contains(why) && outcome.stderr_text.contains(&text(out)),
                        "{what}"
                    );
                    // A disk that refuses all changes does not allow restoring the old set.
                    assert!(mode == 'E' || &now == old, "{what}: the old set is not what it was");
                }
                other => panic!("{what}: exit code {other:?}, signal {signal:?}"),
            }
        }
    }
    stylet::output_folder::recover(out).unwrap_or_else(|why| panic!("{what}: {why}"));
    let now = set_in(out);
    assert!(&now == old || &now == new, "{what}: a mixture of {:?}", now.keys());
}

/// Injects every fault of `modes` at every `step`-th call of a command that overwrites its folder. Returns the number of faults.
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
                let outcome = server.strike(mode, at);
                if outcome.calls < at {
                    break;
                }
                faults += u64::from(!outcome.hit.is_empty());
                check_outcome(case, &outcome, mode, at, out, (old, new));
                // The next command then writes the complete set, and a resumed sweep the same bytes.
                let again = server.strike('-', 0);
                let what = format!("{} after {mode} at call {at} ({})", case.name, outcome.hit);
                assert_eq!(again.status.code(), Some(0), "{what}: {}", again.stderr_text);
                assert!(
                    &set_in(out) == new && staging_files(out).is_empty(),
                    "{what}: {:?}",
                    staging_files(out)
                );
            }
        }
    }
    faults
}

fn out_of(scratch: &Scratch) -> PathBuf {
    fs::canonicalize(scratch.path()).expect("a folder").join("out")
}

#[test]
fn run_and_sweep_leave_consistent_files_after_every_fault_at_every_ninth_call() {
    let scratch = Scratch::in_memory("faults");
    let Some(shim) = shim(scratch.path()) else { return };
    let cases = cases(&scratch);
    let run = every_fault(&shim, &cases[0], &out_of(&scratch), "kateEnNs", 9);
    let sweep = every_fault(&shim, &cases[1], &out_of(&scratch), "kes", 61);
    assert!(run > 50 && sweep > 10, "{run} and {sweep} faults");
}

#[test]
#[ignore = "minutes; tests/disk_faults.sh"]
fn all_commands_leave_consistent_files_after_every_fault_at_every_call() {
    let scratch = Scratch::in_memory("faults-all");
    let Some(shim) = shim(scratch.path()) else { return };
    for case in cases(&scratch) {
        let started = Instant::now();
        let faults = every_fault(&shim, &case, &out_of(&scratch), "kateEnNs", 1);
        println!("{}: {faults} faults in {:.0} s, no mixture", case.name, started.elapsed().as_secs_f64());
    }
}

#[test]
fn results_do_not_depend_on_the_clock() {
    let scratch = Scratch::in_memory("faults-clocks");
    let Some(clock) = preloaded(scratch.path(), "clock") else { return };
    let out = out_of(&scratch);
    for case in cases(&scratch).iter().filter(|case| case.name != "reproduce") {
        let new = written(&case.new, &out);
        restore(&out, &Files::new());
        let mut command = Command::new(env!("CARGO_BIN_EXE_stylet"));
        let output = command.args(to(&case.new, &out)).env("LD_PRELOAD", &clock).output().expect("it starts");
        assert!(output.status.success(), "{}: {}", case.name, stderr_text(&output));
        assert!(
            set_in(&out) == new && staging_files(&out).is_empty(),
            "{}: the clock is in its results",
            case.name
        );
        restore(&out, &Files::new());
    }
}

/// SplitMix64, mapped to 0..1.
fn uniform(seed: u64) -> f64 {
    let x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[test]
#[ignore = "minutes; tests/disk_faults.sh"]
fn a_hundred_kills_at_random_times_leave_one_set() {
    let scratch = Scratch::in_memory("faults-kills");
    let out = out_of(&scratch);
    let mut met = 0;
    for case in cases(&scratch) {
        let (old, new) = sets(&case, &out);
        let started = Instant::now();
        restore(&out, &old);
        assert!(written(&case.new, &out) == new);
        let takes = started.elapsed().as_secs_f64();
        // Twenty kills of each command while it works; one after its end tests nothing.
        let (kills, mut olds, mut news) = (met + 20, 0, 0);
        for k in 0..200 {
            if met == kills {
                break;
            }
            restore(&out, &old);
            let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
                .args(to(&case.new, &out))
                .env("RAYON_NUM_THREADS", "1")
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .expect("it starts");
            std::thread::sleep(Duration::from_secs_f64(1.1 * takes * uniform(1000 + k)));
            let works = child.try_wait().expect("a state").is_none();
            let _ = child.kill();
            let _ = child.wait();
            stylet::output_folder::recover(&out).expect("it settles");
            let now = set_in(&out);
            assert!(now == old || now == new, "{} at kill {k}: a mixture of {:?}", case.name, now.keys());
            if !works {
                continue;
            }
            met += 1;
            if now == old { olds += 1 } else { news += 1 }
        }
        println!("{}: {} kills, {olds} left the old set, {news} the new one", case.name, olds + news);
        assert!(
            written(&case.new, &out) == new && staging_files(&out).is_empty(),
            "{} after the kills",
            case.name
        );
    }
    assert_eq!(met, 100, "kills that met a command at work");
}
