//! What is fitted: base parameters, geometry, effects, numbers of each recording's own, instants of ruptures.
//!
//! | module | what |
//! |---|---|
//! | `belief`, `choice` | what is believed, and how surely; an effect under trial |
//! | `free`, `own` | which numbers are free; those of a recording's or a day's own, and how they scatter |
//! | `number`, `bounds`, `values` | what a number is; how far it may go and what is known of it before; its value |
//! | `compiled` | the law and the measuring chain for one recording |

mod assumptions;
mod compiled_model;
mod effect_term;
mod free_parameters;
mod parameter;
mod parameter_bounds;
mod parameter_values;
mod random_effects;
#[cfg(test)]
mod tests;

pub use assumptions::Assumptions;
pub use compiled_model::CompiledModel;
pub use effect_term::EffectTerm;
pub use free_parameters::FreeParameters;
pub use parameter::{Parameter, ParameterRole};
pub use random_effects::{
    DayParameters, MAX_VARYING_PARAMETERS, RecordingParameters, Scatter, TiedParameter,
};

use std::sync::Arc;
use stylet_tissue::Tissue;

/// The instant (s) of a rupture that never was.
pub const NO_RUPTURE: f64 = f64::INFINITY;

/// A law with everything that is fitted.
#[derive(Clone, Debug)]
pub struct Model {
    /// What was believed.
    pub assumed: Arc<Assumptions>,
    /// The tissue as fitted.
    pub tissue: Tissue,
    /// The effects under trial.
    pub effects: Vec<EffectTerm>,
    /// Which other numbers are free.
    pub free: FreeParameters,
    /// Numbers of each recording's own.
    pub per_recording: Vec<RecordingParameters>,
    /// Scatter between insertions.
    pub scatter: Scatter,
    /// Instants (s) at which the recorded force shows the rupture of each layer, per recording.
    pub rupture_times_s: Vec<Vec<f64>>,
    /// Numbers of effects that are not fitted by themselves.
    pub tied: Vec<TiedParameter>,
    /// Per recording the day on which it was made; empty: nobody asks.
    pub day_of: Vec<usize>,
    /// Numbers of each day's own.
    pub days: Vec<DayParameters>,
    /// Spreads between recordings and days stay as they are in a fit: somebody else tells them.
    pub fixed_scatter: bool,
    /// The delay in s at which the jumps of a late force are put between samples; none: they show at their instants. The likelihood has
    /// steps in it, so that a search begins without.
    pub jump_delay_s: Option<f64>,
}

impl Model {
    /// The base law with its surface and thicknesses free.
    #[must_use]
    pub fn base(belief: Arc<Assumptions>, recordings: usize) -> Self {
        let layers = belief.tissue.layers.len();
        Self {
            tissue: belief.tissue.clone(),
            effects: Vec::new(),
            free: FreeParameters { surface: true, thickness: true, ..FreeParameters::default() },
            per_recording: vec![RecordingParameters::default(); recordings],
            scatter: Scatter::default(),
            rupture_times_s: vec![vec![NO_RUPTURE; layers]; recordings],
            tied: Vec::new(),
            day_of: Vec::new(),
            days: Vec::new(),
            fixed_scatter: false,
            jump_delay_s: None,
            assumed: belief,
        }
    }

    /// The same law for some of the recordings; days keep their numbers.
    #[must_use]
    pub fn subset(&self, which: &[usize]) -> Self {
        let mut model = self.clone();
        model.per_recording = which.iter().map(|r| self.per_recording[*r]).collect();
        model.rupture_times_s = which.iter().map(|r| self.rupture_times_s[*r].clone()).collect();
        if !self.day_of.is_empty() {
            model.day_of = which.iter().map(|r| self.day_of[*r]).collect();
        }
        model
    }

    /// The numbers that differ between insertions as their effects say: effect and parameter.
    pub fn varying_parameters(&self) -> impl Iterator<Item = (usize, usize)> {
        let all = self.effects.iter().enumerate().flat_map(|(effect, choice)| {
            let own =
                choice.info.parameters.iter().enumerate().filter(|(_, p)| p.between_recordings_sd > 0.0);
            own.map(move |(parameter, _)| (effect, parameter))
        });
        all.take(MAX_VARYING_PARAMETERS)
    }

    /// The day of a recording.
    fn day_parameters(&self, recording: usize) -> DayParameters {
        self.day_of.get(recording).and_then(|d| self.days.get(*d)).copied().unwrap_or_default()
    }

    /// The same with one more effect.
    #[must_use]
    pub fn with_effect(&self, choice: EffectTerm) -> Self {
        let mut model = self.clone();
        model.effects.push(choice);
        model
    }

    /// The same without one effect.
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

    /// How many numbers the effects have, and the free geometry.
    #[must_use]
    pub fn effect_parameter_count(&self) -> usize {
        self.effects.iter().map(|e| e.info.parameters.iter().filter(|p| !p.integer).count()).sum()
    }
}
