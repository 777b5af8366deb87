//! Over 200 noise seeds at 0.02 N all three ruptures of both three-layer scenarios are found
//! within a sample, none is false, and the stiffness is right to 5 % (median) in constant motion.
//!
//! Prints the distributions together with the reference values for the same cases (surface known, the sinusoid from full speed), and
//! whether they are met:
//! `cargo test --release --test promises detection_over_noise_seeds -- --nocapture`.

use crate::support;

use rayon::prelude::*;
use stylet_core::config::{Algorithm, Contact, EnhanceConfig, Model, Reset};
use stylet_scenario::{Motion, Scenario, Sensor};
use stylet_score::{Score, score_run};
use stylet_stats::{Interval, quantile_of, wilson};
use stylet_testbed::simulate;

const SEEDS: u64 = 200;

fn load(name: &str) -> Scenario {
    Scenario::load(&support::scenario(name)).expect("a shipped scenario")
}

/// The insertion is simulated once; a seed changes only the noise.
fn scores(scenario: &Scenario, config: &EnhanceConfig) -> Vec<Score> {
    let once = simulate(scenario, 1).expect("a simulation");
    let layers = once.true_layers();
    let noisy = |seed: u64| once.measured_with_seed(seed).expect("a force/torque sensor");
    assert_eq!(noisy(1), once.recording.force_n, "drawing the noise apart must change nothing");
    (1..=SEEDS)
        .into_par_iter()
        .map(|seed| score_run(&once.recording, &noisy(seed), &once.truth, &layers, config).1)
        .collect()
}

struct Summary {
    missed: usize,
    false_alarms: usize,
    median_delay_s: f64,
    p99_delay_s: f64,
    median_stiffness: Vec<f64>,
    median_friction: Vec<f64>,
    /// Median relative error of the enhanced force up to the exit.
    enhancement: f64,
}

fn summarise(name: &str, scores: &[Score]) -> Summary {
    let ruptures: usize = scores.iter().map(|s| s.ruptures.len()).sum();
    let missed = scores.iter().map(|s| s.missed).sum();
    let false_alarms = scores.iter().map(|s| s.false_alarms).sum();
    let delays = || scores.iter().flat_map(|s| &s.ruptures).filter_map(|r| r.delay_s);
    let error = |layer: usize, q: f64, pick: fn(&stylet_score::LayerScore) -> Option<f64>| {
        quantile_of(scores.iter().filter_map(|s| s.layers.get(layer)).filter_map(pick), q)
    };
    let stiffness =
        |q| (0..3).map(|l| error(l, q, |l| l.stiffness_n_per_m.relative_error)).collect::<Vec<_>>();
    let friction =
        |q| (0..3).map(|l| error(l, q, |l| l.friction_ns_per_m2.relative_error)).collect::<Vec<_>>();
    let percent = |v: &[f64]| v.iter().map(|x| format!("{:.1}", 100.0 * x)).collect::<Vec<_>>().join("/");
    let Interval { low, high, .. } = wilson(missed, ruptures);
    println!("{name}: {} seeds, {ruptures} ruptures", scores.len());
    println!("  missed {missed} (95 % interval of the rate {low:.4}-{high:.4}), false {false_alarms}");
    println!(
        "  delay ms: median {:.2}, p95 {:.2}, p99 {:.2}, largest {:.2}",
        1e3 * quantile_of(delays(), 0.5),
        1e3 * quantile_of(delays(), 0.95),
        1e3 * quantile_of(delays(), 0.99),
        1e3 * quantile_of(delays(), 1.0)
    );
    println!("  K error %: median {}, p95 {}", percent(&stiffness(0.5)), percent(&stiffness(0.95)));
    println!("  b error %: median {}, p95 {}", percent(&friction(0.5)), percent(&friction(0.95)));
    println!(
        "  D error %: median {:.1}; enhancement error: median {:.3} to the deepest point, {:.3} up to the exit",
        100.0 * quantile_of(scores.iter().filter_map(|s| s.cumulative_friction_ns_per_m.relative_error), 0.5),
        quantile_of(scores.iter().filter_map(|s| s.enhancement.rms_relative), 0.5),
        quantile_of(scores.iter().filter_map(|s| s.enhancement.in_tissue_relative), 0.5),
    );
    Summary {
        missed,
        false_alarms,
        median_delay_s: quantile_of(delays(), 0.5),
        p99_delay_s: quantile_of(delays(), 0.99),
        median_stiffness: stiffness(0.5),
        median_friction: friction(0.5),
        enhancement: quantile_of(scores.iter().filter_map(|s| s.enhancement.in_tissue_relative), 0.5),
    }
}

#[test]
fn both_three_layer_scenarios_have_no_miss_and_no_false_alarm_over_200_noise_seeds() {
    for name in ["three_layer_latex_constant", "three_layer_latex_sinusoidal"] {
        let scenario = load(name);
        let s = summarise(name, &scores(&scenario, &scenario.enhance));
        assert_eq!((s.missed, s.false_alarms), (0, 0), "{name}");
        assert!(s.median_delay_s <= 1.0 / scenario.sample_hz, "{name}: median delay {} s", s.median_delay_s);
        assert!(s.p99_delay_s <= 0.050, "{name}: p99 delay {} s", s.p99_delay_s);
        if name.ends_with("constant") {
            for (layer, error) in s.median_stiffness.iter().enumerate() {
                assert!(*error <= 0.05, "{name}: K{} off by {error}", layer + 1);
            }
        }
    }
}

/// A reference value as text, and our value.
struct Line {
    what: String,
    reference: f64,
    ours: f64,
}

/// Our value rounded to the decimals of the reference: 1.62 % becomes 1.6 % for 1.6 %.
fn rounded(x: f64, decimals: i32) -> f64 {
    let shift = 10f64.powi(decimals);
    (x * shift).round() / shift
}

fn percents(case: &str, what: &str, reference: [f64; 3], ours: &[f64]) -> Vec<Line> {
    let line = |(i, (r, o)): (usize, (f64, &f64))| {
        // Two significant digits in the reference: no decimal from 10 % on.
        let ours = rounded(100.0 * o, if r >= 10.0 { 0 } else { 1 });
        Line { what: format!("{case}: {what}{}", i + 1), reference: r, ours }
    };
    reference.into_iter().zip(ours).enumerate().map(line).collect()
}

/// Reference values that are not met, by a few per cent up to a seventh; update the list when one changes in either direction. Seeds and noise
/// of the reference differ from ours.
const NOT_MET: &[&str] = &[
    "constant: K3",
    "constant: enhancement error",
    "sinusoid: K2",
    "sinusoid: b2",
    "sinusoid: enhancement error",
];

/// The reference cases: surface known, the sinusoid starting at full speed.
#[test]
fn the_reference_values_are_met_except_the_listed_ones() {
    let known = |model| EnhanceConfig { contact: Contact::Known, model, ..EnhanceConfig::paper() };
    let constant = load("three_layer_latex_constant");
    let sinusoid = from_full_speed();
    let c = summarise("known surface, constant, ML", &scores(&constant, &known(Model::MultiLayer)));
    let s = summarise(
        "known surface, sinusoid from full speed, ML",
        &scores(&sinusoid, &known(Model::MultiLayer)),
    );
    let mut lines = Vec::new();
    for (case, found, k, b, enhancement, decimals) in [
        ("constant", &c, [3.6, 1.6, 2.7], [6.6, 1.0, 2.8], 0.155, 3),
        ("sinusoid", &s, [2.0, 2.9, 38.0], [0.6, 1.5, 26.0], 0.33, 2),
    ] {
        for (what, ours) in [("missed", found.missed), ("false", found.false_alarms)] {
            lines.push(Line { what: format!("{case}: {what}"), reference: 0.0, ours: ours as f64 });
        }
        lines.extend(percents(case, "K", k, &found.median_stiffness));
        lines.extend(percents(case, "b", b, &found.median_friction));
        lines.push(Line {
            what: format!("{case}: enhancement error"),
            reference: enhancement,
            ours: rounded(found.enhancement, decimals),
        });
    }
    println!("{:<32} {:>9} {:>9}", "line", "reference", "ours");
    let mut not_met = Vec::new();
    for line in &lines {
        let met = line.ours <= line.reference;
        println!(
            "{:<32} {:>9} {:>9} {}",
            line.what,
            line.reference,
            line.ours,
            if met { "" } else { "not met" }
        );
        if !met {
            not_met.push(line.what.as_str());
        }
    }
    assert_eq!(not_met, NOT_MET);
}

fn from_full_speed() -> Scenario {
    let mut sinusoid = load("three_layer_latex_sinusoidal");
    if let Motion::Sinusoidal { phase_rad, .. } = &mut sinusoid.motion {
        *phase_rad = 0.0;
    }
    sinusoid
}

/// Least squares of the force minus the true cumulative friction on `[dz, v]` over each layer, with non-negative friction: relative error of K
/// per layer, median over the seeds.
fn kelvin_voigt_by_least_squares(scenario: &Scenario) -> Vec<f64> {
    let once = simulate(scenario, 1).expect("a simulation");
    let layers = once.true_layers();
    let errors: Vec<Vec<f64>> = (1..=SEEDS)
        .into_par_iter()
        .map(|seed| {
            let force_n = once.measured_with_seed(seed).expect("a force/torque sensor");
            let of = |(layer, rupture): (&stylet_score::LayerTruth, &stylet_record::TrueRupture)| {
                let [mut zz, mut zv, mut vv, mut zf, mut vf] = [0.0; 5];
                let all =
                    once.recording.samples().zip(&force_n).zip(&once.truth.cumulative_friction_ns_per_m);
                for ((sample, force_n), cumulative) in all {
                    let (dz, v) = (sample.position_m - layer.front_m, sample.velocity_mps);
                    if dz <= 0.0 || sample.time_s >= rupture.time_s {
                        continue;
                    }
                    let y = force_n - cumulative * v;
                    zz += dz * dz;
                    zv += dz * v;
                    vv += v * v;
                    zf += dz * y;
                    vf += v * y;
                }
                let determinant = zz * vv - zv * zv;
                let friction = (vf * zz - zf * zv) / determinant;
                // Neither is below zero: with the friction at its end the stiffness takes all.
                let stiffness = if friction > 0.0 { (zf * vv - vf * zv) / determinant } else { zf / zz };
                (stiffness / layer.stiffness_n_per_m - 1.0).abs()
            };
            layers.iter().zip(&once.truth.ruptures).map(of).collect()
        })
        .collect();
    (0..layers.len()).map(|layer| quantile_of(errors.iter().map(|e| e[layer]), 0.5)).collect()
}

/// The reference's Kelvin-Voigt errors, K 46 to 52 % (constant) and 150 to 280 % (sinusoid), are those of least
/// squares over the whole layer, without covariance resets: the speed's column is then a mere offset, all local
/// friction goes into K, and K is off by `b v / K`; in the sinusoid by more, because the speed is higher.
/// With resets at 40 Hz and no re-weighting it is less in constant motion, with both, as the algorithm is written, a
/// tenth.
#[test]
fn kelvin_voigt_errors_are_those_of_the_reference_without_covariance_resets_and_smaller_with_them() {
    let run = |name: &str, scenario: &Scenario, reset: Reset, reweight: bool| {
        let mut config = EnhanceConfig {
            contact: Contact::Known,
            model: Model::KelvinVoigt,
            reset,
            ..EnhanceConfig::paper()
        };
        config.drop.reweight = reweight;
        summarise(name, &scores(scenario, &config)).median_stiffness
    };
    let (constant, sinusoid) = (load("three_layer_latex_constant"), from_full_speed());
    let layers = &constant.tissue.layers;
    let predicted: Vec<f64> =
        layers.iter().map(|l| l.friction_ns_per_m2 * 0.0023 / l.stiffness_n_per_m).collect();
    println!("b v / K at 2.3 mm/s: {predicted:.3?}");
    let whole = run("constant, KV, no resets within a layer", &constant, Reset::Ruptures, true);
    for (layer, (found, predicted)) in whole.iter().zip(&predicted).enumerate() {
        assert!((0.455..0.525).contains(found), "K{}: {found}", layer + 1);
        assert!((found / predicted - 1.0).abs() < 0.05, "K{}: {found}, b v / K {predicted}", layer + 1);
    }
    let frequent = Reset::Frequency { hz: 40.0 };
    let plain = run("constant, KV, 40 Hz, not re-weighted", &constant, frequent, false);
    let both = run("constant, KV, 40 Hz, re-weighted", &constant, frequent, true);
    for layer in 0..3 {
        assert!(both[layer] < 0.5 * plain[layer] && plain[layer] < whole[layer], "K{}", layer + 1);
    }
    // Without a recursion: the reference's lines as they stand, 46 to 52 % and 150 to 280 %, layer by layer. The third
    // layer in the sinusoid, 135 %, lies below the reference's range.
    let least = kelvin_voigt_by_least_squares(&constant);
    println!(
        "constant, KV, least squares over the whole layer: K off by {least:.3?}, reference 0.46 to 0.52"
    );
    assert!(least.iter().all(|error| (0.455..0.525).contains(error)), "constant: {least:?}");
    let least = kelvin_voigt_by_least_squares(&sinusoid);
    println!("sinusoid, KV, least squares over the whole layer: K off by {least:.3?}, reference 1.5 to 2.8");
    assert!(least[..2].iter().all(|error| (1.495..2.805).contains(error)), "sinusoid: {least:?}");
    assert!((1.2..1.495).contains(&least[2]), "sinusoid: {least:?}");
    // The recursion without resets misses ruptures in the sinusoid, and what it misses it does not estimate.
    run("sinusoid, KV, no resets within a layer", &sinusoid, Reset::Ruptures, true);
    let both = run("sinusoid, KV, 40 Hz, re-weighted", &sinusoid, frequent, true);
    assert!(both[0] > 1.495 && both[1] > 1.495 && both[2] < 1.495, "the third layer is better: {both:?}");
}

/// Reference values above 0.02 N that are not met. At 0.03 N there are as many misses and 153 instead of 138 false alarms; at 0.1 N 502
/// instead of 256 misses and 2902 instead of 1985 false alarms.
const NOISE_NOT_MET: &[&str] = &["0.03 N: false", "0.1 N: missed", "0.1 N: false"];

/// The same with the 2 mm without a rupture counted from the end of the 7.5 mm in which detection is off, instead of from the rupture.
const LATER_NOT_MET: &[&str] = &["0.03 N: missed"];

/// Above 0.02 N detection fails: in the reference 37 of 600 missed and 138 false at 0.03 N, 256 and
/// 1985 at 0.1 N. At 0.1 N it alarms as often as the blind travel allows,
/// 7.5 mm here. With 9.5 mm both reference values at 0.1 N are met, and the false alarms at 0.03 N.
#[test]
fn detection_fails_above_twenty_millinewtons_of_noise_as_in_the_reference() {
    let mut constant = load("three_layer_latex_constant");
    let detection_off_m = {
        let drop = EnhanceConfig::paper().drop;
        drop.travel_m + drop.compensation_travel_m
    };
    let plain = EnhanceConfig { contact: Contact::Known, ..EnhanceConfig::paper() };
    let mut later = plain.clone();
    later.guard.blind_travel_m += detection_off_m;
    for (name, config, expected) in [
        ("2 mm from the rupture", &plain, NOISE_NOT_MET),
        ("2 mm from the end of 7.5 mm", &later, LATER_NOT_MET),
    ] {
        let mut not_met = Vec::new();
        for (noise_n, missed, alarms) in [(0.03, 37, 138), (0.1, 256, 1985)] {
            if let Sensor::ForceTorque(sensor) = &mut constant.sensor {
                sensor.noise_n = noise_n;
            }
            let s =
                summarise(&format!("constant, ML, noise {noise_n} N, {name}"), &scores(&constant, config));
            for (what, reference, ours) in [("missed", missed, s.missed), ("false", alarms, s.false_alarms)] {
                println!("  {what}: reference {reference}, ours {ours}");
                if ours > reference {
                    not_met.push(format!("{noise_n} N: {what}"));
                }
            }
            assert!(s.false_alarms > 100, "it breaks down: {}", s.false_alarms);
        }
        assert_eq!(not_met, expected, "{name}");
    }
}

/// The literal algorithm has no blind travel after contact: nearly every insertion with detected contact has a false rupture right after it, and
/// from rest the error of K of the first layer is one half. With a known surface there is none.
#[test]
fn the_literal_algorithm_has_a_false_rupture_after_detected_contact() {
    let sinusoid = load("three_layer_latex_sinusoidal");
    let with = |algorithm: Algorithm, contact: Contact| {
        let config = EnhanceConfig { algorithm, contact, ..EnhanceConfig::paper() };
        summarise(
            &format!("sinusoid from rest, {algorithm:?}, {:?}", config.contact),
            &scores(&sinusoid, &config),
        )
    };
    let completed = with(Algorithm::Paper, Contact::Detected);
    let literal = with(Algorithm::Literal, Contact::Detected);
    let known = with(Algorithm::Literal, Contact::Known);
    assert_eq!((completed.false_alarms, known.false_alarms), (0, 0));
    assert!(literal.false_alarms as f64 >= 0.95 * SEEDS as f64, "{}", literal.false_alarms);
    assert!((0.4..0.6).contains(&literal.median_stiffness[0]), "{:?}", literal.median_stiffness);
    assert!(literal.median_stiffness[0] > 3.0 * completed.median_stiffness[0]);
}
