//! A scenario that cannot be used is refused with the file, the line and column of the very token that
//! is wrong, what is wrong with it, and the right spelling or range: the message is all that stands
//! between a typing error and an afternoon lost.
//!
//! In the texts below `⟦` marks where the message must point; it is taken out before parsing.
#![allow(clippy::unwrap_used, clippy::panic)]

use miette::Diagnostic;
use std::path::PathBuf;
use stylet_scenario::{InputError, Scenario};

/// A good scenario; `µ` and `ö` see to it that columns count characters and not bytes.
const GOOD: &str = r#"// A gel. tissue: (layers: [
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

/// The good scenario with one piece replaced.
fn with(piece: &str, replacement: &str) -> String {
    assert_eq!(GOOD.matches(piece).count(), 1, "`{piece}` must stand there once");
    GOOD.replace(piece, replacement)
}

/// The text is refused at its mark, with all of `says` in the message.
fn refused_text(marked: &str, says: &[&str]) {
    let (before, after) = marked.split_once('⟦').expect("a mark");
    let text = format!("{before}{after}");
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap().chars().count() + 1;
    let Err(error) = Scenario::parse("folder/gel.ron", &text) else { panic!("accepted:\n{text}") };
    let message = error.to_string();
    let place = format!("folder/gel.ron:{line}:{column}: ");
    assert!(message.starts_with(&place), "it must point at {line}:{column}: {message}");
    assert_eq!(error.position, Some((line, column)), "{message}");
    for part in says {
        assert!(message.contains(part), "`{part}` is not said: {message}");
    }
    // What is underlined begins there too and lies within the text.
    let label = error.labels().and_then(|mut all| all.next()).expect("a label");
    assert_eq!(label.offset(), before.len(), "{message}");
    assert!(label.offset() + label.len() <= text.len(), "{message}");
}

fn refused(piece: &str, replacement: &str, says: &[&str]) {
    refused_text(&with(piece, replacement), says);
}

/// What the message of a number out of range says: the field, the value, the range.
fn out_of_range(piece: &str, replacement: &str, path: &str, value: &str, right: &str) {
    refused(piece, replacement, &[&format!("{path}: "), value, right]);
}

#[test]
fn the_text_that_the_others_spoil_is_good() {
    Scenario::parse("gel.ron", GOOD).unwrap_or_else(|e| panic!("{e}"));
}

// Unknown fields, at every level.

#[test]
fn unknown_field_of_the_scenario() {
    refused("seed: 1", "⟦sede: 1", &["`sede`", "did you mean `seed`?", "`sample_hz`"]);
}

#[test]
fn unknown_field_of_the_tissue() {
    refused(
        "layers: [\n            (",
        "⟦layer: [\n            (",
        &["`layer`", "did you mean `layers`?", "`surface_m`"],
    );
}

#[test]
fn unknown_field_of_a_layer() {
    refused("thickness_m: 0.03", "⟦thicknes_m: 0.03", &["`thicknes_m`", "did you mean `thickness_m`?"]);
}

#[test]
fn unknown_field_of_the_motion() {
    refused("velocity_mps", "⟦velocty_mps", &["`velocty_mps`", "did you mean `velocity_mps`?"]);
}

#[test]
fn unknown_field_of_the_sensor() {
    refused("noise_n", "⟦nois_n", &["`nois_n`", "did you mean `noise_n`?"]);
}

#[test]
fn unknown_field_of_the_algorithm() {
    refused("reset: F", "⟦resett: F", &["`resett`", "did you mean `reset`?"]);
}

#[test]
fn unknown_field_of_a_part_of_the_algorithm() {
    refused("sigma_rupture_n", "⟦sigma_ruptur_n", &["`sigma_ruptur_n`", "did you mean `sigma_rupture_n`?"]);
}

#[test]
fn unknown_field_of_a_reset() {
    refused("hz: 40.0", "⟦hertz: 40.0", &["unknown field `hertz`", "`hz`"]);
}

#[test]
fn unknown_field_of_the_arm() {
    refused("Slide", "Arm(⟦joints: 6)", &["unknown field `joints`"]);
}

#[test]
fn unknown_field_of_an_effect() {
    refused("c_n_per_m", "⟦c_n_pr_m", &["`c_n_pr_m`", "`c_n_per_m`"]);
}

#[test]
fn unknown_field_of_an_effects_term() {
    refused(
        "CoulombFriction(c_n_per_m: 6.0)",
        "StressRelaxation(terms: [(fraction: 0.3, ⟦time_constants: 2.7)])",
        &["`time_constants`", "`time_constant_s`"],
    );
}

#[test]
fn unknown_field_of_a_programs_segment() {
    refused(
        "Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0)",
        "Program(start_m: -0.005, segments: [Move(velocity_mps: 0.0023, duration_s: 9.0), Hold(⟦duration: 1.0)])",
        &["`duration`", "did you mean `duration_s`?"],
    );
}

#[test]
fn an_unknown_field_is_found_where_it_stands_and_not_where_its_name_is_seen() {
    refused(
        "CoulombFriction(c_n_per_m: 6.0)",
        "CoulombFriction(/* c */ ⟦c /* c: */: 6.0 /* c */)",
        &["unknown field `c`", "`c_n_per_m`"],
    );
}

// Unknown names.

#[test]
fn unknown_motion() {
    refused("Constant(", "⟦Constnt(", &["`Constnt`", "did you mean `Constant`?", "`Sinusoidal`"]);
}

#[test]
fn unknown_effect() {
    refused("CoulombFriction(", "⟦CoulomFriction(", &["`CoulomFriction`", "did you mean `CoulombFriction`?"]);
}

#[test]
fn unknown_robot() {
    refused("Slide", "⟦Slid", &["`Slid`", "did you mean `Slide`?", "`Arm`", "`Replay`"]);
}

#[test]
fn unknown_sensor() {
    refused("ForceTorque(", "⟦Forcetorque(", &["`Forcetorque`", "did you mean `ForceTorque`?"]);
}

#[test]
fn unknown_reset() {
    refused("Frequency(", "⟦Frequenzy(", &["`Frequenzy`", "did you mean `Frequency`?", "`Ruptures`"]);
}

#[test]
fn another_outer_name() {
    refused("Scenario(", "⟦Scenarion(", &["`Scenarion`", "`Scenario`"]);
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

#[test]
fn missing_field_of_a_layer() {
    refused(
        "(name: \"Gel, wölbt sich 3 µm\", thickness_m: 0.03, ",
        "⟦(name: \"Gel, wölbt sich 3 µm\", ",
        &["tissue.layers[0]", "missing field `thickness_m`"],
    );
}

#[test]
fn missing_field_of_the_motion() {
    refused(
        "Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0)",
        "⟦Constant(start_m: -0.005, velocity_mps: 0.0023)",
        &["motion", "missing field `duration_s`"],
    );
}

// Wrong types.

#[test]
fn text_where_a_number_belongs() {
    refused("thickness_m: 0.03", "thickness_m: ⟦\"0.03\"", &["tissue.layers[0].thickness_m", "number"]);
}

#[test]
fn a_number_where_text_belongs() {
    refused("\"gel\"", "⟦12", &["name", "text in double quotes"]);
}

#[test]
fn brackets_where_a_list_belongs() {
    refused(
        "[CoulombFriction(c_n_per_m: 6.0)]",
        "⟦CoulombFriction(c_n_per_m: 6.0)",
        &["effects", "list", "[...]"],
    );
}

#[test]
fn a_negative_seed() {
    refused("seed: 1", "seed: ⟦-1", &["seed", "-1", "whole number"]);
}

#[test]
fn a_seed_with_decimals() {
    refused("seed: 1", "seed: ⟦1.5", &["seed", "1.5", "whole number"]);
}

#[test]
fn a_name_without_its_brackets() {
    refused("ForceTorque(noise_n: 0.02, ar1: 0.0)", "⟦ForceTorque", &["`ForceTorque(...)`"]);
}

#[test]
fn a_unit_behind_a_number() {
    refused("thickness_m: 0.03", "thickness_m: 30 ⟦mm", &["comma"]);
}

#[test]
fn a_decimal_comma() {
    refused("thickness_m: 0.03", "thickness_m: 0,⟦03", &["point", "0.03"]);
}

// Punctuation.

#[test]
fn missing_comma() {
    refused("robot: Slide,\n    sensor", "robot: Slide\n    ⟦sensor", &["comma"]);
}

#[test]
fn missing_comma_between_layers() {
    refused("9000.0),\n            (", "9000.0)\n            ⟦(", &["comma"]);
}

#[test]
fn missing_bracket_at_the_end() {
    refused_text(&with("seed: 1,\n)", "seed: 1,\n").replace("Scenario(", "Scenario⟦("), &["never closed"]);
}

#[test]
fn missing_bracket_of_the_tissue() {
    refused("    ),\n    effects", "    ⟦effects", &["`effects`", "`Tissue`"]);
}

#[test]
fn missing_bracket_of_the_list_of_layers() {
    // The list goes on: what closes the tissue stands where a layer is expected.
    refused("        ],\n    ),", "    ⟦),", &["tissue.layers", "bracket"]);
}

#[test]
fn a_string_that_does_not_end() {
    refused("\"gel\"", "⟦\"gel", &["double quote"]);
}

#[test]
fn a_field_given_twice() {
    refused("seed: 1", "seed: 1, ⟦seed: 2", &["`seed`", "twice"]);
}

#[test]
fn text_behind_the_end() {
    refused("seed: 1,\n)", "seed: 1,\n) ⟦extra", &["end"]);
}

// Ranges: RON reads `NaN` and `-inf`, and makes an infinity of 1e400.

#[test]
fn negative_thickness() {
    out_of_range("0.03,", "⟦-0.03,", "tissue.layers[0].thickness_m", "is -0.03", "positive number of metres");
}

#[test]
fn zero_thickness() {
    out_of_range(
        "0.02, /*",
        "⟦0.0, /*",
        "tissue.layers[1].thickness_m",
        "is 0;",
        "positive number of metres",
    );
}

#[test]
fn not_a_number() {
    out_of_range("40.0, fr", "⟦NaN, fr", "tissue.layers[0].stiffness_n_per_m", "is NaN", "number of N/m");
}

#[test]
fn minus_infinity() {
    out_of_range("-0.005", "⟦-inf", "motion.start_m", "is -inf", "finite number of metres");
}

#[test]
fn a_number_too_large_to_hold() {
    out_of_range("12000.0", "⟦1e400", "tissue.layers[1].friction_ns_per_m2", "is inf", "number of N s/m²");
}

#[test]
fn negative_puncture_force() {
    out_of_range(
        "puncture_n: 2.2",
        "puncture_n: ⟦-2.2",
        "tissue.layers[1].puncture_n",
        "is -2.2",
        "positive number of N",
    );
}

#[test]
fn negative_puncture_force_within_some() {
    refused("puncture_n: 2.2", "puncture_n: ⟦Some(-2.2)", &["tissue.layers[1].puncture_n: is -2.2"]);
}

#[test]
fn zero_layers() {
    let (layers, rest) = GOOD.split_once("        layers: [\n").unwrap();
    let (_, end) = rest.split_once("        ],\n").unwrap();
    refused_text(
        &format!("{layers}        layers: ⟦[\n        ],\n{end}"),
        &["tissue.layers: has no layer", "at least one"],
    );
}

#[test]
fn sample_rate_zero() {
    out_of_range("sample_hz: 200.0", "sample_hz: ⟦0.0", "sample_hz", "is 0;", "positive, for example 200.0");
}

#[test]
fn a_sample_rate_that_does_not_divide_the_physics_rate_is_right() {
    for hz in ["150.0", "333.0", "5000.0"] {
        let text = GOOD.replace("sample_hz: 200.0", &format!("sample_hz: {hz}"));
        assert!(text.contains(hz));
        assert!(Scenario::parse("odd.ron", &text).is_ok(), "{hz} Hz");
    }
}

#[test]
fn a_motion_that_never_reaches_the_tissue() {
    refused(
        "Constant(start_m: -0.005, velocity_mps: 0.0023",
        "⟦Constant(start_m: -0.005, velocity_mps: -0.0023",
        &["motion: never reaches the tissue", "-0.0050 m", "surface lies at 0 m", "start nearer"],
    );
}

#[test]
fn tolerance_of_zero_and_of_one() {
    out_of_range("tolerance: 0.3", "tolerance: ⟦0.0", "tolerance", "is 0;", "between 0 and 1");
    out_of_range("tolerance: 0.3", "tolerance: ⟦1.0", "tolerance", "is 1;", "between 0 and 1");
    out_of_range("tolerance: 0.3", "tolerance: ⟦30", "tolerance", "is 30;", "between 0 and 1");
}

#[test]
fn noise_that_never_forgets() {
    out_of_range("ar1: 0.0", "ar1: ⟦1.0", "sensor.ar1", "is 1;", "between -1 and 1");
}

#[test]
fn reset_at_zero_hertz() {
    out_of_range("hz: 40.0", "hz: ⟦0.0", "enhance.reset.hz", "is 0;", "positive number of Hz");
}

#[test]
fn cusum_sigmas_swapped() {
    out_of_range(
        "sigma_ordinary_n: 0.01, sigma_rupture_n: 0.15",
        "sigma_ordinary_n: 0.15, sigma_rupture_n: ⟦0.01",
        "enhance.cusum.sigma_rupture_n",
        "is 0.01",
        "larger than sigma_ordinary_n, 0.15",
    );
}

#[test]
fn cusum_sigma_above_the_other_ones_default() {
    // 0.15 is the default of the other: what is written is shown.
    refused(
        "sigma_ordinary_n: 0.01, sigma_rupture_n: 0.15",
        "sigma_ordinary_n: ⟦0.2",
        &["enhance.cusum.sigma_rupture_n: is 0.15", "larger than sigma_ordinary_n, 0.2"],
    );
}

#[test]
fn speed_in_millimetres_per_second() {
    out_of_range("0.0023", "⟦2.3", "motion.velocity_mps", "is 2.3", "mm/s?");
}

#[test]
fn thickness_in_millimetres() {
    out_of_range("0.03,", "⟦28.2,", "tissue.layers[0].thickness_m", "is 28.2", "millimetres?");
}

#[test]
fn an_effect_out_of_its_range() {
    out_of_range("c_n_per_m: 6.0", "c_n_per_m: ⟦-6.0", "effects[0].c_n_per_m", "is -6", "between 0 and");
}

#[test]
fn a_term_of_an_effect_out_of_its_range() {
    refused(
        "CoulombFriction(c_n_per_m: 6.0)",
        "ForceBias(force_n: 0.1), StressRelaxation(terms: [(fraction: ⟦1.3, time_constant_s: 2.7)])",
        &["effects[1].terms[0].fraction: is 1.3", "between 0 and 1"],
    );
}

#[test]
fn an_unnamed_scenario() {
    refused("\"gel\"", "⟦\" \"", &["name: is empty"]);
}

// Whole files.

fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("bad_input_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn refused_file(path: &std::path::Path, says: &[&str]) -> InputError {
    let Err(error) = Scenario::load(path) else { panic!("{} is accepted", path.display()) };
    let message = error.to_string();
    assert!(message.starts_with(&path.display().to_string()), "the file is not named: {message}");
    for part in says {
        assert!(message.contains(part), "`{part}` is not said: {message}");
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
    let text = GOOD.replace("3 µm", "3 mm");
    let (before, after) = text.split_once("wö").unwrap();
    let bytes = [before.as_bytes(), b"w\xf6", after.as_bytes()].concat();
    let error = refused_file(&file("latin1.ron", &bytes), &["UTF-8"]);
    let column = before.rsplit('\n').next().unwrap().chars().count() + 2;
    assert_eq!(error.position, Some((6, column)), "the byte that is not UTF-8 is pointed at: {error}");
}

#[test]
fn utf_16_file() {
    let little: Vec<u8> =
        [0xff, 0xfe].into_iter().chain(GOOD.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    let big: Vec<u8> =
        [0xfe, 0xff].into_iter().chain(GOOD.encode_utf16().flat_map(u16::to_be_bytes)).collect();
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
