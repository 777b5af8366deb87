//! Ranks and rank correlation.

/// Ranks from 1; equal values share their mean rank.
#[must_use]
pub fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut from = 0;
    while from < order.len() {
        let mut to = from + 1;
        while to < order.len() && values[order[to]] == values[order[from]] {
            to += 1;
        }
        for index in &order[from..to] {
            ranks[*index] = (from + to + 1) as f64 / 2.0;
        }
        from = to;
    }
    ranks
}

/// Spearman's rank correlation and its two-sided p-value (Fisher's transform with the variance 1.06/(n - 3) of Fieller et
/// al. 1957). `None` with fewer than four pairs, or when either does not vary.
#[must_use]
pub fn spearman(x: &[f64], y: &[f64]) -> Option<(f64, f64)> {
    let n = x.len().min(y.len());
    if n < 4 {
        return None;
    }
    let (a, b) = (ranks(&x[..n]), ranks(&y[..n]));
    let middle = (n as f64 + 1.0) / 2.0;
    let dot = |u: &[f64], v: &[f64]| u.iter().zip(v).map(|(s, t)| (s - middle) * (t - middle)).sum::<f64>();
    let (xx, yy) = (dot(&a, &a), dot(&b, &b));
    if xx <= 0.0 || yy <= 0.0 {
        return None;
    }
    let rho = (dot(&a, &b) / (xx * yy).sqrt()).clamp(-1.0, 1.0);
    let score = libm::atanh(rho.abs().min(1.0 - 1e-15)) * ((n as f64 - 3.0) / 1.06).sqrt();
    Some((rho, libm::erfc(score / core::f64::consts::SQRT_2)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_share_their_rank_and_constants_have_no_correlation() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0]), [3.5, 1.0, 3.5, 2.0]);
        assert_eq!(spearman(&[1.0; 9], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]), None);
        let (rho, p) = spearman(&[1.0, 2.0, 3.0, 4.0, 5.0], &[2.0, 4.0, 8.0, 16.0, 32.0]).expect("it varies");
        assert!(rho == 1.0 && p < 1e-3, "{rho} {p}");
    }

    #[test]
    fn the_p_value_is_about_the_share_of_permutations_with_a_larger_correlation() {
        let x = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
        // Of all 40320 orders, counted; the approximation, by another program.
        for (y, rho, counted, approximate) in [
            ([2.0, 1.0, 5.0, 3.0, 4.0, 8.0, 6.0, 7.0], 5.0 / 6.0, 0.0154, 0.009215677301205006),
            ([3.0, 5.0, 1.0, 4.0, 8.0, 2.0, 7.0, 6.0], 19.0 / 42.0, 0.267, 0.28951115772861946),
            ([8.0, 6.0, 7.0, 3.0, 5.0, 4.0, 1.0, 2.0], -37.0 / 42.0, 0.00724, 0.0027249042173982285),
        ] {
            let (found, p) = spearman(&x, &y).expect("it varies");
            assert!((found - rho).abs() < 1e-14, "{found}");
            assert!((p / approximate - 1.0).abs() < 1e-11 && (p - counted).abs() < 0.03, "{p}");
        }
    }

    #[test]
    fn four_pairs_are_enough_and_the_longer_column_is_cut() {
        assert_eq!(spearman(&[1.0, 2.0, 3.0], &[1.0, 3.0, 2.0]), None);
        let (rho, _) = spearman(&[1.0, 2.0, 3.0, 4.0, -9.0], &[1.0, 2.0, 4.0, 3.0]).expect("it varies");
        assert!((rho - 0.8).abs() < 1e-15, "{rho}");
        assert_eq!(spearman(&[1.0, 2.0, 3.0, 4.0], &[5.0; 4]), None);
        // Ever so sure is not certain.
        let (_, p) = spearman(&[1.0, 2.0, 3.0, 4.0], &[1.0, 2.0, 3.0, 4.0]).expect("it varies");
        assert!(p > 0.0, "{p}");
    }
}
