use stylet_tissue::{AnyEffect, Tissue};

/// What is believed before any measurement, and how surely.
#[derive(Clone, Debug)]
pub struct Assumptions {
    /// The tissue.
    pub tissue: Tissue,
    /// Effects that the simulation has already.
    pub known_effects: Vec<AnyEffect>,
    /// How far stiffness, friction and puncture force may be off, relative, per layer.
    pub tolerance: Vec<f64>,
    /// The same for thicknesses.
    pub thickness_tolerance: Vec<f64>,
    /// And for the position of the surface, in m.
    pub surface_tolerance_m: f64,
}
