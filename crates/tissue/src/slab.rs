//! A layer as the law sees it: faces instead of thicknesses, no names.

use crate::layer::Tissue;
use alloc::vec::Vec;

/// A layer placed in space. Infinite puncture force means: only the far face ruptures it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slab {
    /// Front face `s_i` in metres.
    pub front_m: f64,
    /// Thickness `d_i` in metres.
    pub thickness_m: f64,
    /// Stiffness `K_i` in N/m.
    pub stiffness_n_per_m: f64,
    /// Viscous friction per metre `b_i` in N s/m².
    pub friction_ns_per_m2: f64,
    /// Puncture force `F_i` in N, or infinity.
    pub puncture_n: f64,
    /// How far in metres the tip may push the layer beyond its far face before that ruptures it.
    pub reach_m: f64,
    /// Stiffening of this layer alone in 1/m: `K_i kappa_i x^2` is added to its elastic force.
    pub kappa_per_m: f64,
    /// Share of the friction that effects have taken over from `b_i l_i v`, 0 to 1.
    pub gripped: f64,
}

impl Slab {
    /// Far face in metres.
    #[must_use]
    #[inline]
    pub fn far_m(&self) -> f64 {
        self.front_m + self.thickness_m
    }

    /// Position of the tip in metres at which the layer gives way whatever its force: the far face,
    /// and as much beyond as the layer can be pushed.
    #[must_use]
    #[inline]
    pub fn gives_way_m(&self) -> f64 {
        self.far_m() + self.reach_m
    }

    /// Length of needle inside the layer, `l_i = clamp(z - s_i, 0, d_i)`, in metres.
    #[must_use]
    #[inline]
    pub fn inside_m(&self, z_m: f64) -> f64 {
        let depth = z_m - self.front_m;
        // Written so that it compiles to a maximum and a minimum, without branches.
        let inside = if depth > 0.0 { depth } else { 0.0 };
        if inside < self.thickness_m { inside } else { self.thickness_m }
    }

    /// Places the layers of a tissue in space.
    #[must_use]
    pub fn stack(tissue: &Tissue) -> Vec<Slab> {
        tissue
            .layers
            .iter()
            .enumerate()
            .map(|(i, layer)| Slab {
                front_m: tissue.front_m(i),
                thickness_m: layer.thickness_m,
                stiffness_n_per_m: layer.stiffness_n_per_m,
                friction_ns_per_m2: layer.friction_ns_per_m2,
                puncture_n: layer.puncture_n.unwrap_or(f64::INFINITY),
                reach_m: 0.0,
                kappa_per_m: 0.0,
                gripped: 0.0,
            })
            .collect()
    }
}
