//! An invalid scenario is refused with file, line and column of the wrong token, the cause, and the right spelling or range.
//!
//! In the texts below `⟦` marks where the message must point; it is removed before parsing.
#![allow(clippy::unwrap_used, clippy::panic)]

use miette::Diagnostic;
use std::path::PathBuf;
use stylet_scenario::{InputError, Scenario};

/// A valid scenario; `µ` and `ö` make columns differ from bytes.
const VALID: &str = r#"// A gel. tissue: (layers: [
Scenario(
    name: "gel",
    tissue: (
        layers: [
            (name: "Gel, wölbt sich 3 µm", thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0),
            (thickness_m: 0.02, /* puncture_n: -1.0 */ stiffness_n_per_m: 60.0, friction_ns_per_m2: 12000.0, puncture_n: 2.2),
        ],
    ),
    effects: [CoulombFriction(c_n_per_m: 6.0)],
    motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0),
    robot: Slide,
    sensor: ForceTorque(noise_n: 0.02, ar1: 0.0),
    enhance: (reset: Frequency(hz: 40.0), cusum: (sigma_ordinary_n: 0.01, sigma_rupture_n: 0.15)),
    sample_hz: 200.0,
    physics_hz: 1000.0,
    tolerance: 0.3,
    seed: 1,
)
"#;

/// The valid scenario with one piece replaced.
fn with(piece: &str, replacement: &str) -> String {
    assert_eq!(VALID.matches(piece).count(), 1, "`{piece}` must occur once");
    VALID.replace(piece, replacement)
}

/// The text is refused at its mark, with all of `parts` in the message.
fn refused_text(marked: &str, parts: &[&str]) {
    let (before, after) = marked.split_once('⟦').expect("a mark");
    let text = format!("{before}{after}");
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap().chars().count() + 1;
    let Err(error) = Scenario::parse("folder/gel.ron", &text) else { panic!("accepted:\n{text}") };
    let message = error.to_string();
    let place = format!("folder/gel.ron:{line}:{column}: ");
    assert!(message.starts_with(&place), "it must point at {line}:{column}: {message}");
    assert_eq!(error.position, Some((line, column)), "{message}");
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
    // What is underlined begins there too and lies within the text.
    let label = error.labels().and_then(|mut all| all.next()).expect("a label");
    assert_eq!(label.offset(), before.len(), "{message}");
    assert!(label.offset() + label.len() <= text.len(), "{message}");
}

fn refused(piece: &str, replacement: &str, parts: &[&str]) {
    refused_text(&with(piece, replacement), parts);
}

/// Replaced piece, replacement with mark, parts of the message.
type Case = (&'static str, &'static str, &'static [&'static str]);

#[test]
fn errors_of_syntax_names_and_types_point_at_their_token_and_name_the_remedy() {
    let cases: &[Case] = &[
        ("seed: 1", "⟦sede: 1", &["`sede`", "did you mean `seed`?", "`sample_hz`"]), // unknown field of the scenario
        (
            "layers: [\n            (",
            "⟦layer: [\n            (",
            &["`layer`", "did you mean `layers`?", "`surface_m`"],
        ), // unknown field of the tissue
        ("thickness_m: 0.03", "⟦thicknes_m: 0.03", &["`thicknes_m`", "did you mean `thickness_m`?"]), // unknown field of a layer
        ("velocity_mps", "⟦velocty_mps", &["`velocty_mps`", "did you mean `velocity_mps`?"]), // unknown field of the motion
        ("noise_n", "⟦nois_n", &["`nois_n`", "did you mean `noise_n`?"]), // unknown field of the sensor
        ("reset: F", "⟦resett: F", &["`resett`", "did you mean `reset`?"]), // unknown field of the algorithm
        ("sigma_rupture_n", "⟦sigma_ruptur_n", &["`sigma_ruptur_n`", "did you mean `sigma_rupture_n`?"]), // unknown field of a part of the algorithm
        ("hz: 40.0", "⟦hertz: 40.0", &["unknown field `hertz`", "`hz`"]), // unknown field of a reset
        ("Slide", "Arm(⟦joints: 6)", &["unknown field `joints`"]),        // unknown field of the arm
        ("c_n_per_m", "⟦c_n_pr_m", &["`c_n_pr_m`", "`c_n_per_m`"]),       // unknown field of an effect
        (
            "CoulombFriction(c_n_per_m: 6.0)",
            "StressRelaxation(terms: [(fraction: 0.3, ⟦time_constants: 2.7)])",
            &["`time_constants`", "`time_constant_s`"],
        ), // unknown field of an effects term
        (
            "Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0)",
            "Program(start_m: -0.005, segments: [Move(velocity_mps: 0.0023, duration_s: 9.0), Hold(⟦duration: 1.0)])",
            &["`duration`", "did you mean `duration_s`?"],
        ), // unknown field of a programs segment
        (
            "CoulombFriction(c_n_per_m: 6.0)",
            "CoulombFriction(/* c */ ⟦c /* c: */: 6.0 /* c */)",
            &["unknown field `c`", "`c_n_per_m`"],
        ), // an unknown field is located, not another occurrence of its name
        ("Constant(", "⟦Constnt(", &["`Constnt`", "did you mean `Constant`?", "`Sinusoidal`"]), // unknown motion
        ("CoulombFriction(", "⟦CoulomFriction(", &["`CoulomFriction`", "did you mean `CoulombFriction`?"]), // unknown effect
        ("Slide", "⟦Slid", &["`Slid`", "did you mean `Slide`?", "`Arm`", "`Replay`"]), // unknown robot
        ("ForceTorque(", "⟦Forcetorque(", &["`Forcetorque`", "did you mean `ForceTorque`?"]), // unknown sensor
        ("Frequency(", "⟦Frequenzy(", &["`Frequenzy`", "did you mean `Frequency`?", "`Ruptures`"]), // unknown reset
        ("Scenario(", "⟦Scenarion(", &["`Scenarion`", "`Scenario`"]), // another outer name
        (
            "(name: \"Gel, wölbt sich 3 µm\", thickness_m: 0.03, ",
            "⟦(name: \"Gel, wölbt sich 3 µm\", ",
            &["tissue.layers[0]", "missing field `thickness_m`"],
        ), // missing field of a layer
        (
            "Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0)",
            "⟦Constant(start_m: -0.005, velocity_mps: 0.0023)",
            &["motion", "missing field `duration_s`"],
        ), // missing field of the motion
        ("thickness_m: 0.03", "thickness_m: ⟦\"0.03\"", &["tissue.layers[0].thickness_m", "number"]), // text where a number belongs
        ("\"gel\"", "⟦12", &["name", "text in double quotes"]), // a number where text belongs
        (
            "[CoulombFriction(c_n_per_m: 6.0)]",
            "⟦CoulombFriction(c_n_per_m: 6.0)",
            &["effects", "list", "[...]"],
        ), // brackets where a list belongs
        ("seed: 1", "seed: ⟦-1", &["seed", "-1", "whole number"]), // a negative seed
        ("seed: 1", "seed: ⟦1.5", &["seed", "1.5", "whole number"]), // a seed with decimals
        ("ForceTorque(noise_n: 0.02, ar1: 0.0)", "⟦ForceTorque", &["`ForceTorque(...)`"]), // a name without its brackets
        ("thickness_m: 0.03", "thickness_m: 30 ⟦mm", &["comma"]), // a unit behind a number
        ("thickness_m: 0.03", "thickness_m: 0,⟦03", &["point", "0.03"]), // a decimal comma
        ("robot: Slide,\n    sensor", "robot: Slide\n    ⟦sensor", &["comma"]), // missing comma
        ("9000.0),\n            (", "9000.0)\n            ⟦(", &["comma"]), // missing comma between layers
        ("    ),\n    effects", "    ⟦effects", &["`effects`", "`Tissue`"]), // missing bracket of the tissue
        ("        ],\n    ),", "    ⟦),", &["tissue.layers", "bracket"]), // missing bracket of the list of layers
        ("\"gel\"", "⟦\"gel", &["double quote"]),                         // a string that does not end
        ("seed: 1", "seed: 1, ⟦seed: 2", &["`seed`", "twice"]),           // a field given twice
        ("seed: 1,\n)", "seed: 1,\n) ⟦extra", &["end"]),                  // text behind the end
        ("puncture_n: 2.2", "puncture_n: ⟦Some(-2.2)", &["tissue.layers[1].puncture_n: is -2.2"]), // negative puncture force within some
        (
            "Constant(start_m: -0.005, velocity_mps: 0.0023",
            "⟦Constant(start_m: -0.005, velocity_mps: -0.0023",
            &["motion: never reaches the tissue", "-0.0050 m", "surface lies at 0 m", "start nearer"],
        ), // a motion that never reaches the tissue
        (
            "sigma_ordinary_n: 0.01, sigma_rupture_n: 0.15",
            "sigma_ordinary_n: ⟦0.2",
            &["enhance.cusum.sigma_rupture_n: is 0.15", "larger than sigma_ordinary_n, 0.2"],
        ), // cusum sigma above the other ones default
        (
            "CoulombFriction(c_n_per_m: 6.0)",
            "ForceBias(force_n: 0.1), StressRelaxation(terms: [(fraction: ⟦1.3, time_constant_s: 2.7)])",
            &["effects[1].terms[0].fraction: is 1.3", "between 0 and 1"],
        ), // a term of an effect out of its range
        ("\"gel\"", "⟦\" \"", &["name: is empty"]), // an unnamed scenario
    ];
    for (piece, replacement, parts) in cases {
        refused(piece, replacement, parts);
    }
}

#[test]
fn values_out_of_range_are_refused_with_field_value_and_range() {
    // Replaced piece, replacement with mark, path, value, range. RON reads `NaN` and `-inf` and turns 1e400 into infinity.
    let cases = [
        ("0.03,", "⟦-0.03,", "tissue.layers[0].thickness_m", "is -0.03", "positive number of metres"), // negative thickness
        ("0.02, /*", "⟦0.0, /*", "tissue.layers[1].thickness_m", "is 0;", "positive number of metres"), // zero thickness
        ("40.0, fr", "⟦NaN, fr", "tissue.layers[0].stiffness_n_per_m", "is NaN", "number of N/m"), // not a number
        ("-0.005", "⟦-inf", "motion.start_m", "is -inf", "finite number of metres"), // minus infinity
        ("12000.0", "⟦1e400", "tissue.layers[1].friction_ns_per_m2", "is inf", "number of N s/m²"), // a number too large to hold
        (
            "puncture_n: 2.2",
            "puncture_n: ⟦-2.2",
            "tissue.layers[1].puncture_n",
            "is -2.2",
            "positive number of N",
        ), // negative puncture force
        ("sample_hz: 200.0", "sample_hz: ⟦0.0", "sample_hz", "is 0;", "positive, for example 200.0"), // sample rate zero
        ("tolerance: 0.3", "tolerance: ⟦0.0", "tolerance", "is 0;", "above 0 and at most 1"), // tolerance of zero and above one
        ("tolerance: 0.3", "tolerance: ⟦1.5", "tolerance", "is 1.5;", "above 0 and at most 1"), // tolerance of zero and above one
        ("tolerance: 0.3", "tolerance: ⟦30", "tolerance", "is 30;", "above 0 and at most 1"), // tolerance of zero and above one
        ("ar1: 0.0", "ar1: ⟦1.0", "sensor.ar1", "is 1;", "between -1 and 1"), // noise that never forgets
        ("hz: 40.0", "hz: ⟦0.0", "enhance.reset.hz", "is 0;", "positive number of Hz"), // reset at zero hertz
        (
            "sigma_ordinary_n: 0.01, sigma_rupture_n: 0.15",
            "sigma_ordinary_n: 0.15, sigma_rupture_n: ⟦0.01",
            "enhance.cusum.sigma_rupture_n",
            "is 0.01",
            "larger than sigma_ordinary_n, 0.15",
        ), // cusum sigmas swapped
        ("0.0023", "⟦2.3", "motion.velocity_mps", "is 2.3", "mm/s?"), // speed in millimetres per second
        ("0.03,", "⟦28.2,", "tissue.layers[0].thickness_m", "is 28.2", "millimetres?"), // thickness in millimetres
        ("c_n_per_m: 6.0", "c_n_per_m: ⟦-6.0", "effects[0].c_n_per_m", "is -6", "between 0 and"), // an effect out of its range
    ];
    for (piece, replacement, path, value, range) in cases {
        refused(piece, replacement, &[&format!("{path}: "), value, range]);
    }
}

#[test]
fn the_unchanged_text_is_accepted() {
    Scenario::parse("gel.ron", VALID).unwrap_or_else(|e| panic!("{e}"));
}

// Missing fields: the message points at the brackets that lack it, or the name before them.

#[test]
fn missing_field_of_the_scenario() {
    refused_text(
        &with("    name: \"gel\",\n", "").replace("Scenario(", "⟦Scenario("),
        &["missing field `name`", "`name: ...`"],
    );
}

#[test]
fn missing_motion() {
    refused_text(
        &with("    motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0),\n", "")
            .replace("Scenario(", "⟦Scenario("),
        &["missing field `motion`"],
    );
}

// Punctuation.

#[test]
fn missing_bracket_at_the_end() {
    refused_text(&with("seed: 1,\n)", "seed: 1,\n").replace("Scenario(", "Scenario⟦("), &["never closed"]);
}

// Ranges: RON reads `NaN` and `-inf`, and makes an infinity of 1e400.

#[test]
fn zero_layers() {
    let (layers, rest) = VALID.split_once("        layers: [\n").unwrap();
    let (_, end) = rest.split_once("        ],\n").unwrap();
    refused_text(
        &format!("{layers}        layers: ⟦[\n        ],\n{end}"),
        &["tissue.layers: has no layer", "at least one"],
    );
}

#[test]
fn a_sample_rate_that_does_not_divide_the_physics_rate_is_right() {
    for hz in ["150.0", "333.0", "5000.0"] {
        let text = VALID.replace("sample_hz: 200.0", &format!("sample_hz: {hz}"));
        assert!(text.contains(hz));
        assert!(Scenario::parse("odd.ron", &text).is_ok(), "{hz} Hz");
    }
}

// Whole files.

fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("bad_input_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn refused_file(path: &std::path::Path, parts: &[&str]) -> InputError {
    let Err(error) = Scenario::load(path) else { panic!("{} is accepted", path.display()) };
    let message = error.to_string();
    assert!(message.starts_with(&path.display().to_string()), "the file is not named: {message}");
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
    error
}

#[test]
fn missing_file() {
    let path = file("here.ron", b"").with_file_name("not_here.ron");
    refused_file(&path, &["no such file", "check the spelling"]);
}

#[test]
fn directory() {
    refused_file(file("inside.ron", b"").parent().unwrap(), &["directory", "RON file"]);
}

#[test]
fn empty_file() {
    refused_file(&file("empty.ron", b""), &["is empty", "`Scenario("]);
    refused_file(&file("blank.ron", b" \n\t\r\n"), &["is empty", "`Scenario("]);
}

#[test]
fn comments_only() {
    refused_file(&file("comments.ron", b"// nothing yet\n/* nor here */\n"), &["Scenario"]);
}

#[test]
fn binary_file() {
    refused_file(&file("binary.ron", b"\x7fELF\x02\x01\x01\x00\x00\x00"), &["binary", "UTF-8"]);
}

#[test]
fn latin_1_file() {
    let text = VALID.replace("3 µm", "3 mm");
    let (before, after) = text.split_once("wö").unwrap();
    let bytes = [before.as_bytes(), b"w\xf6", after.as_bytes()].concat();
    let error = refused_file(&file("latin1.ron", &bytes), &["UTF-8"]);
    let column = before.rsplit('\n').next().unwrap().chars().count() + 2;
    assert_eq!(error.position, Some((6, column)), "the byte that is not UTF-8 is pointed at: {error}");
}

#[test]
fn utf_16_file() {
    let little: Vec<u8> =
        [0xff, 0xfe].into_iter().chain(VALID.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    let big: Vec<u8> =
        [0xfe, 0xff].into_iter().chain(VALID.encode_utf16().flat_map(u16::to_be_bytes)).collect();
    refused_file(&file("utf16le.ron", &little), &["UTF-8"]);
    refused_file(&file("utf16be.ron", &big), &["UTF-8"]);
    refused_file(&file("utf16_without_mark.ron", &little[2..]), &["UTF-8"]);
}

#[test]
fn a_bad_line_of_a_file_with_windows_line_ends_and_byte_order_mark_has_its_line_and_column() {
    let text = format!("\u{feff}{}", with("seed: 1", "sede: 1").replace('\n', "\r\n"));
    let error = refused_file(&file("windows.ron", text.as_bytes()), &["windows.ron:18:5: ", "`sede`"]);
    assert_eq!(error.position, Some((18, 5)));
}
