//! Strength of an effect: RMS residual of the re-fitted base law on the force without noise.
//!
//! Given the rupture times, the base law (docs/reference/model.md) is linear in every `K_i` and `b_i`; the re-fit is a
//! linear least squares over all recordings together.

use super::case_definition::CaseSetup;
use crate::cases::unmodelled_shapes::UnmodelledShape;
use crate::simulator::effect::Effect;
use crate::simulator::force_sensor::SensorModel;
use crate::simulator::insertion::{Insertion, UnmodelledForce, simulate_insertion};
use crate::simulator::plain_world::sgn;
use crate::simulator::tissue::Tissue;

/// Sample rate in Hz at which strengths are computed.
const STRENGTH_RATE_HZ: f64 = 50.0;
/// Largest step of these simulations in s.
const STRENGTH_STEP_S: f64 = 2e-3;

/// Terms that are re-fitted together with the base law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefitTerms {
    /// Nothing.
    Nothing,
    /// Dry friction along the shaft.
    DryFriction,
    /// Common effects of the library: a constant, drift, drive and dry friction, inertia, cutting, a square law.
    Common,
}

/// Simulates every recording with the given effects: the insertion, and the sensor reading in N without noise.
#[must_use]
pub fn simulate_effects(
    setup: &CaseSetup,
    effects: &[Effect],
    shape: Option<&UnmodelledShape>,
) -> Vec<(Insertion, Vec<f64>)> {
    let instrument = SensorModel::new(effects, 0.0);
    setup
        .paths
        .iter()
        .map(|path| {
            let n = (path.duration_s() * STRENGTH_RATE_HZ) as usize;
            let at: Vec<f64> = (0..n).map(|k| k as f64 / STRENGTH_RATE_HZ).collect();
            let mut law = setup.law(&setup.truth, effects);
            let mut strange = shape.cloned();
            let strange = strange.as_mut().map(|s| s as &mut dyn UnmodelledForce);
            let insertion =
                simulate_insertion(law.as_mut(), &instrument, strange, path, &at, STRENGTH_STEP_S);
            let read =
                at.iter().zip(&insertion.force_n).map(|(&t, &f)| instrument.reading_n(t, f, 0.0)).collect();
            (insertion, read)
        })
        .collect()
}

/// Largest force without effects in N.
#[must_use]
pub fn max_force_n(setup: &CaseSetup) -> f64 {
    simulate_effects(setup, &[], None).iter().flat_map(|(_, f)| f).fold(0.1, |m, f| f.abs().max(m))
}

/// RMS residual in N of the re-fitted base law.
#[must_use]
pub fn unexplained_rms_n(
    setup: &CaseSetup,
    effects: &[Effect],
    shape: Option<&UnmodelledShape>,
    terms: RefitTerms,
) -> f64 {
    let mut fit = LeastSquares::default();
    let mut row = Vec::new();
    for (insertion, read) in simulate_effects(setup, effects, shape) {
        for (k, force) in read.into_iter().enumerate() {
            columns(&mut row, &setup.truth, &insertion, k, terms);
            fit.add(&row, force);
        }
    }
    let mut square = fit.mean_square_residual();
    for effect in effects {
        if let Effect::ForceSpikes { rate_hz, size_n } = *effect {
            square += rate_hz / setup.amounts.rate_hz * size_n * size_n;
        }
    }
    square.sqrt()
}

fn columns(row: &mut Vec<f64>, tissue: &Tissue, insertion: &Insertion, k: usize, terms: RefitTerms) {
    let (t, z, v) = (insertion.time_s[k], insertion.position_m[k], insertion.velocity_mps[k]);
    let ruptured = insertion.ruptures_s.iter().filter(|r| **r <= t).count();
    row.clear();
    let mut inside = 0.0;
    for (i, layer) in tissue.layers.iter().enumerate() {
        let x = (z - tissue.front_m(i)).max(0.0);
        let l = x.min(layer.thickness_m);
        inside += l;
        row.push(if i == ruptured { x } else { 0.0 });
        row.push(v * l);
    }
    let dry = sgn(v) * inside;
    match terms {
        RefitTerms::Nothing => {}
        RefitTerms::DryFriction => row.push(dry),
        RefitTerms::Common => {
            let x = (z - tissue.front_m(ruptured)).max(0.0);
            let active = if ruptured < tissue.layers.len() { x * x } else { 0.0 };
            let cut = f64::from(sgn(v) > 0.0 && inside > 0.0);
            row.extend([
                dry,
                1.0,
                t,
                sgn(v),
                insertion.acceleration_mps2[k],
                cut,
                active,
                v * v * sgn(v) * inside,
            ]);
        }
    }
}

/// Linear least squares by normal equations, accurate enough for a strength.
#[derive(Default)]
struct LeastSquares {
    gram: Vec<Vec<f64>>,
    product: Vec<f64>,
    square: f64,
    rows: f64,
}

impl LeastSquares {
    fn add(&mut self, row: &[f64], y: f64) {
        if self.gram.is_empty() {
            self.gram = vec![vec![0.0; row.len()]; row.len()];
            self.product = vec![0.0; row.len()];
        }
        for (i, a) in row.iter().enumerate() {
            if *a != 0.0 {
                for (g, b) in self.gram[i].iter_mut().zip(row) {
                    *g += a * b;
                }
                self.product[i] += a * y;
            }
        }
        self.square += y * y;
        self.rows += 1.0;
    }

    /// Mean square of the residual. Columns spanned by earlier ones are left out.
    fn mean_square_residual(mut self) -> f64 {
        let n = self.product.len();
        let own: Vec<f64> = (0..n).map(|i| self.gram[i][i]).collect();
        let mut left = self.square;
        for (i, own) in own.into_iter().enumerate() {
            let pivot = self.gram[i][i];
            if pivot <= 1e-10 * own || pivot <= 0.0 {
                continue;
            }
            left -= self.product[i] * self.product[i] / pivot;
            for j in i + 1..n {
                let share = self.gram[i][j] / pivot;
                for k in i + 1..n {
                    let g = self.gram[i][k];
                    self.gram[j][k] -= share * g;
                }
                let p = self.product[i];
                self.product[j] -= share * p;
            }
        }
        left.max(0.0) / self.rows.max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_leaves_what_the_columns_do_not_span() {
        let mut fit = LeastSquares::default();
        for k in 0..1000 {
            let x = f64::from(k) * 0.01;
            fit.add(&[1.0, x, 2.0 * x], 3.0 - 0.5 * x + 0.1 * if k % 2 == 0 { 1.0 } else { -1.0 });
        }
        assert!((fit.mean_square_residual().sqrt() - 0.1).abs() < 1e-4);
    }
}
