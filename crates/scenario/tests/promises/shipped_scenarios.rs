//! The shipped scenarios load, reach the tissue, and have the ruptures and forces stated in their comments and in `scenarios/README.md`.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::{Path, PathBuf};
use stylet_scenario::{Motion, Scenario, load_effects};
use stylet_tissue::{ForceLaw, ForceLawState, Rupture};

/// File; time (s) and released elastic force (N) of each true rupture; largest force (N).
type Expected = (&'static str, &'static [(f64, f64)], f64);

const SHIPPED: [Expected; 10] = [
    ("abdomen_sinusoidal", &[(7.10, 1.36), (14.11, 1.55)], 3.41),
    ("bovine_liver_constant", &[(9.42, 2.30), (21.57, 1.22)], 2.48),
    ("isinglass_25_constant", &[(14.67, 0.043)], 0.44),
    ("isinglass_25_sinusoidal", &[(7.33, 0.043)], 1.88),
    ("isinglass_50_constant", &[(19.17, 0.117)], 1.20),
    ("isinglass_50_sinusoidal", &[(8.44, 0.117)], 5.12),
    ("isinglass_70_constant", &[(10.48, 0.076)], 0.78),
    ("isinglass_70_sinusoidal", &[(6.15, 0.076)], 3.34),
    ("three_layer_latex_constant", &[(14.43, 1.13), (30.38, 2.20), (44.83, 2.58)], 5.39),
    ("three_layer_latex_sinusoidal", &[(7.26, 1.13), (10.86, 2.20), (13.62, 2.58)], 17.8),
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios")
}

fn load(name: &str) -> Scenario {
    Scenario::load(&folder().join(format!("{name}.ron"))).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn the_example_effects_load() {
    assert_eq!(load_effects(&folder().join("effects/examples.ron")).unwrap().len(), 4);
}

#[derive(Default)]
struct Insertion {
    ruptures: Vec<Rupture>,
    /// Largest force in N.
    peak_n: f64,
    /// Tip at the end in m.
    last_m: f64,
    /// Active layer at the end.
    last_layer: usize,
    /// Share of friction in the force just before the first rupture.
    friction_share: f64,
}

/// The insertion without robot and noise: the law along the motion.
fn insert(s: &Scenario) -> Insertion {
    let law = ForceLaw::new(&s.tissue, &s.effects).unwrap();
    let plan = s.motion.plan().unwrap();
    let mut state = ForceLawState::default();
    let mut result = Insertion::default();
    for k in 0..=(plan.duration_s() * s.sample_hz).round() as usize {
        let t = k as f64 / s.sample_hz;
        let at = plan.at(t);
        let f = law.step(&mut state, t, at.position_m, at.velocity_mps, |r| result.ruptures.push(r));
        result.peak_n = result.peak_n.max(f.total_n);
        (result.last_m, result.last_layer) = (at.position_m, f.active_layer);
        if result.ruptures.is_empty() && f.total_n > 0.0 {
            result.friction_share = f.friction_n / f.total_n;
        }
    }
    result
}

fn near(value: f64, stated: f64) -> bool {
    (value - stated).abs() <= 0.006 * stated.abs() + 0.0005
}

/// Every scenario file of the folder, also those that are not in the table above.
fn all_names() -> Vec<String> {
    let mut found: Vec<String> = std::fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|x| x == "ron"))
        .filter(|path| std::fs::read_to_string(path).unwrap().contains("\nScenario("))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    found.sort();
    found
}

#[test]
fn the_scenarios_of_the_paper_are_all_there() {
    let found = all_names();
    for (name, ..) in SHIPPED {
        assert!(found.iter().any(|f| f == name), "{name}.ron is missing from {}", folder().display());
    }
}

#[test]
fn every_scenario_states_title_source_and_what_it_shows() {
    let readme = std::fs::read_to_string(folder().join("README.md")).unwrap();
    for (name, ..) in SHIPPED {
        let scenario = load(name);
        assert!(!scenario.name.is_empty() && !scenario.source.is_empty(), "{name}");
        assert!(readme.contains(&format!("`{name}`")), "{name} is not in the README");
        let text = std::fs::read_to_string(folder().join(format!("{name}.ron"))).unwrap();
        assert!(text.starts_with("// Shows: "), "{name} does not begin with what it shows");
        assert!(text.lines().nth(1).is_some_and(|l| l.starts_with("// ")), "{name}");
    }
}

#[test]
fn every_scenario_begins_in_air_and_reaches_the_tissue() {
    for (name, ..) in SHIPPED {
        let scenario = load(name);
        let plan = scenario.motion.plan().unwrap();
        assert!(plan.at(0.0).position_m < scenario.tissue.surface_m, "{name} begins inside the tissue");
        assert!(plan.deepest_m() > scenario.tissue.surface_m, "{name}");
    }
}

#[test]
fn every_scenario_has_its_stated_ruptures_and_peak_force() {
    for (name, stated, peak_n) in SHIPPED {
        let got = insert(&load(name));
        let ruptures: Vec<_> = got.ruptures.iter().map(|r| (r.time_s, r.released_n)).collect();
        assert_eq!(ruptures.len(), stated.len(), "{name}: {ruptures:?}");
        for ((time_s, released_n), (stated_s, stated_n)) in ruptures.iter().zip(stated) {
            assert!(near(*time_s, *stated_s) && near(*released_n, *stated_n), "{name}: {ruptures:?}");
        }
        assert!(near(got.peak_n, peak_n), "{name}: {} N", got.peak_n);
    }
}

#[test]
fn every_resolved_scenario_parses_back_to_an_equal_value() {
    for name in all_names() {
        let scenario = load(&name);
        let resolved = scenario.to_ron().unwrap();
        let again = Scenario::parse("resolved.ron", &resolved).unwrap_or_else(|e| panic!("{e}\n{resolved}"));
        assert_eq!(again, scenario, "{name}");
        assert!(
            resolved.contains("seed: ") && resolved.contains("contact_search"),
            "defaults are written out"
        );
    }
}

#[test]
fn all_scenarios_share_the_noise() {
    for (name, ..) in SHIPPED {
        let stylet_scenario::Sensor::ForceTorque(sensor) = load(name).sensor else { panic!("{name}") };
        assert_eq!((sensor.noise_n, sensor.ar1), (0.02, 0.0), "{name}");
    }
}

#[test]
fn the_isinglass_gels_are_nine_tenths_friction_and_grow_with_concentration() {
    let mut before = 0.0;
    for (concentration, exit_s) in [(25, Some(12.5)), (50, Some(17.0)), (70, None)] {
        let scenario = load(&format!("isinglass_{concentration}_constant"));
        let got = insert(&scenario);
        assert!((got.friction_share - 0.9).abs() < 0.005, "{concentration} %: {}", got.friction_share);
        let friction = scenario.tissue.layers[0].friction_ns_per_m2;
        assert!(friction > before, "{concentration} %");
        before = friction;
        // From contact to exit, as in the supplement.
        if let Some(exit_s) = exit_s {
            let contact_s = 0.005 / 0.0023;
            assert!((got.ruptures[0].time_s - contact_s - exit_s).abs() < 1e-6, "{concentration} %");
        }
        // The sinusoidal file has the same gel.
        assert_eq!(load(&format!("isinglass_{concentration}_sinusoidal")).tissue, scenario.tissue);
    }
    assert!(insert(&load("isinglass_25_constant")).peak_n < 0.5 - 3.0 * 0.02 + 0.001);
}

#[test]
fn both_stacks_have_the_same_layers_and_the_latex_ruptures_by_force() {
    let constant = load("three_layer_latex_constant");
    assert_eq!(constant.tissue, load("three_layer_latex_sinusoidal").tissue);
    let by_force: Vec<bool> = insert(&constant).ruptures.iter().map(|r| r.by_force).collect();
    assert_eq!(by_force, [false, true, false]);
}

#[test]
fn fields_left_out_have_the_defaults_written_in_the_file() {
    let text = std::fs::read_to_string(folder().join("three_layer_latex_constant.ron")).unwrap();
    let without_defaults = r#"Scenario(
        name: "three gel layers, latex around the second, constant velocity",
        source: "main paper Fig. 12; supplement Fig. 7 with sinusoidal velocity",
        tissue: (layers: [
            (name: "isinglass 25 %", thickness_m: 0.0282, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0),
            (name: "isinglass 50 % in latex", thickness_m: 0.0377, stiffness_n_per_m: 60.0, friction_ns_per_m2: 12000.0, puncture_n: 2.2),
            (name: "isinglass 70 %", thickness_m: 0.0322, stiffness_n_per_m: 80.0, friction_ns_per_m2: 16000.0),
        ]),
        motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 50.0),
        enhance: (algorithm: Paper),
    )"#;
    assert_eq!(
        Scenario::parse("full.ron", &text).unwrap(),
        Scenario::parse("short.ron", without_defaults).unwrap()
    );
}

#[test]
fn the_sinusoids_are_the_published_one_from_rest() {
    for (name, ..) in SHIPPED.iter().filter(|(name, ..)| name.ends_with("sinusoidal")) {
        let Motion::Sinusoidal { amplitude_m, frequency_hz, phase_rad, .. } = load(name).motion else {
            panic!("{name}")
        };
        assert_eq!((amplitude_m, frequency_hz), (0.12, 0.0167), "{name}");
        assert_eq!(phase_rad, stylet_scenario::PHASE_FROM_REST_RAD, "{name}");
    }
}

#[test]
fn the_capsules_of_the_liver_rupture_by_force_and_the_needle_ends_behind_them() {
    let scenario = load("bovine_liver_constant");
    let got = insert(&scenario);
    assert!(got.ruptures.iter().all(|r| r.by_force));
    // Okamura 2004: 2.304 N at 16.65 mm.
    assert!((got.ruptures[0].position_m - 0.01665).abs() < 5e-5 && near(got.ruptures[0].released_n, 2.304));
    assert!(got.last_m > scenario.tissue.end_m());
}

#[test]
fn the_motion_through_the_abdomen_ends_inside_the_kidney() {
    let scenario = load("abdomen_sinusoidal");
    let got = insert(&scenario);
    assert_eq!(got.last_layer, 3);
    let kidney = scenario.tissue.front_m(2)..scenario.tissue.end_m();
    assert!(kidney.contains(&got.last_m), "{} m, {kidney:?}", got.last_m);
    assert!(got.peak_n < 6.0);
}
