//! Every command ends with a message and its documented exit code: closed pipes, full disks behind standard output, errors in very long
//! lines, work above the limits. Nothing panics (exit code 101).

use crate::support;

use std::fs::File;
use std::process::{Command, Stdio};
use support::{ONE_GEL, Scratch, root, scenario, stderr_text, stylet, text};

/// Exit code and standard error of a command whose standard output is `out`.
fn ended(arguments: &[&str], out: Stdio) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .args(arguments)
        .env("NO_COLOR", "1")
        .stdout(out)
        .stderr(Stdio::piped())
        .output()
        .expect("the binary starts");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// A pipe whose reader has closed it, as `| head` does.
fn gone() -> Stdio {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    writer.into()
}

fn full() -> Option<Stdio> {
    File::options().write(true).open("/dev/full").ok().map(Stdio::from)
}

#[test]
fn a_closed_pipe_changes_no_exit_code_and_a_full_disk_is_reported() {
    let scratch = Scratch::new("pipes");
    let gel = scratch.file("gel.ron", ONE_GEL);
    let sweep = scratch.file(
        "sweep.ron",
        r#"Sweep(scenario: "gel.ron", trials: 8, vary: [(path: "sensor.noise_n", with: Uniform(0.01, 0.02))])"#,
    );
    let gate = |name: &str, at_most: f64| {
        let text = format!(
            r#"Gates([(run: "gel.ron", seeds: 4, expect: [(score: "missed", at_most: {at_most})])])"#
        );
        scratch.file(name, text)
    };
    let (holds, fails) = (gate("holds.ron", 9.0), gate("fails.ron", -1.0));
    let (gel, sweep, holds, fails) = (text(&gel), text(&sweep), text(&holds), text(&fails));
    let (out, svg) = (text(&scratch.path().join("out")), text(&scratch.path().join("map.svg")));
    let swept = text(&scratch.path().join("swept"));
    let (csv, replayed) = (format!("{out}/recording.csv"), text(&scratch.path().join("trial")));
    let [compared, enhanced, diagnosed] =
        ["compared", "enhanced", "diagnosed"].map(|name| text(&scratch.path().join(name)));
    for made in [["run", &gel, "--out", &out, "--quiet"], ["sweep", &sweep, "--out", &swept, "--quiet"]] {
        assert!(stylet(&made).status.success(), "{made:?}");
    }
    let commands: [(&[&str], i32); 11] = [
        (&["effects"], 0),
        (&["run", &gel, "--out", &out], 0),
        (&["sweep", &sweep, "--out", &swept], 0),
        (&["sweep", "plan", &sweep, "--shards", "4"], 0),
        (&["sweep", "map", &sweep, "--svg", &svg], 0),
        (&["gate", &holds], 0),
        (&["gate", &fails], 1),
        (&["compare", &gel, "--seeds", "2", "--out", &compared], 0),
        (&["enhance", &csv, "--out", &enhanced], 0),
        (&["diagnose", &gel, "--data", &csv, "--out", &diagnosed], 0),
        (&["replay", &swept, "3", "--out", &replayed], 0),
    ];
    for (command, code) in commands {
        let (found, stderr_text) = ended(command, gone());
        assert_eq!(found, Some(code), "{command:?} into a pipe that nobody reads: {stderr_text}");
        assert!(
            !stderr_text.contains("panicked") && !stderr_text.contains("please report"),
            "{command:?}: {stderr_text}"
        );
        let Some(full) = full() else { continue };
        let (found, stderr_text) = ended(command, full);
        assert!(!stderr_text.contains("panicked"), "{command:?}: {stderr_text}");
        // A verdict outweighs that it could not be printed.
        assert_eq!(found, Some(if code == 1 { 1 } else { 2 }), "{command:?} onto a full disk: {stderr_text}");
        assert!(
            code == 1 || stderr_text.contains("standard output cannot be written"),
            "{command:?}: {stderr_text}"
        );
    }
}

#[test]
fn an_impossible_number_of_shards_is_refused() {
    let scratch = Scratch::new("shards");
    let out = text(&scratch.path().join("out"));
    let sweep = text(&root().join("scenarios/sweeps/noise.ron"));
    let output = stylet(&["sweep", "run-shard", "1/18446744073709551615", &sweep, "--out", &out]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
    assert!(stderr_text(&output).contains("at most 999999"), "{}", stderr_text(&output));
}

#[test]
fn a_closed_standard_error_changes_no_exit_code() {
    let (Some(out), Ok(err)) = (full(), File::options().write(true).open("/dev/full")) else { return };
    let mut command = Command::new(env!("CARGO_BIN_EXE_stylet"));
    let status = command.args(["run", "nowhere.ron"]).stdout(out).stderr(err).status().expect("it starts");
    assert_eq!(status.code(), Some(2));
}

#[test]
fn an_error_at_column_seventy_thousand_is_reported_with_its_place() {
    let scratch = Scratch::new("wide");
    let wide = ONE_GEL.replace('\n', " ").replace("robot", &format!("{}robbot", " ".repeat(70_000)));
    let file = scratch.file("wide.ron", wide);
    let output = stylet(&["run", &text(&file)]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
    assert!(stderr_text(&output).contains("wide.ron:1:70"), "{}", stderr_text(&output));
    assert!(
        stderr_text(&output).contains("robbot") && stderr_text(&output).contains("robot"),
        "{}",
        stderr_text(&output)
    );
    // A line that fits a screen is shown, with what is wrong underlined.
    let short = scratch.file("short.ron", ONE_GEL.replace("robot", "robbot"));
    let output = stylet(&["run", &text(&short)]);
    assert!(stderr_text(&output).contains("── here"), "{}", stderr_text(&output));
}

#[test]
fn work_above_the_limits_is_refused_with_the_remedy() {
    let scratch = Scratch::new("limits");
    let gel = scratch.file("gel.ron", ONE_GEL);
    let rates = |name: &str, line: &str| {
        text(&scratch.file(name, ONE_GEL.replace("robot: Replay", &format!("robot: Slide, {line}"))))
    };
    let many = rates("many.ron", "sample_hz: 2e7");
    let fast = rates("fast.ron", "physics_hz: 1.4e7");
    let slow = rates("slow.ron", "physics_hz: 1e5");
    let sweep = text(&scratch.file(
        "sweep.ron",
        r#"Sweep(scenario: "gel.ron", trials: 100000000, vary: [(path: "sensor.noise_n", with: Uniform(0.01, 0.02))])"#,
    ));
    let row = "0.123456789,0.123456789,0.123456789\n";
    let log = text(&scratch.file("log.csv", format!("time_s,position_m,force_n\n{}", row.repeat(20_000))));
    let gel = text(&gel);
    let out = scratch.path().join("out");
    let folder = text(&out);
    let cases: [(&[&str], &[&str]); 9] = [
        (&["run", &many], &["many.ron", "samples", "40 GB", "2 GB", "--limit-memory", "sample_hz"]),
        (&["run", &fast], &["fast.ron", "physics_hz", "at most 1e5", "1000.0"]),
        (&["run", &slow, "--limit-time", "0.1s"], &["slow.ron", "physics steps", "--limit-time"]),
        (&["sweep", &sweep], &["sweep.ron", "trials", "--trials", "--limit-memory"]),
        (&["sweep", &sweep, "--trials", "8", "--threads", "100000"], &["100000", "up to 1024"]),
        (&["sweep", "run-shard", "1/2", &sweep, "--threads", "100000"], &["100000", "up to 1024"]),
        (&["enhance", &log, "--limit-memory", "1MB"], &["log.csv", "samples", "1 MB", "--limit-memory"]),
        (&["diagnose", &gel, "--data", &log, "--limit-memory", "1MB"], &["samples", "--limit-memory"]),
        (&["run", &gel, "--limit-memory", "lots"], &["lots", "500MB"]),
    ];
    for (command, words) in cases {
        let output = stylet(&[command, &["--out", &folder]].concat());
        assert_eq!(output.status.code(), Some(2), "{command:?}: {}", stderr_text(&output));
        // The terminal breaks lines between words and after hyphens.
        let stderr_text =
            stderr_text(&output).replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
        let stderr_text = stderr_text.replace("- ", "-");
        for word in words {
            assert!(stderr_text.contains(word), "{command:?} does not say {word}: {stderr_text}");
        }
        assert!(!out.exists(), "{command:?} left a folder");
    }
    let output =
        stylet(&["run", &gel, "--limit-memory", "10MB", "--limit-time", "1h", "--quiet", "--out", &folder]);
    assert!(output.status.success(), "what is within the limits runs: {}", stderr_text(&output));
}

#[test]
fn a_refused_sweep_leaves_no_folder() {
    let scratch = Scratch::new("refused");
    let file = scratch.file(
        "hopeless.ron",
        format!(
            r#"Sweep(scenario: {:?}, trials: 8, vary: [(path: "sensor.noise_n", with: Uniform(-0.02, -0.01))])"#,
            text(&scenario("three_layer_latex_constant"))
        ),
    );
    let out = scratch.path().join("made/for/it");
    let output = stylet(&["sweep", &text(&file), "--out", &text(&out)]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
    assert!(!scratch.path().join("made").exists(), "an empty folder stays behind");
    let merged =
        stylet(&["sweep", "merge", &text(&root().join("scenarios/sweeps/noise.ron")), "--out", &text(&out)]);
    assert_eq!(merged.status.code(), Some(2), "{}", stderr_text(&merged));
    assert!(!scratch.path().join("made").exists(), "an empty folder stays behind");
}

#[test]
fn a_wrong_log_is_reported_with_file_line_and_remedy() {
    let scratch = Scratch::new("messages");
    let rows = "0.0,0.0,0.1\n0.01,0.001,0.2\n0.02,0.002,0.1\n";
    let head = "time_s,position_m,force_n\n";
    let cases: [(&str, String, &[&str]); 5] = [
        ("no_header.csv", rows.to_owned(), &["line 1", "header is missing", "time_s,position_m,force_n"]),
        (
            "comma.csv",
            format!("{head}0,00,0,001,0,1\n0,01,0,002,0,2\n"),
            &["line 2", "decimal points", "semicolons"],
        ),
        (
            "quote.csv",
            format!("{head}0.0,0.0,\"0.1\n0.01,0.001,0.2\n"),
            &["line 2", "quotation mark", "close or remove"],
        ),
        (
            "steep.csv",
            format!("{head}0,0,0\n1e-300,1e300,0\n"),
            &["line 2", "slope of the position", "column map"],
        ),
        ("wide.csv", format!("{head}0.0,0.0\n"), &["line 2", "2 fields", "complete or remove"]),
    ];
    let out = scratch.path().join("out");
    for (name, content, words) in cases {
        let file = scratch.file(name, content);
        let output = stylet(&["enhance", &text(&file), "--out", &text(&out)]);
        let stderr_text =
            stderr_text(&output).replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(2), "{name}: {stderr_text}");
        for word in words.iter().chain(&[name]) {
            assert!(stderr_text.contains(word), "{name} does not say {word}: {stderr_text}");
        }
    }
    // Bars between the columns are read like commas.
    let bars = scratch.file("bars.csv", format!("{head}{rows}").replace(',', "|"));
    let output = stylet(&["enhance", &text(&bars), "--quiet", "--out", &text(&out)]);
    assert!(output.status.success(), "{}", stderr_text(&output));
}
