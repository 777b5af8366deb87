//! Escapes from local minima of the objective by trying shifted layer boundaries.

use crate::base_law_fit::{with_noise_of, with_updated_times};
use crate::model_comparison::MIN_GAIN_NATS;
use crate::selection_state::Search;
use stylet_identify::fit::{Effort, Fit, fit, fit_if_below};
use stylet_identify::likelihood::FitData;
use stylet_stats::parallel::*;

/// Trial shifts of a layer boundary, in tolerances of the thinner prior of both thicknesses.
const BOUNDARY_SHIFTS: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];

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
        let wanted = leader.nats() - MIN_GAIN_NATS;
        let model = with_updated_times(likeliest.model, &self.data, times);
        fit_if_below(&model, &self.data, Effort::FULL, wanted).filter(|f| f.nats() < wanted)
    }
}
