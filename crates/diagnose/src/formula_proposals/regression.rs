//! Linear regression of the residual of a fit, judged on recordings that were left out.

use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_identify::score_test::ScoreTest;
use stylet_stats::linear_algebra::{SymmetricMatrix, dot};

/// Prior information on every coefficient, relative to the mean of that of the data. The one that predicts best is used: what the fitted
/// parameters can nearly take is hardly determined, and the structure that remains is far larger than the noise.
const RIDGES: [f64; 5] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// A whitened force per recording, without the part that the fitted parameters can take.
pub(super) type Column = Vec<Vec<f64>>;

/// The residual of a fit.
pub(super) struct Regression<'a> {
    score_test: ScoreTest<'a>,
}

/// Coefficients of columns.
pub(super) struct Solution {
    /// Coefficients from all recordings.
    pub coefficients: Vec<f64>,
    /// Their jackknife standard errors over the recordings.
    pub standard_errors: Vec<f64>,
    /// Gain on the recordings, each predicted from the others.
    pub held_out_nats: f64,
}

impl<'a> Regression<'a> {
    pub fn new(fit: &'a Fit, data: &'a FitData) -> Self {
        Self { score_test: ScoreTest::new(fit, data) }
    }

    /// The column of a force (N) per block: the part that no change of the fitted parameters predicts.
    pub fn column(&self, force_n: &[Vec<f64>]) -> Column {
        let mut column = self.score_test.force_column(force_n);
        let at = &self.score_test.linearization;
        let change = self.score_test.parameter_change(&column);
        let shared = at.shared.len();
        for (r, w) in column.innovations.iter_mut().enumerate() {
            for (i, parameter) in at.columns.iter().enumerate() {
                let index = if i < shared { i } else { at.index_of(i - shared, r) };
                let Some(derivative) = parameter.innovations.get(r).filter(|_| change[index] != 0.0) else {
                    continue;
                };
                w.iter_mut().zip(derivative).for_each(|(w, d)| *w -= change[index] * d);
            }
        }
        column.innovations
    }

    /// Regresses the residual on columns.
    pub fn solve(&self, columns: &[Column]) -> Option<Solution> {
        let recordings = self.score_test.data.recording_count();
        let m = columns.len();
        let residual = &self.score_test.linearization.residual.innovations;
        let parts: Vec<(SymmetricMatrix, Vec<f64>)> = (0..recordings)
            .map(|r| {
                let mut products = SymmetricMatrix::zeros(m);
                for i in 0..m {
                    (0..=i).for_each(|j| products.add(i, j, dot(&columns[i][r], &columns[j][r])));
                }
                (products, columns.iter().map(|c| dot(&c[r], &residual[r])).collect())
            })
            .collect();
        let ridged = RIDGES.iter().filter_map(|ridge| solution(&parts, *ridge));
        ridged.max_by(|a, b| a.held_out_nats.total_cmp(&b.held_out_nats))
    }
}

/// Ridge regression from normal equations per recording.
fn solution(parts: &[(SymmetricMatrix, Vec<f64>)], ridge: f64) -> Option<Solution> {
    let m = parts.first()?.1.len();
    let without = |left_out: Option<usize>| -> Option<Vec<f64>> {
        let mut matrix = SymmetricMatrix::zeros(m);
        let mut right = vec![0.0; m];
        for (_, (products, with_residual)) in parts.iter().enumerate().filter(|(r, _)| Some(*r) != left_out) {
            for i in 0..m {
                (0..=i).for_each(|j| matrix.add(i, j, products.at(i, j)));
                right[i] += with_residual[i];
            }
        }
        let mean = (0..m).map(|i| matrix.at(i, i)).sum::<f64>() / m as f64;
        (0..m).for_each(|i| matrix.add(i, i, ridge * mean));
        (mean > 0.0).then(|| matrix.cholesky().solve(&right))
    };
    let coefficients = without(None)?;
    let mut held_out_nats = 0.0;
    let mut squares = vec![0.0; m];
    for (r, (products, right)) in parts.iter().enumerate() {
        let c = without(Some(r))?;
        for i in 0..m {
            let row: f64 = (0..m).map(|j| products.at(i.max(j), i.min(j)) * c[j]).sum();
            held_out_nats += c[i] * (right[i] - 0.5 * row);
            squares[i] += (c[i] - coefficients[i]).powi(2);
        }
    }
    let n = parts.len() as f64;
    let standard_errors = squares.iter().map(|s| ((n - 1.0) / n * s).sqrt()).collect();
    Some(Solution { coefficients, standard_errors, held_out_nats })
}
