//! The true tissue.

/// One layer (docs/reference/model.md, section 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Thickness `d_i` in m.
    pub thickness_m: f64,
    /// Stiffness `K_i` in N/m.
    pub stiffness_n_per_m: f64,
    /// Viscous friction per metre of needle inside, `b_i` in N s/m².
    pub friction_ns_per_m2: f64,
    /// Puncture force `F_i` in N; none: only the far face ends the layer.
    pub puncture_n: Option<f64>,
}

/// A stack of layers behind a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Tissue {
    /// Front face of the first layer in m.
    pub surface_m: f64,
    /// The layers in the order in which the needle meets them.
    pub layers: Vec<Layer>,
}

impl Tissue {
    /// Front face of layer `index` (0-based) in m; behind the last one the far face of the stack.
    #[must_use]
    pub fn front_m(&self, index: usize) -> f64 {
        self.surface_m
            + self.layers[..index.min(self.layers.len())].iter().map(|l| l.thickness_m).sum::<f64>()
    }

    /// Far face of the stack in m.
    #[must_use]
    pub fn end_m(&self) -> f64 {
        self.front_m(self.layers.len())
    }
}
