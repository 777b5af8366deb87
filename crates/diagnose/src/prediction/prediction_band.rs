//! Prediction band of a new recording.

use super::group_deviation::Values;
use super::group_update::GroupEstimate;
use super::insertion_course::{Curve, value_at};
use super::prepared::Prepared;
use super::target::Target;
use super::uncertainty::{DRAWS, SEED};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use stylet_stats::order_statistics::quantile_of_sorted;

/// Nominal coverage of the band.
pub const BAND_LEVEL: f64 = 0.9;
/// Number of equally likely noise values per draw, which smooth its quantiles.
const NOISE_VALUES: usize = 9;
impl Prepared<'_> {
    /// Prediction band of a recording: lower and upper edge (N) per block for a group with deviation `deviation`. In an unseen group
    /// (`is_unseen`), the mean residual may not recur and counts as discrepancy; so does `extra_misfit_n`.
    pub fn band(
        &self,
        target: &Target,
        group: &GroupEstimate,
        deviation: Values,
        is_unseen: bool,
        extra_misfit_n: f64,
    ) -> (Vec<f64>, Vec<f64>) {
        let r = target.r;
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let draws: Vec<Vec<f64>> = (0..DRAWS)
            .filter_map(|_| {
                let model = self.uncertainty.draw(&self.model, r, &mut rng);
                let off = group.draw(&std::array::from_fn(|_| StandardNormal.sample(&mut rng)));
                let at: Values = std::array::from_fn(|k| deviation[k] + off[k]);
                self.force_of(&model, r, &at, &target.mean_residual)
            })
            .collect();
        band_edges(&draws, |k| libm::hypot(self.misfit_sd_n(target, k, is_unseen), extra_misfit_n))
    }

    /// Standard deviation (N) of noise and discrepancy in block `k`.
    fn misfit_sd_n(&self, target: &Target, k: usize, is_unseen: bool) -> f64 {
        let noise_n = self.uncertainty.block_n;
        let Some((t, place)) = self.training.zip(target.places.get(k)) else { return noise_n };
        let of = |curve: &Curve| value_at(curve, *place).unwrap_or(0.0);
        let missing_n = if is_unseen { of(&target.mean_residual) } else { 0.0 };
        libm::hypot(libm::hypot(noise_n, of(&t.discrepancy_sd_n)), missing_n)
    }
}

/// Lower and upper edge (N) per block from drawn forces plus noise of standard deviation `sd_n`.
pub fn band_edges(draws: &[Vec<f64>], sd_n: impl Fn(usize) -> f64) -> (Vec<f64>, Vec<f64>) {
    let blocks = draws.first().map_or(0, Vec::len);
    let (mut low, mut high) = (Vec::with_capacity(blocks), Vec::with_capacity(blocks));
    let mut values = Vec::with_capacity(draws.len() * NOISE_VALUES);
    for k in 0..blocks {
        values.clear();
        let noise = noise_values(sd_n(k));
        for draw in draws {
            values.extend(noise.iter().map(|x| draw[k] + x));
        }
        values.sort_unstable_by(f64::total_cmp);
        low.push(quantile_of_sorted(&values, 0.5 * (1.0 - BAND_LEVEL)));
        high.push(quantile_of_sorted(&values, 0.5 * (1.0 + BAND_LEVEL)));
    }
    (low, high)
}

/// Equally likely noise values with standard deviation `sd_n`.
fn noise_values(sd_n: f64) -> [f64; NOISE_VALUES] {
    let at: [f64; NOISE_VALUES] =
        std::array::from_fn(|k| stylet_stats::normal::quantile((k as f64 + 0.5) / NOISE_VALUES as f64));
    let scale = (at.iter().map(|x| x * x).sum::<f64>() / NOISE_VALUES as f64).sqrt();
    at.map(|x| x / scale * sd_n)
}

#[cfg(test)]
mod tests;
