//! Fixtures and assertions of unit tests.

use crate::block_averages::{BLOCK_S, BlockAverages};
use crate::model::{Assumptions, Model};
use std::sync::Arc;
use stylet_record::Recording;
use stylet_tissue::{Layer, Tissue};

/// Asserts that two numbers agree to nine digits.
pub(crate) fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-9 * expected.abs().max(1e-9), "{actual} for {expected}");
}

/// Normal numbers: sums of twelve uniform ones from a linear congruential generator (Knuth's MMIX).
pub(crate) fn normal(seed: u64, n: usize) -> Vec<f64> {
    let mut state = seed;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..n).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
}

/// Blocks of `n` samples every 5 ms with positions (m) and forces (N) as functions of time (s).
pub(crate) fn sampled(
    n: usize,
    position_m: impl Fn(f64) -> f64,
    force_n: impl Fn(f64) -> f64,
) -> BlockAverages {
    let t: Vec<f64> = (0..n).map(|k| k as f64 * 0.005).collect();
    let z = t.iter().map(|t| position_m(*t)).collect();
    let f = t.iter().map(|t| force_n(*t)).collect();
    BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
}

/// The base model of layers below `surface_m` with thickness (m), stiffness (N/m), friction (Ns/m²) and puncture force (N);
/// relative tolerances of the force parameters and of the thicknesses.
pub(crate) fn base_model(
    surface_m: f64,
    layers: &[(f64, f64, f64, Option<f64>)],
    (tolerance, thickness_tolerance): (f64, f64),
    recordings: usize,
) -> Model {
    let layer = |&(thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n)| Layer {
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n,
        name: String::new(),
    };
    let assumptions = Assumptions {
        tissue: Tissue { surface_m, layers: layers.iter().map(layer).collect() },
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![tolerance; layers.len()],
        thickness_tolerance: vec![thickness_tolerance; layers.len()],
        surface_tolerance_m: 0.002,
    };
    Model::base(Arc::new(assumptions), recordings)
}
