//! Compares models by their likelihood under the noise of the larger one, and the BIC.

use stylet_identify::fit::{Effort, Fit, fit_from_zero_scatter};
use stylet_identify::likelihood::FitData;
use stylet_identify::noise::NoiseSource;

/// Smallest gain (nats) of an effect above its BIC penalty; it accounts for the choice among all candidates.
pub const MIN_GAIN_NATS: f64 = 4.0;

/// Confidence (0 to 1) in a cause that gains `surplus_nats` more than its penalty; `competitors` is the sum of the likelihoods of the
/// effects that compete with it, relative to its own.
pub(crate) fn confidence(surplus_nats: f64, competitors: f64) -> f64 {
    1.0 / (1.0 + competitors + libm::exp(-surplus_nats.clamp(-30.0, 30.0) - 3.0))
}

/// Gain in nats of `larger` over `smaller`, both fitted under the noise estimated from the residual of `larger`, with their priors and
/// rupture terms. Gains under another noise are not comparable: small noise makes every model gain much.
pub fn likelihood_gain(smaller: &Fit, larger: &Fit, data: &FitData) -> f64 {
    let larger_data = data.with_estimated_noise(&larger.residuals.residual_n, NoiseSource::Residual);
    let effort = Effort { max_iterations: 3, min_gain_nats: 0.2 };
    let refit = |f: &Fit| fit_from_zero_scatter(&f.model, &larger_data, effort);
    match rayon::join(|| refit(smaller), || refit(larger)) {
        (Some(a), Some(b)) => a.nats() - b.nats(),
        _ => f64::NEG_INFINITY,
    }
}

/// BIC penalty in nats: `parameters / 2 * ln(blocks)` (Schwarz 1978).
pub fn bic_penalty(parameters: usize, blocks: usize) -> f64 {
    0.5 * parameters as f64 * libm::log(blocks.max(2) as f64)
}

#[cfg(test)]
mod tests;
