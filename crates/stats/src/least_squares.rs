//! Linear least squares by normal equations, summed row by row.

use crate::linear_algebra::SymmetricMatrix;

/// Sums of a regression with at most `N` regressors.
#[derive(Clone, Debug)]
pub struct NormalEquations<const N: usize> {
    size: usize,
    /// Lower triangle of the sums of products of two regressors.
    products: [[f64; N]; N],
    /// Sums of products of a regressor and the observation.
    moments: [f64; N],
}

impl<const N: usize> NormalEquations<N> {
    /// For `size` regressors, of the `N` that there is space for.
    #[must_use]
    pub fn new(size: usize) -> Self {
        Self { size: size.min(N), products: [[0.0; N]; N], moments: [0.0; N] }
    }

    /// Adds an observation `y`; of the row only the regressors in use count.
    #[inline]
    pub fn add(&mut self, row: &[f64; N], y: f64) {
        // Rows may be sparse: a needle is in few layers at a time.
        for a in (0..self.size).filter(|a| row[*a] != 0.0) {
            self.moments[a] += row[a] * y;
            for b in 0..=a {
                self.products[a][b] += row[a] * row[b];
            }
        }
    }

    /// The matrix of the equations: sums of products of two regressors.
    #[must_use]
    pub fn matrix(&self) -> SymmetricMatrix {
        let mut matrix = SymmetricMatrix::zeros(self.size);
        for (a, row) in self.products.iter().enumerate().take(self.size) {
            for (b, value) in row.iter().enumerate().take(a + 1) {
                matrix.add(a, b, *value);
            }
        }
        matrix
    }

    /// Their right-hand side: sums of products of a regressor and the observation.
    #[must_use]
    pub fn moments(&self) -> &[f64] {
        &self.moments[..self.size]
    }

    /// The coefficients; zero for a regressor that depends linearly on earlier ones.
    #[must_use]
    pub fn solve(&self) -> Vec<f64> {
        self.matrix().cholesky().solve(self.moments())
    }
}

#[cfg(test)]
mod tests {
    use super::NormalEquations;

    #[test]
    fn a_polynomial_is_recovered_with_the_regressors_in_use() {
        let mut sums = NormalEquations::<4>::new(3);
        for k in 0..9 {
            let t = f64::from(k) - 4.0;
            // The fourth regressor is not in use.
            sums.add(&[1.0, t, t * t, 1e9], 2.0 - 3.0 * t + 0.5 * t * t);
        }
        let x = sums.solve();
        assert_eq!(x.len(), 3);
        for (found, expected) in x.iter().zip([2.0, -3.0, 0.5]) {
            assert!((found - expected).abs() < 1e-12, "{x:?}");
        }
        assert_eq!(sums.moments().len(), 3);
        assert_eq!(sums.matrix().at(0, 0), 9.0);
    }

    #[test]
    fn a_dependent_regressor_is_left_out() {
        let mut sums = NormalEquations::<2>::new(2);
        for y in [1.0, 2.0, 3.0] {
            sums.add(&[1.0, 2.0], y);
        }
        let x = sums.solve();
        assert!((x[0] - 2.0).abs() < 1e-12 && x[1] == 0.0, "{x:?}");
    }
}
