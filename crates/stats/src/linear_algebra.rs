//! Small dense linear algebra in a fixed order of operations: the same bits on every machine.
#![allow(clippy::needless_range_loop, reason = "rows and columns share the index")]

/// A symmetric matrix by rows.
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

    /// Adds to an element and to the one opposite.
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        self.values[i * self.size + j] += value;
        if i != j {
            self.values[j * self.size + i] += value;
        }
    }

    /// The rows and columns named.
    #[must_use]
    pub fn submatrix(&self, rows: &[usize]) -> Self {
        let values = rows.iter().flat_map(|i| rows.iter().map(|j| self.at(*i, *j))).collect();
        Self { size: rows.len(), values }
    }

    /// Cholesky factor; directions that the matrix does not hold (pivot below `1e-13` of the diagonal) are left out: the
    /// solution is zero there.
    #[must_use]
    pub fn cholesky(&self) -> CholeskyFactor {
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
        CholeskyFactor { size: n, l, live }
    }
}

/// Cholesky factor of a [`Symmetric`].
#[derive(Clone, Debug)]
pub struct CholeskyFactor {
    size: usize,
    l: Vec<f64>,
    live: Vec<bool>,
}

impl CholeskyFactor {
    /// Solves `L y = b`: the whitened right-hand side, whose square is `b' A^-1 b`.
    #[must_use]
    pub fn forward_substitute(&self, b: &[f64]) -> Vec<f64> {
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
        self.back_substitute(&self.forward_substitute(b))
    }

    /// Number of rows.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// Solves `L' x = y`: independent numbers of variance one become ones with the covariance `A^-1`.
    #[must_use]
    pub fn back_substitute(&self, y: &[f64]) -> Vec<f64> {
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
                self.forward_substitute(&unit).iter().map(|y| y * y).sum()
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
    // Eight sums side by side: fixed order, no dependence between neighbours.
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
mod tests {
    use super::{SymmetricMatrix, dot};

    fn matrix() -> SymmetricMatrix {
        let mut a = SymmetricMatrix::zeros(3);
        for (i, row) in [[4.0, 2.0, 0.6], [2.0, 5.0, -1.0], [0.6, -1.0, 3.0]].iter().enumerate() {
            for (j, x) in row.iter().enumerate().take(i + 1) {
                a.add(i, j, *x);
            }
        }
        a
    }

    #[test]
    fn a_system_is_solved() {
        let x = matrix().cholesky().solve(&[1.0, -2.0, 0.5]);
        let back: Vec<f64> = (0..3).map(|i| (0..3).map(|j| matrix().at(i, j) * x[j]).sum()).collect();
        assert!(
            (back[0] - 1.0).abs() < 1e-12 && (back[1] + 2.0).abs() < 1e-12 && (back[2] - 0.5).abs() < 1e-12
        );
    }

    #[test]
    fn a_direction_that_the_matrix_does_not_hold_stays_zero() {
        let mut a = SymmetricMatrix::zeros(2);
        a.add(0, 0, 2.0);
        let x = a.cholesky().solve(&[2.0, 1.0]);
        assert!((x[0] - 1.0).abs() < 1e-15 && x[1] == 0.0);
        assert_eq!(a.cholesky().inverse_diagonal()[1], f64::INFINITY);
    }

    #[test]
    fn the_determinant_is_that_of_the_rule_of_sarrus() {
        let by_hand = 4.0 * (15.0 - 1.0) - 2.0 * (6.0 + 0.6) + 0.6 * (-2.0 - 3.0);
        assert!((matrix().cholesky().log_determinant() - f64::ln(by_hand)).abs() < 1e-12);
    }

    #[test]
    fn a_scalar_product_has_every_element_once() {
        for n in 0..12 {
            let a: Vec<f64> = (0..n).map(|k| f64::from(k) + 2.5).collect();
            let b: Vec<f64> = (0..n).map(|k| 7.0 - 1.5 * f64::from(k)).collect();
            let naive: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            assert_eq!(dot(&a, &b), naive, "{n}");
        }
    }

    /// Gauss and Jordan, with the largest pivot.
    fn inverse(a: &SymmetricMatrix) -> Vec<Vec<f64>> {
        let n = a.size;
        let unit = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
        let row = |i: usize| (0..n).map(|j| a.at(i, j)).chain((0..n).map(|j| unit(i, j))).collect();
        let mut rows: Vec<Vec<f64>> = (0..n).map(row).collect();
        for k in 0..n {
            let best = (k..n).max_by(|i, j| rows[*i][k].abs().total_cmp(&rows[*j][k].abs())).expect("rows");
            rows.swap(k, best);
            let pivot = rows[k][k];
            rows[k].iter_mut().for_each(|x| *x /= pivot);
            let own = rows[k].clone();
            for i in (0..n).filter(|i| *i != k) {
                let share = rows[i][k];
                rows[i].iter_mut().zip(&own).for_each(|(x, y)| *x -= share * y);
            }
        }
        rows.into_iter().map(|r| r[n..].to_vec()).collect()
    }

    /// A sum of outer products, five rows.
    fn larger() -> SymmetricMatrix {
        let mut a = SymmetricMatrix::zeros(5);
        for k in 0..9 {
            let row: Vec<f64> =
                (0..5).map(|i| libm::sin(1.3 * f64::from(k) + 2.1 * f64::from(i) + 0.4)).collect();
            for i in 0..5 {
                for j in 0..=i {
                    a.add(i, j, row[i] * row[j]);
                }
            }
        }
        for i in 0..5 {
            a.add(i, i, 0.3 + 0.1 * i as f64);
        }
        a
    }

    #[test]
    fn a_factor_gives_what_the_inverse_gives() {
        let a = larger();
        let (factor, inverse) = (a.cholesky(), inverse(&a));
        let b = [1.7, -2.3, 0.9, 3.1, -0.6];
        let near = |told: f64, wanted: f64| {
            assert!((told - wanted).abs() < 1e-10 * wanted.abs().max(1.0), "{told} for {wanted}")
        };
        for i in 0..5 {
            near(factor.solve(&b)[i], (0..5).map(|j| inverse[i][j] * b[j]).sum());
            near(factor.inverse_diagonal()[i], inverse[i][i]);
        }
        let square: f64 =
            (0..5).flat_map(|i| (0..5).map(move |j| (i, j))).map(|(i, j)| b[i] * inverse[i][j] * b[j]).sum();
        near(factor.forward_substitute(&b).iter().map(|y| y * y).sum(), square);
        assert_eq!(factor.size(), 5);
        // `back` of unit vectors: columns whose outer products add up to the inverse.
        let columns: Vec<Vec<f64>> = (0..5)
            .map(|k| factor.back_substitute(&[0, 1, 2, 3, 4].map(|i| f64::from(u8::from(i == k)))))
            .collect();
        for i in 0..5 {
            for j in 0..5 {
                near(columns.iter().map(|c| c[i] * c[j]).sum(), inverse[i][j]);
            }
        }
    }

    #[test]
    fn rows_named_make_a_matrix_of_their_own() {
        let (a, part) = (larger(), larger().submatrix(&[3, 1, 4]));
        assert_eq!(part.size, 3);
        for (i, x) in [3, 1, 4].into_iter().enumerate() {
            for (j, y) in [3, 1, 4].into_iter().enumerate() {
                assert_eq!(part.at(i, j), a.at(x, y));
            }
        }
        let (factor, own) = (part.cholesky().solve(&[0.3, 0.7, -1.1]), inverse(&part));
        assert!((factor[1] - (own[1][0] * 0.3 + own[1][1] * 0.7 - own[1][2] * 1.1)).abs() < 1e-10);
    }

    /// What the others say of one another does not depend on a direction in the middle that the matrix does not hold.
    #[test]
    fn directions_in_the_middle_that_are_not_held_change_nothing_for_the_others() {
        let held = larger();
        let wide = |middle: f64| {
            let mut a = SymmetricMatrix::zeros(6);
            let place = |i: usize| i + usize::from(i >= 2);
            for i in 0..5 {
                for j in 0..=i {
                    a.add(place(i), place(j), held.at(i, j));
                }
            }
            a.add(2, 2, middle);
            a
        };
        let b = [1.7, -2.3, 99.0, 0.9, 3.1, -0.6];
        let alone = held.cholesky().solve(&[1.7, -2.3, 0.9, 3.1, -0.6]);
        for middle in [0.0, -3.0, f64::NAN] {
            let factor = wide(middle).cholesky();
            let x = factor.solve(&b);
            assert_eq!([x[0], x[1], x[3], x[4], x[5]], alone[..], "{middle}");
            assert_eq!(x[2], 0.0);
            assert_eq!(factor.forward_substitute(&b)[2], 0.0);
            assert_eq!(factor.inverse_diagonal()[2], f64::INFINITY);
            assert_eq!(factor.log_determinant(), held.cholesky().log_determinant());
        }
    }

    /// Of two columns that differ by a share of `1e-6` the second has a pivot of `1e-12`, by one of `1e-7` of `1e-14`.
    #[test]
    fn a_direction_is_held_from_a_share_of_1e_13_on() {
        let twin = |off: f64| {
            let mut a = SymmetricMatrix::zeros(2);
            a.add(0, 0, 4.0);
            a.add(1, 0, 4.0);
            a.add(1, 1, 4.0 * (1.0 + off));
            a.cholesky().inverse_diagonal()[1]
        };
        assert!(twin(4e-13).is_finite() && twin(1.5e-13).is_finite());
        assert!(twin(5e-14).is_infinite() && twin(0.0).is_infinite());
    }
}
