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
fn solve_inverts_the_matrix() {
    let x = matrix().cholesky().solve(&[1.0, -2.0, 0.5]);
    let back: Vec<f64> = (0..3).map(|i| (0..3).map(|j| matrix().at(i, j) * x[j]).sum()).collect();
    assert!((back[0] - 1.0).abs() < 1e-12 && (back[1] + 2.0).abs() < 1e-12 && (back[2] - 0.5).abs() < 1e-12);
}

#[test]
fn a_dependent_row_has_a_zero_solution() {
    let mut a = SymmetricMatrix::zeros(2);
    a.add(0, 0, 2.0);
    let x = a.cholesky().solve(&[2.0, 1.0]);
    assert!((x[0] - 1.0).abs() < 1e-15 && x[1] == 0.0);
    assert_eq!(a.cholesky().inverse_diagonal()[1], f64::INFINITY);
}

#[test]
fn the_determinant_agrees_with_the_rule_of_sarrus() {
    let by_hand = 4.0 * (15.0 - 1.0) - 2.0 * (6.0 + 0.6) + 0.6 * (-2.0 - 3.0);
    assert!((matrix().cholesky().log_determinant() - f64::ln(by_hand)).abs() < 1e-12);
}

#[test]
fn a_scalar_product_has_every_term_once() {
    for n in 0..12 {
        let a: Vec<f64> = (0..n).map(|k| f64::from(k) + 2.5).collect();
        let b: Vec<f64> = (0..n).map(|k| 7.0 - 1.5 * f64::from(k)).collect();
        let naive: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
        assert_eq!(dot(&a, &b), naive, "{n}");
    }
}

/// Inverse by Gauss-Jordan elimination with pivoting.
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
        let inverse_of_part = rows[k].clone();
        for i in (0..n).filter(|i| *i != k) {
            let share = rows[i][k];
            rows[i].iter_mut().zip(&inverse_of_part).for_each(|(x, y)| *x -= share * y);
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
fn the_factor_agrees_with_the_inverse() {
    let a = larger();
    let (factor, inverse) = (a.cholesky(), inverse(&a));
    let b = [1.7, -2.3, 0.9, 3.1, -0.6];
    let near = |found: f64, wanted: f64| {
        assert!((found - wanted).abs() < 1e-10 * wanted.abs().max(1.0), "{found} for {wanted}")
    };
    for i in 0..5 {
        near(factor.solve(&b)[i], (0..5).map(|j| inverse[i][j] * b[j]).sum());
        near(factor.inverse_diagonal()[i], inverse[i][i]);
    }
    let square: f64 =
        (0..5).flat_map(|i| (0..5).map(move |j| (i, j))).map(|(i, j)| b[i] * inverse[i][j] * b[j]).sum();
    near(factor.forward_substitute(&b).iter().map(|y| y * y).sum(), square);
    assert_eq!(factor.size(), 5);
    // The outer products of back-substituted unit vectors add up to the inverse.
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
fn a_submatrix_has_the_given_rows_and_columns() {
    let (a, part) = (larger(), larger().submatrix(&[3, 1, 4]));
    assert_eq!(part.size, 3);
    for (i, x) in [3, 1, 4].into_iter().enumerate() {
        for (j, y) in [3, 1, 4].into_iter().enumerate() {
            assert_eq!(part.at(i, j), a.at(x, y));
        }
    }
    let (factor, inverse_of_part) = (part.cholesky().solve(&[0.3, 0.7, -1.1]), inverse(&part));
    assert!(
        (factor[1]
            - (inverse_of_part[1][0] * 0.3 + inverse_of_part[1][1] * 0.7 - inverse_of_part[1][2] * 1.1))
            .abs()
            < 1e-10
    );
}

#[test]
fn a_row_without_information_does_not_change_the_others() {
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

/// Two columns that differ by a relative `1e-6` leave a pivot of `1e-12`, by `1e-7` one of `1e-14`.
#[test]
fn a_row_is_independent_from_a_relative_pivot_of_1e_13_on() {
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
