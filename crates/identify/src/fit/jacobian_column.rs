use core::ops::Range;
use stylet_stats::linear_algebra::dot;

/// One column of the Jacobian of all residuals, which are normalised by their standard deviations.
#[derive(Clone, Debug, Default)]
pub struct JacobianColumn {
    /// Change of the predicted force, whitened and weighted, per recording.
    pub innovations: Vec<Vec<f64>>,
    /// Change of the rupture residuals, per recording.
    pub rupture_rows: Vec<Vec<f64>>,
}

impl JacobianColumn {
    /// Scalar product over one recording.
    #[must_use]
    pub fn dot(&self, other: &Self, r: usize) -> f64 {
        let part = |a: &Vec<Vec<f64>>, b: &Vec<Vec<f64>>| match (a.get(r), b.get(r)) {
            (Some(a), Some(b)) => dot(a, b),
            _ => 0.0,
        };
        part(&self.innovations, &other.innovations) + part(&self.rupture_rows, &other.rupture_rows)
    }

    /// Scalar product over all recordings.
    pub(crate) fn dot_all(&self, other: &Self) -> f64 {
        (0..self.innovations.len()).map(|r| self.dot(other, r)).sum()
    }
}

/// Range of blocks with non-zero entries in every recording: most parameters affect part of a recording.
pub(super) fn support(column: &JacobianColumn) -> Vec<Range<usize>> {
    let of = |w: &Vec<f64>| {
        let first = w.iter().position(|w| *w != 0.0).unwrap_or(w.len());
        first..w.iter().rposition(|w| *w != 0.0).map_or(first, |k| k + 1)
    };
    column.innovations.iter().map(of).collect()
}
