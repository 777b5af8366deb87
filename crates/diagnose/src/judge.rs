//! Whether a larger model is worth its numbers: both under the noise that the larger one leaves.

use stylet_identify::fit::{Effort, Fit, fit_sharp};
use stylet_identify::nats::{Nats, OfTheLarger};
use stylet_identify::noise::From;
use stylet_identify::objective::Data;

/// Nats that an effect must gain beyond half the logarithm of the number of blocks per fitted number.
pub const LEAST: f64 = 4.0;

/// What `larger` gains over `smaller` when all that `larger` leaves is noise.
#[must_use]
pub fn gain(smaller: &Fit, larger: &Fit, data: &Data) -> Nats<OfTheLarger> {
    let own = data.judged_by(&larger.residuals.e, From::Whole);
    let effort = Effort { turns: 3, enough: 0.2 };
    let under = |f: &Fit| fit_sharp(&f.model, &own, effort);
    match rayon::join(|| under(smaller), || under(larger)) {
        (Some(a), Some(b)) => Nats::new(a.nats() - b.nats()),
        _ => Nats::new(f64::NEG_INFINITY),
    }
}

/// What `numbers` fitted numbers cost with `blocks` compared.
#[must_use]
pub fn cost(numbers: usize, blocks: usize) -> f64 {
    0.5 * numbers as f64 * libm::log(blocks.max(2) as f64)
}

#[cfg(test)]
mod tests {
    use super::{cost, gain};
    use crate::made::{settled, showing};
    use stylet_identify::fit::{Effort, fit};
    use stylet_identify::noise::From;
    use stylet_tissue::{AnyEffect, ForceBias, ForceDrift};

    #[test]
    fn a_number_costs_half_the_logarithm_of_the_number_of_blocks() {
        assert!((cost(3, 700) - 1.5 * 700.0_f64.ln()).abs() < 1e-12);
        assert!((cost(2, 1) - 2.0_f64.ln()).abs() < 1e-12);
        assert_eq!(cost(0, 700), 0.0);
    }

    #[test]
    fn a_larger_model_gains_by_the_noise_that_it_leaves_itself() {
        let drift: AnyEffect = ForceDrift { rate_n_per_s: 2e-3 }.into();
        let runs = showing(&[], &[[4e-3, 3e-4], [6e-3, -3e-4]], |t| 2e-3 * t);
        let with = settled(&[drift, ForceBias { force_n: 1e-4 }.into()], &runs.iter().collect::<Vec<_>>());
        let data = &with.data;
        let under = |m: &stylet_identify::model::Model| fit(m, data, Effort::FULL).expect("a fit");
        let (no_drift, no_bias) = (under(&with.fit.model.without(0)), under(&with.fit.model.without(1)));
        let own = data.judged_by(&with.fit.residuals.e, From::Whole);
        let nats = |m| fit(m, &own, Effort::FULL).expect("a fit").nats();
        let wanted = nats(&no_drift.model) - nats(&with.fit.model);
        let told = gain(&no_drift, &with.fit, data).number();
        assert!(wanted > 10.0 && (told / wanted - 1.0).abs() < 0.02, "{told} for {wanted}");
        let told = gain(&no_bias, &with.fit, data).number();
        assert!((-0.1..1.5).contains(&told), "{told}");
        // What cannot be replayed gains nothing.
        let mut broken = with.fit.clone();
        broken.model.effects[0].values[0] = f64::NAN;
        assert_eq!(gain(&no_bias, &broken, data).number(), f64::NEG_INFINITY);
    }
}
