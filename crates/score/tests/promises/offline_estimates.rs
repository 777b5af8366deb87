//! Offline least squares over each layer, with the true ruptures: exact where the data separate stiffness from friction, otherwise
//! with the split of the online estimate, and none without either.

use crate::support::{near, rupture};
use stylet_core::EnhanceConfig;
use stylet_core::config::{Algorithm, CusumConfig, DerivativeConfig};
use stylet_record::{Recording, Truth};
use stylet_score::{LayerTruth, Score, Trace, score_run};

/// Layers from 10 to 25 mm and from 25 to 35 mm.
const LAYERS: [LayerTruth; 2] = [
    LayerTruth { front_m: 0.010, thickness_m: 0.015, stiffness_n_per_m: 40.0, friction_ns_per_m2: 2000.0 },
    LayerTruth { front_m: 0.025, thickness_m: 0.010, stiffness_n_per_m: 100.0, friction_ns_per_m2: 3000.0 },
];

/// Two layers by the base law: each ruptures at its far face, friction `b l v` remains.
struct Insertion {
    recording: Recording,
    truth: Truth,
}

/// From 5 mm before the surface to beyond the last layer, at a velocity that depends on the tip position.
fn insertion(velocity_mps: impl Fn(f64) -> f64) -> Insertion {
    let (mut columns, mut truth) = ([vec![], vec![], vec![], vec![]], Truth::default());
    let (mut time_s, mut z) = (0.0, 0.005);
    let mut active = 0;
    while z < 0.042 {
        let v = velocity_mps(z);
        if let Some(far_m) = LAYERS.get(active).map(|l| l.front_m + l.thickness_m).filter(|far_m| z >= *far_m)
        {
            active += 1;
            truth.ruptures.push(rupture(active, time_s - (z - far_m) / v, far_m));
        }
        let passed: f64 = LAYERS[..active].iter().map(|l| l.friction_ns_per_m2 * l.thickness_m).sum();
        let tip = LAYERS
            .get(active)
            .map_or(0.0, |l| l.length_inside_m(z) * (l.stiffness_n_per_m + l.friction_ns_per_m2 * v));
        for (column, value) in columns.iter_mut().zip([time_s, z, v, tip + passed * v]) {
            column.push(value);
        }
        truth.tip_force_n.push(tip);
        truth.tissue_force_n.push(tip + passed * v);
        time_s += 0.005;
        z += 0.005 * v;
    }
    let [time_s, position_m, velocity_mps, force_n] = columns;
    let recording = Recording::with_velocity(time_s, position_m, velocity_mps, force_n).expect("columns");
    Insertion { recording, truth }
}

/// 2 to 4 mm/s with a period of 4 mm.
fn varying(z: f64) -> f64 {
    0.003 + 0.001 * (z / 0.004 * std::f64::consts::TAU).sin()
}

fn scored(insertion: &Insertion, config: &EnhanceConfig) -> (Trace, Score) {
    score_run(&insertion.recording, &insertion.recording.force_n, &insertion.truth, &LAYERS, config)
}

fn paper() -> EnhanceConfig {
    EnhanceConfig { algorithm: Algorithm::Paper, ..EnhanceConfig::default() }
}

/// A core that never declares a rupture.
fn without_detection() -> EnhanceConfig {
    EnhanceConfig {
        cusum: CusumConfig { enabled: false, ..CusumConfig::default() },
        derivative: DerivativeConfig { enabled: false, ..DerivativeConfig::default() },
        ..paper()
    }
}

#[track_caller]
fn close(found: Option<f64>, wanted: f64) {
    assert!(found.is_some_and(|f| (f / wanted - 1.0).abs() < 1e-6), "{found:?} instead of {wanted}");
}

#[test]
fn a_run_is_scored_against_its_truth() {
    let run = insertion(varying);
    let (trace, score) = scored(&run, &paper());
    assert_eq!(score.ruptures.len(), 2);
    assert_eq!(score.missed, 0, "{:?}", score.ruptures);
    assert_eq!(trace.enhanced_n.len(), run.recording.len());
    assert_eq!(score.contact_m.estimated, trace.contact_m);
    // The same from the columns; the needle never reverses, and the surface is at 10 mm.
    let inside = || (0..run.recording.len()).filter(|i| run.recording.position_m[*i] >= LAYERS[0].front_m);
    let tip2: f64 = inside().map(|i| run.truth.tip_force_n[i].powi(2)).sum();
    let miss2: f64 = inside().map(|i| (trace.enhanced_n[i] - run.truth.tip_force_n[i]).powi(2)).sum();
    near(score.enhancement.rms_relative, (miss2 / tip2).sqrt());
    // The sensor is exact: the whole error is friction.
    close(score.enhancement.friction_rms_relative, (miss2 / tip2).sqrt());
}

#[test]
fn a_varying_velocity_gives_both_coefficients_exactly() {
    let run = insertion(varying);
    for config in [paper(), without_detection()] {
        let (trace, score) = scored(&run, &config);
        assert_eq!(trace.detections.is_empty(), config == without_detection());
        for (layer, truth) in score.layers.iter().zip(LAYERS) {
            assert_eq!(layer.offline_separable, Some(true));
            close(layer.offline_stiffness_n_per_m, truth.stiffness_n_per_m);
            close(layer.offline_friction_ns_per_m2, truth.friction_ns_per_m2);
        }
    }
}

#[test]
fn only_forward_samples_inside_a_layer_before_its_rupture_count() {
    let mut run = insertion(varying);
    let recording = &mut run.recording;
    let ruptures = run.truth.ruptures.clone();
    for i in 0..recording.len() {
        let (t, z) = (recording.time_s[i], recording.position_m[i]);
        // Occasional backward samples do not count.
        let pulled = i % 7 == 3 && z > 0.012;
        // The first true rupture is slightly before the far face: later samples do not count.
        let after = t >= ruptures[0].time_s && z < 0.0253;
        if pulled {
            recording.velocity_mps[i] = -0.001;
        }
        if i % 11 == 5 && z > 0.012 {
            recording.velocity_mps[i] = 0.0;
        }
        if pulled || i % 11 == 5 && z > 0.012 || after {
            recording.force_n[i] = 7.0;
        }
    }
    // From the time of the rupture on the tip springs back into the layer for ten samples.
    let at = recording.time_s.partition_point(|t| *t < ruptures[0].time_s);
    run.truth.ruptures[0].time_s = recording.time_s[at];
    for i in at..at + 10 {
        recording.position_m[i] = 0.018;
        recording.force_n[i] = 9.0;
    }
    // Before it, single samples lie beyond and at the far face, and before and at the front.
    for (i, z) in [(at - 9, 0.026), (at - 8, ruptures[0].position_m), (at - 6, 0.009), (at - 5, 0.010)] {
        recording.position_m[i] = z;
        recording.force_n[i] = 5.0;
    }
    let (_, score) = scored(&run, &without_detection());
    close(score.layers[0].offline_stiffness_n_per_m, LAYERS[0].stiffness_n_per_m);
    close(score.layers[0].offline_friction_ns_per_m2, LAYERS[0].friction_ns_per_m2);
}

#[test]
fn at_constant_velocity_the_measured_drop_determines_the_split() {
    let v = 0.0023;
    let run = insertion(|_| v);
    let (trace, score) = scored(&run, &paper());
    let layer = &score.layers[0];
    assert_eq!(layer.offline_separable, Some(false));
    let (k, b) = (LAYERS[0].stiffness_n_per_m, LAYERS[0].friction_ns_per_m2);
    let number = score.ruptures[0].detection.expect("detected");
    let estimate = trace.estimates.iter().find(|e| e.layer == number).expect("estimated");
    assert!((0.05..0.95).contains(&estimate.elastic_share), "{estimate:?}");
    // Force and depth give the sum k + b v; the drop gives the elastic share.
    close(layer.offline_stiffness_n_per_m, estimate.elastic_share * (k + b * v));
    close(layer.offline_friction_ns_per_m2, (1.0 - estimate.elastic_share) * (k + b * v) / v);
}

#[test]
fn friction_of_previous_layers_is_subtracted_by_their_offline_estimates() {
    let v = 0.0023;
    let run = insertion(|_| v);
    let (trace, score) = scored(&run, &paper());
    let (first, second) = (&score.layers[0], &score.layers[1]);
    let found = first.offline_friction_ns_per_m2.expect("a drop");
    // The force of the second layer rises by k + b v per metre. An error of the first layer's friction is a constant, which least
    // squares through the origin turn into a slope: 3/2 of it over the thickness.
    let wrong = (LAYERS[0].friction_ns_per_m2 - found) * LAYERS[0].thickness_m * v;
    let slope =
        LAYERS[1].stiffness_n_per_m + LAYERS[1].friction_ns_per_m2 * v + 1.5 * wrong / LAYERS[1].thickness_m;
    let number = score.ruptures[1].detection.expect("detected");
    let share = trace.estimates.iter().find(|e| e.layer == number).expect("estimated").elastic_share;
    let stiffness = second.offline_stiffness_n_per_m.expect("a drop");
    assert!((stiffness / (share * slope) - 1.0).abs() < 2e-3, "{stiffness} {}", share * slope);
}

#[test]
fn without_drop_and_velocity_changes_there_is_no_offline_estimate() {
    let (_, score) = scored(&insertion(|_| 0.0023), &without_detection());
    assert_eq!(score.layers.len(), 2);
    for layer in &score.layers {
        assert_eq!((layer.offline_stiffness_n_per_m, layer.offline_separable), (None, None));
    }
}
