//! Linear solver for symmetric positive definite matrices of fixed size, without branches on the data.

use nalgebra::{SMatrix, SVector};

/// `x` with `A x = b`, by `A = L L^T`; of `A` only the lower triangle is read. A matrix that is not positive definite gives numbers that are not
/// finite.
pub(crate) fn solve_spd<const D: usize>(
    mut a: SMatrix<f64, D, D>,
    mut b: SVector<f64, D>,
) -> SVector<f64, D> {
    for j in 0..D {
        for k in 0..j {
            for i in j..D {
                a[(i, j)] -= a[(i, k)] * a[(j, k)];
            }
        }
        let pivot = libm::sqrt(a[(j, j)]);
        for i in j..D {
            a[(i, j)] /= pivot;
        }
        b[j] /= pivot;
        for i in j + 1..D {
            b[i] -= a[(i, j)] * b[j];
        }
    }
    for j in (0..D).rev() {
        for i in j + 1..D {
            b[j] -= a[(i, j)] * b[i];
        }
        b[j] /= a[(j, j)];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn solves_a_positive_definite_system_and_flags_an_indefinite_one() {
        let a = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 2.0);
        let x = Vector3::new(1.0, -2.0, 3.0);
        assert!((solve_spd(a, a * x) - x).amax() < 1e-15);
        assert!(solve_spd(-a, x).iter().any(|v| !v.is_finite()));
    }
}
