//! Small dense linear algebra in a fixed order of operations: the same bits on every machine.
#![allow(clippy::needless_range_loop, reason = "rows and columns share the index")]

/// A symmetric matrix, stored by rows.
#[derive(Clone, Debug, Default)]
pub struct SymmetricMatrix {
    /// Number of rows.
    pub size: usize,
    values: Vec<f64>,
}

impl SymmetricMatrix {
    /// All zeros.
    #[must_use]
    pub fn zeros(size: usize) -> Self {
        Self { size, values: vec![0.0; size * size] }
    }

    /// An element.
    #[must_use]
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.values[i * self.size + j]
    }

    /// Adds to an element and its mirror element.
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        self.values[i * self.size + j] += value;
        if i != j {
            self.values[j * self.size + i] += value;
        }
    }

    /// The matrix of the given rows and columns.
    #[must_use]
    pub fn submatrix(&self, rows: &[usize]) -> Self {
        let values = rows.iter().flat_map(|i| rows.iter().map(|j| self.at(*i, *j))).collect();
        Self { size: rows.len(), values }
    }

    /// Cholesky factor. Rows that are linearly dependent on earlier ones (pivot below `1e-13` of the diagonal) are left out:
    /// the solution is zero there.
    #[must_use]
    pub fn cholesky(&self) -> CholeskyFactor {
        let n = self.size;
        let mut l = vec![0.0; n * n];
        let mut kept = vec![true; n];
        for j in 0..n {
            let mut pivot = self.at(j, j);
            for k in 0..j {
                pivot -= l[j * n + k] * l[j * n + k];
            }
            if pivot.is_nan() || pivot <= 1e-13 * self.at(j, j).abs() || self.at(j, j) <= 0.0 {
                kept[j] = false;
                continue;
            }
            let root = pivot.sqrt();
            l[j * n + j] = root;
            for i in j + 1..n {
                let mut value = self.at(i, j);
                for k in 0..j {
                    value -= l[i * n + k] * l[j * n + k];
                }
                l[i * n + j] = value / root;
            }
        }
        CholeskyFactor { size: n, l, kept }
    }
}

/// Cholesky factor of a [`SymmetricMatrix`].
#[derive(Clone, Debug)]
pub struct CholeskyFactor {
    size: usize,
    l: Vec<f64>,
    kept: Vec<bool>,
}

impl CholeskyFactor {
    /// Solves `L y = b`: the whitened right-hand side, with `y'y = b' A^-1 b`.
    #[must_use]
    pub fn forward_substitute(&self, b: &[f64]) -> Vec<f64> {
        let n = self.size;
        let mut y = vec![0.0; n];
        for i in 0..n {
            if self.kept[i] {
                let sum: f64 = (0..i).map(|k| self.l[i * n + k] * y[k]).sum();
                y[i] = (b[i] - sum) / self.l[i * n + i];
            }
        }
        y
    }

    /// Solves `A x = b`.
    #[must_use]
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        self.back_substitute(&self.forward_substitute(b))
    }

    /// Number of rows.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// Solves `L' x = y`: maps independent variables of unit variance to variables of covariance `A^-1`.
    #[must_use]
    pub fn back_substitute(&self, y: &[f64]) -> Vec<f64> {
        let n = self.size;
        let mut x: Vec<f64> =
            y.iter().zip(&self.kept).map(|(y, kept)| if *kept { *y } else { 0.0 }).collect();
        for i in (0..n).rev() {
            if self.kept[i] {
                let sum: f64 = (i + 1..n).map(|k| self.l[k * n + i] * x[k]).sum();
                x[i] = (x[i] - sum) / self.l[i * n + i];
            }
        }
        x
    }

    /// `L y`: maps independent variables of unit variance to variables of covariance `A`.
    #[must_use]
    pub fn multiply(&self, y: &[f64]) -> Vec<f64> {
        let row =
            |i: usize| (0..=i).filter(|k| self.kept[*k]).map(|k| self.l[i * self.size + k] * y[k]).sum();
        (0..self.size).map(row).collect()
    }

    /// Diagonal of the inverse; infinite for rows that were left out.
    #[must_use]
    pub fn inverse_diagonal(&self) -> Vec<f64> {
        (0..self.size)
            .map(|i| {
                if !self.kept[i] {
                    return f64::INFINITY;
                }
                let mut unit = vec![0.0; self.size];
                unit[i] = 1.0;
                self.forward_substitute(&unit).iter().map(|y| y * y).sum()
            })
            .collect()
    }

    /// Logarithm of the determinant, without the rows that were left out.
    #[must_use]
    pub fn log_determinant(&self) -> f64 {
        (0..self.size).filter(|i| self.kept[*i]).map(|i| 2.0 * libm::log(self.l[i * self.size + i])).sum()
    }
}

/// Scalar product, in a fixed order.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight independent partial sums: a fixed order that the compiler can vectorise.
    let mut sums = [0.0; 8];
    let (a8, a1) = a.as_chunks::<8>();
    let (b8, b1) = b.as_chunks::<8>();
    for (x, y) in a8.iter().zip(b8) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    let rest: f64 = a1.iter().zip(b1).map(|(x, y)| x * y).sum();
    let half = |s: &[f64]| (s[0] + s[1]) + (s[2] + s[3]);
    half(&sums[..4]) + half(&sums[4..]) + rest
}

#[cfg(test)]
mod tests;
