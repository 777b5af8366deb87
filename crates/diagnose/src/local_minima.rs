//! Escapes from local minima of the objective by trying shifted layer boundaries and other breaking forces.

use crate::base_law_fit::{with_noise_of, with_updated_times};
use crate::model_comparison::MIN_GAIN_NATS;
use crate::selection_state::Search;
use stylet_identify::fit::{Effort, Fit, fit, fit_if_below};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::{EffectTerm, Model};
use stylet_stats::parallel::*;
use stylet_tissue::Proposal;

/// Trial shifts of a layer boundary, in tolerances of the thinner prior of both thicknesses.
const BOUNDARY_SHIFTS: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
/// Largest factor by which the breaking force is varied, up and down.
const STRENGTH_FACTOR: f64 = 3.0;
/// Steps of that variation in each direction with fixed rupture times.
const FIXED_TIME_STEPS: i32 = 40;
/// Steps of that variation in each direction with updated rupture times, which cost more.
const UPDATED_TIME_STEPS: i32 = 10;
/// Number of local minima of that variation from which a fit starts.
const MAX_MINIMA: usize = 5;

impl Search {
    /// The leading candidate with one layer boundary shifted, if it leaves structure and the shift improves it. A boundary that was fitted
    /// to the ruptures of an incomplete model is in a local minimum.
    pub(crate) fn with_boundary_moved(
        &self,
        leader: &Fit,
        coarse: &FitData,
        times: &[Vec<f64>],
    ) -> Option<Fit> {
        if !leader.model.free.thickness || self.leaves_noise(leader) {
            return None;
        }
        let coarse = with_noise_of(&leader.model, coarse)?;
        let assumed = &leader.model.assumed;
        let tolerance_m = |l: usize| assumed.thickness_tolerance[l] * assumed.tissue.layers[l].thickness_m;
        let moved = |l: usize, tolerances: f64| {
            let shift_m = tolerances * tolerance_m(l).min(tolerance_m(l + 1));
            let mut model = leader.model.clone();
            model.tissue.layers[l].thickness_m += shift_m;
            model.tissue.layers[l + 1].thickness_m -= shift_m;
            fit(&with_updated_times(model, &coarse, times), &coarse, Effort::SHORT)
        };
        let boundaries = 0..leader.model.layers().saturating_sub(1);
        let tried: Vec<(usize, f64)> = boundaries.flat_map(|l| BOUNDARY_SHIFTS.map(|m| (l, m))).collect();
        let fits: Vec<Fit> = tried.into_par_iter().filter_map(|(l, m)| moved(l, m)).collect();
        let likeliest = fits.into_iter().min_by(|a, b| a.nats().total_cmp(&b.nats()))?;
        self.full_fit_below(likeliest.model, times, leader.nats() - MIN_GAIN_NATS)
    }

    /// The leading candidate with another breaking force, if that improves it. With a reversal of the motion the break can lie before or
    /// after it, which gives two local minima, and fitted rupture times keep the fit in one of them.
    pub(crate) fn with_other_strength(
        &self,
        leader: &Fit,
        coarse: &FitData,
        times: &[Vec<f64>],
    ) -> Option<Fit> {
        let last = leader.model.effects.last().filter(|e| e.info.proposal == Proposal::MembraneRupture)?;
        let coarse = with_noise_of(&leader.model, coarse)?;
        let rest = leader.model.without_effect(leader.model.effects.len() - 1);
        // Local minima along the breaking force: fine with fixed rupture times, coarse with updated ones.
        let along = |steps: i32, update: bool| -> Vec<(f64, Model)> {
            let at = |choice: EffectTerm| {
                let model = rest.with_effect(choice);
                let model = if update { with_updated_times(model, &coarse, times) } else { model };
                Some((residuals(&model, &coarse)?.nats, model))
            };
            let tried: Vec<(f64, Model)> =
                breaking_force_variations(last, steps).into_par_iter().filter_map(at).collect();
            let lowest = |k: usize| {
                let neighbours = [k.checked_sub(1), Some(k + 1)].into_iter().flatten();
                neighbours.filter_map(|k| tried.get(k)).all(|b| tried[k].0 < b.0)
            };
            (0..tried.len()).filter(|k| lowest(*k)).map(|k| tried[k].clone()).collect()
        };
        let mut minima = along(FIXED_TIME_STEPS, false);
        minima.extend(along(UPDATED_TIME_STEPS, true));
        minima.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut fits: Vec<Fit> = minima
            .into_iter()
            .take(MAX_MINIMA)
            .into_par_iter()
            .filter_map(|(_, model)| fit(&with_updated_times(model, &coarse, times), &coarse, Effort::SHORT))
            .collect();
        fits.sort_by(|a, b| a.nats().total_cmp(&b.nats()));
        let wanted = leader.nats() - MIN_GAIN_NATS;
        let full = |f: &Fit| self.full_fit_below(f.model.clone(), times, wanted);
        let fitted = fits.iter().take(2).into_par_iter().filter_map(full).collect::<Vec<Fit>>();
        fitted.into_iter().min_by(|a, b| a.nats().total_cmp(&b.nats()))
    }

    /// Full fit with updated rupture times; `None` if its objective does not fall below `wanted` nats.
    fn full_fit_below(&self, model: Model, times: &[Vec<f64>], wanted: f64) -> Option<Fit> {
        let model = with_updated_times(model, &self.data, times);
        fit_if_below(&model, &self.data, Effort::FULL, wanted).filter(|f| f.nats() < wanted)
    }
}

/// Index of the breaking force among the parameters of an effect.
fn breaking_force_index(at: &EffectTerm) -> Option<usize> {
    at.info.parameters.iter().position(|p| p.unit == "N")
}

/// The effect with lower and higher breaking forces, in ascending order.
fn breaking_force_variations(at: &EffectTerm, steps: i32) -> Vec<EffectTerm> {
    let index = breaking_force_index(at);
    let with = |k: i32| {
        let mut values = at.values.clone();
        *values.get_mut(index?)? *= libm::pow(STRENGTH_FACTOR, f64::from(k) / f64::from(steps));
        Some(EffectTerm::new(at.info, &values))
    };
    (-steps..=steps).filter_map(with).collect()
}
