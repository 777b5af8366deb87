//! Order statistics.
//!
//! The quantile of `n` sorted values at `q` is the linear interpolation between the two values around position
//! `q (n - 1)` (Hyndman and Fan 1996, type 7; the default of NumPy, R and Excel). The median is the quantile at one half:
//! the middle value, or the mean of the two in the middle.
//!
//! Values are ordered by [`f64::total_cmp`], so that a `NaN` among them counts as the largest; leave them out beforehand.

use crate::confidence_interval::Interval;
use crate::normal::Z95;

/// The median. Reorders `values`; takes time proportional to their number. `NaN` without values.
#[must_use]
pub fn median(values: &mut [f64]) -> f64 {
    quantile(values, 0.5)
}

/// The median of an iterator. `NaN` without values.
#[must_use]
pub fn median_of(values: impl IntoIterator<Item = f64>) -> f64 {
    quantile_of(values, 0.5)
}

/// The quantile at `q` (0 to 1). Reorders `values`; takes time proportional to their number. `NaN` without values.
#[must_use]
pub fn quantile(values: &mut [f64], q: f64) -> f64 {
    let Some((below, share)) = interpolation_position(values.len(), q) else { return f64::NAN };
    let (_, &mut low, above) = values.select_nth_unstable_by(below, f64::total_cmp);
    if share == 0.0 {
        return low;
    }
    let high = above.iter().copied().min_by(f64::total_cmp).unwrap_or(low);
    interpolate_between(low, high, share)
}

/// The quantile at `q` of an iterator. `NaN` without values.
#[must_use]
pub fn quantile_of(values: impl IntoIterator<Item = f64>, q: f64) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    quantile(&mut values, q)
}

/// The quantile at `q` (0 to 1) of values in ascending order: for many quantiles of the same values. `NaN` without values.
#[must_use]
pub fn quantile_of_sorted(sorted: &[f64], q: f64) -> f64 {
    let Some((below, share)) = interpolation_position(sorted.len(), q) else { return f64::NAN };
    if share == 0.0 {
        return sorted[below];
    }
    interpolate_between(sorted[below], sorted[below + 1], share)
}

/// The `q` quantile of values in ascending order with its distribution-free 95 % interval between order statistics: the
/// number of values below the quantile is binomial, approximated as normal. With too few values for an end, that end is
/// the extreme of the sample. `None` without values.
#[must_use]
pub fn quantile_interval(sorted: &[f64], q: f64) -> Option<Interval> {
    let last = sorted.len().checked_sub(1)?;
    let n = sorted.len() as f64;
    let value = quantile_of_sorted(sorted, q);
    let half = Z95 * (n * q * (1.0 - q)).sqrt();
    let index = |x: f64| (x.max(0.0) as usize).min(last);
    let low = sorted[index((n * q - half).floor() - 1.0)].min(value);
    let high = sorted[index((n * q + half).ceil())].max(value);
    Some(Interval { value, low, high })
}

/// Standard deviation of a centred normal distribution with median absolute value one: `1 / normal::quantile(0.75)`.
pub const MAD_TO_SD: f64 = 1.482_602_218_505_602;

/// Smallest and largest value, `NaN` left out; `(NaN, NaN)` without values.
#[must_use]
pub fn extremes(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::NAN, f64::NAN), |(low, high), &value| (low.min(value), high.max(value)))
}

/// The values in ascending order, without `NaN`.
#[must_use]
pub fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.into_iter().filter(|x| !x.is_nan()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// Index below the quantile and the weight of the next value; `None` where there is no quantile.
pub(crate) fn interpolation_position(count: usize, q: f64) -> Option<(usize, f64)> {
    let last = count.checked_sub(1)?;
    if !(0.0..=1.0).contains(&q) {
        return None;
    }
    let at = q * last as f64;
    let below = (at.floor() as usize).min(last);
    Some((below, if below == last { 0.0 } else { at - below as f64 }))
}

/// Linear interpolation between two values, also of equal infinite ones.
pub(crate) fn interpolate_between(low: f64, high: f64, share: f64) -> f64 {
    if low == high { low } else { low + share * (high - low) }
}

/// Standard deviation of white noise on smooth columns: the scaled median of their third differences, whose variance is
/// twenty times that of the noise.
#[must_use]
pub fn third_difference_sd<'a>(columns: impl IntoIterator<Item = &'a [f64]>) -> f64 {
    let third = |w: &[f64]| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs();
    let mut all: Vec<f64> = columns.into_iter().flat_map(|x| x.windows(4).map(third)).collect();
    median(&mut all) * MAD_TO_SD / 20.0_f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_an_even_count_is_the_mean_of_the_middle_two() {
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 1e9]), 3.0);
        assert_eq!(median(&mut [3.0, 1.0, 1e9]), 3.0);
        assert_eq!(median_of([7.0]), 7.0);
        assert!(median(&mut []).is_nan());
    }

    #[test]
    fn all_quantile_functions_agree() {
        let values: Vec<f64> = (0..23).map(|i| f64::from((i * 7) % 23) * 1.3 - 4.0).collect();
        let sorted = sorted(values.iter().copied());
        for q in [0.0, 0.05, 0.31, 0.5, 0.77, 0.95, 1.0] {
            let one = quantile_of(values.iter().copied(), q);
            assert_eq!(one, quantile(&mut values.clone(), q));
            assert_eq!(one, quantile_of_sorted(&sorted, q));
            assert_eq!(one, quantile_interval(&sorted, q).expect("values").value);
        }
        assert!(quantile_of([1.0], 1.5).is_nan() && quantile_of([1.0], f64::NAN).is_nan());
    }

    #[test]
    fn a_third_of_outliers_leaves_the_scale_finite() {
        let mut clean: Vec<f64> = (1..1000).map(|i| crate::normal::quantile(f64::from(i) / 1000.0)).collect();
        let scale = MAD_TO_SD * median_of(clean.iter().map(|x| x.abs()));
        assert!((scale - 1.0).abs() < 0.01, "{scale}");
        clean.iter_mut().step_by(3).for_each(|x| *x = 1e9);
        assert!(MAD_TO_SD * median_of(clean.iter().map(|x| x.abs())) < 2.0);
        assert!((MAD_TO_SD * crate::normal::quantile(0.75) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn the_interval_of_a_quantile_lies_between_order_statistics() {
        // Values equal to their rank. Conover 1999, section 3.2: of 100 values the 40th and the 61st hold the median.
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        let median = quantile_interval(&values, 0.5).expect("values");
        assert_eq!((median.value, median.low, median.high), (50.5, 40.0, 61.0));
        // 64 x 0.2 = 12.8 below, give or take 1.96 x 3.2 = 6.27: from the 6th to the 21st.
        let fifth = quantile_interval(&values[..64], 0.2).expect("values");
        assert_eq!((fifth.low, fifth.high), (6.0, 21.0));
        // Too few values for an end: the extremes.
        let few = quantile_interval(&values[..5], 0.9).expect("values");
        assert_eq!((few.low, few.high), (3.0, 5.0));
        let fewer = quantile_interval(&values[..3], 0.1).expect("values");
        assert_eq!((fewer.low, fewer.high), (1.0, 3.0));
        assert_eq!(quantile_interval(&[], 0.5), None);
    }

    #[test]
    fn extremes_and_sorting_leave_out_nan() {
        assert_eq!(extremes(&[2.0, f64::NAN, -3.0, 7.5]), (-3.0, 7.5));
        let none = extremes(&[f64::NAN]);
        assert!(none.0.is_nan() && none.1.is_nan());
        assert_eq!(sorted([2.0, f64::NAN, -3.0, 7.5]), [-3.0, 2.0, 7.5]);
    }

    #[test]
    fn a_quantile_between_infinite_or_equal_values_is_a_number() {
        assert_eq!(quantile(&mut [f64::INFINITY, f64::INFINITY], 0.3), f64::INFINITY);
        assert_eq!(quantile_of_sorted(&[1.0, f64::INFINITY], 0.0), 1.0);
        assert_eq!(quantile_of_sorted(&[1.0, 3.0], 0.25), 1.5);
        assert_eq!(quantile_of_sorted(&[1.0, 3.0], 1.0), 3.0);
        assert!(quantile_of_sorted(&[], 0.5).is_nan() && quantile_of_sorted(&[1.0], -0.1).is_nan());
    }

    #[test]
    fn third_differences_measure_noise_and_not_a_smooth_signal() {
        let parabola: Vec<f64> = (0..40).map(|k| f64::from(k * k) - 3.0 * f64::from(k)).collect();
        assert!(third_difference_sd([parabola.as_slice()]) < 1e-9);
        // Alternating by one to either side: third differences of eight.
        let rough: Vec<f64> =
            parabola.iter().enumerate().map(|(k, x)| x + if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        assert!(
            (third_difference_sd([rough.as_slice()]) - 8.0 * 1.4826 / 20.0_f64.sqrt()).abs() < 1e-3,
            "{}",
            third_difference_sd([rough.as_slice()])
        );
        let cubic: Vec<f64> = (0..40).map(|k| f64::from(k).powi(3) / 6.0).collect();
        assert!((third_difference_sd([cubic.as_slice()]) - 1.4826 / 20.0_f64.sqrt()).abs() < 1e-3);
    }
}
