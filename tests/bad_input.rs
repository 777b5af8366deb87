//! Promise: invalid input gives exit code 2 and a message with file, position and remedy, and writes no output; files in an
//! existing output folder are kept.

use crate::support;

use std::fs;
use std::path::Path;
use support::{Scratch, scenario, stderr_text, stylet};

/// Asserts that a command is refused with a message that contains all of `words`, and that nothing is written.
fn refused(arguments: &[&str], out: &Path, words: &[&str]) {
    let output = stylet(arguments);
    let message = stderr_text(&output);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    for word in words {
        assert!(message.contains(word), "{arguments:?}: {word:?} is missing in: {message}");
    }
    assert!(!message.contains("panicked"), "{message}");
    assert!(!out.exists(), "{arguments:?} left {} behind", out.display());
}

fn invalidate(from: &str, to: &str) -> String {
    let text = fs::read_to_string(scenario("three_layer_latex_constant")).expect("the scenario");
    assert!(text.contains(from), "the scenario no longer contains {from:?}");
    text.replacen(from, to, 1)
}

#[test]
fn an_invalid_scenario_is_refused_with_position_and_remedy() {
    let cases: [(&str, &str, &str, &[&str]); 13] = [
        ("unknown_field", "thickness_m: 0.0282", "thicknes_m: 0.0282", &["unknown field", "`thickness_m`"]),
        ("missing_field", "thickness_m: 0.0282, ", "", &["missing field", "thickness_m"]),
        ("negative_thickness", "thickness_m: 0.0282", "thickness_m: -0.0282", &["-0.0282", "positive"]),
        ("not_a_number", "thickness_m: 0.0282", "thickness_m: NaN", &["NaN", "positive"]),
        ("too_large", "thickness_m: 0.0282", "thickness_m: 1e400", &["inf", "positive"]),
        ("rate_zero", "sample_hz: 200.0", "sample_hz: 0.0", &["sample_hz", "positive"]),
        ("never_there", "start_m: -0.005", "start_m: -5.0", &["never reaches the tissue", "surface"]),
        ("backwards", "velocity_mps: 0.0023", "velocity_mps: -0.0023", &["never reaches the tissue"]),
        ("millimetres", "velocity_mps: 0.0023", "velocity_mps: 2.3", &["mm/s"]),
        ("variant", "motion: Constant", "motion: Constat", &["`Constat`", "`Constant`"]),
        ("text", "thickness_m: 0.0282", "thickness_m: \"thin\"", &["thickness_m", "a number"]),
        ("noise", "ar1: 0.0", "ar1: 1.0", &["ar1", "between -1 and 1"]),
        ("bracket", "layers: [", "layers: ", &["tissue.layers", "square brackets"]),
    ];
    let scratch = Scratch::new("bad-scenario");
    let out = scratch.path().join("out");
    for (name, from, to, words) in cases {
        let text = invalidate(from, to);
        let file = scratch.file(&format!("{name}.ron"), &text);
        let arguments = ["run", file.to_str().expect("a path"), "--out", out.to_str().expect("a path")];
        let place = format!("{name}.ron:");
        let mut words = words.to_vec();
        words.push(&place);
        refused(&arguments, &out, &words);
    }
}

#[test]
fn a_scenario_without_layers_is_refused() {
    let scratch = Scratch::new("no-layers");
    let out = scratch.path().join("out");
    let text = "Scenario(\n name: \"empty\",\n tissue: (layers: []),\n motion: Constant(start_m: 0.0, velocity_mps: 0.001, duration_s: 5.0),\n)";
    let file = scratch.file("none.ron", text);
    refused(
        &["run", file.to_str().expect("a path"), "--out", out.to_str().expect("a path")],
        &out,
        &["none.ron:3:19", "at least one"],
    );
}

#[test]
fn files_that_are_no_scenario_are_refused() {
    let scratch = Scratch::new("not-a-file");
    let out = scratch.path().join("out");
    let cases = [
        (scratch.file("empty.ron", ""), "is empty"),
        (scratch.file("binary.ron", [0u8, 159, 146, 150, 255]), "binary file"),
        (scratch.path().to_path_buf(), "is a directory"),
        (scratch.path().join("nowhere.ron"), "no such file"),
    ];
    for (file, word) in cases {
        let file = file.to_str().expect("a path");
        refused(&["run", file, "--out", out.to_str().expect("a path")], &out, &[file, word]);
    }
}

#[test]
fn an_invalid_recording_is_refused_with_line_and_column() {
    let good = |rows: &str| format!("time_s,position_m,force_n\n0.00,0.000,0.1\n0.01,0.001,0.2\n{rows}");
    let cases: [(&str, Vec<u8>, &[&str]); 11] = [
        ("missing_column", b"time_s,position_m,forze_n\n0,0,0\n1,1,1\n".to_vec(), &["force_n", "forze_n"]),
        ("text", good("0.02,0.002,abc\n").into(), &["line 4", "force_n", "abc"]),
        ("not_a_number", good("0.02,NaN,0.3\n").into(), &["line 4", "position_m", "NaN"]),
        ("backward", good("0.005,0.002,0.3\n").into(), &["line 4", "--repair"]),
        ("duplicate", good("0.01,0.002,0.3\n").into(), &["line 4", "--repair"]),
        ("ragged", good("0.02,0.002\n").into(), &["line 4"]),
        ("header_only", b"time_s,position_m,force_n\n".to_vec(), &["header_only.csv"]),
        ("one_sample", b"time_s,position_m,force_n\n0,0,0\n".to_vec(), &["one_sample.csv"]),
        ("empty", Vec::new(), &["empty"]),
        ("binary", vec![0x89, b'P', b'N', b'G', 0, 1, 2, 255], &["binary.csv"]),
        ("infinite", good("0.02,0.002,1e999\n").into(), &["line 4", "force_n"]),
    ];
    let scratch = Scratch::new("bad-recording");
    let out = scratch.path().join("out");
    for (name, content, words) in cases {
        let file = scratch.file(&format!("{name}.csv"), content);
        let arguments = ["enhance", file.to_str().expect("a path"), "--out", out.to_str().expect("a path")];
        refused(&arguments, &out, words);
    }
    let folder = scratch.path().to_str().expect("a path");
    refused(&["enhance", folder, "--out", out.to_str().expect("a path")], &out, &["directory"]);
}

#[test]
fn a_recording_in_place_of_an_option_is_refused_with_the_option() {
    let out = Scratch::new("recording-without-option").path().join("out");
    let arguments = ["diagnose", "a.csv", "b.csv", "--out", out.to_str().expect("a path")];
    refused(&arguments, &out, &["'b.csv'", "recordings follow the option `--data`"]);
}

#[test]
fn an_invalid_configuration_or_column_map_is_refused() {
    let scratch = Scratch::new("bad-config");
    let out = scratch.path().join("out");
    let data =
        scratch.file("d.csv", "time_s,position_m,force_n\n0.00,0.000,0.1\n0.01,0.001,0.2\n0.02,0.002,0.3\n");
    let (data, folder) = (data.to_str().expect("a path"), out.to_str().expect("a path"));
    let config = scratch.file("c.ron", "Enhance(\n  cusum: (sigma_ordinary_n: 0.2),\n)");
    refused(
        &["enhance", data, "--config", config.to_str().expect("a path"), "--out", folder],
        &out,
        &["c.ron:2", "sigma_rupture_n", "larger"],
    );
    let map = scratch.file("m.ron", "Columns(time: (name: \"t\"), position: (names: \"z\"))");
    refused(
        &["enhance", data, "--columns", map.to_str().expect("a path"), "--out", folder],
        &out,
        &["m.ron:1"],
    );
    let map =
        scratch.file("n.ron", "Columns(time: (name: \"t\"), position: (name: \"z\"), force: (name: \"f\"))");
    refused(
        &["enhance", data, "--columns", map.to_str().expect("a path"), "--out", folder],
        &out,
        &["d.csv", "no column \"t\"", "\"time_s\""],
    );
}

#[test]
fn repair_drops_backward_and_repeated_rows_and_reports_them() {
    let scratch = Scratch::new("repair");
    let rows: String =
        (0..200).map(|k| format!("{},{},{}\n", 0.01 * f64::from(k), 1e-4 * f64::from(k), 0.0)).collect();
    let text = format!("time_s,position_m,force_n\n{rows}1.5,0.02,0.0\n2.00,0.02,0.0\n");
    let file = scratch.file("d.csv", text);
    let out = scratch.path().join("out");
    let arguments =
        ["enhance", file.to_str().expect("a path"), "--repair", "--out", out.to_str().expect("a path")];
    let output = stylet(&arguments);
    assert!(output.status.success(), "{}", stderr_text(&output));
    let json = fs::read_to_string(out.join("enhance.json")).expect("results");
    assert!(json.contains("repaired_rows") && json.contains("202"), "{json}");
}

#[test]
fn an_output_folder_that_cannot_be_created_is_refused_and_other_files_are_kept() {
    let scratch = Scratch::new("out");
    let file = scenario("three_layer_latex_constant");
    let blocked = scratch.file("a_file", "precious");
    let inside = blocked.join("out");
    let arguments = ["run", file.to_str().expect("a path"), "--out", inside.to_str().expect("a path")];
    let output = stylet(&arguments);
    assert_eq!(output.status.code(), Some(2), "{}", stderr_text(&output));
    assert_eq!(fs::read_to_string(&blocked).expect("the file"), "precious");

    let folder = scratch.path().join("mine");
    fs::create_dir(&folder).expect("a folder");
    fs::write(folder.join("notes.txt"), "precious").expect("a file");
    let arguments =
        ["run", file.to_str().expect("a path"), "--quiet", "--out", folder.to_str().expect("a path")];
    assert!(stylet(&arguments).status.success());
    assert_eq!(fs::read_to_string(folder.join("notes.txt")).expect("the file"), "precious");
    assert!(folder.join("report.html").exists());
    let leftovers: Vec<_> = fs::read_dir(&folder)
        .expect("the folder")
        .filter_map(|e| e.ok()?.file_name().into_string().ok())
        .filter(|n| n.ends_with(".part"))
        .collect();
    assert!(leftovers.is_empty(), "{leftovers:?}");
}
