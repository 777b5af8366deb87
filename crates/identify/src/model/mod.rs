//! What is fitted: base parameters, geometry, effects, numbers of each recording's own, instants of ruptures.
//!
//! | module | what |
//! |---|---|
//! | `belief`, `choice` | what is believed, and how surely; an effect under trial |
//! | `free`, `own` | which numbers are free; those of a recording's or a day's own, and how they scatter |
//! | `number`, `bounds`, `values` | what a number is; how far it may go and what is known of it before; its value |
//! | `compiled` | the law and the measuring chain for one recording |

mod belief;
mod bounds;
mod choice;
mod compiled;
mod free;
mod number;
mod own;
#[cfg(test)]
mod tests;
mod values;

pub use belief::Belief;
pub use choice::Choice;
pub use compiled::Compiled;
pub use free::Free;
pub use number::{Number, Role};
pub use own::{Bound, DIFFERING, Day, Own, Scatter};

use std::sync::Arc;
use stylet_tissue::Tissue;

/// The instant (s) of a rupture that never was.
pub const NEVER: f64 = f64::INFINITY;

/// A law with everything that is fitted.
#[derive(Clone, Debug)]
pub struct Model {
    /// What was believed.
    pub belief: Arc<Belief>,
    /// The tissue as fitted.
    pub tissue: Tissue,
    /// The effects under trial.
    pub effects: Vec<Choice>,
    /// Which other numbers are free.
    pub free: Free,
    /// Numbers of each recording's own.
    pub own: Vec<Own>,
    /// Scatter between insertions.
    pub scatter: Scatter,
    /// Instants (s) at which the recorded force shows the rupture of each layer, per recording.
    pub instants: Vec<Vec<f64>>,
    /// Numbers of effects that are not fitted by themselves.
    pub bound: Vec<Bound>,
    /// Per recording the day on which it was made; empty: nobody asks.
    pub day_of: Vec<usize>,
    /// Numbers of each day's own.
    pub days: Vec<Day>,
    /// Spreads between recordings and days stay as they are in a fit: somebody else tells them.
    pub steady: bool,
    /// The delay in s at which the jumps of a late force are put between samples; none: they show at their instants. The likelihood has
    /// steps in it, so that a search begins without.
    pub placed_s: Option<f64>,
}

impl Model {
    /// The base law with its surface and thicknesses free.
    #[must_use]
    pub fn base(belief: Arc<Belief>, recordings: usize) -> Self {
        let layers = belief.tissue.layers.len();
        Self {
            tissue: belief.tissue.clone(),
            effects: Vec::new(),
            free: Free { surface: true, thickness: true, ..Free::default() },
            own: vec![Own::default(); recordings],
            scatter: Scatter::default(),
            instants: vec![vec![NEVER; layers]; recordings],
            bound: Vec::new(),
            day_of: Vec::new(),
            days: Vec::new(),
            steady: false,
            placed_s: None,
            belief,
        }
    }

    /// The same law for some of the recordings; days keep their numbers.
    #[must_use]
    pub fn only(&self, which: &[usize]) -> Self {
        let mut model = self.clone();
        model.own = which.iter().map(|r| self.own[*r]).collect();
        model.instants = which.iter().map(|r| self.instants[*r].clone()).collect();
        if !self.day_of.is_empty() {
            model.day_of = which.iter().map(|r| self.day_of[*r]).collect();
        }
        model
    }

    /// The numbers that differ between insertions as their effects say: effect and parameter.
    pub fn differing(&self) -> impl Iterator<Item = (usize, usize)> {
        let all = self.effects.iter().enumerate().flat_map(|(effect, choice)| {
            let own = choice.info.parameters.iter().enumerate().filter(|(_, p)| p.differs > 0.0);
            own.map(move |(parameter, _)| (effect, parameter))
        });
        all.take(DIFFERING)
    }

    /// The day of a recording.
    fn day(&self, recording: usize) -> Day {
        self.day_of.get(recording).and_then(|d| self.days.get(*d)).copied().unwrap_or_default()
    }

    /// The same with one more effect.
    #[must_use]
    pub fn with(&self, choice: Choice) -> Self {
        let mut model = self.clone();
        model.effects.push(choice);
        model
    }

    /// The same without one effect.
    #[must_use]
    pub fn without(&self, effect: usize) -> Self {
        let mut model = self.clone();
        model.effects.remove(effect);
        model.bound.retain(|b| b.effect != effect && b.like != Some(effect));
        let down = |e: &mut usize| *e -= usize::from(*e > effect);
        for b in &mut model.bound {
            down(&mut b.effect);
            b.like.as_mut().map(down);
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
    pub fn effect_numbers(&self) -> usize {
        self.effects.iter().map(|e| e.info.parameters.iter().filter(|p| !p.whole).count()).sum()
    }
}
