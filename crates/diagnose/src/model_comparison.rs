//! Whether a larger model is worth its numbers: both under the noise that the larger one leaves.

use stylet_identify::evidence_nats::{Nats, UnderLargerModelNoise};
use stylet_identify::fit::{Effort, Fit, fit_from_zero_scatter};
use stylet_identify::likelihood::FitData;
use stylet_identify::noise::NoiseSource;

/// Nats that an effect must gain beyond half the logarithm of the number of blocks per fitted number.
pub const MIN_GAIN_NATS: f64 = 4.0;

/// What `larger` gains over `smaller` when all that `larger` leaves is noise.
#[must_use]
pub fn likelihood_gain(smaller: &Fit, larger: &Fit, data: &FitData) -> Nats<UnderLargerModelNoise> {
    let own = data.with_estimated_noise(&larger.residuals.residual_n, NoiseSource::Residual);
    let effort = Effort { max_iterations: 3, min_gain_nats: 0.2 };
    let under = |f: &Fit| fit_from_zero_scatter(&f.model, &own, effort);
    match rayon::join(|| under(smaller), || under(larger)) {
        (Some(a), Some(b)) => Nats::new(a.nats() - b.nats()),
        _ => Nats::new(f64::NEG_INFINITY),
    }
}

/// What `numbers` fitted numbers cost with `blocks` compared.
#[must_use]
pub fn bic_penalty(numbers: usize, blocks: usize) -> f64 {
    0.5 * numbers as f64 * libm::log(blocks.max(2) as f64)
}

#[cfg(test)]
mod tests {
    use super::{bic_penalty, likelihood_gain};
    use crate::test_fixtures::{fit_from_truth, recordings_with_added_force};
    use stylet_identify::fit::{Effort, fit};
    use stylet_identify::noise::NoiseSource;
    use stylet_tissue::{AnyEffect, ForceBias, ForceDrift};

    #[test]
    fn a_number_costs_half_the_logarithm_of_the_number_of_blocks() {
        assert!((bic_penalty(3, 700) - 1.5 * 700.0_f64.ln()).abs() < 1e-12);
        assert!((bic_penalty(2, 1) - 2.0_f64.ln()).abs() < 1e-12);
        assert_eq!(bic_penalty(0, 700), 0.0);
    }

    #[test]
    fn a_larger_model_gains_by_the_noise_that_it_leaves_itself() {
        let drift: AnyEffect = ForceDrift { rate_n_per_s: 2e-3 }.into();
        let runs = recordings_with_added_force(&[], &[[4e-3, 3e-4], [6e-3, -3e-4]], |t| 2e-3 * t);
        let with =
            fit_from_truth(&[drift, ForceBias { force_n: 1e-4 }.into()], &runs.iter().collect::<Vec<_>>());
        let data = &with.data;
        let under = |m: &stylet_identify::model::Model| fit(m, data, Effort::FULL).expect("a fit");
        let (no_drift, no_bias) =
            (under(&with.fit.model.without_effect(0)), under(&with.fit.model.without_effect(1)));
        let own = data.with_estimated_noise(&with.fit.residuals.residual_n, NoiseSource::Residual);
        let nats = |m| fit(m, &own, Effort::FULL).expect("a fit").nats();
        let wanted = nats(&no_drift.model) - nats(&with.fit.model);
        let told = likelihood_gain(&no_drift, &with.fit, data).value();
        assert!(wanted > 10.0 && (told / wanted - 1.0).abs() < 0.02, "{told} for {wanted}");
        let told = likelihood_gain(&no_bias, &with.fit, data).value();
        assert!((-0.1..1.5).contains(&told), "{told}");
        // What cannot be replayed gains nothing.
        let mut broken = with.fit.clone();
        broken.model.effects[0].values[0] = f64::NAN;
        assert_eq!(likelihood_gain(&no_bias, &broken, data).value(), f64::NEG_INFINITY);
    }
}
