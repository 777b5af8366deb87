//! Promise: `stylet enhance LOG --model EXTENDED.ron` uses the friction of an identified model and names it in every result; invalid
//! models and algorithms without model are refused with file, place and remedy.

use crate::support;

use std::fs;
use support::{Scratch, scenario, stderr_text, stylet};

/// A gel with dry friction that builds up over 2 mm; insertion, hold, retraction.
const MODEL: &str = r#"Scenario(
    name: "dry gel",
    tissue: (surface_m: 0.005, layers: [
        (thickness_m: 0.03, stiffness_n_per_m: 60.0, friction_ns_per_m2: 800.0, puncture_n: 1.2),
        (thickness_m: 0.05, stiffness_n_per_m: 90.0, friction_ns_per_m2: 1200.0),
    ]),
    effects: [PreslidingFriction(c_n_per_m: 30.0, delta_m: 0.002)],
    motion: Program(start_m: 0.0, segments: [
        Move(velocity_mps: 0.004, duration_s: 9.0), Hold(duration_s: 2.0), Move(velocity_mps: -0.004, duration_s: 8.0),
    ]),
    robot: Replay,
    sensor: ForceTorque(noise_n: 0.02),
)"#;

#[test]
fn a_model_of_another_insertion_compensates_the_hold_and_every_result_names_it() {
    let scratch = Scratch::new("with-model");
    let model = scratch.file("extended.ron", MODEL);
    let model = model.to_str().expect("a path");
    let folder = |name: &str| scratch.path().join(name).to_str().expect("a path").to_owned();
    let ran = stylet(&["run", model, "--seed", "5", "--out", &folder("run")]);
    assert!(ran.status.success(), "{}", stderr_text(&ran));
    let log = folder("run/recording.csv");
    let alone = stylet(&["enhance", &log, "--out", &folder("alone")]);
    assert!(alone.status.success(), "{}", stderr_text(&alone));
    let with_model = stylet(&["enhance", &log, "--model", model, "--out", &folder("with_model")]);
    assert!(with_model.status.success(), "{}", stderr_text(&with_model));
    let terminal = String::from_utf8_lossy(&with_model.stdout);
    assert!(terminal.contains("shaft friction from") && terminal.contains("extended.ron"), "{terminal}");

    let read = |file: &str| fs::read_to_string(scratch.path().join(file)).expect("a result");
    assert!(
        read("with_model/enhance.json").contains("extended.ron")
            && !read("alone/enhance.json").contains("identified_model")
    );
    let page = read("with_model/report.html");
    assert!(page.contains("shaft friction from") && page.contains("--model"), "the page names the model");
    // Ruptures are those without the model.
    assert_eq!(read("with_model/events.json"), read("alone/events.json"));

    // In the hold only the second layer acts at the tip.
    let mean = |file: &str, column: &str| {
        let text = read(file);
        let mut lines = text.lines();
        let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let of = |name: &str| header.iter().position(|h| *h == name).expect("a column");
        let (time, value) = (of("time_s"), of(column));
        let rows = lines.map(|l| l.split(',').collect::<Vec<_>>());
        let number = |s: &str| s.parse::<f64>().expect("a number");
        let held: Vec<f64> =
            rows.filter(|r| (9.5..10.5).contains(&number(r[time]))).map(|r| number(r[value])).collect();
        assert!(held.len() > 100);
        held.iter().sum::<f64>() / held.len() as f64
    };
    let (tip, alone, with_model) = (
        mean("run/recording.csv", "true_tip_force_n"),
        mean("alone/enhanced.csv", "enhanced_n"),
        mean("with_model/enhanced.csv", "enhanced_n"),
    );
    let message = format!("{with_model} N with the model, {alone} N without, {tip} N at the tip");
    assert!((with_model - tip).abs() < 0.05, "{message}");
    assert!((with_model - tip).abs() < 0.5 * (alone - tip).abs(), "{message}");
}

#[test]
fn files_that_are_no_model_and_algorithms_that_take_none_are_refused() {
    let scratch = Scratch::new("no-model");
    let out = scratch.path().join("out");
    let data =
        scratch.file("d.csv", "time_s,position_m,force_n\n0.00,0.000,0.1\n0.01,0.001,0.2\n0.02,0.002,0.3\n");
    let path = |p: &std::path::Path| p.to_str().expect("a path").to_owned();
    let enhance = scratch.file("e.ron", "Enhance(surface_m: 0.01)");
    let paper = scratch.file("p.ron", "Enhance(algorithm: Paper)");
    let broken = scratch.file("b.ron", MODEL.replacen("thickness_m: 0.03", "thickness_m: -0.03", 1));
    let good = scenario("three_layer_latex_constant");
    let cases: [(&[String], &[&str]); 4] = [
        (&["--model".into(), path(&scratch.path().join("none.ron"))], &["none.ron"]),
        (&["--model".into(), path(&enhance)], &["e.ron:1:1", "`Enhance`", "`Scenario` is expected"]),
        (&["--model".into(), path(&broken)], &["b.ron:4", "-0.03", "positive"]),
        (
            &["--model".into(), path(&good), "--config".into(), path(&paper)],
            &["three_layer_latex_constant", "Stylet", "runs Paper", "omit --model"],
        ),
    ];
    for (more, words) in cases {
        let (data, folder) = (path(&data), path(&out));
        let mut arguments = vec!["enhance", data.as_str(), "--out", folder.as_str()];
        arguments.extend(more.iter().map(String::as_str));
        let output = stylet(&arguments);
        let message = stderr_text(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        for word in words {
            assert!(message.contains(word), "{arguments:?}: no {word:?} in {message}");
        }
        assert!(!out.exists(), "{arguments:?} left output files");
    }
}

/// The phantom of the README: at a turn without a hold viscous friction jumps, and the force with it.
#[test]
fn a_viscous_model_leaves_little_residual_after_a_turn_without_a_hold() {
    let scratch = Scratch::new("viscous-model");
    let phantom = r#"Scenario(
    name: "two gels",
    tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
        (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0),
    ]),
    motion: Program(start_m: -0.005, segments: [
        Move(velocity_mps: 0.002, duration_s: 15.0), Hold(duration_s: 3.0),
        Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 15.0),
        Move(velocity_mps: -0.004, duration_s: 5.0),
    ]),
    sensor: ForceTorque(noise_n: 0.01, ar1: 0.5),
)"#;
    let model = scratch.file("phantom.ron", phantom);
    let model = model.to_str().expect("a path");
    let folder = |name: &str| scratch.path().join(name).to_str().expect("a path").to_owned();
    let ran = stylet(&["run", model, "--out", &folder("run")]);
    assert!(ran.status.success(), "{}", stderr_text(&ran));
    let with_model =
        stylet(&["enhance", &folder("run/recording.csv"), "--model", model, "--out", &folder("with_model")]);
    assert!(with_model.status.success(), "{}", stderr_text(&with_model));
    let text = fs::read_to_string(scratch.path().join("with_model/enhanced.csv")).expect("a result");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let at = header.iter().position(|h| *h == "enhanced_n").expect("a column");
    // The turn is at 33 s, beyond the last layer.
    let back: Vec<f64> = lines
        .map(|l| l.split(',').collect::<Vec<_>>())
        .filter(|row| row[0].parse::<f64>().expect("a time") >= 33.0)
        .map(|row| row[at].parse().expect("a force"))
        .collect();
    let rms_n = (back.iter().map(|f| f * f).sum::<f64>() / back.len() as f64).sqrt();
    assert!(back.len() > 900 && rms_n < 0.06, "{rms_n} N of {} samples", back.len());
    assert!(back.iter().all(|f| f.abs() < 0.3));
}
