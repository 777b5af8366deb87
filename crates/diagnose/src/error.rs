//! Errors of a diagnosis.

/// Why a diagnosis is refused, and how to correct the input.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// No recording.
    #[error("no recording was given; name at least one with --data")]
    NoRecording,
    /// No layers to start from.
    #[error(
        "no recording begins in air and then meets tissue, so there are no layers to start from; look at `stylet enhance`'s report, or name a \
         scenario"
    )]
    NoContact,
    /// The recordings show fewer layers than requested.
    #[error(
        "the recordings show {found} layer(s), not {asked}; leave the number away, or describe the layers in a scenario"
    )]
    FewerLayers {
        /// Requested number of layers.
        asked: usize,
        /// Layers found.
        found: usize,
    },
    /// More layers than a diagnosis can distinguish.
    #[error(
        "the scenario has {layers} layers; a diagnosis distinguishes up to {most}: merge neighbouring layers of the same tissue"
    )]
    TooManyLayers {
        /// Layers of the scenario.
        layers: usize,
        /// Upper limit.
        most: usize,
    },
    /// Too few samples.
    #[error("{name}: {samples} usable sample(s); a diagnosis needs at least {least}")]
    TooShort {
        /// Recording.
        name: String,
        /// Samples.
        samples: usize,
        /// Required samples.
        least: usize,
    },
    /// The needle never reaches the tissue.
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
        /// Remedy.
        remedy: &'static str,
    },
    /// The needle starts behind the tissue.
    #[error(
        "{name}: the needle begins behind the tissue: its smallest position is {lowest_m:.6} m, the tissue ends at {end_m:.6} m; does \
         position zero mean the same in both? a column map shifts it with position: (name: \"...\", offset: {offset_m:.3}) with the name in your file, which \
         begins at the surface, or give the scenario the surface_m that the recording has"
    )]
    BeginsBehind {
        /// Recording.
        name: String,
        /// Smallest position.
        lowest_m: f64,
        /// End of the tissue.
        end_m: f64,
        /// Offset that moves the first position to the surface.
        offset_m: f64,
    },
    /// Positions in another unit.
    #[error(
        "{name}: positions reach {deepest:.4} where the tissue ends at {end_m:.4} m: this looks like {unit}; give a column map \
         with position: (name: \"...\", scale: {scale}) and the name in your file"
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
        /// Scale that would correct it.
        scale: f64,
    },
    /// Time in another unit.
    #[error(
        "{name}: it lasts {duration_s:.4} s, and {expected}: the time looks like {unit}; give a \
         column map with time: (name: \"...\", scale: {scale}) and the name in your file"
    )]
    TimeUnit {
        /// Recording.
        name: String,
        /// Its duration as read.
        duration_s: f64,
        /// What the scenario expects.
        expected: String,
        /// Probable unit.
        unit: &'static str,
        /// Scale that would correct it.
        scale: &'static str,
    },
    /// Force with another unit or sign.
    #[error(
        "{name}: {what}; give a column map with force: (name: \"...\", scale: {scale}) and the name in your file"
    )]
    Force {
        /// Recording.
        name: String,
        /// What is wrong.
        what: String,
        /// Scale that would correct it.
        scale: f64,
    },
    /// The check rates the recordings unusable.
    #[error(
        "a diagnosis of these recordings would mean nothing: {reasons}; look at `stylet check`; `stylet diagnose --force` goes on all the same"
    )]
    Unusable {
        /// The reasons.
        reasons: String,
    },
    /// The diagnosis does not have the curves of its recordings.
    #[error(
        "the diagnosis.json of the model does not have the curves of its recordings (`training`); repeat the diagnosis"
    )]
    NoTrainingSummary,
    /// The base law could not be fitted.
    #[error("the base law cannot be fitted to these recordings: a replay gives no finite force")]
    NoFit,
}

impl DiagnoseError {
    /// Whether the recordings can still be diagnosed with `force`: only their units, signs or reach differ from the scenario.
    #[must_use]
    pub fn is_implausible(&self) -> bool {
        matches!(
            self,
            Self::NeverReaches { .. }
                | Self::BeginsBehind { .. }
                | Self::PositionUnit { .. }
                | Self::TimeUnit { .. }
                | Self::Force { .. }
        )
    }
}
