//! Assumed tissue before any insertion.

use stylet_tissue::{Layer, Tissue};

/// A skin of 11 mm on a deep layer, or the deep layer alone.
pub fn assumed_tissue(layers: usize) -> Tissue {
    let layer = |thickness_m| Layer {
        name: String::new(),
        thickness_m,
        stiffness_n_per_m: 300.0,
        friction_ns_per_m2: 0.0,
        puncture_n: Some(4.0),
    };
    let thick = if layers > 1 { vec![layer(0.011), layer(0.08)] } else { vec![layer(0.08)] };
    Tissue { surface_m: 0.004, layers: thick }
}
