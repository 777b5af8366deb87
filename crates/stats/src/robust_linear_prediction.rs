//! Linear prediction of the first element of a row from the others, by robust least squares.
//!
//! For an autoregression a row holds a sample, the previous samples, and any other known regressors.

use crate::linear_algebra::SymmetricMatrix;
use crate::order_statistics::{MAD_TO_SD, median};
use crate::robust_loss::huber_weight;

/// Prediction error of the first element of a row: `row[0] - sum_i a[i] row[i]`, `i >= 1`; `a[0]` is not used.
#[inline]
#[must_use]
pub fn prediction_residual<const N: usize>(row: &[f64; N], a: &[f64; N]) -> f64 {
    let mut w = row[0];
    for i in 1..N {
        w -= a[i] * row[i];
    }
    w
}

/// Coefficients of the given columns (from 1 on) and the standard deviation of the prediction error, by least squares under
/// Huber's loss (linear beyond `huber` standard deviations).
///
/// Iteratively reweighted in `iterations` steps from the standard deviation `sd` on, which is nowhere below `floor`. With
/// one iteration: ordinary least squares.
#[must_use]
pub fn robust_linear_prediction<const N: usize>(
    rows: &[[f64; N]],
    columns: &[usize],
    (sd, floor): (f64, f64),
    huber: f64,
    iterations: usize,
) -> ([f64; N], f64) {
    let mut a = [0.0; N];
    let mut s = if iterations == 1 { f64::INFINITY } else { sd };
    for _ in 0..iterations {
        let mut sums = [[0.0; N]; N];
        for row in rows {
            let w = huber_weight(prediction_residual(row, &a) / s, huber);
            for (sums, i) in sums.iter_mut().zip(columns) {
                let x = w * row[*i];
                sums[0] += x * row[0];
                for (sum, j) in sums[1..].iter_mut().zip(columns) {
                    *sum += x * row[*j];
                }
            }
        }
        let mut h = SymmetricMatrix::zeros(columns.len());
        for (i, sums) in sums.iter().enumerate().take(columns.len()) {
            (0..=i).for_each(|j| h.add(i, j, sums[j + 1]));
        }
        let g: Vec<f64> = sums.iter().take(columns.len()).map(|sums| sums[0]).collect();
        for (x, value) in columns.iter().zip(h.cholesky().solve(&g)) {
            a[*x] = value;
        }
        s = if iterations == 1 { rms_error(rows, &a) } else { huber_scale(rows, &a, huber) }.max(floor);
    }
    (a, s)
}

/// RMS of the prediction errors.
fn rms_error<const N: usize>(rows: &[[f64; N]], a: &[f64; N]) -> f64 {
    (rows.iter().map(|row| prediction_residual(row, a).powi(2)).sum::<f64>() / rows.len() as f64).sqrt()
}

/// Scale of the prediction errors under Huber's loss: the square root of `sum weight w^2 / n` over its expectation for normal
/// noise.
fn huber_scale<const N: usize>(rows: &[[f64; N]], a: &[f64; N], huber: f64) -> f64 {
    let mut size: Vec<f64> = rows.iter().map(|row| prediction_residual(row, a).abs()).collect();
    let mut s = (median(&mut size) * MAD_TO_SD).max(1e-300);
    for _ in 0..6 {
        let sum: f64 = rows
            .iter()
            .map(|row| {
                let w = prediction_residual(row, a) / s;
                huber_weight(w, huber) * w * w
            })
            .sum();
        // For normal noise E[min(|w|, k)|w|] = erf(k/sqrt 2).
        let expected = libm::erf(huber * core::f64::consts::FRAC_1_SQRT_2);
        s *= (sum / (rows.len() as f64 * expected)).sqrt();
    }
    s
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 8;

    fn near(found: f64, wanted: f64) {
        assert!((found - wanted).abs() <= 1e-9 * wanted.abs().max(1e-9), "{found} for {wanted}");
    }

    /// Normal numbers, each a sum of twelve uniform ones of a linear congruential generator (Knuth's MMIX).
    fn normal(seed: u64, n: usize) -> Vec<f64> {
        let mut state = seed;
        let mut even = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..n).map(|_| (0..12).map(|_| even()).sum::<f64>() - 6.0).collect()
    }

    #[test]
    fn the_residual_subtracts_the_weighted_regressors() {
        let row = [2.0, 0.5, -1.0, 3.0, 0.1, 0.2, 0.3, 0.4];
        let a = [9.0, 0.3, -0.2, 0.7, 0.11, 0.5, -0.4, 0.9];
        near(prediction_residual(&row, &a), 2.0 - 0.15 - 0.2 - 2.1 - 0.011 - 0.1 + 0.12 - 0.36);
    }

    #[test]
    fn the_residual_of_ordinary_least_squares_is_orthogonal_to_its_columns() {
        let numbers = normal(21, 60 * N);
        let rows: Vec<[f64; N]> = numbers.chunks_exact(N).map(|c| core::array::from_fn(|i| c[i])).collect();
        let columns = [1, 3, 6];
        let (a, s) = robust_linear_prediction(&rows, &columns, (1.0, 1e-6), 2.5, 1);
        for x in 1..N {
            let along: f64 = rows.iter().map(|r| r[x] * prediction_residual(r, &a)).sum();
            assert_eq!(columns.contains(&x), along.abs() < 1e-9, "{x}: {along}");
            assert_eq!(columns.contains(&x), a[x] != 0.0);
        }
        near(s, (rows.iter().map(|r| prediction_residual(r, &a).powi(2)).sum::<f64>() / 60.0).sqrt());
        assert_eq!(robust_linear_prediction(&rows, &columns, (1.0, 5.0), 2.5, 1).1, 5.0);
        // A robust fit is insensitive to an outlier.
        let mut outlier = rows.clone();
        outlier[10][0] = 30.0;
        let (robust, s) = robust_linear_prediction(&outlier, &columns, (1.0, 1e-6), 2.5, 4);
        assert!((1..N).all(|x| (robust[x] - a[x]).abs() < 0.4), "{robust:?} {a:?}");
        assert!(s > 0.9 && s < 2.2, "{s}");
    }

    #[test]
    fn the_scale_is_consistent_for_normal_noise_and_exact_for_equal_sizes() {
        let rows = |x: &[f64]| -> Vec<[f64; N]> {
            x.iter().map(|x| core::array::from_fn(|i| if i == 0 { *x } else { 0.0 })).collect()
        };
        let none = [0.0; N];
        // Every weight is one: the root of their square over its expectation under Huber's loss.
        let equal: Vec<f64> = (0..50).map(|k| if k % 3 == 0 { 0.7 } else { -0.7 }).collect();
        near(huber_scale(&rows(&equal), &none, 2.5), 0.7 / libm::erf(2.5 / core::f64::consts::SQRT_2).sqrt());
        near(rms_error(&rows(&equal), &none), 0.7);
        let noise: Vec<f64> = normal(4, 20_000).into_iter().map(|x| 0.03 * x).collect();
        assert!((huber_scale(&rows(&noise), &none, 2.5) / 0.03 - 1.0).abs() < 0.02);
        // One in fifty is twelve times as large: the weighted squares have their expected mean.
        let tails: Vec<f64> =
            noise.iter().enumerate().map(|(k, x)| if k % 50 == 0 { 12.0 * x } else { *x }).collect();
        let found = huber_scale(&rows(&tails), &none, 2.5);
        let counted = |x: &f64| (x / found).abs() * (x / found).abs().min(2.5);
        let share = tails.iter().map(counted).sum::<f64>() / 20_000.0;
        assert!((share - libm::erf(2.5 / core::f64::consts::SQRT_2)).abs() < 1e-3, "{share}");
        assert!(found / 0.03 > 1.1 && found / 0.03 < 1.4, "{found}");
    }
}
