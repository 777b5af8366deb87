//! Output of the force law: the force of one sample with its ground truth, and ruptures.

/// The force of one sample with its components (docs/reference/model.md, Symbols).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TissueForce {
    /// Total force `f` at the needle's base in N; positive resists the insertion.
    pub total_n: f64,
    /// Elastic force `f_K` of the active layer in N.
    pub elastic_n: f64,
    /// Friction `f_B` along the whole shaft in N.
    pub friction_n: f64,
    /// Other forces at the tip (effects: cutting, incomplete release, ...) in N.
    pub tip_extra_n: f64,
    /// Cumulative friction of the ruptured layers, `D = sum b_j l_j`, in N s/m.
    pub cumulative_friction_ns_per_m: f64,
    /// Tip force in N, the target of force enhancement: `f` without the friction of the passed layers along the shaft,
    /// viscous (`D v`), dry and presliding.
    pub tip_n: f64,
    /// Active layer, 1-based; number of layers + 1 after the last rupture.
    pub active_layer: usize,
}

impl TissueForce {
    /// The force of a sample that is not finite.
    pub(crate) fn not_finite(active_layer: usize) -> Self {
        let nan = f64::NAN;
        Self {
            total_n: nan,
            elastic_n: nan,
            friction_n: nan,
            tip_extra_n: nan,
            cumulative_friction_ns_per_m: nan,
            tip_n: nan,
            active_layer,
        }
    }
}

/// A rupture of a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rupture {
    /// Layer, 1-based.
    pub layer: usize,
    /// Time in seconds, interpolated between the two samples around it.
    pub time_s: f64,
    /// Tip position at that time in metres, relative to the tissue.
    pub position_m: f64,
    /// Elastic force that was released, in N.
    pub released_n: f64,
    /// Whether the puncture force was reached; otherwise the tip reached the far face.
    pub by_force: bool,
}
