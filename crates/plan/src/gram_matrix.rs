//! Gram matrices of Jacobian columns with nuisance parameters eliminated.

use stylet_identify::fit::{JacobianColumn, Linearization};
use stylet_identify::likelihood::FitData;
use stylet_stats::linear_algebra::{SymmetricMatrix, dot};

/// Gram matrix of the columns of the shared parameters and of further ones; per-recording parameters (rupture
/// times among them) are eliminated. Priors of shared parameters are not included. In squares of whitened
/// residuals: half of an entry is in nats.
#[must_use]
pub fn gram_matrix(
    linearization: &Linearization,
    data: &FitData,
    more: &[JacobianColumn],
) -> SymmetricMatrix {
    let ns = linearization.shared.len();
    let columns: Vec<&JacobianColumn> = linearization.columns[..ns].iter().chain(more).collect();
    let per_recording = &linearization.columns[ns..];
    let n = columns.len();
    let mut out = SymmetricMatrix::zeros(n);
    for r in 0..data.recording_count() {
        let mut among = SymmetricMatrix::zeros(per_recording.len());
        for (i, a) in per_recording.iter().enumerate() {
            for (j, b) in per_recording.iter().enumerate().take(i + 1) {
                among.add(i, j, a.dot(b, r));
            }
            let sd = linearization.per_recording[i].prior_sd;
            if sd.is_finite() && sd > 0.0 {
                among.add(i, i, 1.0 / (sd * sd));
            }
        }
        let factor = among.cholesky();
        let halves: Vec<Vec<f64>> = columns
            .iter()
            .map(|c| {
                factor.forward_substitute(&per_recording.iter().map(|o| o.dot(c, r)).collect::<Vec<_>>())
            })
            .collect();
        for i in 0..n {
            for j in 0..=i {
                out.add(i, j, columns[i].dot(columns[j], r) - dot(&halves[i], &halves[j]));
            }
        }
    }
    out
}

/// Sum of two matrices of equal size.
#[must_use]
pub fn add(a: &SymmetricMatrix, b: &SymmetricMatrix) -> SymmetricMatrix {
    let mut out = a.clone();
    for i in 0..a.size.min(b.size) {
        for j in 0..=i {
            out.add(i, j, b.at(i, j));
        }
    }
    out
}

/// A diagonal entry reduced to less than this share is rounding.
const ROUNDING_SHARE: f64 = 1e-9;

/// Schur complement: the last rows of a matrix with the first `first` eliminated.
#[must_use]
pub fn schur_complement(m: &SymmetricMatrix, first: usize) -> SymmetricMatrix {
    let rows: Vec<usize> = (0..first).collect();
    let factor = m.submatrix(&rows).cholesky();
    let n = m.size - first;
    let halves: Vec<Vec<f64>> = (0..n)
        .map(|i| factor.forward_substitute(&rows.iter().map(|k| m.at(*k, first + i)).collect::<Vec<_>>()))
        .collect();
    let mut out = SymmetricMatrix::zeros(n);
    for i in 0..n {
        for j in 0..=i {
            let all = m.at(first + i, first + j);
            let left = all - dot(&halves[i], &halves[j]);
            out.add(i, j, if i == j && left < ROUNDING_SHARE * all { 0.0 } else { left });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eliminated_columns_explain_their_multiples_completely() {
        let mut m = SymmetricMatrix::zeros(2);
        m.add(0, 0, 4.0);
        m.add(0, 1, 6.0);
        m.add(1, 1, 9.0);
        assert_eq!(schur_complement(&m, 1).at(0, 0), 0.0);
        let mut other = m.clone();
        other.add(1, 1, 1.0);
        assert!((schur_complement(&other, 1).at(0, 0) - 1.0).abs() < 1e-12);
        assert_eq!(add(&m, &other).at(0, 1), 12.0);
    }
}
