//! Mean of a quantity over the noise seeds with its 95 % interval; seeds are the sampling units.

pub use stylet_stats::Interval;
use stylet_stats::{mean_interval, wilson_at};

/// Mean with its t interval; `None` with fewer than two values.
#[must_use]
pub fn mean(values: &[f64]) -> Option<Interval> {
    if values.len() < 2 || values.iter().any(|x| !x.is_finite()) {
        return None;
    }
    mean_interval(values)
}

/// Geometric mean with its t interval on the logarithms; `None` with fewer than two values or one that is
/// not positive.
#[must_use]
pub fn geometric_mean(values: &[f64]) -> Option<Interval> {
    if values.iter().any(|x| *x <= 0.0) {
        return None;
    }
    let logarithms: Vec<f64> = values.iter().map(|x| libm::log(*x)).collect();
    let i = mean(&logarithms)?;
    Some(Interval { value: libm::exp(i.value), low: libm::exp(i.low), high: libm::exp(i.high) })
}

/// Share with its Wilson interval; a seed with several experiments may count in part.
#[must_use]
pub fn share(values: &[f64]) -> Option<Interval> {
    if values.is_empty() {
        return None;
    }
    Some(wilson_at(values.iter().sum(), values.len() as f64, 0.95))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_agrees_with_newcombe_1998() {
        let values: Vec<f64> = (0..263).map(|i| f64::from(i < 81)).collect();
        let i = share(&values).expect("values");
        assert!((i.low - 0.2553).abs() < 5e-5 && (i.high - 0.3662).abs() < 5e-5, "{i:?}");
    }

    #[test]
    fn the_interval_of_a_mean_has_its_nominal_coverage() {
        // A linear congruential generator; the sum of twelve uniform numbers is nearly normal.
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut covered = 0;
        for _ in 0..2000 {
            let values: Vec<f64> = (0..20).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect();
            let i = mean(&values).expect("values");
            covered += i32::from(i.low <= 0.0 && 0.0 <= i.high);
        }
        assert!((1860..=1940).contains(&covered), "{covered} of 2000");
        assert_eq!(mean(&[1.0]), None);
        assert_eq!(geometric_mean(&[1.0, 0.0]), None);
        let ratio = geometric_mean(&[0.5, 2.0, 0.5, 2.0]).expect("values");
        assert!((ratio.value - 1.0).abs() < 1e-12 && (ratio.low * ratio.high - 1.0).abs() < 1e-9);
    }
}
