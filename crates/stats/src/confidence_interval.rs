//! Confidence intervals of rates and means.

use crate::moments::{mean, sd};
use crate::normal::{self, Z95};
use crate::student_t;

/// An estimate with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Wilson's 95 % score interval of a rate, `hits` of `of` (Wilson 1927). For `of = 0` the rate is `NaN` and the interval is
/// 0 to 1.
#[must_use]
pub fn wilson(hits: usize, of: usize) -> Interval {
    score_interval(hits as f64, of as f64, Z95)
}

/// Wilson's score interval of a rate at any confidence (0 to 1), also for weighted counts.
#[must_use]
pub fn wilson_at(hits: f64, of: f64, confidence: f64) -> Interval {
    score_interval(hits, of, normal::quantile(0.5 + confidence / 2.0))
}

fn score_interval(hits: f64, of: f64, z: f64) -> Interval {
    if of <= 0.0 {
        return Interval { value: f64::NAN, low: 0.0, high: 1.0 };
    }
    let (p, z2) = (hits / of, z * z);
    let middle = (p + z2 / (2.0 * of)) / (1.0 + z2 / of);
    let half = z / (1.0 + z2 / of) * (p * (1.0 - p) / of + z2 / (4.0 * of * of)).sqrt();
    // Exact at the ends, in spite of rounding.
    let low = if hits <= 0.0 { 0.0 } else { (middle - half).max(0.0) };
    let high = if hits >= of { 1.0 } else { (middle + half).min(1.0) };
    Interval { value: p, low, high }
}

/// The mean with its 95 % interval by Student's distribution. Infinite for one value; `None` for an empty slice.
#[must_use]
pub fn mean_interval(values: &[f64]) -> Option<Interval> {
    let value = if values.is_empty() { return None } else { mean(values) };
    let dof = values.len() as f64 - 1.0;
    if dof < 1.0 {
        return Some(Interval { value, low: f64::NEG_INFINITY, high: f64::INFINITY });
    }
    let half = student_t::quantile(0.975, dof) * sd(values) / (values.len() as f64).sqrt();
    Some(Interval { value, low: value - half, high: value + half })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_agrees_with_published_values() {
        let none = wilson(0, 600);
        assert!((none.high - 0.006_361).abs() < 1e-5 && none.low == 0.0, "{none:?}");
        // Newcombe 1998, table I.
        let some = wilson(81, 263);
        assert!((some.low - 0.2553).abs() < 5e-5 && (some.high - 0.3662).abs() < 5e-5, "{some:?}");
        assert_eq!(wilson(9, 9).high, 1.0);
        assert_eq!((wilson(0, 0).low, wilson(0, 0).high), (0.0, 1.0));
    }

    #[test]
    fn the_interval_of_a_mean_has_the_student_width() {
        // Two values: one degree of freedom, 12.706 standard errors.
        let two = mean_interval(&[1.0, 3.0]).expect("values");
        assert!((two.high - (2.0 + 12.706_204_736)).abs() < 1e-8, "{two:?}");
        assert_eq!(mean_interval(&[1.0]).expect("a value").high, f64::INFINITY);
        assert_eq!(mean_interval(&[]), None);
    }

    #[test]
    fn a_score_interval_ends_where_the_test_of_its_end_would_just_reject() {
        // Wilson's interval by its definition: at an end p the estimate is z standard errors sqrt(p (1 - p)/n) away.
        for (hits, of, confidence) in [(3.0, 10.0, 0.95), (0.5, 4.0, 0.8), (70.0, 71.5, 0.99)] {
            let i = wilson_at(hits, of, confidence);
            let z = normal::quantile(0.5 + confidence / 2.0);
            assert_eq!(i.value, hits / of);
            for end in [i.low, i.high] {
                let errors = (i.value - end).abs() / (end * (1.0 - end) / of).sqrt();
                assert!((errors / z - 1.0).abs() < 1e-10, "{hits} of {of}: {end}");
            }
            assert!(i.low < i.value && i.value < i.high);
        }
        assert!(wilson(0, 0).value.is_nan());
        assert_eq!((wilson_at(0.0, 3.0, 0.5).low, wilson_at(3.0, 3.0, 0.5).high), (0.0, 1.0));
    }

    #[test]
    fn three_values_have_an_interval_of_4_303_standard_errors() {
        // Mean 6, variance 13; Student's quantile of two degrees of freedom in closed form.
        let i = mean_interval(&[2.0, 7.0, 9.0]).expect("values");
        let t = 0.95 * (2.0 / (1.0 - 0.95 * 0.95_f64)).sqrt();
        let half = t * (13.0_f64 / 3.0).sqrt();
        assert!((i.low - (6.0 - half)).abs() < 1e-12 && (i.high - (6.0 + half)).abs() < 1e-12, "{i:?}");
        let one = mean_interval(&[4.0]).expect("a value");
        assert_eq!((one.value, one.low, one.high), (4.0, f64::NEG_INFINITY, f64::INFINITY));
    }
}
