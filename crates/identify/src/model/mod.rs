//! The fitted model: base parameters, geometry, effects, per-recording parameters, rupture times.
//!
//! | module | contents |
//! |---|---|
//! | `assumptions`, `effect_term` | assumed tissue with tolerances; an effect with its parameter values |
//! | `free_parameters`, `random_effects` | which parameters are free; parameters of recordings and days and their scatter |
//! | `parameter`, `parameter_bounds`, `parameter_values` | role of a parameter; bounds and prior; its value |
//! | `zero_steps`, `sensor_zero` | steps of the sensor zero in each recording |
//! | `compiled_model` | tissue model and measurement chain of one recording |

mod assumptions;
mod compiled_model;
mod effect_term;
mod free_parameters;
mod parameter;
mod parameter_bounds;
mod parameter_values;
mod random_effects;
mod sensor_zero;
#[cfg(test)]
mod tests;
mod zero_steps;

pub use assumptions::Assumptions;
pub use compiled_model::CompiledModel;
pub use effect_term::EffectTerm;
pub use free_parameters::FreeParameters;
pub use parameter::{Parameter, ParameterRole};
pub use parameter_bounds::MAX_TOLERANCES_WIDE;
pub use random_effects::{
    DayParameters, MAX_VARYING_PARAMETERS, RecordingParameters, Scatter, TiedParameter,
};
pub use zero_steps::ZeroStep;

use std::sync::Arc;
use stylet_tissue::Tissue;

/// Rupture time (s) of a layer that does not rupture.
pub const NO_RUPTURE: f64 = f64::INFINITY;

/// A model with all parameter values.
#[derive(Clone, Debug)]
pub struct Model {
    /// Assumed tissue, known effects and tolerances.
    pub assumed: Arc<Assumptions>,
    /// Tissue with the fitted parameters.
    pub tissue: Tissue,
    /// Effects that are part of the model.
    pub effects: Vec<EffectTerm>,
    /// Which further parameters are free.
    pub free: FreeParameters,
    /// Parameters of each recording.
    pub per_recording: Vec<RecordingParameters>,
    /// Standard deviations between recordings.
    pub scatter: Scatter,
    /// Times (s) at which the recorded force shows the rupture of each layer, per recording.
    pub rupture_times_s: Vec<Vec<f64>>,
    /// Steps of the sensor zero, per recording in order of time; their sizes are fitted.
    pub zero_steps: Vec<Vec<ZeroStep>>,
    /// Effect parameters that are constant or equal to another parameter.
    pub tied: Vec<TiedParameter>,
    /// Day of each recording; empty when days are not modelled.
    pub day_of: Vec<usize>,
    /// Parameters of each day.
    pub days: Vec<DayParameters>,
    /// Whether the standard deviations of random effects are given by the caller instead of updated by a fit.
    pub fixed_scatter: bool,
    /// Delay (s) that determines between which samples the jumps of a delayed force lie; `None` places them at their exact times. The
    /// likelihood is piecewise constant in this delay, so fits start without it ([`crate::delay_refinement`]).
    pub jump_delay_s: Option<f64>,
}

impl Model {
    /// The base law with free surface and thicknesses.
    #[must_use]
    pub fn base(assumptions: Arc<Assumptions>, recordings: usize) -> Self {
        let layers = assumptions.tissue.layers.len();
        Self {
            tissue: assumptions.tissue.clone(),
            effects: Vec::new(),
            free: FreeParameters { surface: true, thickness: true, ..Default::default() },
            per_recording: vec![RecordingParameters::default(); recordings],
            scatter: Scatter::default(),
            rupture_times_s: vec![vec![NO_RUPTURE; layers]; recordings],
            zero_steps: vec![Vec::new(); recordings],
            tied: Vec::new(),
            day_of: Vec::new(),
            days: Vec::new(),
            fixed_scatter: false,
            jump_delay_s: None,
            assumed: assumptions,
        }
    }

    /// The model restricted to some of the recordings; all days are kept.
    #[must_use]
    pub fn subset(&self, which: &[usize]) -> Self {
        let mut model = self.clone();
        model.per_recording = which.iter().map(|r| self.per_recording[*r]).collect();
        model.rupture_times_s = which.iter().map(|r| self.rupture_times_s[*r].clone()).collect();
        model.zero_steps =
            which.iter().map(|r| self.zero_steps.get(*r).cloned().unwrap_or_default()).collect();
        if !self.day_of.is_empty() {
            model.day_of = which.iter().map(|r| self.day_of[*r]).collect();
        }
        model
    }

    /// Indices (effect, parameter) of effect parameters that vary between recordings.
    pub fn varying_parameters(&self) -> impl Iterator<Item = (usize, usize)> {
        let all = self.effects.iter().enumerate().flat_map(|(effect, term)| {
            let varying =
                term.info.parameters.iter().enumerate().filter(|(_, p)| p.between_recordings_sd > 0.0);
            varying.map(move |(parameter, _)| (effect, parameter))
        });
        all.take(MAX_VARYING_PARAMETERS)
    }

    /// Parameters of the day of a recording.
    fn day_parameters(&self, recording: usize) -> DayParameters {
        self.day_of.get(recording).and_then(|d| self.days.get(*d)).copied().unwrap_or_default()
    }

    /// The model with one more effect.
    #[must_use]
    pub fn with_effect(&self, term: EffectTerm) -> Self {
        let mut model = self.clone();
        model.effects.push(term);
        model
    }

    /// The model without one effect.
    #[must_use]
    pub fn without_effect(&self, effect: usize) -> Self {
        let mut model = self.clone();
        model.effects.remove(effect);
        model.tied.retain(|b| b.effect != effect && b.tied_to != Some(effect));
        let down = |e: &mut usize| *e -= usize::from(*e > effect);
        for b in &mut model.tied {
            down(&mut b.effect);
            b.tied_to.as_mut().map(down);
        }
        model
    }

    /// Number of layers.
    #[must_use]
    pub fn layers(&self) -> usize {
        self.tissue.layers.len()
    }

    /// Number of parameters added to the base model: fitted effect parameters, and time and size of each step of the sensor zero.
    #[must_use]
    pub fn effect_parameter_count(&self) -> usize {
        let of_effect = |e: &EffectTerm| e.info.parameters.iter().filter(|p| !p.integer).count();
        self.effects.iter().map(of_effect).sum::<usize>() + 2 * self.zero_step_count()
    }
}
