/// The quantity that a parameter represents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterRole {
    /// Stiffness of a layer (0-based), relative to the assumed one.
    Stiffness(usize),
    /// Friction of a layer, relative to the assumed one.
    Friction(usize),
    /// Puncture force of a layer, relative to the assumed one.
    Puncture(usize),
    /// Position of the surface in m.
    Surface,
    /// Thickness of a layer in m.
    Thickness(usize),
    /// A parameter of an effect, on its fit scale.
    Effect {
        /// Index of the effect in the model.
        effect: usize,
        /// Index of the parameter in the effect.
        parameter: usize,
    },
    /// Surface offset of each recording: one value per recording.
    RecordingSurface,
    /// Log friction factor of each recording.
    RecordingFriction,
    /// Deviation of a varying effect parameter
    /// ([`Model::varying_parameters`](super::Model::varying_parameters)) in each recording.
    RecordingEffect(usize),
    /// Surface offset of a day.
    DaySurface(usize),
    /// Log friction factor of a day.
    DayFriction(usize),
    /// Size of a step of the sensor zero (0-based) in each recording, in N.
    ZeroStep(usize),
    /// Rupture time of a layer (0-based) in each recording, in s.
    RuptureTime(usize),
}

impl ParameterRole {
    /// Whether every recording has its own value.
    pub(crate) fn is_per_recording(self) -> bool {
        matches!(
            self,
            ParameterRole::RecordingSurface
                | ParameterRole::RecordingFriction
                | ParameterRole::RecordingEffect(_)
                | ParameterRole::ZeroStep(_)
                | ParameterRole::RuptureTime(_)
        )
    }
}

/// A free parameter of a fit.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// The quantity.
    pub role: ParameterRole,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Prior mean.
    pub prior_mean: f64,
    /// Prior standard deviation; infinite for a flat prior.
    pub prior_sd: f64,
    /// Step of the finite difference.
    pub step: f64,
}

impl Parameter {
    /// Negative log prior (nats) of a value, without normalisation; zero for a flat prior.
    #[must_use]
    pub fn prior_nats(&self, x: f64) -> f64 {
        if self.prior_sd.is_finite() { 0.5 * ((x - self.prior_mean) / self.prior_sd).powi(2) } else { 0.0 }
    }

    /// Whether a value is within `tolerance` of a bound, as a share of the range (of at most one).
    #[must_use]
    pub fn is_at_bound(&self, x: f64, tolerance: f64) -> bool {
        let margin = tolerance * (self.high - self.low).min(1.0);
        x <= self.low + margin || x >= self.high - margin
    }
}
