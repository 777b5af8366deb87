//! A delay to a fraction of a sampling step.
//!
//! Where the speed jumps, so does the friction. A sample lies before such a jump or after it: a delay moves samples across one by one, and
//! the likelihood has a step for each. Derivatives do not see steps. A delay found with the jumps at their instants, which no sampled force shows,
//! is therefore looked for once more on a grid; what the smooth parts of the force say is fitted with the jumps between the samples where they
//! are by then.

use crate::fit::{Effort, Fit, fit};
use crate::likelihood::{FitData, residuals};
use crate::model::{EffectTerm, Model};
use rayon::prelude::*;
use stylet_tissue::Effect;

/// Spacings of the grids, as shares of a sampling step.
const GRID_SPACINGS: [f64; 2] = [0.1, 0.03];
/// Grid points to either side.
const GRID_HALF_POINTS: i32 = 12;

/// The effect that makes the force late, if it is in the search and has the delay as its only number.
fn delay_effect_index(model: &Model) -> Option<usize> {
    let late = |c: &EffectTerm| c.effect().is_some_and(|e| e.delay_s() > 0.0);
    model.effects.iter().position(|c| c.info.parameters.len() == 1 && late(c))
}

/// By how much a model's force is late, in s.
#[must_use]
pub fn delay_s(model: &Model) -> f64 {
    model.compile(0).map_or(0.0, |c| c.delay_s)
}

/// A fit whose force is late, with its jumps between the samples that show them, and the data with what that leaves open; `None` when its
/// force is not late, or is no better so.
#[must_use]
pub fn refine_delay(found: &Fit, data: &FitData) -> Option<(Fit, FitData)> {
    let step_s = data.recordings.iter().map(|b| b.sample_step_s).fold(f64::INFINITY, f64::min);
    let effect = delay_effect_index(&found.model)?;
    let seen = data.with_recordings(
        data.recordings.par_iter().map(|b| b.with_delayed_jump_uncertainty(delay_s(&found.model))).collect(),
    );
    let was = residuals(&found.model, &seen)?;
    let mut best: Option<Fit> = None;
    // Fine steps about what the coarse ones led to.
    for spacing_s in GRID_SPACINGS.map(|share| share * step_s) {
        let about = best.as_ref().unwrap_or(found).model.clone();
        let from_s = delay_s(&about);
        let at = |k: i32| {
            let to_s = from_s + spacing_s * f64::from(k);
            let mut model = Model { jump_delay_s: Some(to_s), ..about.clone() };
            model.effects[effect] = EffectTerm::new(model.effects[effect].info, &[to_s]);
            let nats = if to_s > 0.0 { residuals(&model, &seen)?.nats } else { return None };
            Some((nats, model))
        };
        let tried: Vec<(f64, Model)> =
            (-GRID_HALF_POINTS..=GRID_HALF_POINTS).into_par_iter().filter_map(at).collect();
        let likeliest = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let Some(next) = likeliest.and_then(|(_, model)| fit(&model, &seen, Effort::FULL)) else { continue };
        if best.as_ref().is_none_or(|b| next.nats() < b.nats()) {
            best = Some(next);
        }
    }
    best.filter(|b| b.nats() < was.nats).map(|better| (better, seen))
}
