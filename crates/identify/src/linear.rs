//! Small dense linear algebra in a fixed order of operations: the same bits on every machine.

/// A symmetric matrix by rows.
#[derive(Clone, Debug, Default)]
pub struct Symmetric {
    /// Number of rows.
    pub size: usize,
    values: Vec<f64>,
}

impl Symmetric {
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

    /// Adds to an element and to the one opposite.
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        self.values[i * self.size + j] += value;
        if i != j {
            self.values[j * self.size + i] += value;
        }
    }

    /// The rows and columns named.
    #[must_use]
    pub fn part(&self, rows: &[usize]) -> Self {
        let values = rows.iter().flat_map(|i| rows.iter().map(|j| self.at(*i, *j))).collect();
        Self { size: rows.len(), values }
    }

    /// Cholesky factor; directions that the matrix does not hold (pivot below `1e-13` of the diagonal) are left out: the
    /// solution is zero there.
    #[must_use]
    pub fn factor(&self) -> Factor {
        let n = self.size;
        let mut l = vec![0.0; n * n];
        let mut live = vec![true; n];
        for j in 0..n {
            let mut pivot = self.at(j, j);
            for k in 0..j {
                pivot -= l[j * n + k] * l[j * n + k];
            }
            if pivot.is_nan() || pivot <= 1e-13 * self.at(j, j).abs() || self.at(j, j) <= 0.0 {
                live[j] = false;
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
        Factor { size: n, l, live }
    }
}

/// Cholesky factor of a [`Symmetric`].
#[derive(Clone, Debug)]
pub struct Factor {
    size: usize,
    l: Vec<f64>,
    live: Vec<bool>,
}

impl Factor {
    /// Solves `L y = b`: the whitened right-hand side, whose square is `b' A^-1 b`.
    #[must_use]
    pub fn half(&self, b: &[f64]) -> Vec<f64> {
        let n = self.size;
        let mut y = vec![0.0; n];
        for i in 0..n {
            if self.live[i] {
                let sum: f64 = (0..i).map(|k| self.l[i * n + k] * y[k]).sum();
                y[i] = (b[i] - sum) / self.l[i * n + i];
            }
        }
        y
    }

    /// Solves `A x = b`.
    #[must_use]
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        self.back(&self.half(b))
    }

    /// Number of rows.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// Solves `L' x = y`: independent numbers of variance one become ones with the covariance `A^-1`.
    #[must_use]
    pub fn back(&self, y: &[f64]) -> Vec<f64> {
        let n = self.size;
        let mut x: Vec<f64> =
            y.iter().zip(&self.live).map(|(y, live)| if *live { *y } else { 0.0 }).collect();
        for i in (0..n).rev() {
            if self.live[i] {
                let sum: f64 = (i + 1..n).map(|k| self.l[k * n + i] * x[k]).sum();
                x[i] = (x[i] - sum) / self.l[i * n + i];
            }
        }
        x
    }

    /// Diagonal of the inverse; infinite where the matrix holds nothing.
    #[must_use]
    pub fn inverse_diagonal(&self) -> Vec<f64> {
        (0..self.size)
            .map(|i| {
                if !self.live[i] {
                    return f64::INFINITY;
                }
                let mut unit = vec![0.0; self.size];
                unit[i] = 1.0;
                self.half(&unit).iter().map(|y| y * y).sum()
            })
            .collect()
    }

    /// Logarithm of the determinant over the directions that it holds.
    #[must_use]
    pub fn log_determinant(&self) -> f64 {
        (0..self.size).filter(|i| self.live[*i]).map(|i| 2.0 * libm::log(self.l[i * self.size + i])).sum()
    }
}

/// Scalar product, in order.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums side by side: fixed order, no dependence between neighbours.
    let mut sums = [0.0; 4];
    let (a4, a1) = a.as_chunks::<4>();
    let (b4, b1) = b.as_chunks::<4>();
    for (x, y) in a4.iter().zip(b4) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    let rest: f64 = a1.iter().zip(b1).map(|(x, y)| x * y).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::{Symmetric, dot};

    fn matrix() -> Symmetric {
        let mut a = Symmetric::zeros(3);
        for (i, row) in [[4.0, 2.0, 0.6], [2.0, 5.0, -1.0], [0.6, -1.0, 3.0]].iter().enumerate() {
            for (j, x) in row.iter().enumerate().take(i + 1) {
                a.add(i, j, *x);
            }
        }
        a
    }

    #[test]
    fn a_system_is_solved() {
        let x = matrix().factor().solve(&[1.0, -2.0, 0.5]);
        let back: Vec<f64> = (0..3).map(|i| (0..3).map(|j| matrix().at(i, j) * x[j]).sum()).collect();
        assert!(
            (back[0] - 1.0).abs() < 1e-12 && (back[1] + 2.0).abs() < 1e-12 && (back[2] - 0.5).abs() < 1e-12
        );
    }

    #[test]
    fn a_direction_that_the_matrix_does_not_hold_stays_zero() {
        let mut a = Symmetric::zeros(2);
        a.add(0, 0, 2.0);
        let x = a.factor().solve(&[2.0, 1.0]);
        assert!((x[0] - 1.0).abs() < 1e-15 && x[1] == 0.0);
        assert_eq!(a.factor().inverse_diagonal()[1], f64::INFINITY);
    }

    #[test]
    fn the_determinant_is_that_of_the_rule_of_sarrus() {
        let by_hand = 4.0 * (15.0 - 1.0) - 2.0 * (6.0 + 0.6) + 0.6 * (-2.0 - 3.0);
        assert!((matrix().factor().log_determinant() - f64::ln(by_hand)).abs() < 1e-12);
    }

    #[test]
    fn a_scalar_product_has_every_element_once() {
        let a: Vec<f64> = (0..11).map(f64::from).collect();
        assert_eq!(dot(&a, &a), 385.0);
    }
}
