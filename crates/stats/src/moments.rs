//! Mean, variance and RMS in the order of the values: the same values in the same order give the same bits.

/// Standard deviation of a uniform distribution of unit width, to three digits.
pub const UNIFORM_SD: f64 = 0.289;

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
    fn rms_of_a_sine_is_its_amplitude_over_root_two() {
        let sine: Vec<f64> = (0..360).map(|i| 3.0 * libm::sin(f64::from(i).to_radians())).collect();
        assert!((rms(&sine) - 3.0 / 2f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn moments_of_few_values_agree_with_a_hand_calculation() {
        assert_eq!((mean(&[2.0, 7.0, 9.0]), variance(&[2.0, 7.0, 9.0])), (6.0, 13.0));
        assert_eq!((variance(&[2.0, 4.0]), sd(&[2.0, 4.0])), (2.0, 2f64.sqrt()));
        assert!(variance(&[5.0]).is_nan() && sd(&[1.0]).is_nan() && mean(&[]).is_nan() && rms(&[]).is_nan());
        assert_eq!(rms(&[3.0, -3.0]), 3.0);
    }
}
