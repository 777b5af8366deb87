//! Promise: an invalid sweep, a damaged shard, a full disk or a read-only folder gives an error message that names it and exit code 2,
//! and existing files are kept.

use crate::support;

use std::fs;
use std::path::Path;
use std::process::Command;
use support::{Scratch, root, stderr_text, stylet, text};

const GOOD: &str = r#"Sweep(
    scenario: "SCENARIO",
    trials: 6,
    vary: [
        (path: "sensor.noise_n", with: Uniform(0.01, 0.02)),
    ],
    effects: [(effect: CoulombFriction(c_n_per_m: 6.0), probability: 0.3)],
)"#;

fn good() -> String {
    GOOD.replace(
        "SCENARIO",
        root().join("scenarios/three_layer_latex_constant.ron").to_str().expect("a path"),
    )
}

#[test]
fn an_invalid_sweep_is_rejected_with_line_column_and_remedy() {
    let cases: [(&str, &str, &str, &[&str]); 17] = [
        (
            "misspelt",
            "sensor.noise_n",
            "sensor.noize_n",
            &["5:16", "`noize_n`", "did you mean `noise_n`", "`ar1`", "`range_n`"],
        ),
        ("section", "sensor.noise_n", "sensors.noise_n", &["5:16", "did you mean `sensor`", "`motion`"]),
        (
            "index",
            "sensor.noise_n",
            "tissue.layers[3].stiffness_n_per_m",
            &["5:16", "3 entries", "[0] to [2]"],
        ),
        (
            "no_index",
            "sensor.noise_n",
            "tissue.layers.stiffness_n_per_m",
            &["5:16", "tissue.layers[0].stiffness_n_per_m"],
        ),
        ("group", "sensor.noise_n", "enhance.cusum", &["5:16", "`sigma_rupture_n`"]),
        ("name", "sensor.noise_n", "enhance.model", &["5:16", "`MultiLayer`", "only numbers"]),
        ("variant", "sensor.noise_n", "motion.amplitude_m", &["5:16", "`velocity_mps`"]),
        ("seed", "sensor.noise_n", "seed", &["5:16", "its own seed"]),
        ("brackets", "sensor.noise_n", "tissue.layers[x]", &["5:16", "is not a path"]),
        ("swapped", "Uniform(0.01, 0.02)", "Uniform(0.02, 0.01)", &["5:40", "swap"]),
        ("log", "Uniform(0.01, 0.02)", "LogUniform(0.0, 0.01)", &["5:40", "above zero"]),
        ("sd", "Uniform(0.01, 0.02)", "Normal(mean: 0.02, sd: -1.0)", &["5:40", "sd -1"]),
        ("nan", "Uniform(0.01, 0.02)", "Uniform(0.01, NaN)", &["5:40", "finite"]),
        ("kind", "Uniform(0.01, 0.02)", "Unifrom(0.01, 0.02)", &["5:40", "did you mean `Uniform`"]),
        ("zero", "trials: 6", "trials: 0", &["3:13", "is 0", "between 1"]),
        ("probability", "probability: 0.3", "probability: 1.3", &["7:", "between 0 and 1"]),
        ("effect", "c_n_per_m: 6.0", "c_n_per_m: -6.0", &["7:", "effects[0].effect.c_n_per_m", "between 0"]),
    ];
    let scratch = Scratch::new("bad-sweep");
    let out = scratch.path().join("out");
    for (name, from, to, words) in cases {
        let file = scratch.file(&format!("{name}.ron"), good().replacen(from, to, 1));
        let output = stylet(&["sweep", &text(&file), "--out", &text(&out)]);
        let stderr_text = stderr_text(&output);
        assert_eq!(output.status.code(), Some(2), "{name}: {stderr_text}");
        assert!(stderr_text.contains(&format!("{name}.ron:")), "{name}: {stderr_text}");
        for word in words {
            assert!(stderr_text.contains(word), "{name} lacks {word}: {stderr_text}");
        }
        assert!(!out.exists(), "{name}: no output");
    }
    let file = scratch.file("good.ron", good());
    let output = stylet(&["sweep", &text(&file), "--trials", "0", "--out", &text(&out)]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
    assert!(stylet(&["sweep", &text(&file), "--quiet", "--out", &text(&out)]).status.success());
}

#[test]
fn invalid_draws_are_repeated_and_reported_when_all_are_invalid() {
    let scratch = Scratch::new("redraw");
    let wide = good()
        .replace("Uniform(0.01, 0.02)", "Normal(mean: 0.0, sd: 0.02)")
        .replace("trials: 6", "trials: 40");
    let file = scratch.file("wide.ron", wide);
    let out = text(&scratch.path().join("out"));
    let output = stylet(&["sweep", &text(&file), "--quiet", "--out", &out]);
    assert!(output.status.success(), "{}", stderr_text(&output));
    let csv = fs::read_to_string(Path::new(&out).join("trials.csv")).expect("a table");
    let redrawn = csv.lines().skip(1).filter(|l| l.split(',').nth(2) != Some("0")).count();
    assert!((8..=32).contains(&redrawn), "half of the draws are negative: {redrawn} of 40");

    let file = scratch.file("hopeless.ron", good().replace("Uniform(0.01, 0.02)", "Uniform(-0.02, -0.01)"));
    let output = stylet(&["sweep", &text(&file), "--out", &text(&scratch.path().join("none"))]);
    assert_eq!(output.status.code(), Some(2));
    for word in ["trial 0", "sensor.noise_n", "narrow the distributions"] {
        assert!(stderr_text(&output).contains(word), "{}", stderr_text(&output));
    }
}

fn shards(scratch: &Scratch, name: &str, extra: &[&str]) -> std::path::PathBuf {
    let file = scratch.file("sweep.ron", good());
    let out = scratch.path().join(name);
    for shard in ["1/2", "2/2"] {
        let folder = text(&out);
        let base = ["sweep", "run-shard", shard, &text(&file), "--out", &folder];
        let output = stylet(&[&base[..], extra].concat());
        assert!(output.status.success(), "{}", stderr_text(&output));
    }
    out
}

fn merge(scratch: &Scratch, out: &Path) -> std::process::Output {
    stylet(&["sweep", "merge", &text(&scratch.path().join("sweep.ron")), "--out", &text(out)])
}

#[test]
fn merge_rejects_missing_damaged_and_foreign_shards_and_keeps_the_others() {
    let scratch = Scratch::new("merge");
    let second = "shards/000002-of-000002.shard";
    let spoil = |name: &str, change: &dyn Fn(&mut Vec<u8>), words: &[&str]| {
        let out = shards(&scratch, name, &[]);
        let mut bytes = fs::read(out.join(second)).expect("a shard");
        change(&mut bytes);
        fs::write(out.join(second), &bytes).expect("it can be written");
        let output = merge(&scratch, &out);
        assert_eq!(output.status.code(), Some(2), "{name}: {}", stderr_text(&output));
        for word in words.iter().chain(&["000002-of-000002.shard"]) {
            assert!(stderr_text(&output).contains(word), "{name} lacks {word}: {}", stderr_text(&output));
        }
        assert!(out.join("shards/000001-of-000002.shard").exists(), "{name}: the good shard is kept");
        assert!(!out.join("trials.csv").exists(), "{name}");
    };
    let last = |bytes: &mut Vec<u8>| {
        let end = bytes.len() - 5;
        bytes[end] ^= 1;
    };
    spoil("bit", &last, &["damaged", "checksum"]);
    spoil("short", &|bytes| bytes.truncate(bytes.len() - 9), &["damaged", "length"]);
    spoil("header", &|bytes| bytes[3] = b'!', &["damaged", "header"]);
    spoil("empty", &|bytes| bytes.clear(), &["damaged"]);
    let version = |bytes: &mut Vec<u8>| {
        let end = bytes.iter().position(|b| *b == b'\n').expect("a header");
        let header = String::from_utf8_lossy(&bytes[..end]).into_owned();
        let now = format!("\"version\":\"{}\"", env!("CARGO_PKG_VERSION"));
        assert!(header.contains(&now));
        let old = header.replace(&now, "\"version\":\"0.0.9\"");
        bytes.splice(..end, old.into_bytes());
    };
    spoil("version", &version, &["version", "0.0.9", env!("CARGO_PKG_VERSION")]);

    let out = shards(&scratch, "missing", &[]);
    fs::remove_file(out.join(second)).expect("it goes");
    let output = merge(&scratch, &out);
    assert!(stderr_text(&output).contains("shard 2 of 2 is missing"), "{}", stderr_text(&output));

    let out = shards(&scratch, "foreign", &["--seed", "9"]);
    let output = merge(&scratch, &out);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr_text(&output).contains("another seed: 9 instead of 1"), "{}", stderr_text(&output));

    let output = merge(&scratch, &scratch.path().join("nowhere"));
    assert!(stderr_text(&output).contains("holds no shards"), "{}", stderr_text(&output));
}

#[test]
fn a_full_disk_or_unwritable_folder_is_reported_and_existing_files_are_kept() {
    let scratch = Scratch::new("limit");
    let file = scratch.file("sweep.ron", good().replace("trials: 6", "trials: 2000"));
    let out = scratch.path().join("out");
    // 8 blocks of 1024 bytes: the first shard does not fit.
    let command = format!(
        "trap '' XFSZ; ulimit -f 8; '{}' sweep '{}' --out '{}'",
        env!("CARGO_BIN_EXE_stylet"),
        file.display(),
        out.display()
    );
    let output = Command::new("bash").args(["-c", &command]).env("NO_COLOR", "1").output().expect("bash");
    assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
    assert!(stderr_text(&output).contains("cannot be written"), "{}", stderr_text(&output));
    assert!(!out.join("trials.csv").exists());
    let parts = fs::read_dir(out.join("shards")).map_or(0, Iterator::count);
    assert_eq!(parts, 0, "no partial file remains");

    let blocked = scratch.file("a_file", "precious");
    let output = stylet(&["sweep", &text(&file), "--trials", "6", "--out", &text(&blocked.join("out"))]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
    assert!(stderr_text(&output).contains("cannot be written"), "{}", stderr_text(&output));
    assert_eq!(fs::read_to_string(&blocked).expect("the file"), "precious");
}

/// Runs `stylet` as a user whom file permissions restrict: as `nobody` if the test runs as root. `None` when `nobody` cannot start the
/// binary.
fn unprivileged(arguments: &[&str]) -> Option<std::process::Output> {
    use std::os::unix::process::CommandExt;
    let mut command = Command::new(env!("CARGO_BIN_EXE_stylet"));
    command.args(arguments).env("NO_COLOR", "1");
    if nix::unistd::geteuid().is_root() {
        command.uid(65534).gid(65534);
    }
    command.output().ok()
}

#[test]
fn a_read_only_folder_is_reported_and_its_shards_are_kept() {
    use std::os::unix::fs::PermissionsExt;
    let scratch = Scratch::new("read-only");
    let out = shards(&scratch, "out", &[]);
    let whole = shards(&scratch, "whole", &[]);
    fs::remove_file(out.join("shards/000002-of-000002.shard")).expect("it goes");
    let first = out.join("shards/000001-of-000002.shard");
    let before = fs::read(&first).expect("a shard");
    let permit = |mode| {
        for folder in [out.join("shards"), out.clone()] {
            fs::set_permissions(folder, fs::Permissions::from_mode(mode)).expect("own files");
        }
    };
    permit(0o555);
    let (file, folder) = (text(&scratch.path().join("sweep.ron")), text(&out));
    let second = ["sweep", "run-shard", "2/2", &file, "--out", &folder];
    let Some(output) = unprivileged(&second) else {
        permit(0o755);
        println!("SKIPPED: `nobody` cannot start the binary, and root can write to read-only folders");
        return;
    };
    assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
    for word in ["cannot be written", "000002-of-000002.shard", "finished shards are kept"] {
        assert!(stderr_text(&output).contains(word), "it lacks {word}: {}", stderr_text(&output));
    }
    let sweep = unprivileged(&["sweep", &file, "--out", &text(&out.join("deeper"))]).expect("it starts");
    assert_eq!(sweep.status.code(), Some(2), "{}", stderr_text(&sweep));
    assert!(stderr_text(&sweep).contains("cannot be written"), "{}", stderr_text(&sweep));
    assert_eq!(fs::read(&first).expect("it is still there"), before);
    permit(0o755);
    assert!(stylet(&second).status.success());
    assert!(merge(&scratch, &out).status.success() && merge(&scratch, &whole).status.success());
    let table = |folder: &Path| fs::read(folder.join("trials.csv")).expect("a table");
    assert_eq!(table(&out), table(&whole));
}
