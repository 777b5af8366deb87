//! Beside the core's estimates stand those of least squares over each layer as a whole, with the true ruptures: where the data alone tell
//! stiffness from friction they are exact, where not the split is the core's, and with neither there is none.

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

/// The stack by the base law: each layer ruptures at its far face, friction `b l v` stays.
struct Insertion {
    recording: Recording,
    truth: Truth,
}

/// From 5 mm before the surface to 5 mm behind the last layer, at `velocity_mps` of the tip's place.
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

/// 2 to 4 mm/s, a wave every 4 mm.
fn waving(z: f64) -> f64 {
    0.003 + 0.001 * (z / 0.004 * std::f64::consts::TAU).sin()
}

fn scored(insertion: &Insertion, config: &EnhanceConfig) -> (Trace, Score) {
    score_run(&insertion.recording, &insertion.recording.force_n, &insertion.truth, &LAYERS, config)
}

fn paper() -> EnhanceConfig {
    EnhanceConfig { algorithm: Algorithm::Paper, ..EnhanceConfig::default() }
}

/// A core that never declares a rupture.
fn deaf() -> EnhanceConfig {
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
    let run = insertion(waving);
    let (trace, score) = scored(&run, &paper());
    assert_eq!(score.ruptures.len(), 2);
    assert_eq!(score.missed, 0, "{:?}", score.ruptures);
    assert_eq!(trace.enhanced_n.len(), run.recording.len());
    assert_eq!(score.contact_m.estimated, trace.contact_m);
    // The same by hand from the columns; the needle never turns, and the surface is at 10 mm.
    let inside = || (0..run.recording.len()).filter(|i| run.recording.position_m[*i] >= LAYERS[0].front_m);
    let tip2: f64 = inside().map(|i| run.truth.tip_force_n[i].powi(2)).sum();
    let miss2: f64 = inside().map(|i| (trace.enhanced_n[i] - run.truth.tip_force_n[i]).powi(2)).sum();
    near(score.enhancement.rms_relative, (miss2 / tip2).sqrt());
    // The sensor is exact: all that is missed is friction.
    close(score.enhancement.friction_rms_relative, (miss2 / tip2).sqrt());
}

#[test]
fn a_waving_velocity_gives_both_coefficients_exactly_whatever_the_core_thinks() {
    let run = insertion(waving);
    for config in [paper(), deaf()] {
        let (trace, score) = scored(&run, &config);
        assert_eq!(trace.detections.is_empty(), config == deaf());
        for (layer, truth) in score.layers.iter().zip(LAYERS) {
            assert_eq!(layer.offline_separable, Some(true));
            close(layer.offline_stiffness_n_per_m, truth.stiffness_n_per_m);
            close(layer.offline_friction_ns_per_m2, truth.friction_ns_per_m2);
        }
    }
}

#[test]
fn only_the_way_forward_inside_a_layer_before_its_rupture_is_asked() {
    let mut run = insertion(waving);
    let recording = &mut run.recording;
    let ruptures = run.truth.ruptures.clone();
    for i in 0..recording.len() {
        let (t, z) = (recording.time_s[i], recording.position_m[i]);
        // On the way: pulled back a little now and then, which no law of advancing describes.
        let pulled = i % 7 == 3 && z > 0.012;
        // The truth's first rupture is a little before the far face: what follows is no longer the layer's.
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
    // From the instant of the rupture on the tip springs back into the layer for ten samples.
    let at = recording.time_s.partition_point(|t| *t < ruptures[0].time_s);
    run.truth.ruptures[0].time_s = recording.time_s[at];
    for i in at..at + 10 {
        recording.position_m[i] = 0.018;
        recording.force_n[i] = 9.0;
    }
    // And before it, it has looked out behind the layer's far face once, and been on it and on its front.
    for (i, z) in [(at - 9, 0.026), (at - 8, ruptures[0].position_m), (at - 6, 0.009), (at - 5, 0.010)] {
        recording.position_m[i] = z;
        recording.force_n[i] = 5.0;
    }
    let (_, score) = scored(&run, &deaf());
    close(score.layers[0].offline_stiffness_n_per_m, LAYERS[0].stiffness_n_per_m);
    close(score.layers[0].offline_friction_ns_per_m2, LAYERS[0].friction_ns_per_m2);
}

#[test]
fn a_constant_velocity_leaves_the_split_to_the_core_s_measured_drop() {
    let v = 0.0023;
    let run = insertion(|_| v);
    let (trace, score) = scored(&run, &paper());
    let layer = &score.layers[0];
    assert_eq!(layer.offline_separable, Some(false));
    let (k, b) = (LAYERS[0].stiffness_n_per_m, LAYERS[0].friction_ns_per_m2);
    let number = score.ruptures[0].detection.expect("detected");
    let estimate = trace.estimates.iter().find(|e| e.layer == number).expect("estimated");
    assert!((0.05..0.95).contains(&estimate.elastic_share), "{estimate:?}");
    // What force and depth alone say is the sum k + b v; the drop says how much of it is elastic.
    close(layer.offline_stiffness_n_per_m, estimate.elastic_share * (k + b * v));
    close(layer.offline_friction_ns_per_m2, (1.0 - estimate.elastic_share) * (k + b * v) / v);
}

#[test]
fn the_friction_of_the_layers_before_is_taken_off_with_their_own_offline_estimate() {
    let v = 0.0023;
    let run = insertion(|_| v);
    let (trace, score) = scored(&run, &paper());
    let (first, second) = (&score.layers[0], &score.layers[1]);
    let found = first.offline_friction_ns_per_m2.expect("a drop");
    // Per metre of the second layer the force rises by k + b v; the passed layer's friction d v is the same all along, and what the
    // first estimate leaves of it, least squares through the origin take for a slope: 3/2 of it over the layer's thickness.
    let wrong = (LAYERS[0].friction_ns_per_m2 - found) * LAYERS[0].thickness_m * v;
    let slope =
        LAYERS[1].stiffness_n_per_m + LAYERS[1].friction_ns_per_m2 * v + 1.5 * wrong / LAYERS[1].thickness_m;
    let number = score.ruptures[1].detection.expect("detected");
    let share = trace.estimates.iter().find(|e| e.layer == number).expect("estimated").elastic_share;
    let stiffness = second.offline_stiffness_n_per_m.expect("a drop");
    assert!((stiffness / (share * slope) - 1.0).abs() < 2e-3, "{stiffness} {}", share * slope);
}

#[test]
fn without_a_drop_and_without_changes_of_velocity_nothing_tells_the_two_apart() {
    let (_, score) = scored(&insertion(|_| 0.0023), &deaf());
    assert_eq!(score.layers.len(), 2);
    for layer in &score.layers {
        assert_eq!((layer.offline_stiffness_n_per_m, layer.offline_separable), (None, None));
    }
}
