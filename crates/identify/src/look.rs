//! What every effect would gain, to first order: columns projected out of everything that is fitted already.

use crate::fit::{Column, Fit, Tangent};
use crate::linear::{Factor, Symmetric};
use crate::model::{Choice, Model};
use crate::noise::weight;
use crate::objective::Data;
use stylet_tissue::{EffectInfo, FitScale};

/// The linear picture of a fit, ready for columns.
pub struct Look<'a> {
    /// The fit.
    pub fit: &'a Fit,
    /// The data.
    pub data: &'a Data,
    /// Its linear picture.
    pub tangent: Tangent,
    factor: Factor,
    slope: Vec<f64>,
}

/// What columns would gain.
#[derive(Clone, Debug, Default)]
pub struct Gain {
    /// Nats.
    pub nats: f64,
    /// The coefficient of every column.
    pub coefficients: Vec<f64>,
    /// Nats that the columns would show at coefficients of one, after everything fitted has imitated them.
    pub visible: f64,
    /// Share of the columns' size that is left after that.
    pub left: f64,
}

impl<'a> Look<'a> {
    /// The picture around a fit.
    #[must_use]
    pub fn new(fit: &'a Fit, data: &'a Data) -> Self {
        let tangent = Tangent::new(&fit.model, data, &fit.residuals);
        let factor = tangent.factor();
        let slope = factor.half(&tangent.slope);
        Self { fit, data, tangent, factor, slope }
    }

    /// What columns would gain together.
    #[must_use]
    pub fn gain(&self, columns: &[Column]) -> Gain {
        let recordings = self.data.recordings();
        let m = columns.len();
        let halves: Vec<Vec<f64>> =
            columns.iter().map(|c| self.factor.half(&self.tangent.against(c, recordings))).collect();
        let mut s = Symmetric::zeros(m);
        let mut g = vec![0.0; m];
        let (mut visible, mut whole) = (0.0, 0.0);
        for i in 0..m {
            g[i] = columns[i].dot_all(&self.tangent.rest) - crate::linear::dot(&halves[i], &self.slope);
            for j in 0..=i {
                let all = columns[i].dot_all(&columns[j]);
                let left = all - crate::linear::dot(&halves[i], &halves[j]);
                s.add(i, j, if i == j { left.max(1e-9 * all) } else { left });
                let twice = if i == j { 1.0 } else { 2.0 };
                visible += 0.5 * twice * left;
                whole += 0.5 * twice * all;
            }
        }
        let coefficients = s.factor().solve(&g);
        let nats = 0.5 * coefficients.iter().zip(&g).map(|(x, g)| x * g).sum::<f64>();
        Gain { nats, coefficients, visible: visible.max(0.0), left: (visible / whole.max(1e-300)).max(0.0) }
    }

    /// The column of an effect with these values, beside the fitted model.
    #[must_use]
    pub fn column(&self, choice: &Choice) -> Option<Column> {
        let model = self.fit.model.with(choice.clone());
        self.tangent.difference(&self.fit.model, self.data, &self.fit.residuals, &model)
    }

    /// The column of a change of another model.
    #[must_use]
    pub fn change(&self, other: &Model) -> Option<Column> {
        self.tangent.difference(&self.fit.model, self.data, &self.fit.residuals, other)
    }

    /// The column of a predicted force given block by block (N), one vector per recording.
    #[must_use]
    pub fn of_force(&self, force: &[Vec<f64>]) -> Column {
        let mut column = Column::default();
        for (r, force) in force.iter().enumerate() {
            let mut w = self.data.whiten(r, force);
            w.iter_mut().zip(&self.fit.residuals.w[r]).for_each(|(w, at)| *w *= weight(*at).sqrt());
            column.w.push(w);
            column.rows.push(vec![0.0; 4 * self.fit.residuals.events[r].len()]);
        }
        column
    }
}

/// The values at which columns with these coefficients stand: strengths scaled, shapes as they are.
#[must_use]
pub fn scaled(info: &EffectInfo, group: &[&[f64]], coefficients: &[f64]) -> Vec<f64> {
    info.parameters
        .iter()
        .enumerate()
        .map(|(k, p)| {
            if !p.strength {
                return group[0][k];
            }
            let scale = p.fit_scale();
            let into = |x: f64| if scale == FitScale::Reciprocal { 1.0 / x } else { x };
            let neutral = into(p.neutral);
            let sum: f64 = group.iter().zip(coefficients).map(|(g, c)| c * (into(g[k]) - neutral)).sum();
            let value = neutral + sum;
            let (from, to) = p.search;
            if scale == FitScale::Reciprocal {
                // No softer than a fit may go.
                1.0 / value.clamp(1e-12, 10.0 / from)
            } else {
                value.clamp(p.low.max(from - (to - from)), p.high.min(to + 3.0 * (to - from)))
            }
        })
        .collect()
}
