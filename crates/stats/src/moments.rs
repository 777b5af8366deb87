//! Sums and moments in the order of the values: the same values in the same order give the same bits.

/// Standard deviation of a uniform distribution of unit width, to three digits.
pub const UNIFORM_SD: f64 = 0.289;

/// A compensated sum (Neumaier 1974): its error does not grow with the number of terms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    sum: f64,
    compensation: f64,
}

impl Sum {
    /// Adds a term.
    #[inline]
    pub fn add(&mut self, term: f64) {
        let sum = self.sum + term;
        self.compensation +=
            if self.sum.abs() >= term.abs() { (self.sum - sum) + term } else { (term - sum) + self.sum };
        self.sum = sum;
    }

    /// The sum so far.
    #[must_use]
    pub fn value(&self) -> f64 {
        // An infinite term makes the compensation NaN.
        if self.sum.is_finite() { self.sum + self.compensation } else { self.sum }
    }
}

impl FromIterator<f64> for Sum {
    fn from_iter<I: IntoIterator<Item = f64>>(terms: I) -> Self {
        let mut sum = Self::default();
        terms.into_iter().for_each(|term| sum.add(term));
        sum
    }
}

/// Running mean, variance and extremes (Welford 1962).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    count: usize,
    mean: f64,
    squares: f64,
    min: f64,
    max: f64,
}

impl Default for Moments {
    fn default() -> Self {
        Self { count: 0, mean: 0.0, squares: 0.0, min: f64::NAN, max: f64::NAN }
    }
}

impl Moments {
    /// Adds a value.
    #[inline]
    pub fn add(&mut self, x: f64) {
        self.count += 1;
        let off = x - self.mean;
        self.mean += off / self.count as f64;
        self.squares += off * (x - self.mean);
        self.min = self.min.min(x);
        self.max = self.max.max(x);
    }

    /// Number of values.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Their mean; `NaN` without values.
    #[must_use]
    pub fn mean(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { self.mean }
    }

    /// Their variance as a sample (divided by one less than the count); `NaN` for fewer than two values.
    #[must_use]
    pub fn variance(&self) -> f64 {
        if self.count < 2 { f64::NAN } else { self.squares / (self.count - 1) as f64 }
    }

    /// Their standard deviation as a sample; `NaN` for fewer than two values.
    #[must_use]
    pub fn sd(&self) -> f64 {
        self.variance().sqrt()
    }

    /// The smallest; `NaN` without values.
    #[must_use]
    pub fn min(&self) -> f64 {
        self.min
    }

    /// The largest; `NaN` without values.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.max
    }
}

impl FromIterator<f64> for Moments {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let mut moments = Self::default();
        values.into_iter().for_each(|x| moments.add(x));
        moments
    }
}

/// The mean; `NaN` without values.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { f64::NAN } else { values.iter().sum::<f64>() / values.len() as f64 }
}

/// The variance as a sample (divided by one less than the count); `NaN` for fewer than two values.
#[must_use]
pub fn variance(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return f64::NAN;
    }
    let mean = mean(values);
    values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (values.len() - 1) as f64
}

/// The standard deviation as a sample; `NaN` for fewer than two values.
#[must_use]
pub fn sd(values: &[f64]) -> f64 {
    variance(values).sqrt()
}

/// Root mean square; `NaN` without values.
#[must_use]
pub fn rms(values: &[f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_compensated_sum_keeps_the_rounding_error() {
        let terms = [1.0, 1e100, 1.0, -1e100];
        assert_eq!(terms.into_iter().collect::<Sum>().value(), 2.0);
        assert_eq!(terms.into_iter().sum::<f64>(), 0.0);
        assert_eq!([1.0, f64::INFINITY].into_iter().collect::<Sum>().value(), f64::INFINITY);
    }

    #[test]
    fn running_moments_agree_with_those_of_the_slice_even_far_from_zero() {
        let values: Vec<f64> = (0..1000).map(|i| 1e9 + f64::from((i * 37) % 101)).collect();
        let running: Moments = values.iter().copied().collect();
        assert!((running.mean() - mean(&values)).abs() < 1e-6);
        assert!((running.sd() / sd(&values) - 1.0).abs() < 1e-9);
        assert_eq!((running.min(), running.max(), running.count()), (1e9, 1e9 + 100.0, 1000));
        assert!(Moments::default().mean().is_nan() && sd(&[1.0]).is_nan());
    }

    #[test]
    fn rms_of_a_sine_is_its_amplitude_over_root_two() {
        let sine: Vec<f64> = (0..360).map(|i| 3.0 * libm::sin(f64::from(i).to_radians())).collect();
        assert!((rms(&sine) - 3.0 / 2f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn moments_of_few_values_agree_with_a_hand_calculation() {
        let three: Moments = [2.0, 7.0, 9.0].into_iter().collect();
        assert_eq!((three.mean(), three.variance(), three.sd()), (6.0, 13.0, 13f64.sqrt()));
        assert_eq!((mean(&[2.0, 7.0, 9.0]), variance(&[2.0, 7.0, 9.0])), (6.0, 13.0));
        assert_eq!((variance(&[2.0, 4.0]), sd(&[2.0, 4.0])), (2.0, 2f64.sqrt()));
        let two: Moments = [2.0, 4.0].into_iter().collect();
        assert_eq!((two.count(), two.variance()), (2, 2.0));
        let one: Moments = [5.0].into_iter().collect();
        assert!(one.variance().is_nan() && one.sd().is_nan() && variance(&[5.0]).is_nan());
        assert_eq!((one.mean(), one.min(), one.max()), (5.0, 5.0, 5.0));
        assert!(mean(&[]).is_nan() && rms(&[]).is_nan() && Moments::default().min().is_nan());
        assert_eq!(rms(&[3.0, -3.0]), 3.0);
    }

    #[test]
    fn a_compensated_sum_is_exact_whichever_of_two_terms_is_the_larger() {
        let (large, small) = (2f64.powi(53), 1.0);
        for terms in
            [[large, small, small, -large], [small, large, small, -large], [small, small, -large, large]]
        {
            assert_eq!(terms.into_iter().collect::<Sum>().value(), 2.0, "{terms:?}");
            assert_eq!(terms.map(|x| -x).into_iter().collect::<Sum>().value(), -2.0, "{terms:?}");
        }
    }
}
