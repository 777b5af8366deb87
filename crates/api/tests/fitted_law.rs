//! With a model fitted to other insertions the enhanced force is closer to the tip force in holds and during retraction than without, and
//! about as close during insertion; causally, and with punctures at the detected ruptures instead of the model's own.

use stylet_api::{Error, IdentifiedModel, enhance, enhance_with_model};
use stylet_core::config::{Algorithm, EnhanceConfig};
use stylet_record::Recording;
use stylet_scenario::{EnhancerConfigFile, Scenario};
use stylet_stats::rms;
use stylet_testbed::{Simulation, simulate};
use stylet_tissue::{AnyEffect, ForceLaw, ForceLawState, PreslidingFriction};

/// Two layers whose friction is dry and builds up over millimetres; in by 48 mm, a rest of 2 s, and back.
fn insertion(forces_n: [f64; 2], dry_n_per_m: f64, effects: &str) -> Scenario {
    let text = format!(
        r#"Scenario(
            name: "dry gel",
            tissue: (surface_m: 0.005, layers: [
                (thickness_m: 0.024, stiffness_n_per_m: 60.0, friction_ns_per_m2: 800.0, puncture_n: {:?}),
                (thickness_m: 0.03, stiffness_n_per_m: 110.0, friction_ns_per_m2: 1200.0, puncture_n: {:?}),
            ]),
            effects: [PreslidingFriction(c_n_per_m: {dry_n_per_m:?}, delta_m: 0.002){effects}],
            motion: Program(start_m: 0.0, segments: [
                Move(velocity_mps: 0.004, duration_s: 12.0), Hold(duration_s: 2.0), Move(velocity_mps: -0.004, duration_s: 10.0),
            ]),
            robot: Replay,
            sensor: ForceTorque(noise_n: 0.02),
        )"#,
        forces_n[0], forces_n[1]
    );
    Scenario::parse("dry.ron", &text).expect("a scenario")
}

fn simulated(seed: u64) -> Simulation {
    // What differs between insertions: layers that are a little tougher, friction that holds a little more.
    let of = |k: u64, size: f64| 1.0 + size * ((seed * k) % 7) as f64 / 6.0 - 0.5 * size;
    let scenario = insertion([1.2 * of(3, 0.2), 1.5 * of(5, 0.2)], 30.0 * of(2, 0.2), "");
    simulate(&scenario, seed).expect("a simulation")
}

/// What is fitted to the mean of them.
fn fitted() -> Scenario {
    insertion([1.2, 1.5], 30.0, "")
}

fn off_n(simulation: &Simulation, enhanced_n: &[f64], from_s: f64, to_s: f64) -> f64 {
    let r = &simulation.recording;
    let within = (0..r.len()).filter(|i| (from_s..to_s).contains(&r.time_s[*i]) && r.position_m[*i] > 0.006);
    rms(&within.map(|i| enhanced_n[i] - simulation.truth.tip_force_n[i]).collect::<Vec<_>>())
}

/// The model replayed with its own ruptures.
fn replayed_alone(law: &Scenario, r: &Recording) -> Vec<f64> {
    let law = ForceLaw::new(&law.tissue, &law.effects).expect("a law");
    let mut state = ForceLawState::default();
    let tip = |(i, s): (usize, stylet_record::Sample)| {
        let force = law.step(&mut state, s.time_s, s.position_m, s.velocity_mps, |_| {});
        let friction_n = if s.velocity_mps < 0.0 { force.friction_n } else { force.total_n - force.tip_n };
        r.force_n[i] - friction_n
    };
    r.samples().enumerate().map(tip).collect()
}

#[test]
fn with_a_law_fitted_elsewhere_the_enhanced_force_is_nearer_to_the_tips() -> Result<(), Error> {
    let law = IdentifiedModel::new("extended.ron", &fitted())?;
    let config = EnhancerConfigFile::default();
    let (mut without, mut with, mut own) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    for seed in 1..=12 {
        let simulated = simulated(seed);
        let r = &simulated.recording;
        let alone = enhance(r, &config).trace;
        let with_model = enhance_with_model(r, &config, &law)?.trace;
        assert_eq!(with_model.detections, alone.detections, "a model does not change the detections");
        assert_eq!(with_model.detections.len(), 2, "seed {seed}: both ruptures, {:?}", with_model.detections);
        let replayed = replayed_alone(&fitted(), r);
        for (part, (from_s, to_s)) in [(0.0, 12.0), (12.0, 14.0), (14.0, 24.0)].into_iter().enumerate() {
            for (sum, trace) in [
                (&mut without, &alone.enhanced_n),
                (&mut with, &with_model.enhanced_n),
                (&mut own, &replayed),
            ] {
                sum[part] += off_n(&simulated, trace, from_s, to_s) / 12.0;
            }
        }
    }
    println!(
        "N rms in insertion, hold, retraction: alone {without:.3?}, with the model {with:.3?}, replayed with its own ruptures {own:.3?}"
    );
    // During insertion at constant speed the algorithm estimates the friction from this insertion itself; the model differs by the variation
    // between insertions.
    assert!(with[0] < 0.05, "{with:?}");
    for part in [1, 2] {
        assert!(
            with[part] < 0.5 * without[part],
            "part {part}: {with:?} N rms with the model, {without:?} without"
        );
    }
    assert!(with[0] < 0.7 * own[0], "{with:?} with the detected ruptures, {own:?} with those of the model");
    Ok(())
}

#[test]
fn the_output_of_a_sample_does_not_depend_on_later_ones() -> Result<(), Error> {
    let law = IdentifiedModel::new("extended.ron", &fitted())?;
    let whole = simulated(1).recording;
    let with_model = enhance_with_model(&whole, &EnhancerConfigFile::default(), &law)?.trace;
    for samples in [1500, 2500, 3300] {
        let mut begin = whole.clone();
        begin.time_s.truncate(samples);
        begin.position_m.truncate(samples);
        begin.velocity_mps.truncate(samples);
        begin.force_n.truncate(samples);
        let first = enhance_with_model(&begin, &EnhancerConfigFile::default(), &law)?.trace;
        assert_eq!(first.enhanced_n, with_model.enhanced_n[..samples]);
        assert_eq!(first.low_n, with_model.low_n[..samples]);
    }
    Ok(())
}

/// A force gauge that reads too much, and late, shows so of friction, too; bias and drift are no friction.
#[test]
fn friction_is_given_as_the_sensor_shows_it() -> Result<(), Error> {
    let through = ", ForceGain(eps: 0.5), TimeDelay(delay_s: 0.1), ForceBias(force_n: 7.0)";
    let plain = IdentifiedModel::new("plain.ron", &fitted())?;
    let seen = IdentifiedModel::new("seen.ron", &insertion([1.2, 1.5], 30.0, through))?;
    let r = simulated(1).recording;
    let (mut plain, mut seen) = (plain.shaft_friction(r.sample_hz()), seen.shaft_friction(r.sample_hz()));
    let mut both = Vec::new();
    for s in r.samples() {
        let ruptured = usize::from(s.time_s > 5.0) + usize::from(s.time_s > 9.0);
        let at = |shaft: &mut stylet_tissue::ShaftFriction| {
            shaft.step(s.time_s, s.position_m, s.velocity_mps, ruptured)
        };
        both.push([at(&mut plain), at(&mut seen)]);
    }
    assert!(both.iter().any(|b| b[0] > 0.5) && both.iter().any(|b| b[0] < -0.5), "friction both ways");
    for i in 20..both.len() {
        assert!((both[i][1] - 1.5 * both[i - 20][0]).abs() < 1e-9, "{i}: {:?}", both[i]);
    }
    Ok(())
}

#[test]
fn a_model_is_refused_by_algorithms_without_models_and_warned_about_where_it_does_not_match()
-> Result<(), Error> {
    let r = simulated(1).recording;
    let law = IdentifiedModel::new("extended.ron", &fitted())?;
    let paper = EnhanceConfig { algorithm: Algorithm::Paper, ..EnhanceConfig::paper() };
    let config = EnhancerConfigFile { enhance: paper, ..EnhancerConfigFile::default() };
    let why = enhance_with_model(&r, &config, &law).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(
        why.contains("extended.ron") && why.contains("Paper") && why.contains("algorithm: Stylet"),
        "{why}"
    );
    let trace = enhance_with_model(&r, &EnhancerConfigFile::default(), &law)?.trace;
    assert!(law.warnings(&trace).is_empty(), "{:?}", law.warnings(&trace));
    let mut elsewhere = fitted();
    elsewhere.tissue.surface_m = 0.03;
    elsewhere.tissue.layers.truncate(1);
    let doubts = IdentifiedModel::new("other.ron", &elsewhere)?.warnings(&trace).join("; ");
    assert!(doubts.contains("surface at 30.0 mm") && doubts.contains("has 1 layer"), "{doubts}");
    // More effects than the force law supports.
    let mut many = fitted();
    many.effects =
        vec![AnyEffect::PreslidingFriction(PreslidingFriction { c_n_per_m: 1.0, delta_m: 0.002 }); 17];
    let why = IdentifiedModel::new("many.ron", &many).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(why.contains("many.ron") && why.contains("17"), "{why}");
    Ok(())
}
