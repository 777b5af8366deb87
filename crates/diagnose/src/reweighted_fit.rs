//! Iteratively reweighted fit for data with an unmodelled force.
//!
//! Under the sensor noise, a large unmodelled force biases true effects and leads to the selection of imitations. Such a force is usually
//! local, for example in depth. Each block is therefore weighted by the local residual, scaled for its correlation (iteratively reweighted
//! least squares, Beaton and Tukey 1974), so that regions with small residuals determine the effects.

use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::FitData;

/// Half width (s) of the window in which the local residual is averaged.
const HALF_WINDOW_S: f64 = 0.25;
/// Ratio of the local residual to the noise from which it counts as unexplained.
const MIN_RESIDUAL_SD: f64 = 1.5;
/// Iterations of weighting and fitting.
const ITERATIONS: usize = 4;

/// Reweighted fit, and the data with the final weights.
pub fn fit_reweighted(best: &Fit, data: &FitData) -> Option<(Fit, FitData)> {
    let mut f = best.clone();
    let mut weighted = data.clone();
    for _ in 0..ITERATIONS {
        weighted = reweighted_data(&f, data);
        f = fit(&f.model, &weighted, Effort { max_iterations: 3, min_gain_nats: 0.1 })?;
    }
    Some((f, weighted))
}

/// The data with the local residual of a fit as additional standard deviation.
fn reweighted_data(f: &Fit, data: &FitData) -> FitData {
    let of =
        |(b, e): (&BlockAverages, &Vec<f64>)| b.clone().with_unmodelled_sd(local_residual_sd(b, e, data));
    data.with_recordings(data.recordings.iter().zip(&f.residuals.residual_n).map(of).collect())
}

/// Standard deviation (N) of the residual around every block, scaled for its correlation; 0 if it does not exceed the noise by
/// [`MIN_RESIDUAL_SD`].
fn local_residual_sd(b: &BlockAverages, e: &[f64], data: &FitData) -> Vec<f64> {
    let half = (HALF_WINDOW_S / b.block_s()).round().max(1.0) as usize;
    let square = |k: usize| if b.used[k] { (e[k] * e[k], 1.0) } else { (0.0, 0.0) };
    (0..b.len())
        .map(|k| {
            let around = k.saturating_sub(half)..(k + half + 1).min(b.len());
            let (sum, n) = around.map(square).fold((0.0, 0.0), |a, s| (a.0 + s.0, a.1 + s.1));
            let residual_sd_n = (sum / f64::max(n, 1.0)).sqrt();
            let sd = data.noise.bin_at(b.abs_force_n[k]).sd_n;
            if residual_sd_n > MIN_RESIDUAL_SD * sd { residual_sd_n * n.sqrt() } else { 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests;
