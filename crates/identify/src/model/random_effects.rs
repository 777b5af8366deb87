//! Random effects: parameters of recordings and days, and their standard deviations.

/// Largest number of varying effect parameters in one model: the length of the fixed arrays below.
pub const MAX_VARYING_PARAMETERS: usize = 8;

/// Parameters of one recording.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RecordingParameters {
    /// Surface offset from the shared position, in m.
    pub surface_m: f64,
    /// Natural logarithm of the friction factor.
    pub ln_friction: f64,
    /// Deviations of varying effect parameters, in the order of
    /// [`Model::varying_parameters`](super::Model::varying_parameters).
    pub varying: [f64; 8],
}

/// Parameters of one day, shared by the recordings made with one set-up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DayParameters {
    /// Surface offset from the shared position, in m.
    pub surface_m: f64,
    /// Natural logarithm of the friction factor.
    pub ln_friction: f64,
}

/// An effect parameter that is constant or equal to another parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TiedParameter {
    /// Index of the effect in the model.
    pub effect: usize,
    /// Index of the parameter in the effect.
    pub parameter: usize,
    /// The effect whose parameter of the same index it equals; `None` keeps it constant.
    pub tied_to: Option<usize>,
}

/// Standard deviations between recordings and between days, estimated with each model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Relative standard deviation of the force at rupture.
    pub rupture_force: f64,
    /// Standard deviation of the depth of an interface at rupture, in m.
    pub rupture_depth_m: f64,
    /// Standard deviation of the surface position in m.
    pub surface_m: f64,
    /// Standard deviation of the logarithm of friction.
    pub ln_friction: f64,
    /// Standard deviations of varying effect parameters, in the order of
    /// [`Model::varying_parameters`](super::Model::varying_parameters); zero: the library's value.
    pub varying: [f64; 8],
    /// Standard deviation of the surface position between days, in m.
    pub day_surface_m: f64,
    /// Standard deviation of the logarithm of friction between days.
    pub day_ln_friction: f64,
}

impl Default for Scatter {
    /// No rupture scatter; wide initial values for the other standard deviations.
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
