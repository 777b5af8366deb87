//! Why a diagnosis cannot be made.

/// What is wrong with the input, and what would be right.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// No recording.
    #[error("no recording was given; name at least one with --data")]
    NoRecording,
    /// More layers than a diagnosis tells apart.
    #[error(
        "the scenario has {layers} layers; a diagnosis tells up to {most} apart: take neighbouring layers of one tissue together"
    )]
    TooManyLayers {
        /// Layers of the scenario.
        layers: usize,
        /// Most.
        most: usize,
    },
    /// Too few samples.
    #[error("{name}: {samples} usable sample(s); a diagnosis needs at least {least}")]
    TooShort {
        /// Recording.
        name: String,
        /// Samples.
        samples: usize,
        /// Needed.
        least: usize,
    },
    /// The needle never gets to the tissue.
    #[error(
        "{name}: the needle never reaches the tissue: its largest position is {deepest_m:.6} m, the surface lies at {surface_m:.6} m; \
         {remedy}"
    )]
    NeverReaches {
        /// Recording.
        name: String,
        /// Largest position.
        deepest_m: f64,
        /// Surface.
        surface_m: f64,
        /// What to do.
        remedy: &'static str,
    },
    /// The needle is behind the tissue from the beginning.
    #[error(
        "{name}: the needle begins behind the tissue: its smallest position is {lowest_m:.6} m, the tissue ends at {end_m:.6} m; does \
         position zero mean the same in both? a column map shifts it with position: (name: \"position_m\", offset: {offset_m:.3}), which \
         begins at the surface, or give the scenario the surface_m that the recording has"
    )]
    BeginsBehind {
        /// Recording.
        name: String,
        /// Smallest position.
        lowest_m: f64,
        /// End of the tissue.
        end_m: f64,
        /// Offset that puts the first position to the surface.
        offset_m: f64,
    },
    /// Position in another unit.
    #[error(
        "{name}: positions reach {deepest:.4} where the tissue ends at {end_m:.4} m: this looks like {unit}; give a column map \
         with position: (name: \"position_m\", scale: {scale})"
    )]
    PositionUnit {
        /// Recording.
        name: String,
        /// Largest position.
        deepest: f64,
        /// End of the tissue.
        end_m: f64,
        /// Probable unit.
        unit: &'static str,
        /// Scale that would be right.
        scale: f64,
    },
    /// Force in another unit or sign.
    #[error("{name}: {what}; give a column map with force: (name: \"force_n\", scale: {scale})")]
    Force {
        /// Recording.
        name: String,
        /// What is wrong.
        what: String,
        /// Scale that would be right.
        scale: f64,
    },
    /// Nothing could be fitted.
    #[error("the base law cannot be fitted to these recordings: a replay gives no finite force")]
    NoFit,
}
