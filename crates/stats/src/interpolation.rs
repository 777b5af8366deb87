//! Linear interpolation.

/// Linear interpolation of samples `y` at increasing abscissae `x`, constant beyond the ends; `NaN` without samples.
#[must_use]
pub fn interpolate(x: &[f64], y: &[f64], at: f64) -> f64 {
    let after = x.partition_point(|x| *x < at);
    match (after.checked_sub(1), x.get(after)) {
        (Some(before), Some(x1)) => {
            let share = (at - x[before]) / (x1 - x[before]).max(1e-300);
            y[before] + (y[after] - y[before]) * share
        }
        (None, Some(_)) => y[after],
        (before, None) => before.map_or(f64::NAN, |k| y[k]),
    }
}

#[cfg(test)]
mod tests {
    use super::interpolate;

    #[test]
    fn interpolation_is_linear_and_constant_beyond_the_ends() {
        let (x, y) = ([0.0, 1.0, 3.0], [2.0, 4.0, 0.0]);
        for (at, wanted) in
            [(-1.0, 2.0), (0.0, 2.0), (0.25, 2.5), (1.0, 4.0), (2.0, 2.0), (3.0, 0.0), (9.0, 0.0)]
        {
            assert!((interpolate(&x, &y, at) - wanted).abs() < 1e-15, "{at}");
        }
        assert!(interpolate(&[], &[], 1.0).is_nan());
    }

    #[test]
    fn at_a_repeated_abscissa_the_left_value_counts() {
        assert_eq!(interpolate(&[0.0, 1.0, 1.0, 2.0], &[0.0, 1.0, 5.0, 5.0], 1.0), 1.0);
        assert_eq!(interpolate(&[-2.0, 6.0], &[10.0, -6.0], 1.5), 3.0);
        assert_eq!(interpolate(&[3.0], &[7.0], 3.0), 7.0);
    }
}
