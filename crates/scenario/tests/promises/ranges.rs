//! Every value of a scenario has a range; a value outside is refused with its location and the range.
#![allow(clippy::unwrap_used, clippy::panic)]

use proptest::prelude::*;
use stylet_scenario::Scenario;

const LAYERS: &str = "(thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0),
        (thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 12000.0)";
const CONSTANT: &str = "Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0)";

fn scenario(motion: &str, rest: &str) -> String {
    format!(
        "Scenario(\n    name: \"gel\",\n    tissue: (layers: [{LAYERS}]),\n    motion: {motion},\n    {rest}\n)"
    )
}

/// The message for a text that must be refused at the first occurrence of `at` in `written`.
fn message_for(text: &str, written: &str, at: &str) -> String {
    let Err(error) = Scenario::parse("gel.ron", text) else { panic!("accepted:\n{text}") };
    let message = error.to_string();
    let from = text.find(written).unwrap_or_else(|| panic!("no `{written}`"));
    let before = &text[..from + written.find(at).unwrap_or_else(|| panic!("no `{at}`"))];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap().chars().count() + 1;
    assert!(message.starts_with(&format!("gel.ron:{line}:{column}: ")), "not at {line}:{column}: {message}");
    message
}

/// Cases of text, location and message.
fn all_refused(cases: &[(&str, &str, &str)], text: impl Fn(&str) -> String) {
    for (written, at, expected) in cases {
        let message = message_for(&text(written), written, at);
        assert!(message.contains(expected), "`{expected}` is missing in: {message}");
    }
}

#[test]
fn motions() {
    let cases = [
        (
            "Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 0.0)",
            "0.0)",
            "motion.duration_s: is 0; it must be a positive number of seconds",
        ),
        (
            "Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 1e6)",
            "Constant",
            "motion: makes 2.000e8 samples in 1000000 s at 200 Hz; at most 5e7",
        ),
        (
            "Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 0.001)",
            "Constant",
            "less than two samples",
        ),
        (
            "Sinusoidal(start_m: 0.0, amplitude_m: 120.0, frequency_hz: 0.0167, duration_s: 15.0)",
            "120.0",
            "motion.amplitude_m: is 120, which at 0.0167 Hz makes 12.592 m/s",
        ),
        (
            "Sinusoidal(start_m: 0.0, amplitude_m: 0.001, frequency_hz: 100.0, duration_s: 15.0)",
            "100.0",
            "motion.frequency_hz: is 100; it must lie between 0 and half of sample_hz, 100 Hz",
        ),
        (
            "Sinusoidal(start_m: 0.0, amplitude_m: 0.1, frequency_hz: -1.0, duration_s: 15.0)",
            "-1.0",
            "motion.frequency_hz: is -1",
        ),
        (
            "Sinusoidal(start_m: -0.3, amplitude_m: 0.12, frequency_hz: 0.0167, duration_s: 15.0)",
            "Sinusoidal",
            "the tip comes to -0.1796 m",
        ),
        ("Program(start_m: -0.01, segments: [])", "[])", "motion.segments: is empty"),
        (
            "Program(start_m: -0.01, segments: [Hold(duration_s: 1.0), Move(velocity_mps: 5.0, duration_s: 2.0)])",
            "5.0",
            "motion.segments[1].velocity_mps: is 5; speeds are at most 1 m/s",
        ),
        (
            "Program(start_m: -0.01, segments: [Hold(duration_s: -1.0)])",
            "-1.0",
            "motion.segments[0].duration_s: is -1",
        ),
        (
            "Program(start_m: -0.01, segments: [Ripple(velocity_mps: 0.0, amplitude_mps: 0.003, frequency_hz: 0.0, duration_s: 9.0)])",
            "0.0, duration_s: 9",
            "motion.segments[0].frequency_hz: is 0",
        ),
    ];
    all_refused(&cases, |motion| scenario(motion, ""));
}

#[test]
fn effects() {
    let cases = [
        (
            "BoundaryShift(layer: 2, shift_m: 0.001)",
            "2, shift",
            "effects[0].layer: is 2; it must lie between 1 and 1",
        ),
        (
            "CoulombFriction(c_n_per_m: 1e400)",
            "1e400",
            "effects[0].c_n_per_m: is inf; it must be a finite number",
        ),
        ("StressRelaxation(terms: [])", "[])", "effects[0].terms: has 0 terms; give one or two"),
        (
            "StressRelaxation(terms: [(fraction: 0.7, time_constant_s: 1.0), (fraction: 0.6, time_constant_s: 9.0)])",
            "0.6",
            "effects[0].terms[1].fraction: is 0.6; it must lie between 0 and 0.3",
        ),
        ("LowPassLag(time_constant_s: NaN)", "NaN", "effects[0].time_constant_s: is NaN"),
    ];
    all_refused(&cases, |effect| scenario(CONSTANT, &format!("effects: [{effect}],")));
    let many = scenario(CONSTANT, &format!("effects: [{}],", "CoulombFriction(c_n_per_m: 1.0), ".repeat(17)));
    assert!(
        message_for(&many, "[Coulomb", "[")
            .contains("17 effects act on the tissue at once; at most 16 are possible")
    );
}

#[test]
fn every_number_of_the_online_algorithm() {
    let cases = [
        ("forgetting: 0.0", "0.0", "enhance.forgetting: is 0; it must lie above 0 and be at most 1"),
        ("reset: Trace(below: -1.0)", "-1.0", "enhance.reset.below: is -1"),
        (
            "depths: Known([0.01, -0.02])",
            "-0.02",
            "enhance.depths[1]: is -0.02; it must be a positive number of metres",
        ),
        ("depths: Known([])", "Known", "enhance.depths: is empty; give one thickness in metres per layer"),
        ("prior_friction: 0.0", "0.0", "enhance.prior_friction: is 0"),
        (
            "derivative: (on_n_per_s: 0.05, off_n_per_s: 0.06)",
            "0.06",
            "it must be smaller than on_n_per_s, 0.05",
        ),
        (
            "derivative: (force_time_constant_s: -0.5)",
            "-0.5",
            "enhance.derivative.force_time_constant_s: is -0.5",
        ),
        (
            "drop: (share_limits: (0.9, 0.1))",
            "(0.9",
            "enhance.drop.share_limits: is (0.9, 0.1); the first must be smaller",
        ),
        (
            "drop: (share_limits: (0.1, 1.5))",
            "1.5",
            "enhance.drop.share_limits[1]: is 1.5; it must lie between 0 and 1",
        ),
        ("drop: (replay_per_tick: 0)", "0)", "enhance.drop.replay_per_tick: is 0"),
        ("contact_search: (samples: 0)", "0)", "enhance.contact_search.samples: is 0"),
        ("guard: (sudden_mps2: NaN)", "NaN", "enhance.guard.sudden_mps2: is NaN"),
    ];
    all_refused(&cases, |field| scenario(CONSTANT, &format!("enhance: ({field}),")));
}

#[test]
fn sensors_and_rates() {
    let cases = [
        (
            "sensor: ForceTorque(noise_n: -0.02),",
            "-0.02",
            "sensor.noise_n: is -0.02; it must be zero or a positive number of N",
        ),
        ("sensor: ForceTorque(range_n: 0.0),", "0.0)", "sensor.range_n: is 0"),
        ("sensor: Both(force_torque: (ar1: -1.0)),", "-1.0", "sensor.force_torque.ar1: is -1"),
        ("sensor: Virtual(gain_per_s: 0.0),", "0.0)", "sensor.gain_per_s: is 0"),
        ("physics_hz: 1e9,", "1e9", "which makes 2.000e10 steps in 20 s"),
    ];
    all_refused(&cases, |field| scenario(CONSTANT, field));
}

#[test]
fn a_file_that_is_far_too_long_is_not_read() {
    let path =
        std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("long_{}.ron", std::process::id()));
    std::fs::write(&path, vec![b' '; 5 << 20]).unwrap();
    let message = Scenario::load(&path).unwrap_err().to_string();
    std::fs::remove_file(&path).unwrap();
    assert!(message.contains("longer than 4 MB"), "{message}");
}

proptest! {
    #[test]
    fn a_corrupted_text_is_refused_with_a_message_without_panic(
        at in 0usize..500,
        gone in 0usize..6,
        put in "[(){}\\[\\]:,\"\\\\/*#.é\n0-9a-c -]{0,4}",
    ) {
        let text = scenario(CONSTANT, "effects: [CoulombFriction(c_n_per_m: 6.0)], // µ\n    seed: 1,");
        let mut bytes = text.into_bytes();
        let from = at.min(bytes.len());
        let to = (from + gone).min(bytes.len());
        bytes.splice(from..to, put.bytes());
        let text = String::from_utf8_lossy(&bytes);
        if let Err(error) = Scenario::parse("gel.ron", &text) {
            let message = error.to_string();
            prop_assert!(message.starts_with("gel.ron:"), "{}", message);
            if let Some((line, column)) = error.position {
                prop_assert!(line <= text.matches('\n').count() + 1 && column >= 1, "{}", message);
            }
        }
    }
}
