/// What a number is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterRole {
    /// Stiffness of a layer (0-based).
    Stiffness(usize),
    /// Friction of a layer.
    Friction(usize),
    /// Puncture force of a layer.
    Puncture(usize),
    /// Position of the surface.
    Surface,
    /// Thickness of a layer.
    Thickness(usize),
    /// A parameter of an effect.
    Effect {
        /// Which effect of the model.
        effect: usize,
        /// Which of its parameters.
        parameter: usize,
    },
    /// Surface of each recording's own: as many numbers as recordings.
    RecordingSurface,
    /// Friction of each recording's own.
    RecordingFriction,
    /// One of the numbers that differ between insertions ([`Model::differing`](super::Model::differing)).
    RecordingEffect(usize),
    /// Surface of a day.
    DaySurface(usize),
    /// Friction of a day.
    DayFriction(usize),
    /// The instant of a layer's rupture (0-based), one number per recording.
    RuptureTime(usize),
}

impl ParameterRole {
    /// Whether every recording has such a number of its own.
    #[must_use]
    pub fn is_per_recording(self) -> bool {
        matches!(
            self,
            ParameterRole::RecordingSurface
                | ParameterRole::RecordingFriction
                | ParameterRole::RecordingEffect(_)
                | ParameterRole::RuptureTime(_)
        )
    }
}

/// A number of the fit.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// What it is.
    pub role: ParameterRole,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Middle of the prior.
    pub prior_mean: f64,
    /// Standard deviation of the prior; infinite for none.
    pub prior_sd: f64,
    /// Step of the numeric derivative.
    pub step: f64,
}
