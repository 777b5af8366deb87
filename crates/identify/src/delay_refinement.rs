//! Refines an estimated force delay to a fraction of the sampling interval by a grid search.
//!
//! Friction jumps with the velocity. As the delay grows, samples cross such a jump one by one, so the likelihood is piecewise constant in
//! the delay and has no useful derivative. On a grid of delays the jumps are placed between the corresponding samples and the smooth part
//! of the force is refitted.

use crate::fit::{Effort, Fit, fit};
use crate::likelihood::{FitData, residuals};
use crate::model::{EffectTerm, Model};
use stylet_stats::parallel::*;
use stylet_tissue::Effect;

/// Grid spacings of the two passes, as shares of the sampling interval.
const GRID_SPACINGS: [f64; 2] = [0.1, 0.03];
/// Grid points on either side of the current delay.
const GRID_HALF_POINTS: i32 = 12;

/// Index of the model's delay effect, if it has the delay as its only parameter.
fn delay_effect_index(model: &Model) -> Option<usize> {
    let is_delayed = |c: &EffectTerm| c.effect().is_some_and(|e| e.delay_s() > 0.0);
    model.effects.iter().position(|c| c.info.parameters.len() == 1 && is_delayed(c))
}

/// Delay of the force in s.
#[must_use]
pub fn delay_s(model: &Model) -> f64 {
    model.compile(0).map_or(0.0, |c| c.delay_s)
}

/// Best fit over the delay grid, and the data with the timing uncertainty that remains. `None` when the force is not delayed or the fit
/// does not improve.
#[must_use]
pub fn refine_delay(found: &Fit, data: &FitData) -> Option<(Fit, FitData)> {
    let step_s = data.recordings.iter().map(|b| b.sample_step_s).fold(f64::INFINITY, f64::min);
    let effect = delay_effect_index(&found.model)?;
    let delayed = data.with_recordings(
        data.recordings.par_iter().map(|b| b.with_delayed_jump_uncertainty(delay_s(&found.model))).collect(),
    );
    let was = residuals(&found.model, &delayed)?;
    let mut best: Option<Fit> = None;
    // The finer grid is centred on the result of the coarser one.
    for spacing_s in GRID_SPACINGS.map(|share| share * step_s) {
        let about = best.as_ref().unwrap_or(found).model.clone();
        let from_s = delay_s(&about);
        let at = |k: i32| {
            let to_s = from_s + spacing_s * f64::from(k);
            let mut model = Model { jump_delay_s: Some(to_s), ..about.clone() };
            model.effects[effect] = EffectTerm::new(model.effects[effect].info, &[to_s]);
            let nats = if to_s > 0.0 { residuals(&model, &delayed)?.nats } else { return None };
            Some((nats, model))
        };
        let tried: Vec<(f64, Model)> =
            (-GRID_HALF_POINTS..=GRID_HALF_POINTS).into_par_iter().filter_map(at).collect();
        let likeliest = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let Some(next) = likeliest.and_then(|(_, model)| fit(&model, &delayed, Effort::FULL)) else {
            continue;
        };
        if best.as_ref().is_none_or(|b| next.nats() < b.nats()) {
            best = Some(next);
        }
    }
    best.filter(|b| b.nats() < was.nats).map(|better| (better, delayed))
}
