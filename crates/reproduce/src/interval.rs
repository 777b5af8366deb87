//! A number over the noise seeds with its 95 % interval: seeds are the units.

use serde::Serialize;

/// 97.5 % quantile of the normal distribution.
const Z: f64 = 1.959_963_985;

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// 97.5 % quantile of Student's t with `freedom` degrees: Cornish-Fisher's expansion about the normal
/// quantile, right to 1 % from three degrees on and to 0.02 % from ten on.
#[must_use]
pub fn t_quantile(freedom: f64) -> f64 {
    let (z, n) = (Z, freedom);
    let (z3, z5) = (z.powi(3), z.powi(5));
    let (z7, z9) = (z.powi(7), z.powi(9));
    z + (z3 + z) / (4.0 * n)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * n * n)
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * n.powi(3))
        + (79.0 * z9 + 776.0 * z7 + 1482.0 * z5 - 1920.0 * z3 - 945.0 * z) / (92_160.0 * n.powi(4))
}

/// Mean with its t interval; `None` with fewer than two values.
#[must_use]
pub fn mean(values: &[f64]) -> Option<Interval> {
    let n = values.len() as f64;
    if values.len() < 2 || values.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0);
    let half = t_quantile(n - 1.0) * (variance / n).sqrt();
    Some(Interval { value: mean, low: mean - half, high: mean + half })
}

/// Geometric mean with its t interval on the logarithms; `None` with fewer than two values or one that is
/// not positive.
#[must_use]
pub fn geometric_mean(values: &[f64]) -> Option<Interval> {
    if values.iter().any(|x| *x <= 0.0) {
        return None;
    }
    let logarithms: Vec<f64> = values.iter().map(|x| x.ln()).collect();
    let i = mean(&logarithms)?;
    Some(Interval { value: i.value.exp(), low: i.low.exp(), high: i.high.exp() })
}

/// Share with its Wilson interval; a seed may count in part, when it holds several experiments.
#[must_use]
pub fn share(values: &[f64]) -> Option<Interval> {
    if values.is_empty() {
        return None;
    }
    let n = values.len() as f64;
    let p = values.iter().sum::<f64>() / n;
    let z2 = Z * Z;
    let middle = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    let low = if p <= 0.0 { 0.0 } else { (middle - half).max(0.0) };
    let high = if p >= 1.0 { 1.0 } else { (middle + half).min(1.0) };
    Some(Interval { value: p, low, high })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn t_quantiles_agree_with_the_tables() {
        for (freedom, table) in [(3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (19.0, 2.093), (49.0, 2.0096)] {
            assert!((t_quantile(freedom) / table - 1.0).abs() < 0.01, "{freedom}: {}", t_quantile(freedom));
        }
        assert!((t_quantile(49.0) - 2.009_575).abs() < 1e-5);
    }

    #[test]
    fn a_share_agrees_with_newcombe_1998() {
        let values: Vec<f64> = (0..263).map(|i| f64::from(i < 81)).collect();
        let i = share(&values).expect("values");
        assert!((i.low - 0.2553).abs() < 5e-5 && (i.high - 0.3662).abs() < 5e-5, "{i:?}");
    }

    #[test]
    fn the_interval_of_a_mean_covers_the_truth_as_often_as_it_says() {
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
