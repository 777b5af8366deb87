//! `enhance`, `diagnose`, repeats and data sets report an unusable recording with the same message and remedy, before any cause is
//! identified, and repair and downsample recordings in every command.

use crate::support;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use support::{Scratch, stderr_text, stylet, text};

const ASSUMED: &str = r#"Scenario(
    name: "one gel",
    tissue: (layers: [(thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0)]),
    motion: Program(start_m: -0.004, segments: [Move(velocity_mps: 0.004, duration_s: 4.0), Move(velocity_mps: -0.004, duration_s: 3.0)]),
    robot: Replay,
)"#;

fn flat(output: &Output) -> String {
    let all = format!("{}\n{}", stderr_text(output), String::from_utf8_lossy(&output.stdout));
    all.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

type Row = [f64; 3];

/// An insertion, simulated with this noise seed, as rows of time, position and force.
fn simulated(scratch: &Scratch, seed: u32) -> Vec<Row> {
    let assumed = scratch.file("assumed.ron", ASSUMED);
    let out = scratch.path().join(format!("made-{seed}"));
    let output =
        stylet(&["run", &text(&assumed), "--seed", &seed.to_string(), "--quiet", "--out", &text(&out)]);
    assert!(output.status.success(), "{}", stderr_text(&output));
    let csv = fs::read_to_string(out.join("recording.csv")).expect("a recording");
    let row = |line: &str| {
        let mut numbers = line.split(',').filter_map(|x| x.parse().ok());
        [numbers.next(), numbers.next(), numbers.next()].map(|x| x.expect("three numbers"))
    };
    csv.lines().skip(1).map(row).collect()
}

fn csv(rows: impl IntoIterator<Item = Row>) -> String {
    let mut text = "time_s,position_m,force_n\n".to_owned();
    for [t, z, f] in rows {
        let _ = writeln!(text, "{t},{z},{f}");
    }
    text
}

/// Noise of a sensor in air.
fn air(i: usize) -> f64 {
    let mut x = (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    0.04 * ((x >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
}

#[test]
fn one_unusable_recording_is_reported_with_the_same_message_by_every_command() {
    let scratch = Scratch::new("unusable");
    let good: Vec<String> = (1..=3)
        .map(|seed| text(&scratch.file(&format!("good{seed}.csv"), csv(simulated(&scratch, seed)))))
        .collect();
    let rows = simulated(&scratch, 4);
    let with =
        |change: &dyn Fn(usize, Row) -> Row| csv(rows.iter().enumerate().map(|(i, row)| change(i, *row)));
    let cases: [(&str, String, &[&str]); 6] = [
        ("dead.csv", with(&|_, [t, z, _]| [t, z, 0.0]), &["the force is 0 N", "check the cable"]),
        ("reversed.csv", with(&|_, [t, z, f]| [t, z, -f]), &["the force has the wrong sign", "scale: -1"]),
        (
            "millimetres.csv",
            with(&|_, [t, z, f]| [t, 1e3 * z, f]),
            &["may be in mm (scale 0.001", "column map"],
        ),
        (
            "air.csv",
            with(&|i, [t, z, _]| [t, z, air(i)]),
            &["is only noise", "check that this is an insertion"],
        ),
        (
            "short.csv",
            csv(rows.iter().copied().take(3)),
            &["3 usable sample(s)", "record the whole insertion"],
        ),
        (
            "huge.csv",
            with(&|i, [t, z, f]| [t, z, if i == 700 { 1e300 } else { f }]),
            &["force_n is 1e300", "remove the row"],
        ),
    ];
    let assumed = text(&scratch.path().join("assumed.ron"));
    let set = scratch.file(
        "set.ron",
        r#"Dataset(
    name: "four insertions",
    tissue: (layers: [(thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0)]),
    recordings: ["good*.csv", "BAD"],
)"#,
    );
    for (name, content, words) in cases {
        let bad = text(&scratch.file(name, content));
        let out = scratch.path().join("out");
        let folder = text(&out);
        let all = [&good[0], &good[1], &good[2], &bad].map(String::as_str);
        let alone = stylet(&["diagnose", &assumed, "--data", &bad, "--out", &folder]);
        let several = stylet(&[&["diagnose", &assumed, "--out", &folder, "--data"], &all[..]].concat());
        let repeats =
            stylet(&[&["diagnose", &assumed, "--repeats", "--out", &folder, "--data"], &all[..]].concat());
        let this = fs::read_to_string(&set).expect("the set").replace("BAD", name);
        let this = scratch.file("this.ron", this);
        let of_set = Command::new(env!("CARGO_BIN_EXE_stylet"))
            .args(["diagnose", &text(&this), "--out", &folder])
            .env("STYLET_MEASURED", scratch.path())
            .env("NO_COLOR", "1")
            .output()
            .expect("it starts");
        for (how, output) in
            [("alone", alone), ("diagnose", several), ("--repeats", repeats), ("data set", of_set)]
        {
            let stderr_text = flat(&output);
            assert_eq!(output.status.code(), Some(2), "{name}, {how}: {stderr_text}");
            for word in words.iter().chain(&[name]) {
                assert!(stderr_text.contains(word), "{name}, {how}: does not say {word}: {stderr_text}");
            }
            assert!(
                how == "alone" || stderr_text.contains("1 of 4 recordings cannot be used"),
                "{name}, {how}: {stderr_text}"
            );
            assert!(!stderr_text.contains("lacks"), "{name}, {how}: names a cause: {stderr_text}");
            assert!(!out.exists(), "{name}, {how}: left a folder");
        }
        let enhanced = stylet(&["enhance", &bad, "--out", &folder]);
        let stderr_text = flat(&enhanced);
        // A wrong sign or unit makes every number wrong; otherwise enhance shows what there is.
        let grave = ["reversed.csv", "millimetres.csv", "huge.csv"].contains(&name);
        assert_eq!(enhanced.status.code(), Some(if grave { 2 } else { 0 }), "{name}: enhance: {stderr_text}");
        for word in words {
            assert!(stderr_text.contains(word), "{name}, enhance: does not say {word}: {stderr_text}");
        }
        assert!(!stderr_text.contains("never stands out"), "{name}: {stderr_text}");
        if !grave {
            fs::remove_dir_all(&out).expect("it was made");
        }
    }
}

#[test]
fn repeats_are_repaired_on_request_and_report_the_outlier() {
    let scratch = Scratch::new("unusable-repeats");
    let mut files = Vec::new();
    for seed in 1..=4 {
        let mut rows = simulated(&scratch, seed);
        if seed == 2 {
            // A logger that writes a row twice.
            let again = rows[600];
            rows.insert(601, again);
        }
        if seed == 4 {
            // A recording of another needle.
            rows.iter_mut().for_each(|row| row[2] *= 3.0);
        }
        files.push(text(&scratch.file(&format!("run{seed}.csv"), csv(rows))));
    }
    let assumed = text(&scratch.path().join("assumed.ron"));
    let folder = text(&scratch.path().join("out"));
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let command = [&["diagnose", &assumed, "--repeats", "--out", &folder, "--data"], &files[..]].concat();
    let refused = stylet(&command);
    assert_eq!(refused.status.code(), Some(2), "{}", flat(&refused));
    assert!(
        flat(&refused).contains("run2.csv: line 603") && flat(&refused).contains("--repair"),
        "{}",
        flat(&refused)
    );
    let repaired = stylet(&[&command[..], &["--repair"]].concat());
    let stderr_text = flat(&repaired);
    assert!(repaired.status.success(), "{stderr_text}");
    assert!(stderr_text.contains("run4.csv: it is an outlier among its repeats"), "{stderr_text}");
    for good in ["run1.csv", "run2.csv", "run3.csv"] {
        assert!(!stderr_text.contains(&format!("{good}: it is an outlier")), "{stderr_text}");
    }
    let json = fs::read_to_string(Path::new(&folder).join("diagnosis.json")).expect("results");
    assert!(json.contains("\"repaired_rows\"") && json.contains("\"outlier_recording\""));
    // As recordings that need not be repeats, too.
    let command = [&["diagnose", &assumed, "--repair", "--out", &folder, "--data"], &files[..]].concat();
    let stderr_text = flat(&stylet(&command));
    assert!(stderr_text.contains("run4.csv: it is not like the others: its force is 3.0"), "{stderr_text}");
    assert_eq!(stderr_text.matches("it is not like the others").count(), 1, "{stderr_text}");
    assert!(
        stderr_text.contains("run4.csv is not like the other recordings")
            && !stderr_text.contains("agrees with"),
        "{stderr_text}"
    );
}

#[test]
fn a_wrong_position_origin_is_reported() {
    let scratch = Scratch::new("unusable-offset");
    let rows = simulated(&scratch, 1);
    let out = text(&scratch.path().join("out"));
    let assumed = text(&scratch.path().join("assumed.ron"));
    let cases: [(f64, &[&str]); 4] = [
        (1.5, &["begins behind the tissue", "offset: -1.49", "surface_m"]),
        (0.1, &["begins behind the tissue", "offset: -0.09", "surface_m"]),
        (0.03, &["begins behind the tissue", "offset: -0.02", "surface_m"]),
        (-0.03, &["never reaches the tissue", "offset", "surface_m"]),
    ];
    for (offset_m, words) in cases {
        let data = csv(rows.iter().map(|[t, z, f]| [*t, z + offset_m, *f]));
        let data = text(&scratch.file("offset.csv", data));
        let output = stylet(&["diagnose", &assumed, "--data", &data, "--out", &out]);
        let stderr_text = flat(&output);
        assert_eq!(output.status.code(), Some(2), "{offset_m}: {stderr_text}");
        for word in words.iter().chain(&["offset.csv"]) {
            assert!(stderr_text.contains(word), "{offset_m}: does not say {word}: {stderr_text}");
        }
    }
}

#[test]
fn repeats_without_retraction_are_reported_without_nan() {
    let scratch = Scratch::new("unusable-in");
    let files: Vec<String> = (1..=3)
        .map(|seed| {
            let insertion = csv(simulated(&scratch, seed).into_iter().take(780));
            text(&scratch.file(&format!("in{seed}.csv"), insertion))
        })
        .collect();
    let assumed = text(&scratch.path().join("assumed.ron"));
    let out = text(&scratch.path().join("out"));
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let output =
        stylet(&[&["diagnose", &assumed, "--repeats", "--out", &out, "--data"], &files[..]].concat());
    let stderr_text = flat(&output);
    assert!(output.status.success() && stderr_text.contains("online algorithm"), "{stderr_text}");
    assert!(!stderr_text.contains("NaN"), "{stderr_text}");
}

#[test]
fn a_recording_that_is_too_long_is_downsampled_with_a_note() {
    let scratch = Scratch::new("unusable-long");
    let rows = simulated(&scratch, 1);
    // The insertion at 200 Hz as a logger at 20 kHz would have it.
    let dense = rows.windows(2).flat_map(|pair| {
        let [a, b] = [pair[0], pair[1]];
        (0..100).map(move |k| {
            let s = f64::from(k) / 100.0;
            [0, 1, 2].map(|i| a[i] + s * (b[i] - a[i]))
        })
    });
    let long = text(&scratch.file("long.csv", csv(dense)));
    let assumed = text(&scratch.path().join("assumed.ron"));
    let output =
        stylet(&["diagnose", &assumed, "--data", &long, "--out", &text(&scratch.path().join("out"))]);
    let stderr_text = flat(&output);
    assert!(output.status.success(), "{stderr_text}");
    assert!(
        stderr_text.contains("139900 samples are too many for a diagnosis: each 2 were averaged"),
        "{stderr_text}"
    );
}

#[test]
fn layers_are_accepted_up_to_the_stated_limit() {
    let scratch = Scratch::new("unusable-layers");
    let many = |layers: u32| {
        let thickness_m = 0.02 / f64::from(layers);
        let each: Vec<String> = (0..layers)
            .map(|i| {
                format!(
                    "(thickness_m: {thickness_m}, stiffness_n_per_m: {}.0, friction_ns_per_m2: {}.0)",
                    60 + 40 * (i % 3),
                    9000 + 500 * i
                )
            })
            .collect();
        let tissue = format!("tissue: (layers: [{}])", each.join(", "));
        let from = ASSUMED.find("tissue:").expect("a tissue");
        let to = ASSUMED.find(",\n    motion").expect("a motion");
        scratch.file(&format!("{layers}.ron"), format!("{}{tissue}{}", &ASSUMED[..from], &ASSUMED[to..]))
    };
    let diagnosed = |layers: u32| {
        let assumed = text(&many(layers));
        let out = text(&scratch.path().join(format!("made-{layers}")));
        let made = stylet(&["run", &assumed, "--quiet", "--out", &out]);
        assert!(made.status.success(), "{}", stderr_text(&made));
        stylet(&[
            "diagnose",
            &assumed,
            "--data",
            &format!("{out}/recording.csv"),
            "--out",
            &format!("{out}-d"),
        ])
    };
    let eighteen = diagnosed(18);
    assert!(flat(&eighteen).contains("The simulation agrees with the data"), "{}", flat(&eighteen));
    let over = diagnosed(41);
    assert_eq!(over.status.code(), Some(2), "{}", flat(&over));
    assert!(flat(&over).contains("41 layers") && flat(&over).contains("up to 40"), "{}", flat(&over));
}

/// Positions of the other sign, a retraction alone, the same recording under two names, and time in other units.
#[test]
fn recordings_that_a_search_would_misread_are_refused_before_it() {
    let scratch = Scratch::new("misread");
    let assumed = text(&scratch.file("assumed.ron", ASSUMED));
    let rows = simulated(&scratch, 1);
    let scaled = |time: f64, position: f64| rows.iter().map(move |[t, z, f]| [t * time, z * position, *f]);
    let retraction: Vec<Row> = rows.iter().filter(|r| r[0] > 4.1).copied().collect();
    let cases = [
        ("other_sign", csv(scaled(1.0, -1.0)), "scale: -1"),
        ("retraction", csv(retraction), "only retracts"),
        ("ms", csv(scaled(1e3, 1.0)), "milliseconds"),
        ("us", csv(scaled(1e6, 1.0)), "microseconds"),
        ("minutes", csv(scaled(1.0 / 60.0, 1.0)), "minutes"),
    ];
    for (name, rows, remedy) in cases {
        let file = text(&scratch.file(&format!("{name}.csv"), &rows));
        let out = text(&scratch.path().join(name));
        let output = stylet(&["diagnose", &assumed, "--out", &out, "--data", &file]);
        assert_eq!(output.status.code(), Some(2), "{name}: {}", flat(&output));
        assert!(flat(&output).contains(remedy), "{name}: {}", flat(&output));
        assert!(!Path::new(&out).exists(), "{name}");
    }
    let (a, b) = (scratch.file("a.csv", csv(rows.clone())), scratch.file("b.csv", csv(rows)));
    let (a, b) = (text(&a), text(&b));
    for flags in [&["--data", &a, &a][..], &["--data", &a, &b], &["--repeats", "--data", &a, &b, &a]] {
        let mut all = vec!["diagnose", &assumed];
        all.extend(flags);
        let output = stylet(&all);
        assert_eq!(output.status.code(), Some(2), "{flags:?}: {}", flat(&output));
        assert!(flat(&output).contains("holds the samples of"), "{flags:?}: {}", flat(&output));
    }
}

#[test]
fn a_diagnosis_is_stopped_at_its_time_limit_and_writes_nothing() {
    let scratch = Scratch::new("time-limit");
    let assumed = text(&scratch.file("assumed.ron", ASSUMED));
    let file = text(&scratch.file("a.csv", csv(simulated(&scratch, 1))));
    let out = text(&scratch.path().join("out"));
    // The forecast for these samples is below the limit, which no diagnosis meets.
    let long = "0.0000001h";
    let output = stylet(&["diagnose", &assumed, "--out", &out, "--limit-time", long, "--data", &file]);
    assert_eq!(output.status.code(), Some(2), "{}", flat(&output));
    assert!(flat(&output).contains("--limit-time"), "{}", flat(&output));
    assert!(!Path::new(&out).exists());
    let output = stylet(&["diagnose", &assumed, "--out", &out, "--limit-time", "10min", "--data", &file]);
    assert!(output.status.success() && Path::new(&out).exists(), "{}", flat(&output));
}
