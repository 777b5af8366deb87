//! Scalar products of columns with everything that is fitted beside them taken out.

use stylet_identify::fit::{Column, Tangent};
use stylet_identify::objective::Data;
use stylet_stats::linear::{Symmetric, dot};

/// Products of the shared numbers' columns and of further ones, the numbers of each recording's own (instants of ruptures
/// among them) eliminated; no priors of shared numbers. In squares of whitened residuals: half of a product is nats.
#[must_use]
pub fn products(tangent: &Tangent, data: &Data, more: &[Column]) -> Symmetric {
    let ns = tangent.shared.len();
    let columns: Vec<&Column> = tangent.columns[..ns].iter().chain(more).collect();
    let own = &tangent.columns[ns..];
    let n = columns.len();
    let mut out = Symmetric::zeros(n);
    for r in 0..data.recordings() {
        let mut among = Symmetric::zeros(own.len());
        for (i, a) in own.iter().enumerate() {
            for (j, b) in own.iter().enumerate().take(i + 1) {
                among.add(i, j, a.dot(b, r));
            }
            let sd = tangent.own[i].sd;
            if sd.is_finite() && sd > 0.0 {
                among.add(i, i, 1.0 / (sd * sd));
            }
        }
        let factor = among.factor();
        let halves: Vec<Vec<f64>> = columns
            .iter()
            .map(|c| factor.half(&own.iter().map(|o| o.dot(c, r)).collect::<Vec<_>>()))
            .collect();
        for i in 0..n {
            for j in 0..=i {
                out.add(i, j, columns[i].dot(columns[j], r) - dot(&halves[i], &halves[j]));
            }
        }
    }
    out
}

/// The sum of two matrices of one size.
#[must_use]
pub fn sum(a: &Symmetric, b: &Symmetric) -> Symmetric {
    let mut out = a.clone();
    for i in 0..a.size.min(b.size) {
        for j in 0..=i {
            out.add(i, j, b.at(i, j));
        }
    }
    out
}

/// What is left of a column whose size is this share of what it was, is rounding.
const ROUNDING: f64 = 1e-9;

/// The last rows of a matrix with its first `first` eliminated.
#[must_use]
pub fn without_first(m: &Symmetric, first: usize) -> Symmetric {
    let rows: Vec<usize> = (0..first).collect();
    let factor = m.part(&rows).factor();
    let n = m.size - first;
    let halves: Vec<Vec<f64>> =
        (0..n).map(|i| factor.half(&rows.iter().map(|k| m.at(*k, first + i)).collect::<Vec<_>>())).collect();
    let mut out = Symmetric::zeros(n);
    for i in 0..n {
        for j in 0..=i {
            let all = m.at(first + i, first + j);
            let left = all - dot(&halves[i], &halves[j]);
            out.add(i, j, if i == j && left < ROUNDING * all { 0.0 } else { left });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_eliminated_explains_its_own_multiples_completely() {
        let mut m = Symmetric::zeros(2);
        m.add(0, 0, 4.0);
        m.add(0, 1, 6.0);
        m.add(1, 1, 9.0);
        assert_eq!(without_first(&m, 1).at(0, 0), 0.0);
        let mut other = m.clone();
        other.add(1, 1, 1.0);
        assert!((without_first(&other, 1).at(0, 0) - 1.0).abs() < 1e-12);
        assert_eq!(sum(&m, &other).at(0, 1), 12.0);
    }
}
