//! Promise: no answer changes unnoticed. Small drawn cases of different character are diagnosed, and what comes out (verdicts, causes,
//! numbers, intervals, traces, what is left, the search's steps) is compared with what is kept in `recorded_answers.txt`, to 1e-5 of each
//! number, so that another machine's mathematics passes. The tests of sets keep theirs in the same file.
//!
//! Whoever changes an answer on purpose records anew and explains it:
//!
//! ```sh
//! STYLET_RECORD=1 cargo test -p stylet-diagnose --all-features
//! ```
//! What is known of a case beforehand (its cause, its numbers) is asserted beside that.

mod drawn;
mod recorded;

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use recorded::AnswerLines;
use stylet_diagnose::diagnosis_json::Cause;
use stylet_diagnose::prediction::{Refit, predict};
use stylet_diagnose::{DiagnosisResult, NamedRecording, Options, Verdict, diagnose};
use stylet_own_world::{self as hidden, Drawn, Harder, Kind, Motions, Outside};
use stylet_record::Recording;
use stylet_scenario::Scenario;
use stylet_tissue::{
    AnyEffect, AsymmetricFriction, BoundaryShift, CoulombFriction, CuttingForce, Effect, ForceBias,
    ForceDrift, ForceLaw, ForceLawState, ForceSpikes, HiddenMembrane, IncompleteRelease, Layer, LowPassLag,
    MeasurementChain, NeedleCompliance, PeriodicInterference, PositionScale, PowerLawFriction, PronyTerm,
    Quantisation, RateDependentPuncture, Respiration, Saturation, SensorInput, SoftBoundary,
    StressRelaxation, StribeckFriction, TimeDelay, Tissue, ToolInertia,
};

const FILE: &str = "recorded_answers.txt";
/// Noise of the sensor (N).
const NOISE_N: f64 = 0.01;
/// Samples per second.
const HZ: f64 = 100.0;

/// Two layers in 29 mm.
fn believed() -> Scenario {
    let layer = |name: &str, d: f64, k: f64, b: f64, f: Option<f64>| Layer {
        name: name.to_owned(),
        thickness_m: d,
        stiffness_n_per_m: k,
        friction_ns_per_m2: b,
        puncture_n: f,
    };
    let mut s = hidden::scenario();
    s.tissue = Tissue {
        surface_m: 0.0,
        layers: vec![
            layer("soft", 0.014, 150.0, 9000.0, Some(1.2)),
            layer("hard", 0.0152, 200.0, 12000.0, None),
        ],
    };
    s
}

/// Three layers, so that two faces are seen.
fn three() -> Scenario {
    let mut s = believed();
    let [first, second] = &s.tissue.layers[..] else { unreachable!("two layers") };
    let mut third = second.clone();
    let (mut first, mut second) = (first.clone(), second.clone());
    (first.thickness_m, second.thickness_m, third.thickness_m) = (0.0085, 0.0092, 0.0131);
    (first.puncture_n, second.puncture_n) = (Some(0.8), Some(1.1));
    third.stiffness_n_per_m = 170.0;
    s.tissue.layers = vec![first, second, third];
    s
}

/// Four layers, so that three faces are seen.
fn four() -> Scenario {
    let mut s = three();
    let third = s.tissue.layers[2].clone();
    s.tissue.layers.push(third);
    for (layer, (d, f)) in s.tissue.layers.iter_mut().zip([
        (0.006, Some(0.6)),
        (0.0065, Some(0.9)),
        (0.007, Some(0.8)),
        (0.0131, None),
    ]) {
        (layer.thickness_m, layer.puncture_n) = (d, f);
    }
    s
}

/// What is there: 8 to 12 % off what is believed.
fn truth() -> Tissue {
    let mut t = believed().tissue;
    for (layer, [k, b]) in t.layers.iter_mut().zip([[1.1, 0.9], [0.92, 1.12]]) {
        layer.stiffness_n_per_m *= k;
        layer.friction_ns_per_m2 *= b;
    }
    t.layers[0].puncture_n = Some(1.3);
    t
}

/// Position, velocity, acceleration: in with a ripple, a hold, further in, and back.
fn motion(k: usize, t: f64) -> [f64; 3] {
    let (speed, ripple, omega) =
        ([0.004, 0.005, 0.0034][k % 3], [0.0012, 0.002, 0.0016][k % 3], [4.1, 3.3, 5.2][k % 3]);
    let (first, hold, second, rest) = (3.1 + 0.2 * k as f64, 0.9, 2.6, 0.4);
    let way = |t: f64| {
        [
            speed * t + ripple / omega * (1.0 - (omega * t).cos()),
            speed + ripple * (omega * t).sin(),
            ripple * omega * (omega * t).cos(),
        ]
    };
    let start = -0.0025;
    match t {
        t if t < first => {
            let [z, v, a] = way(t);
            [start + z, v, a]
        }
        t if t < first + hold => [start + way(first)[0], 0.0, 0.0],
        t if t < first + hold + second => {
            let [z, v, a] = way(t - first - hold);
            [start + way(first)[0] + z, v, a]
        }
        t => {
            let deep = start + way(first)[0] + way(second)[0];
            let since = t - first - hold - second - rest;
            if since < 0.0 { [deep, 0.0, 0.0] } else { [deep - 0.006 * since, -0.006, 0.0] }
        }
    }
}

/// What is drawn.
struct Case {
    believed: Scenario,
    effects: Vec<AnyEffect>,
    truth: Tissue,
    /// Recordings.
    count: usize,
    noise_n: f64,
    /// A wander of the zero (N), of so many seconds.
    wander: (f64, f64),
    outside: Option<Outside>,
    /// How far the surface of each recording is moved (m).
    moved_m: f64,
    /// How much puncture forces scatter.
    scatter: f64,
    seed: u64,
}

impl Default for Case {
    fn default() -> Self {
        Self {
            believed: believed(),
            effects: Vec::new(),
            truth: truth(),
            count: 3,
            noise_n: NOISE_N,
            wander: (0.0, 1.0),
            outside: None,
            moved_m: 0.0,
            scatter: 0.0,
            seed: 11,
        }
    }
}

impl Case {
    fn with(effects: impl IntoIterator<Item = AnyEffect>) -> Self {
        Self { effects: effects.into_iter().collect(), ..Self::default() }
    }

    fn evidence(&self) -> Vec<NamedRecording> {
        const FINE: usize = 5;
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut out = Vec::new();
        for k in 0..self.count {
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let mut tissue = self.truth.clone();
            tissue.surface_m += self.moved_m * [1.0, -0.6, 0.3][k % 3];
            let factor = 1.0 + self.scatter * normal();
            tissue.layers[0].puncture_n = tissue.layers[0].puncture_n.map(|f| f * factor);
            let law = ForceLaw::new(&tissue, &self.effects).expect("a law");
            let chain = MeasurementChain::new(&self.effects);
            let (mut state, mut measuring) = (ForceLawState::default(), chain.start(HZ * FINE as f64));
            let mut outside = self.outside.clone();
            let (keep, mut slow) = (libm::exp(-1.0 / (HZ * self.wander.1)), normal());
            let spike_n = self.effects.iter().find_map(|e| match e {
                AnyEffect::ForceSpikes(s) => Some(s.size_n),
                _ => None,
            });
            let spike_n = spike_n.unwrap_or(0.0);
            let mut columns = [vec![], vec![], vec![]];
            for i in 0..(9.0 * HZ) as usize * FINE {
                let t = i as f64 / (HZ * FINE as f64);
                let [z, v, a] = motion(k, t);
                let mut tissue_n = law.step(&mut state, t, z, v, |_| {}).total_n;
                if let Some(o) = &mut outside {
                    tissue_n += o.force(t, z, v, a, z.clamp(0.0, tissue.end_m()));
                }
                let sampled = i % FINE == 0;
                let mut noise_n = 0.0;
                if sampled {
                    slow = keep * slow + (1.0 - keep * keep).sqrt() * normal();
                    noise_n = self.noise_n * normal() + self.wander.0 * slow;
                    // Now and then a spike, in and out of either sign.
                    let spike = if (i / FINE + 13 * k) % 97 == 40 {
                        1.0 - 2.0 * ((i / FINE) % 2) as f64
                    } else {
                        0.0
                    };
                    noise_n += spike * spike_n;
                }
                let reading =
                    SensorInput { time_s: t, velocity_mps: v, acceleration_mps2: a, tissue_n, noise_n };
                let f = chain.step(&mut measuring, &reading);
                if sampled {
                    columns.iter_mut().zip([t, chain.recorded_position(z), f]).for_each(|(c, x)| c.push(x));
                }
            }
            let [t, z, f] = columns;
            let recording = Recording::new(t, z, f).expect("clean columns");
            out.push(NamedRecording { name: format!("{k}.csv"), recording, notes: Vec::new() });
        }
        out
    }

    /// Diagnoses the case; all that comes out is compared with what is kept under this name.
    fn examined(&self, name: &str) -> DiagnosisResult {
        let found =
            diagnose(&self.believed, &self.evidence(), &Options::default(), |_| {}).expect("a diagnosis");
        let mut told = AnswerLines::default();
        tell(&mut told, &found);
        told.compare(FILE, name);
        found
    }
}

fn tell(told: &mut AnswerLines, found: &DiagnosisResult) {
    told.value("diagnosis", &serde_json::to_value(&found.diagnosis).expect("JSON"));
    told.value("tissue", &serde_json::to_value(&found.extended_scenario.tissue).expect("JSON"));
    for e in &found.extended_scenario.effects {
        told.numbers(&format!("extended.{}", e.id()), &e.parameters());
    }
    for (k, class) in found.competing_effects.iter().enumerate() {
        class.iter().for_each(|r| told.number(&format!("class.{k}.{}", r.name), r.nats_behind));
    }
    for (name, left) in [("before", &found.base_held_out), ("after", &found.extended_held_out)] {
        for (k, l) in left.iter().enumerate() {
            let Some(l) = l else { continue };
            told.column(&format!("{name}.{k}.e"), &l.residual_n);
            told.numbers(&format!("{name}.{k}.instants"), &l.rupture_times_s);
        }
    }
    for (k, c) in stylet_diagnose::report_curves::recording_curves(found).iter().enumerate() {
        for (name, x) in [
            ("time", &c.time_s),
            ("position", &c.position_m),
            ("velocity", &c.velocity_mps),
            ("force", &c.force_n),
            ("base", &c.base_residual_n),
            ("extended", &c.extended_residual_n),
            ("free", &c.free_run_residual_n),
            ("ruptures", &c.ruptures_s),
        ] {
            told.column(&format!("curve.{k}.{name}"), x);
        }
        let layers: Vec<f64> = c.layer.iter().map(|l| *l as f64).collect();
        told.column(&format!("curve.{k}.layer"), &layers);
    }
}

fn named(found: &DiagnosisResult) -> Vec<&str> {
    found.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect()
}

fn cause<'a>(found: &'a DiagnosisResult, effect: &str) -> &'a Cause {
    let all = named(found);
    let found = found.diagnosis.causes.iter().find(|c| c.effect == effect);
    assert!(found.is_some(), "no {effect}: {all:?}");
    found.expect("a cause")
}

/// Whether the interval of a cause's number holds the truth.
fn holds(found: &DiagnosisResult, effect: &str, path: &str, truth: f64) {
    let e = cause(found, effect).parameters[path];
    assert!(e.low <= truth && truth <= e.high, "{effect}.{path} is {truth}, said {e:?}");
}

#[test]
fn nothing_wrong() {
    let found = Case::default().examined("nothing wrong");
    assert_eq!(found.diagnosis.verdict, Verdict::None, "{:?}", named(&found));
    let t = truth();
    for (layer, name, x) in [
        (1, "stiffness_n_per_m", t.layers[0].stiffness_n_per_m),
        (1, "friction_ns_per_m2", t.layers[0].friction_ns_per_m2),
        (1, "puncture_n", 1.3),
        (2, "stiffness_n_per_m", t.layers[1].stiffness_n_per_m),
        (2, "friction_ns_per_m2", t.layers[1].friction_ns_per_m2),
    ] {
        let b = found.diagnosis.base_parameters.iter().find(|b| b.layer == layer && b.name == name);
        let b = b.expect("a base parameter");
        assert!(b.low <= x && x <= b.high, "{layer} {name} is {x}: {b:?}");
    }
}

#[test]
fn one_strong_cause() {
    let found = Case::with([CoulombFriction { c_n_per_m: 12.0 }.into()]).examined("one strong cause");
    assert_eq!(found.diagnosis.verdict, Verdict::Named, "{:?}", named(&found));
    assert_eq!(named(&found), ["coulomb_friction"]);
    holds(&found, "coulomb_friction", "c_n_per_m", 12.0);
}

#[test]
fn two_causes() {
    let terms = vec![PronyTerm { fraction: 0.35, time_constant_s: 0.8 }];
    let found = Case::with([
        StressRelaxation { terms }.into(),
        PeriodicInterference { amplitude_n: 0.04, frequency_hz: 6.3, phase_rad: 0.7 }.into(),
    ])
    .examined("two causes");
    let mut all = named(&found);
    all.sort_unstable();
    assert_eq!(all, ["periodic_interference", "stress_relaxation"]);
    holds(&found, "periodic_interference", "amplitude_n", 0.04);
    holds(&found, "stress_relaxation", "terms.0.fraction", 0.35);
}

#[test]
fn a_range_of_the_sensor() {
    let found = Case::with([Saturation { limit_n: 2.4 }.into()]).examined("saturated");
    assert_eq!(named(&found), ["saturation"]);
    holds(&found, "saturation", "limit_n", 2.4);
}

#[test]
fn a_late_force() {
    let found = Case::with([TimeDelay { delay_s: 0.043 }.into()]).examined("late");
    assert_eq!(named(&found), ["time_delay"]);
    holds(&found, "time_delay", "delay_s", 0.043);
}

#[test]
fn a_face_elsewhere() {
    let case = Case { believed: three(), truth: three().tissue, ..Case::default() };
    let found = Case { effects: vec![BoundaryShift { layer: 1, shift_m: 0.0013 }.into()], ..case }
        .examined("a wrong thickness");
    assert_eq!(named(&found), ["boundary_shift"]);
    holds(&found, "boundary_shift", "shift_m", 0.0013);
}

#[test]
fn a_wandering_zero() {
    let found = Case { wander: (0.008, 1.5), ..Case::default() }.examined("a wandering zero");
    assert_eq!(found.diagnosis.verdict, Verdict::None, "{:?}", named(&found));
}

#[test]
fn coarse_steps() {
    let found = Case::with([Quantisation { step_n: 0.05 }.into()]).examined("coarse steps");
    assert_eq!(named(&found), ["quantisation"]);
    holds(&found, "quantisation", "step_n", 0.05);
}

#[test]
fn outside_the_library() {
    let outside = Some(Outside::new(0, [0.1, 0.3, 0.5, 0.7], 0.15));
    let found = Case { outside, ..Case::default() }.examined("outside the library");
    assert_eq!(found.diagnosis.verdict, Verdict::Unknown, "{:?}", named(&found));
}

/// A strong cause stands beside what nobody knows; where one recording is alone, what is unknown has to be far larger.
#[test]
fn outside_the_library_beside_a_cause_and_alone() {
    let outside = |kind, size_n| Some(Outside::new(kind, [0.1, 0.3, 0.5, 0.7], size_n));
    let friction: AnyEffect = CoulombFriction { c_n_per_m: 90.0 }.into();
    let beside =
        Case { outside: outside(0, 0.12), ..Case::with([friction]) }.examined("unknown beside a cause");
    assert_eq!((beside.diagnosis.verdict, named(&beside)), (Verdict::Unknown, vec!["coulomb_friction"]));
    let alone = Case { outside: outside(0, 0.3), count: 1, ..Case::default() }.examined("unknown, alone");
    assert_eq!(alone.diagnosis.verdict, Verdict::Unknown, "{:?}", named(&alone));
    let chirp = Case { outside: outside(3, 0.1), ..Case::default() }.examined("unknown: a chirp");
    assert_eq!(chirp.diagnosis.verdict, Verdict::Unknown, "{:?}", named(&chirp));
}

#[test]
fn a_membrane() {
    let effect = HiddenMembrane { depth_m: 0.018, stiffness_n_per_m: 300.0, puncture_n: 0.9 };
    let found = Case::with([effect.into()]).examined("a membrane");
    assert!(named(&found).contains(&"hidden_membrane"), "{:?}", named(&found));
}

#[test]
fn a_breath() {
    let effect = Respiration { amplitude_m: 0.001, frequency_hz: 0.33, phase_rad: 1.1 };
    let found = Case::with([effect.into()]).examined("a breath");
    assert!(named(&found).contains(&"respiration"), "{:?}", named(&found));
}

#[test]
fn a_wrong_scale() {
    let case = Case { believed: four(), truth: four().tissue, ..Case::default() };
    let found = Case { effects: vec![PositionScale { eps: 0.07 }.into()], ..case }.examined("a wrong scale");
    assert_eq!(named(&found), ["position_scale"]);
    holds(&found, "position_scale", "eps", 0.07);
}

/// Two thicknesses that are off in proportion may be so by chance.
#[test]
fn a_wrong_scale_of_two_thicknesses() {
    let case = Case { believed: three(), truth: three().tissue, ..Case::default() };
    let effects = vec![PositionScale { eps: 0.07 }.into()];
    let found = Case { effects, ..case }.examined("a wrong scale of two thicknesses");
    assert!(named(&found).is_empty(), "{:?}", named(&found));
    assert_eq!(found.diagnosis.verdict, Verdict::None);
}

#[test]
fn surfaces_of_their_own() {
    let found = Case { moved_m: 5e-4, ..Case::default() }.examined("surfaces of their own");
    assert_eq!(found.diagnosis.verdict, Verdict::None, "{:?}", named(&found));
    let told = found.diagnosis.random_effect_sd.surface_m;
    assert!((2e-4..7e-4).contains(&told), "{told}");
}

#[test]
fn a_puncture_that_depends_on_speed() {
    let case = Case { scatter: 0.02, ..Case::with([RateDependentPuncture { alpha: 0.2 }.into()]) };
    let found = case.examined("a puncture that depends on speed");
    assert_eq!(named(&found), ["rate_dependent_puncture"]);
    holds(&found, "rate_dependent_puncture", "alpha", 0.2);
}

#[test]
fn one_recording_alone() {
    let effect = StribeckFriction { c_n_per_m: 8.0, c_static_n_per_m: 22.0, v_stribeck_mps: 0.002 };
    let case = Case { count: 1, ..Case::with([effect.into()]) };
    let found = case.examined("one recording alone");
    assert_eq!(named(&found), ["stribeck_friction"]);
    holds(&found, "stribeck_friction", "c_n_per_m", 8.0);
}

/// Causes of every other kind, one by one and in pairs, some of them too small to matter: what is said, not what is drawn of it.
fn others(which: &[(&str, Vec<AnyEffect>, f64, f64)]) {
    for (name, effects, noise_n, scatter) in which {
        let case = Case { noise_n: *noise_n, scatter: *scatter, ..Case::with(effects.iter().cloned()) };
        let found =
            diagnose(&case.believed, &case.evidence(), &Options::default(), |_| {}).expect("a diagnosis");
        // What is hidden is named, but for traces.
        let mut all = named(&found);
        all.extend(found.diagnosis.negligible.iter().map(|t| t.effect.as_str()));
        let mut hidden: Vec<&str> = effects.iter().map(Effect::id).collect();
        all.sort_unstable();
        hidden.sort_unstable();
        assert_eq!(all, hidden, "{name}");
        let mut told = AnswerLines::default();
        told.value("diagnosis", &serde_json::to_value(&found.diagnosis).expect("JSON"));
        for (k, class) in found.competing_effects.iter().enumerate() {
            class.iter().for_each(|r| told.number(&format!("class.{k}.{}", r.name), r.nats_behind));
        }
        told.compare(FILE, &format!("other: {name}"));
    }
}

#[test]
fn causes_of_other_kinds() {
    let two =
        [(0.2, 0.3), (0.25, 2.4)].map(|(fraction, time_constant_s)| PronyTerm { fraction, time_constant_s });
    others(&[
        ("compliance", vec![NeedleCompliance { stiffness_n_per_m: 700.0 }.into()], NOISE_N, 0.0),
        ("cutting", vec![CuttingForce { force_n: 0.3 }.into()], NOISE_N, 0.0),
        ("soft faces", vec![SoftBoundary { width_m: 0.003 }.into()], NOISE_N, 0.0),
        ("two terms", vec![StressRelaxation { terms: two.to_vec() }.into()], NOISE_N, 0.0),
        ("lag", vec![LowPassLag { time_constant_s: 0.05 }.into()], NOISE_N, 0.0),
    ]);
}

#[test]
fn causes_of_still_other_kinds() {
    others(&[
        (
            "spikes",
            vec![ForceSpikes { rate_hz: 1.0, size_n: 0.8 }.into(), ForceDrift { rate_n_per_s: 0.03 }.into()],
            NOISE_N,
            0.0,
        ),
        ("release", vec![IncompleteRelease { fraction: 0.4 }.into()], NOISE_N, 0.0),
        ("exponent", vec![PowerLawFriction { exponent: 0.6 }.into()], NOISE_N, 0.06),
        (
            "asymmetric",
            vec![AsymmetricFriction { eps: 0.3 }.into(), ForceBias { force_n: 0.15 }.into()],
            NOISE_N,
            0.0,
        ),
        ("inertia", vec![ToolInertia { mass_kg: 1.5 }.into()], NOISE_N, 0.0),
    ]);
}

#[test]
fn causes_too_small_to_matter() {
    others(&[
        ("a delay of a part of a sample", vec![TimeDelay { delay_s: 4e-4 }.into()], 5e-4, 0.0),
        (
            "a little bias",
            vec![ForceBias { force_n: 8e-4 }.into(), CoulombFriction { c_n_per_m: 30.0 }.into()],
            5e-3,
            0.0,
        ),
        ("a little drift", vec![ForceDrift { rate_n_per_s: 4e-4 }.into()], NOISE_N, 0.0),
        (
            "a breath of micrometres",
            vec![Respiration { amplitude_m: 3e-5, frequency_hz: 0.4, phase_rad: 0.3 }.into()],
            1e-3,
            0.0,
        ),
    ]);
}

#[test]
fn causes_that_go_together() {
    others(&[
        (
            "late and slow",
            vec![TimeDelay { delay_s: 0.03 }.into(), LowPassLag { time_constant_s: 0.04 }.into()],
            NOISE_N,
            0.0,
        ),
        (
            "three",
            vec![
                CoulombFriction { c_n_per_m: 10.0 }.into(),
                ForceDrift { rate_n_per_s: 0.02 }.into(),
                HiddenMembrane { depth_m: 0.017, stiffness_n_per_m: 250.0, puncture_n: 0.7 }.into(),
            ],
            NOISE_N,
            0.0,
        ),
        (
            "friction of two kinds",
            vec![PowerLawFriction { exponent: 0.7 }.into(), AsymmetricFriction { eps: -0.2 }.into()],
            NOISE_N,
            0.04,
        ),
    ]);
}

/// Two days later, the surface moved and the needle more slippery: by the diagnosis, and by the numbers that the others lend.
#[test]
fn predictions() {
    let effect: AnyEffect = CoulombFriction { c_n_per_m: 12.0 }.into();
    let found =
        diagnose(&believed(), &Case::with([effect.clone()]).evidence(), &Options { brief: true }, |_| {})
            .expect("a diagnosis");
    let mut case = Case { scatter: 0.05, seed: 23, ..Case::with([effect.clone()]) };
    case.truth.surface_m = 6e-4;
    case.truth.layers.iter_mut().for_each(|l| l.friction_ns_per_m2 *= 0.85);
    let evidence = case.evidence();
    let mut told = AnswerLines::default();
    let (model, d) = (&found.extended_scenario, &found.diagnosis);
    let base = believed();
    for (name, d, was, refit) in [
        ("as it is", None, None, &[][..]),
        ("by the diagnosis", Some(d), Some(&base), &[][..]),
        ("by the others", Some(d), None, &[Refit::Surface, Refit::Friction][..]),
    ] {
        let p = predict(model, d, was, refit, &evidence).expect("a prediction");
        told.value(name, &serde_json::to_value(&p.prediction).expect("JSON"));
        for (k, s) in p.curves.iter().enumerate() {
            let mut column = |what: &str, x: &[f64]| told.column(&format!("{name}.{k}.{what}"), x);
            column("time", &s.time_s);
            column("position", &s.position_m);
            column("measured", &s.measured_n);
            column("predicted", &s.predicted_n);
            column("believed", s.assumed_n.as_deref().unwrap_or(&[]));
            column("low", &s.low_n);
            column("high", &s.high_n);
            column("ruptures", &s.ruptures_s);
        }
        assert!(refit.is_empty() || p.prediction.rmse_n < 0.2, "{:?}", p.prediction);
    }
    let alone = predict(model, Some(d), None, &[Refit::Friction], &evidence[..1]).expect("a prediction");
    assert!(!alone.prediction.held_out);
    told.value("alone", &serde_json::to_value(&alone.prediction).expect("JSON"));
    told.compare(FILE, "predictions");
}

/// What is drawn for a seed and an index stays the same: older tables were made of it.
#[test]
fn sketches_of_the_former_benchmark() {
    let mut told = AnswerLines::default();
    for index in 0..70 {
        let s = hidden::sketch(5, index);
        let what = s
            .drawn
            .outside
            .as_ref()
            .map_or(String::new(), |o| format!("{} {:?} {:.7e}", o.kind, o.u, o.size_n));
        told.words(&format!("{index}"), &format!("{:?} {} {what}", s.kind, s.drawn.seed));
        told.numbers(
            &format!("{index}.target"),
            &[s.target, s.drawn.ar[0], s.drawn.ar[1], s.drawn.noise_n, s.drawn.off],
        );
        for e in &s.drawn.effects {
            told.numbers(&format!("{index}.{}", e.id()), &e.parameters());
            for factor in [0.37, 1.9, 55.0] {
                let more = hidden::scaled(e, factor, 3.7).expect("an effect");
                told.numbers(&format!("{index}.{} times {factor}", e.id()), &more.parameters());
            }
        }
    }
    for turn in 0..60 {
        let s = hidden::sketch_of(9, 3 * turn, Kind::Single, turn);
        for e in &s.drawn.effects {
            told.numbers(&format!("single {turn}.{}", e.id()), &e.parameters());
            for factor in [0.05, 0.6, 2.7, 19.0] {
                let more = hidden::scaled(e, factor, 3.3).expect("an effect");
                told.numbers(&format!("single {turn} times {factor}"), &more.parameters());
            }
        }
        told.number(&format!("single {turn}.target"), s.target);
        let s = hidden::sketch_of(9, turn, Kind::Two, turn);
        let all: Vec<f64> = s.drawn.effects.iter().flat_map(AnyEffect::parameters).collect();
        let names: Vec<&str> = s.drawn.effects.iter().map(Effect::id).collect();
        told.words(&format!("two {turn}"), &names.join(" "));
        told.numbers(&format!("two {turn}.numbers"), &all);
    }
    for harder in [Harder::Ar2, Harder::Scatter, Harder::Velocity, Harder::AndOutside, Harder::One] {
        let d = harder.make(hidden::sketch(5, 11)).drawn;
        told.words(&format!("{harder:?}"), &format!("{:?} {:?}", d.motions, d.outside));
        told.numbers(&format!("{harder:?}"), &[d.ar[0], d.ar[1], d.scatter, d.velocity_noise_mps]);
    }
    told.compare(FILE, "drawn sketches");
}

/// The same for recordings: each motion, noise of a colour, spikes, a scatter, what the library lacks.
#[test]
fn recordings_of_the_former_benchmark() {
    let mut told = AnswerLines::default();
    let plain = |seed, motions| Drawn {
        seed,
        effects: Vec::new(),
        outside: None,
        noise_n: 0.02,
        ar: [0.0; 2],
        off: 0.15,
        motions,
        scatter: 0.0,
        velocity_noise_mps: 0.0,
    };
    let drive = NeedleCompliance { stiffness_n_per_m: 500.0 };
    let all = [
        ("rich", plain(3, Motions::Rich)),
        ("rich again", Drawn { ar: [1.3, -0.6], scatter: 0.03, ..plain(4, Motions::Rich) }),
        ("constant", Drawn { ar: [0.7, 0.0], velocity_noise_mps: 1e-4, ..plain(5, Motions::Constant) }),
        (
            "one",
            Drawn {
                effects: vec![ForceSpikes { rate_hz: 0.7, size_n: 1.0 }.into()],
                ..plain(6, Motions::One)
            },
        ),
        (
            "late",
            Drawn {
                effects: vec![drive.into(), LowPassLag { time_constant_s: 0.04 }.into()],
                ..plain(7, Motions::One)
            },
        ),
        (
            "scaled",
            Drawn {
                effects: vec![PositionScale { eps: 0.03 }.into(), TimeDelay { delay_s: 0.06 }.into()],
                ..plain(8, Motions::One)
            },
        ),
        (
            "silent",
            Drawn {
                noise_n: 0.0,
                outside: Some(Outside::new(4, [0.2, 0.4, 0.6, 0.9], 0.1)),
                ..plain(9, Motions::One)
            },
        ),
    ];
    for (name, drawn) in &all {
        let case = hidden::case(drawn);
        told.value(&format!("{name}.truth"), &serde_json::to_value(&case.truth).expect("JSON"));
        for (k, (r, ruptures)) in case.recordings.iter().zip(&case.ruptures).enumerate() {
            told.column(&format!("{name}.{k}.time"), &r.time_s);
            told.column(&format!("{name}.{k}.position"), &r.position_m);
            told.column(&format!("{name}.{k}.velocity"), &r.velocity_mps);
            told.column(&format!("{name}.{k}.force"), &r.force_n);
            told.numbers(&format!("{name}.{k}.ruptures"), ruptures);
        }
    }
    for drawn in [&all[3].1, &all[6].1] {
        for (k, f) in hidden::clean_force(drawn).iter().enumerate() {
            told.column(&format!("clean.{}.{k}", drawn.seed), f);
        }
        told.number(&format!("largest.{}", drawn.seed), hidden::largest_force(drawn));
    }
    told.compare(FILE, "drawn recordings");
}
