//! What unit tests of several modules make up.

use std::sync::Arc;
use stylet_identify::model::Belief;
use stylet_tissue::{Layer, Tissue};

/// Layers of so much thickness, stiffness and friction, from the origin on, believed to 30 % and their thickness to 10 %.
pub fn believed(layers: &[[f64; 3]]) -> Arc<Belief> {
    let layer = |&[thickness_m, stiffness_n_per_m, friction_ns_per_m2]: &[f64; 3]| Layer {
        name: String::new(),
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n: None,
    };
    Arc::new(Belief {
        tissue: Tissue { surface_m: 0.0, layers: layers.iter().map(layer).collect() },
        given: Vec::new(),
        tolerance: vec![0.3; layers.len()],
        thickness_tolerance: vec![0.1; layers.len()],
        surface_tolerance_m: 0.01,
    })
}
