//! Fixtures shared by several tests.

use std::sync::Arc;
use stylet_identify::model::Assumptions;
use stylet_tissue::{Layer, Tissue};

/// One layer from zero to `thickness_m` with this stiffness (N/m) and friction (Ns/m²), without a puncture
/// force.
pub fn one_layer(thickness_m: f64, (stiffness_n_per_m, friction_ns_per_m2): (f64, f64)) -> Arc<Assumptions> {
    let layer =
        Layer { thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n: None, name: String::new() };
    Arc::new(Assumptions {
        tissue: Tissue { surface_m: 0.0, layers: vec![layer] },
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![0.3],
        thickness_tolerance: vec![0.1],
        surface_tolerance_m: 0.002,
    })
}
