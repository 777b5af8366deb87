//! Layers of a tissue, as scenarios describe them.

use alloc::string::String;
use alloc::vec::Vec;

/// One layer of the base law (docs/reference/model.md, Symbols; multi-layer model, supplement eq. 4).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Layer {
    /// Name, for reports.
    #[cfg_attr(feature = "serde", serde(default))]
    pub name: String,
    /// Thickness `d_i` in metres, positive.
    pub thickness_m: f64,
    /// Stiffness `K_i` in N/m, zero or positive: `f_K = K_i (z - s_i)` until the layer ruptures.
    pub stiffness_n_per_m: f64,
    /// Viscous friction per metre of needle inside the layer, `b_i` in N s/m², zero or positive.
    pub friction_ns_per_m2: f64,
    /// Puncture force `F_i` in N, at which the layer ruptures before its far face; absent: it ruptures at its far face.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub puncture_n: Option<f64>,
}

/// A stack of layers.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Tissue {
    /// Position of the first layer's front face along the insertion axis, in metres.
    #[cfg_attr(feature = "serde", serde(default))]
    pub surface_m: f64,
    /// The layers, in the order in which the needle meets them; at least one.
    pub layers: Vec<Layer>,
}

impl Tissue {
    /// The paper's phantom of Fig. 12: three layers of isinglass gel (25, 50 and 70 %), 98.1 mm in all, latex
    /// around the second, which ruptures at 2.2 N.
    #[must_use]
    pub fn three_gels() -> Self {
        let layer = |name: &str, thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n| Layer {
            name: name.into(),
            thickness_m,
            stiffness_n_per_m,
            friction_ns_per_m2,
            puncture_n,
        };
        Self {
            surface_m: 0.0,
            layers: alloc::vec![
                layer("isinglass 25 %", 0.0282, 40.0, 9000.0, None),
                layer("isinglass 50 % in latex", 0.0377, 60.0, 12000.0, Some(2.2)),
                layer("isinglass 70 %", 0.0322, 80.0, 16000.0, None),
            ],
        }
    }

    /// Position of the front face `s_i` of layer `index` (0-based), in metres; with
    /// `index = layers.len()` the far face of the stack.
    #[must_use]
    pub fn front_m(&self, index: usize) -> f64 {
        self.layers.iter().take(index).fold(self.surface_m, |s, layer| s + layer.thickness_m)
    }

    /// Position of the far face of the last layer, in metres.
    #[must_use]
    pub fn end_m(&self) -> f64 {
        self.front_m(self.layers.len())
    }
}
