//! Prediction of an insertion that nobody has seen: the mean over the population and its 90 % band.

use crate::fit::Fit;
use crate::forward;
use crate::population::{Population, part};
use crate::run::{Columns, Run};
use crate::shape::Ingredient;
use crate::stats::normal_quantile;

/// Draws from the population.
pub const DRAWS: usize = 64;

/// A prediction.
#[derive(Clone, Debug, Default)]
pub struct Prediction {
    /// Mean force in N.
    pub mean: Vec<f64>,
    /// Lower end of the 90 % band in N; empty when none was asked for.
    pub low: Vec<f64>,
    /// Upper end.
    pub high: Vec<f64>,
}

/// The law with the population's rate dependence.
#[must_use]
pub fn law_of(fit: &Fit, population: &Population) -> crate::shape::Shape {
    let mut shape = fit.shape.clone();
    shape.alpha = if shape.has(Ingredient::RatePuncture) { population.alpha } else { 0.0 };
    shape
}

/// Forces of the drawn insertions over a motion, those that can be simulated.
#[must_use]
pub fn draws(fit: &Fit, population: &Population, data: &Columns, count: usize) -> Vec<Vec<f64>> {
    let shape = law_of(fit, population);
    population
        .draws(count)
        .iter()
        .filter_map(|own| {
            let mut force = Vec::new();
            forward::free(&shape, &fit.x, own, data, &mut force).then_some(force)
        })
        .collect()
}

/// Mean force over the population.
#[must_use]
pub fn mean(fit: &Fit, population: &Population, data: &Columns, count: usize) -> Vec<f64> {
    average(&draws(fit, population, data, count), data.t.len())
}

fn average(forces: &[Vec<f64>], samples: usize) -> Vec<f64> {
    (0..samples).map(|i| forces.iter().map(|f| f[i]).sum::<f64>() / forces.len().max(1) as f64).collect()
}

/// Mean and band for a run's own motion. The band holds 90 % of the drawn forces, each with the scatter
/// that the law leaves in that part of an insertion.
#[must_use]
pub fn predict(fit: &Fit, population: &Population, run: &Run) -> Prediction {
    let data = run.columns();
    let forces = draws(fit, population, &data, DRAWS);
    if forces.is_empty() {
        return Prediction::default();
    }
    // Quantiles of a normal distribution in five pieces of equal share.
    let pieces: Vec<f64> = (0..5).map(|k| normal_quantile(0.1 + 0.2 * f64::from(k))).collect();
    let mut out = Prediction { mean: average(&forces, data.t.len()), ..Prediction::default() };
    let mut all = Vec::with_capacity(forces.len() * pieces.len());
    for i in 0..data.t.len() {
        // Nobody knows beforehand where the puncture comes: what follows it is told by the mean prediction's drawing.
        let scatter = population.residual_n[part(run, i)];
        all.clear();
        for f in &forces {
            all.extend(pieces.iter().map(|q| f[i] + scatter * q));
        }
        let n = all.len();
        let (low, high) = (n / 20, n - 1 - n / 20);
        all.select_nth_unstable_by(low, f64::total_cmp);
        out.low.push(all[low]);
        all.select_nth_unstable_by(high, f64::total_cmp);
        out.high.push(all[high]);
    }
    out
}
