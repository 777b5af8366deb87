//! Numbers of a recording's or a day's own.

/// Most numbers of effects that differ between insertions in one model.
pub const MAX_VARYING_PARAMETERS: usize = 8;

/// Numbers of one recording's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RecordingParameters {
    /// Position of the surface beyond the common one, in m.
    pub surface_m: f64,
    /// Natural logarithm of the factor on friction.
    pub ln_friction: f64,
    /// What effects say differs between insertions, beyond the common value, in the order of [`Model::differing`](super::Model::differing).
    pub varying: [f64; 8],
}

/// Numbers of one day's own: of recordings that were made with one set-up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DayParameters {
    /// Position of the surface beyond the common one, in m.
    pub surface_m: f64,
    /// Natural logarithm of the factor on friction.
    pub ln_friction: f64,
}

/// A number of an effect that is not fitted by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TiedParameter {
    /// Which effect of the model.
    pub effect: usize,
    /// Which of its parameters.
    pub parameter: usize,
    /// The effect whose same parameter it always equals; none: it stays as it is.
    pub tied_to: Option<usize>,
}

/// How much insertions differ from one another, beyond the law: estimated with each model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Standard deviation of the force at a rupture, relative.
    pub rupture_force: f64,
    /// Standard deviation of the position of a face at which a layer gives way, in m.
    pub rupture_depth_m: f64,
    /// Standard deviation of the surface in m.
    pub surface_m: f64,
    /// Standard deviation of the logarithm of friction.
    pub ln_friction: f64,
    /// Standard deviations of what differs by effects, in the order of [`Model::differing`](super::Model::differing); zero: as the library says.
    pub varying: [f64; 8],
    /// Standard deviation of the surface between days, in m.
    pub day_surface_m: f64,
    /// Standard deviation of the logarithm of friction between days.
    pub day_ln_friction: f64,
}

impl Default for Scatter {
    /// None, and for the numbers of a recording's or day's own wide first guesses.
    fn default() -> Self {
        Self {
            rupture_force: 0.0,
            rupture_depth_m: 0.0,
            surface_m: 1e-3,
            ln_friction: 0.05,
            varying: [0.0; 8],
            day_surface_m: 1e-3,
            day_ln_friction: 0.1,
        }
    }
}
