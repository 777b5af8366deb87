//! Small statistics.

/// The median; zero for no values.
#[must_use]
pub fn median(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return 0.0;
    }
    values.sort_unstable_by(f64::total_cmp);
    if n % 2 == 1 { values[n / 2] } else { 0.5 * (values[n / 2 - 1] + values[n / 2]) }
}

/// Mean and standard deviation (of a sample); zeros where there are too few values.
#[must_use]
pub fn mean_sd(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    if values.is_empty() {
        return (0.0, 0.0);
    }
    let mean = values.iter().sum::<f64>() / n;
    let sum: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
    (mean, if values.len() > 1 { libm::sqrt(sum / (n - 1.0)) } else { 0.0 })
}

/// Root mean square.
#[must_use]
pub fn rms(values: &[f64]) -> f64 {
    libm::sqrt(values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64)
}

/// The value below which a share `p` (0 to 1) of a normal distribution lies: P. J. Acklam's rational
/// approximation, relative error 1.2e-9.
#[must_use]
#[allow(clippy::excessive_precision, reason = "coefficients as published")]
pub fn normal_quantile(p: f64) -> f64 {
    const A: [f64; 6] = [
        -3.969683028665376e1,
        2.209460984245205e2,
        -2.759285104469687e2,
        1.383577518672690e2,
        -3.066479806614716e1,
        2.506628277459239,
    ];
    const B: [f64; 5] = [
        -5.447609879822406e1,
        1.615858368580409e2,
        -1.556989798598866e2,
        6.680131188771972e1,
        -1.328068155288572e1,
    ];
    const C: [f64; 6] = [
        -7.784894002430293e-3,
        -3.223964580411365e-1,
        -2.400758277161838,
        -2.549732539343734,
        4.374664141464968,
        2.938163982698783,
    ];
    const D: [f64; 4] = [7.784695709041462e-3, 3.224671290700398e-1, 2.445134137142996, 3.754408661907416];
    let poly = |c: &[f64], x: f64| c.iter().fold(0.0, |sum, c| sum * x + c);
    let p = p.clamp(1e-12, 1.0 - 1e-12);
    if p < 0.02425 {
        let q = libm::sqrt(-2.0 * libm::log(p));
        return poly(&C, q) / (poly(&D, q) * q + 1.0);
    }
    if p > 1.0 - 0.02425 {
        return -normal_quantile(1.0 - p);
    }
    let q = p - 0.5;
    let r = q * q;
    poly(&A, r) * q / (poly(&B, r) * r + 1.0)
}

/// Point `index` of the Halton sequence (Halton 1960) in base `base`.
#[must_use]
pub fn halton(index: usize, base: usize) -> f64 {
    let (mut i, mut weight, mut out) = (index, 1.0, 0.0);
    while i > 0 {
        weight /= base as f64;
        out += weight * (i % base) as f64;
        i /= base;
    }
    out
}

/// The first primes, bases of [`halton`].
pub const PRIMES: [usize; 16] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53];

/// Two-sided 95 % quantile of Student's distribution with `n` degrees of freedom (Cornish-Fisher; within
/// 1 % from three degrees on).
#[must_use]
pub fn student_95(n: usize) -> f64 {
    let (z, n) = (1.959_963_985, n.max(1) as f64);
    let z2 = z * z;
    let g1 = z * (z2 + 1.0) / 4.0;
    let g2 = z * (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / 96.0;
    let g3 = z * (3.0 * z2 * z2 * z2 + 19.0 * z2 * z2 + 17.0 * z2 - 15.0) / 384.0;
    z + g1 / n + g2 / (n * n) + g3 / (n * n * n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        assert!((normal_quantile(0.975) - 1.959_963_985).abs() < 1e-7);
        assert!((normal_quantile(0.01) + 2.326_347_874).abs() < 1e-7);
        assert!((student_95(4) / 2.776 - 1.0).abs() < 0.01 && (student_95(14) / 2.145 - 1.0).abs() < 0.002);
    }

    #[test]
    fn the_halton_sequence_begins_as_published() {
        let two: Vec<f64> = (1..5).map(|i| halton(i, 2)).collect();
        assert_eq!(two, [0.5, 0.25, 0.75, 0.125]);
        assert!((halton(2, 3) - 2.0 / 3.0).abs() < 1e-15);
    }
}
