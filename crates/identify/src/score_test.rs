//! Score test of additional columns: first-order gain in nats after projection onto the complement of all fitted parameters.

use crate::fit::{Fit, JacobianColumn, Linearization};
use crate::likelihood::FitData;
use crate::model::EffectTerm;
use crate::noise::huber_weight;
use stylet_stats::linear_algebra::{CholeskyFactor, SymmetricMatrix};
use stylet_tissue::{EffectInfo, FitScale};

/// Linearization of a fit at which columns are tested.
pub struct ScoreTest<'a> {
    /// The fit.
    pub fit: &'a Fit,
    /// The data.
    pub data: &'a FitData,
    /// Linearization of the fit.
    pub linearization: Linearization,
    factor: CholeskyFactor,
    half_neg_gradient: Vec<f64>,
}

/// Result of testing columns.
#[derive(Clone, Debug, Default)]
pub struct ScoreTestResult {
    /// Predicted gain in nats.
    pub nats: f64,
    /// Coefficient of every column.
    pub coefficients: Vec<f64>,
    /// Gain (nats) that unit coefficients would give if the columns were present, after projection.
    pub detectable_nats: f64,
    /// Share of the columns' squared norm that remains after projection.
    pub unexplained_share: f64,
}

impl<'a> ScoreTest<'a> {
    /// Linearizes a fit.
    #[must_use]
    pub fn new(fit: &'a Fit, data: &'a FitData) -> Self {
        let linearization = Linearization::new(&fit.model, data, &fit.residuals);
        let factor = linearization.factor();
        let slope = factor.forward_substitute(&linearization.neg_gradient);
        Self { fit, data, linearization, factor, half_neg_gradient: slope }
    }

    /// Joint predicted gain of columns.
    #[must_use]
    pub fn gain(&self, columns: &[JacobianColumn]) -> ScoreTestResult {
        let recordings = self.data.recording_count();
        let m = columns.len();
        let halves: Vec<Vec<f64>> = columns
            .iter()
            .map(|c| self.factor.forward_substitute(&self.linearization.products_with(c, recordings)))
            .collect();
        let mut s = SymmetricMatrix::zeros(m);
        let mut g = vec![0.0; m];
        let (mut visible, mut whole) = (0.0, 0.0);
        for i in 0..m {
            g[i] = columns[i].dot_all(&self.linearization.residual)
                - stylet_stats::linear_algebra::dot(&halves[i], &self.half_neg_gradient);
            for j in 0..=i {
                let all = columns[i].dot_all(&columns[j]);
                let left = all - stylet_stats::linear_algebra::dot(&halves[i], &halves[j]);
                s.add(i, j, if i == j { left.max(1e-9 * all) } else { left });
                let twice = if i == j { 1.0 } else { 2.0 };
                visible += 0.5 * twice * left;
                whole += 0.5 * twice * all;
            }
        }
        let coefficients = s.cholesky().solve(&g);
        let nats = 0.5 * coefficients.iter().zip(&g).map(|(x, g)| x * g).sum::<f64>();
        ScoreTestResult {
            nats,
            coefficients,
            detectable_nats: visible.max(0.0),
            unexplained_share: (visible / whole.max(1e-300)).max(0.0),
        }
    }

    /// Change of all fitted parameters, in the order of the normal matrix, that predicts a column best.
    #[must_use]
    pub fn parameter_change(&self, column: &JacobianColumn) -> Vec<f64> {
        self.factor.solve(&self.linearization.products_with(column, self.data.recording_count()))
    }

    /// Column of an effect with these values: the change of the prediction when it is added to the fitted model.
    #[must_use]
    pub fn effect_column(&self, term: &EffectTerm) -> Option<JacobianColumn> {
        let model = self.fit.model.with_effect(term.clone());
        self.linearization.difference(&self.fit.model, self.data, &self.fit.residuals, &model)
    }

    /// Column of an additional force (N) per block, one vector per recording.
    #[must_use]
    pub fn force_column(&self, force: &[Vec<f64>]) -> JacobianColumn {
        let mut column = JacobianColumn::default();
        for (r, force) in force.iter().enumerate() {
            let mut w = self.data.whiten(r, force);
            w.iter_mut()
                .zip(&self.fit.residuals.innovations[r])
                .for_each(|(w, at)| *w *= huber_weight(*at).sqrt());
            column.innovations.push(w);
            column.rupture_rows.push(vec![0.0; 4 * self.fit.residuals.ruptures[r].len()]);
        }
        column
    }
}

/// Effect values for fitted coefficients: strengths are scaled and summed over the group, shape parameters keep their values.
#[must_use]
pub fn scale_strengths(info: &EffectInfo, group: &[&[f64]], coefficients: &[f64]) -> Vec<f64> {
    info.parameters
        .iter()
        .enumerate()
        .map(|(k, p)| {
            if !p.strength {
                return group[0][k];
            }
            let scale = p.fit_scale();
            let into = |x: f64| if scale == FitScale::Reciprocal { 1.0 / x } else { x };
            let neutral = into(p.inactive);
            let sum: f64 = group.iter().zip(coefficients).map(|(g, c)| c * (into(g[k]) - neutral)).sum();
            let value = neutral + sum;
            let (from, to) = p.search;
            if scale == FitScale::Reciprocal {
                // Limits the compliance to the bounds of a fit.
                1.0 / value.clamp(1e-12, 10.0 / from)
            } else {
                value.clamp(p.low.max(from - (to - from)), p.high.min(to + 3.0 * (to - from)))
            }
        })
        .collect()
}

#[cfg(test)]
mod tests;
