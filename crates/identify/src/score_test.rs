//! Score test: first-order gain of additional columns, projected onto the complement of all fitted parameters.

use crate::fit::{Fit, JacobianColumn, Linearization};
use crate::likelihood::FitData;
use crate::model::{EffectTerm, Model};
use crate::noise::HUBER_LOSS;
use stylet_stats::linear_algebra::{CholeskyFactor, SymmetricMatrix};
use stylet_tissue::{EffectInfo, FitScale};

/// Linearization of a fit, ready to test columns.
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
    /// Gain in nats.
    pub nats: f64,
    /// Coefficient of every column.
    pub coefficients: Vec<f64>,
    /// Nats that the columns would contribute with unit coefficients, after projection.
    pub detectable_nats: f64,
    /// Share of the columns' squared norm that remains after projection.
    pub unexplained_share: f64,
}

impl<'a> ScoreTest<'a> {
    /// Linearization around a fit.
    #[must_use]
    pub fn new(fit: &'a Fit, data: &'a FitData) -> Self {
        let tangent = Linearization::new(&fit.model, data, &fit.residuals);
        let factor = tangent.factor();
        let slope = factor.forward_substitute(&tangent.neg_gradient);
        Self { fit, data, linearization: tangent, factor, half_neg_gradient: slope }
    }

    /// Joint gain of columns.
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

    /// Column of an effect with these values, added to the fitted model.
    #[must_use]
    pub fn effect_column(&self, choice: &EffectTerm) -> Option<JacobianColumn> {
        let model = self.fit.model.with_effect(choice.clone());
        self.linearization.difference(&self.fit.model, self.data, &self.fit.residuals, &model)
    }

    /// Column of the difference to another model.
    #[must_use]
    pub fn model_change_column(&self, other: &Model) -> Option<JacobianColumn> {
        self.linearization.difference(&self.fit.model, self.data, &self.fit.residuals, other)
    }

    /// Column of a force given per block (N), one vector per recording.
    #[must_use]
    pub fn force_column(&self, force: &[Vec<f64>]) -> JacobianColumn {
        let mut column = JacobianColumn::default();
        for (r, force) in force.iter().enumerate() {
            let mut w = self.data.whiten(r, force);
            w.iter_mut()
                .zip(&self.fit.residuals.innovations[r])
                .for_each(|(w, at)| *w *= HUBER_LOSS.weight(*at).sqrt());
            column.innovations.push(w);
            column.rupture_rows.push(vec![0.0; 4 * self.fit.residuals.ruptures[r].len()]);
        }
        column
    }
}

/// Effect values for these coefficients: strengths are scaled, shape parameters keep their values.
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
                // Not more compliant than a fit may go.
                1.0 / value.clamp(1e-12, 10.0 / from)
            } else {
                value.clamp(p.low.max(from - (to - from)), p.high.min(to + 3.0 * (to - from)))
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block_averages::{BLOCK_S, BlockAverages};
    use crate::likelihood::residuals;
    use crate::model::{Assumptions, NO_RUPTURE};
    use crate::noise::Noise;
    use std::sync::Arc;
    use stylet_record::Recording;
    use stylet_tissue::{Layer, Tissue, effect_info};

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-6 * wanted.abs().max(1e-9), "{told} for {wanted}");
    }

    /// Two recordings of a layer that does not rupture, and a model that is slightly off.
    fn given() -> (Fit, FitData) {
        let layer = Layer {
            thickness_m: 0.03,
            stiffness_n_per_m: 100.0,
            friction_ns_per_m2: 3000.0,
            puncture_n: None,
            name: String::new(),
        };
        let belief = Assumptions {
            tissue: Tissue { surface_m: 0.002, layers: vec![layer] },
            known_effects: Vec::new(),
            tolerance: vec![0.3],
            thickness_tolerance: vec![0.1],
            surface_tolerance_m: 0.002,
        };
        let mut model = Model::base(Arc::new(belief), 2);
        model.free.recording_surface = true;
        model.rupture_times_s = vec![vec![NO_RUPTURE]; 2];
        let recorded = |seed: usize| {
            let t: Vec<f64> = (0..800).map(|k| f64::from(k) * 0.005).collect();
            let z: Vec<f64> = t.iter().map(|t| 0.004 * t + 4e-4 * (2.0 * t).sin()).collect();
            let force = |(k, z): (usize, &f64)| {
                110.0 * (z - 0.002).max(0.0) + 0.05 + 0.02 * (1.7 * (k * k % (89 + seed)) as f64).sin()
            };
            let f = z.iter().enumerate().map(force).collect();
            BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
        };
        let data = FitData::new(Arc::new(vec![recorded(0), recorded(12)]), Noise::white(0.2), 0.0);
        let residuals = residuals(&model, &data).expect("a replay");
        (Fit { model, residuals }, data)
    }

    /// Gaussian elimination with pivoting.
    fn solved(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
        let n = b.len();
        for i in 0..n {
            let p = (i..n).max_by(|x, y| a[*x][i].abs().total_cmp(&a[*y][i].abs())).expect("a row");
            a.swap(i, p);
            b.swap(i, p);
            for r in i + 1..n {
                let q = a[r][i] / a[i][i];
                for c in i..n {
                    a[r][c] -= q * a[i][c];
                }
                b[r] -= q * b[i];
            }
        }
        for i in (0..n).rev() {
            let sum: f64 = (i + 1..n).map(|c| a[i][c] * b[c]).sum();
            b[i] = (b[i] - sum) / a[i][i];
        }
        b
    }

    fn product(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    #[test]
    fn the_score_test_agrees_with_the_joint_system() {
        let (fit, data) = given();
        let look = ScoreTest::new(&fit, &data);
        let n = look.linearization.normal_matrix.size;
        // Surface, stiffness, friction, thickness; a surface offset per recording, and a layer without rupture.
        assert_eq!(n, 8);
        let force = |f: &dyn Fn(usize, f64) -> f64| -> Vec<Vec<f64>> {
            let one = |r: usize| data.recordings[r].start_s.iter().map(|t| f(r, *t)).collect();
            (0..2).map(one).collect()
        };
        let columns = [
            look.force_column(&force(&|_, _| 1.0)),
            look.force_column(&force(&|r, t| if r == 1 { 0.3 * t * t } else { 0.1 })),
        ];
        let told = look.gain(&columns);
        // All columns in one system.
        let against: Vec<Vec<f64>> = columns.iter().map(|c| look.linearization.products_with(c, 2)).collect();
        let mut whole = vec![vec![0.0; n + 2]; n + 2];
        let mut slope = look.linearization.neg_gradient.clone();
        for i in 0..n {
            for j in 0..n {
                whole[i][j] = look.linearization.normal_matrix.at(i.max(j), i.min(j));
            }
            if whole[i][i] == 0.0 {
                whole[i][i] = 1.0;
            }
        }
        let base: Vec<Vec<f64>> = whole[..n].iter().map(|row| row[..n].to_vec()).collect();
        for (c, column) in columns.iter().enumerate() {
            for i in 0..n {
                whole[i][n + c] = against[c][i];
                whole[n + c][i] = against[c][i];
            }
            for (d, other) in columns.iter().enumerate() {
                whole[n + c][n + d] = column.dot_all(other);
            }
            slope.push(column.dot_all(&look.linearization.residual));
        }
        let x = solved(whole.clone(), slope.clone());
        let without = solved(base.clone(), slope[..n].to_vec());
        near(told.nats, 0.5 * (product(&x, &slope) - product(&without, &slope[..n])));
        assert!(told.nats > 1.0);
        for (told, wanted) in told.coefficients.iter().zip(&x[n..]) {
            near(*told, *wanted);
        }
        // Remainder of both columns after projection.
        let both: Vec<f64> = (0..n).map(|i| against[0][i] + against[1][i]).collect();
        let size: f64 =
            (0..2).flat_map(|c| (0..2).map(move |d| (c, d))).map(|(c, d)| whole[n + c][n + d]).sum();
        let left = size - product(&both, &solved(base, both.clone()));
        near(told.detectable_nats, 0.5 * left);
        near(told.unexplained_share, left / size);
        let none = look.gain(&[]);
        assert_eq!((none.nats, none.detectable_nats, none.unexplained_share), (0.0, 0.0, 0.0));
    }

    #[test]
    fn an_effect_column_is_that_of_its_force() {
        let (fit, data) = given();
        let look = ScoreTest::new(&fit, &data);
        let bias = EffectTerm::new(effect_info("force_bias").expect("in the library"), &[0.03]);
        let told = look.effect_column(&bias).expect("a column");
        let force: Vec<Vec<f64>> = data.recordings.iter().map(|b| vec![0.03; b.len()]).collect();
        let wanted = look.force_column(&force);
        let changed = look.model_change_column(&fit.model.with_effect(bias)).expect("a column");
        for r in 0..2 {
            assert_eq!((told.rupture_rows[r].len(), wanted.rupture_rows[r].len()), (4, 4));
            assert!(told.rupture_rows[r].iter().chain(&wanted.rupture_rows[r]).all(|x| *x == 0.0));
            for ((told, changed), wanted) in
                told.innovations[r].iter().zip(&changed.innovations[r]).zip(&wanted.innovations[r])
            {
                assert!((told - wanted).abs() < 1e-9 && told == changed, "{told} for {wanted}");
            }
        }
        // Large residuals have less weight: the square root of their excess over 2.5 standard deviations.
        let mut rough = fit.clone();
        rough.residuals.innovations[0][7] = -10.0;
        let weighed = ScoreTest::new(&rough, &data).force_column(&force);
        near(weighed.innovations[0][7] / wanted.innovations[0][7], 0.5);
        near(weighed.innovations[0][8], wanted.innovations[0][8]);
    }

    #[test]
    fn strengths_are_scaled_within_an_extended_search_range() {
        let of = |id: &str, group: &[&[f64]], coefficients: &[f64]| {
            scale_strengths(effect_info(id).expect("in the library"), group, coefficients)
        };
        near(of("force_bias", &[&[0.1]], &[7.0])[0], 0.7);
        // Searched from -2 to 2 N: the range once below, three times above.
        assert_eq!(of("force_bias", &[&[0.1]], &[1e3]), [14.0]);
        assert_eq!(of("force_bias", &[&[0.1]], &[-1e3]), [-6.0]);
        // Within the library's limits.
        assert_eq!(of("rate_dependent_puncture", &[&[0.02]], &[1e3]), [2.0]);
        assert_eq!(of("coulomb_friction", &[&[1.0]], &[-3.0]), [0.0]);
        near(of("coulomb_friction", &[&[1.0]], &[1e4])[0], 100.0 + 3.0 * 99.95);
        // Two columns: strengths add, the Stribeck velocity stays.
        let told = of("stribeck_friction", &[&[1.0, 1.0, 3e-4], &[0.0, 1.0, 3e-4]], &[2.0, 0.5]);
        assert_eq!(told, [2.0, 2.5, 3e-4]);
        // Compliances add, up to ten times the largest one searched.
        near(of("needle_compliance", &[&[1500.0]], &[2.0])[0], 750.0);
        near(of("needle_compliance", &[&[1500.0]], &[1e4])[0], 5.0);
        near(of("needle_compliance", &[&[1500.0]], &[-1.0])[0], 1e12);
    }
}
