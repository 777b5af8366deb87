use stylet_tissue::{AnyEffect, EffectInfo, Tissue, general_effects};

/// Tissue assumed before any measurement, with tolerances that define priors and bounds.
#[derive(Clone, Debug)]
pub struct Assumptions {
    /// Assumed tissue.
    pub tissue: Tissue,
    /// Effects that the assumed model already contains.
    pub known_effects: Vec<AnyEffect>,
    /// Candidate effects outside the library.
    pub further_effects: Vec<&'static EffectInfo>,
    /// Relative tolerance of stiffness, friction and puncture force, per layer.
    pub tolerance: Vec<f64>,
    /// Relative tolerance of the thickness, per layer.
    pub thickness_tolerance: Vec<f64>,
    /// Tolerance of the surface position in m.
    pub surface_tolerance_m: f64,
}

impl Assumptions {
    /// Relative tolerance from which a thickness counts as guessed: half of its value.
    pub const GUESSED_TOLERANCE: f64 = 0.5;

    /// Relative tolerance of stiffness, friction and puncture force for values that are only guessed.
    pub const WEAK_TOLERANCE: f64 = 1.0;

    /// The same tissue with weak priors on its layers.
    #[must_use]
    pub fn with_weak_priors(&self) -> Self {
        let mut out = self.clone();
        out.tolerance.fill(Self::WEAK_TOLERANCE);
        out.thickness_tolerance.fill(Self::GUESSED_TOLERANCE);
        out
    }

    /// The candidate effects: those of the library, then the further ones.
    pub fn candidates(&self) -> impl Iterator<Item = &'static EffectInfo> {
        general_effects().chain(self.further_effects.iter().copied())
    }

    /// Whether all thicknesses are guessed, so that a fitted layer boundary gives no evidence for an effect that moves boundaries.
    #[must_use]
    pub fn is_geometry_guessed(&self) -> bool {
        self.thickness_tolerance.iter().all(|t| *t >= Self::GUESSED_TOLERANCE)
    }
}
