//! Promise: an effect given by a formula is simulated, found, reported and read again like an effect of the library; among the candidates
//! of recordings without it, it is not named; and a formula that cannot be right is refused at its place, whatever its parameters.

use crate::support;

use stylet_diagnose::{NamedRecording, Options, Verdict};
use stylet_scenario::{InputError, Scenario};
use support::{Scratch, root};

/// Formula and parameters of an effect outside the library: a strength and a shape.
const STIFFENING: &str = "name: \"rate_stiffening\", place: Elastic, force: \"k * max(0, z_layer) * log(1 + abs(v)/v0)\", parameters: {
    k: (start: 8.0, VALUE unit: \"N/m\", inactive: 0.0),
    v0: (start: 0.002, prior: LogNormal(median: 0.002, factor: 2.0), unit: \"m/s\"),
}";

fn scenario(effects: &str, candidates: &str, seed: u64) -> Result<Scenario, InputError> {
    // Two recordings with different motions.
    let speed = 0.002 + 0.0005 * seed as f64;
    let text = format!(
        "Scenario(name: \"two gels\", tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
        (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0)]),
        effects: [{effects}], candidates: [{candidates}],
        motion: Program(start_m: -0.005, segments: [
            Move(velocity_mps: {speed}, duration_s: 12.0), Hold(duration_s: 3.0),
            Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 9.0), Move(velocity_mps: -0.004, duration_s: 5.0)]),
        robot: Replay, sensor: ForceTorque(noise_n: 0.01, ar1: 0.5))"
    );
    Scenario::parse("two_gels.ron", &text)
}

fn custom(value: &str) -> String {
    format!("Custom({})", STIFFENING.replace("VALUE", value))
}

fn recordings(effects: &str) -> Vec<NamedRecording> {
    let one = |seed: u64| {
        let truth = scenario(effects, "", seed).expect("a scenario");
        let recording = stylet_testbed::simulate(&truth, seed).expect("an insertion").recording;
        NamedRecording { name: format!("{seed}.csv"), recording, notes: Vec::new() }
    };
    [1, 2].map(one).into()
}

#[test]
fn a_hidden_custom_effect_is_found_and_one_that_is_not_there_is_not() {
    let assumed = scenario("", &custom(""), 1).expect("a scenario");
    let hidden = recordings(&custom("value: 20.0,"));
    let found =
        stylet_diagnose::diagnose(&assumed, &hidden, &Options::default(), |_| {}).expect("a diagnosis");
    let causes: Vec<&str> = found.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(causes, ["rate_stiffening"]);
    let k = found.diagnosis.causes[0].parameters["k"];
    assert!(k.low < 20.0 && 20.0 < k.high && k.high - k.low < 4.0, "{k:?}");
    // The result is a scenario with the effect, and its held-out error is that of the noise.
    assert!(
        found.diagnosis.gain.rmse_after_n < 1.1 * found.diagnosis.gain.floor_n,
        "{:?}",
        found.diagnosis.gain
    );
    let text = found.extended_scenario.to_ron().expect("RON");
    let again = Scenario::parse("extended.ron", &text).expect("a valid scenario");
    assert_eq!(again.effects, found.extended_scenario.effects);
    assert!((again.effects[0].parameters()[0] - 20.0).abs() < 1.5, "{text}");

    let clean = recordings("");
    let found =
        stylet_diagnose::diagnose(&assumed, &clean, &Options::default(), |_| {}).expect("a diagnosis");
    assert_eq!(found.diagnosis.verdict, Verdict::None, "{:?}", found.diagnosis.causes);
    // The report says that it was tried.
    let said = stylet_report::pages::diagnosis::unneeded_custom_effects(&found.diagnosis);
    assert!(said.len() == 1 && said[0].starts_with("rate_stiffening is not needed"), "{said:?}");
}

#[test]
#[ignore = "half a minute; tests/accuracy.sh"]
fn a_force_outside_the_library_gets_formulas_and_the_best_is_found_as_a_custom_effect() {
    // A periodic force over depth, as of a grooved needle.
    let grooves =
        "Custom(name: \"grooves\", place: Tip, force: \"if(inserted > 0, c*sin(2*pi*z/p), 0)\", parameters: {
        c: (start: 0.2, unit: \"N\", inactive: 0.0), p: (start: 0.006, unit: \"m\")})";
    let assumed = scenario("", "", 1).expect("a scenario");
    let hidden = recordings(grooves);
    let found =
        stylet_diagnose::diagnose(&assumed, &hidden, &Options::default(), |_| {}).expect("a diagnosis");
    let d = &found.diagnosis;
    assert_eq!(d.verdict, Verdict::Unknown);
    let formulas = d.formulas.as_ref().expect("formulas");
    assert_eq!(formulas.variables[0].variable, "z");
    let best = &formulas.proposals[0];
    assert!(best.held_out_n < 0.3 * d.gain.rmse_after_n, "{best:?}, without {}", d.gain.rmse_after_n);

    let directory = Scratch::new("proposed_effects");
    let text = stylet_scenario::effects_to_ron(&found.proposed_effects[..1]).expect("RON");
    let file = directory.file("proposed_effects.ron", text);
    let mut with = assumed.clone();
    with.add_candidates(&file).expect("a file of effects");
    let found = stylet_diagnose::diagnose(&with, &hidden, &Options::default(), |_| {}).expect("a diagnosis");
    let causes: Vec<&str> = found.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(causes, [best.name.as_str()]);
    assert!(found.diagnosis.formulas.is_none());
}

#[test]
fn an_error_points_into_the_formula() {
    for (from, to, place, says) in [
        ("abs(v)/v0)", "abs(v)/v0) + v", "two_gels.ron:4:", "`v`: units do not fit: this has m/s"),
        ("max(0, z_layer)", "max(0, depth)", "two_gels.ron:4:", "`depth` is not known"),
        ("\"m/s\"", "\"mm/s\"", "two_gels.ron:6:", "`mm` is no unit"),
        ("rate_stiffening", "cutting_force", "two_gels.ron:4:", "is an effect of the library"),
        (", inactive: 0.0", "", "two_gels.ron:4:", "no parameter is a strength"),
        ("start: 8.0,", "start: 8.0, value: -1.0,", "two_gels.ron:5:", "must be at least 0 N/m"),
    ] {
        let error = scenario(&custom("").replace(from, to), "", 1).expect_err("an error");
        let text = error.to_string();
        assert!(error.location.starts_with(place) && text.contains(says), "{} {text}", error.location);
    }
    let column = |e: &InputError| {
        e.location.rsplit(':').next().and_then(|c| c.parse::<usize>().ok()).expect("a column")
    };
    let error = scenario(&custom("").replace("abs(v)/v0)", "abs(v)/v0) + v"), "", 1).expect_err("an error");
    let line = format!("        effects: [{}", custom("").replace("abs(v)/v0)", "abs(v)/v0) + v"));
    assert_eq!(Some(column(&error) - 1), line.find("+ v\"").map(|at| at + 2));
}

#[test]
fn a_candidate_must_be_outside_the_library_and_has_one_definition() {
    for (candidates, says) in [
        ("CoulombFriction(c_n_per_m: 3.0)".to_owned(), "is an effect of the library"),
        (format!("{}, {}", custom(""), custom("")), "another effect of the name"),
    ] {
        let error = scenario("", &candidates, 1).expect_err("an error").to_string();
        assert!(error.contains(says), "{error}");
    }
    let other = custom("").replace("start: 8.0", "start: 9.0");
    assert!(
        scenario(&custom(""), &other, 1).expect_err("two definitions").to_string().contains("another effect")
    );
    // The effect that is assumed may also be a candidate.
    assert!(scenario(&custom("value: 3.0,"), &custom(""), 1).is_ok());
}

#[test]
fn a_formula_without_a_value_ends_a_simulation_with_an_error() {
    let wild = custom("value: 20.0,").replace("log(1 + abs(v)/v0)", "exp(1e6*z_layer/v0/t)");
    let scenario = scenario(&wild, "", 1).expect("its units fit");
    let error = stylet_testbed::simulate(&scenario, 1).expect_err("no value").to_string();
    assert!(error.contains("rate_stiffening") && error.contains("equation"), "{error}");
}

#[test]
fn the_commands_take_a_file_of_effects() {
    let scratch = Scratch::new("custom-effects");
    let file = scratch.path().join("mine.ron");
    std::fs::write(&file, format!("[{}]", custom(""))).expect("a file");
    let stylet = |words: &[&str]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_stylet"))
            .args(words)
            .args(["--effects", &file.display().to_string()])
            .current_dir(root())
            .output()
            .expect("the command runs");
        assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    assert!(stylet(&["effects", "rate_stiffening"]).contains("k * max(0, z_layer)"));
    assert!(stylet(&["effects"]).contains("rate_stiffening"));
    let out = scratch.path().join("out").display().to_string();
    let table = stylet(&["identifiability", "scenarios/three_layers.ron", "--out", &out]);
    assert!(table.contains("rate_stiffening"), "{table}");
}

#[test]
fn a_benchmark_hides_the_effects_of_a_file_among_the_candidates() {
    let scratch = Scratch::new("custom-benchmark");
    let file = |name: &str, effect: &str| scratch.file(name, format!("[{effect}]")).display().to_string();
    let mine = file("mine.ron", &custom(""));
    let out = scratch.path().join("out").display().to_string();
    let benchmark = |words: &[&str]| support::stylet(&[&["benchmark", "diagnose"], words].concat());
    let hides = ["--hide", "custom,clean", "--cases", "2", "--seed", "3", "--out", &out];
    let run = benchmark(&[&hides[..], &["--effects", &mine]].concat());
    let table = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success(), "{}", support::stderr_text(&run));
    let journal = || std::fs::read_to_string(scratch.path().join("out/cases.jsonl")).expect("a journal");
    let outcomes = journal();
    let hidden: Vec<&str> =
        outcomes.lines().filter(|l| l.contains("\"hidden\":[\"rate_stiffening\"]")).collect();
    assert!(hidden.len() == 1 && outcomes.lines().count() == 2, "{outcomes}");
    assert!(hidden[0].contains("\"correct\":true"), "{table}");
    // The answers depend on the candidates, so they are not mixed with those of other effects.
    let other = file("other.ron", &custom("").replace("start: 8.0", "start: 9.0"));
    for effects in [&["--effects", other.as_str()][..], &[]] {
        let refused = benchmark(&[&hides[..], effects].concat());
        assert!(!refused.status.success());
        let says = support::stderr_text(&refused);
        assert!(
            says.contains(if effects.is_empty() { "--effects" } else { "other custom effects" }),
            "{says}"
        );
    }
    assert_eq!(journal(), outcomes);
}
