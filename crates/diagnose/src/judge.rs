//! Whether a larger model is worth its numbers: both under the noise that the larger one leaves.

use stylet_identify::fit::{Effort, Fit, fit_sharp};
use stylet_identify::noise::From;
use stylet_identify::objective::Data;

/// Nats that an effect must gain beyond half the logarithm of the number of blocks per fitted number.
pub const LEAST: f64 = 4.0;

/// What `larger` gains over `smaller` when all that `larger` leaves is noise.
#[must_use]
pub fn gain(smaller: &Fit, larger: &Fit, data: &Data) -> f64 {
    let own = data.judged_by(&larger.residuals.e, From::Whole);
    let effort = Effort { turns: 3, enough: 0.2 };
    let under = |f: &Fit| fit_sharp(&f.model, &own, effort);
    match rayon::join(|| under(smaller), || under(larger)) {
        (Some(a), Some(b)) => a.nats() - b.nats(),
        _ => f64::NEG_INFINITY,
    }
}

/// What `numbers` fitted numbers cost with `blocks` compared.
#[must_use]
pub fn cost(numbers: usize, blocks: usize) -> f64 {
    0.5 * numbers as f64 * libm::log(blocks.max(2) as f64)
}

#[cfg(test)]
mod tests {
    use super::cost;

    #[test]
    fn a_number_costs_half_the_logarithm_of_the_number_of_blocks() {
        assert!((cost(3, 700) - 1.5 * 700.0_f64.ln()).abs() < 1e-12);
        assert!((cost(2, 1) - 2.0_f64.ln()).abs() < 1e-12);
        assert_eq!(cost(0, 700), 0.0);
    }
}
