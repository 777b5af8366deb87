use super::*;
use crate::block_averages::{BLOCK_S, BlockAverages};
use crate::likelihood::residuals;
use crate::model::NO_RUPTURE;
use crate::noise::Noise;
use crate::test_support::base_model;
use std::sync::Arc;
use stylet_record::Recording;
use stylet_tissue::effect_info;

fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-6 * expected.abs().max(1e-9), "{actual} for {expected}");
}

/// Two recordings of a layer that does not rupture, and a model that is slightly off.
fn given() -> (Fit, FitData) {
    let mut model = base_model(0.002, &[(0.03, 100.0, 3000.0, None)], (0.3, 0.1), 2);
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
    let score_test = ScoreTest::new(&fit, &data);
    let n = score_test.linearization.normal_matrix.size;
    // Surface, stiffness, friction, thickness; a surface offset per recording, and a layer without rupture.
    assert_eq!(n, 8);
    let force = |f: &dyn Fn(usize, f64) -> f64| -> Vec<Vec<f64>> {
        let one = |r: usize| data.recordings[r].start_s.iter().map(|t| f(r, *t)).collect();
        (0..2).map(one).collect()
    };
    let columns = [
        score_test.force_column(&force(&|_, _| 1.0)),
        score_test.force_column(&force(&|r, t| if r == 1 { 0.3 * t * t } else { 0.1 })),
    ];
    let actual = score_test.gain(&columns);
    // All columns in one system.
    let against: Vec<Vec<f64>> =
        columns.iter().map(|c| score_test.linearization.products_with(c, 2)).collect();
    let mut whole = vec![vec![0.0; n + 2]; n + 2];
    let mut slope = score_test.linearization.neg_gradient.clone();
    for i in 0..n {
        for j in 0..n {
            whole[i][j] = score_test.linearization.normal_matrix.at(i.max(j), i.min(j));
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
        slope.push(column.dot_all(&score_test.linearization.residual));
    }
    let x = solved(whole.clone(), slope.clone());
    let without = solved(base.clone(), slope[..n].to_vec());
    assert_close(actual.nats, 0.5 * (product(&x, &slope) - product(&without, &slope[..n])));
    assert!(actual.nats > 1.0);
    for (actual, expected) in actual.coefficients.iter().zip(&x[n..]) {
        assert_close(*actual, *expected);
    }
    // Remainder of both columns after projection.
    let both: Vec<f64> = (0..n).map(|i| against[0][i] + against[1][i]).collect();
    let size: f64 = (0..2).flat_map(|c| (0..2).map(move |d| (c, d))).map(|(c, d)| whole[n + c][n + d]).sum();
    let left = size - product(&both, &solved(base, both.clone()));
    assert_close(actual.detectable_nats, 0.5 * left);
    assert_close(actual.unexplained_share, left / size);
    let none = score_test.gain(&[]);
    assert_eq!((none.nats, none.detectable_nats, none.unexplained_share), (0.0, 0.0, 0.0));
}

#[test]
fn an_effect_column_is_that_of_its_force() {
    let (fit, data) = given();
    let score_test = ScoreTest::new(&fit, &data);
    let bias = EffectTerm::new(effect_info("force_bias").expect("in the library"), &[0.03]);
    let actual = score_test.effect_column(&bias).expect("a column");
    let force: Vec<Vec<f64>> = data.recordings.iter().map(|b| vec![0.03; b.len()]).collect();
    let expected = score_test.force_column(&force);
    for r in 0..2 {
        assert_eq!((actual.rupture_rows[r].len(), expected.rupture_rows[r].len()), (4, 4));
        assert!(actual.rupture_rows[r].iter().chain(&expected.rupture_rows[r]).all(|x| *x == 0.0));
        for (actual, expected) in actual.innovations[r].iter().zip(&expected.innovations[r]) {
            assert!((actual - expected).abs() < 1e-9, "{actual} for {expected}");
        }
    }
    // Large residuals have less weight: the square root of their excess over 2.5 standard deviations.
    let mut rough = fit.clone();
    rough.residuals.innovations[0][7] = -10.0;
    let weighed = ScoreTest::new(&rough, &data).force_column(&force);
    assert_close(weighed.innovations[0][7] / expected.innovations[0][7], 0.5);
    assert_close(weighed.innovations[0][8], expected.innovations[0][8]);
}

#[test]
fn strengths_are_scaled_within_an_extended_search_range() {
    let of = |id: &str, group: &[&[f64]], coefficients: &[f64]| {
        scale_strengths(effect_info(id).expect("in the library"), group, coefficients)
    };
    assert_close(of("force_bias", &[&[0.1]], &[7.0])[0], 0.7);
    // Searched up to its limits, from -100 to 100 N.
    assert_eq!(of("force_bias", &[&[0.1]], &[1e4]), [100.0]);
    assert_eq!(of("force_bias", &[&[0.1]], &[-1e4]), [-100.0]);
    // Within the library's limits.
    assert_eq!(of("rate_dependent_puncture", &[&[0.02]], &[1e3]), [2.0]);
    assert_eq!(of("coulomb_friction", &[&[1.0]], &[-3.0]), [0.0]);
    assert_close(of("coulomb_friction", &[&[1.0]], &[1e4])[0], 100.0 + 3.0 * 99.95);
    // Two columns: strengths add, the Stribeck velocity stays.
    let actual = of("stribeck_friction", &[&[1.0, 1.0, 3e-4], &[0.0, 1.0, 3e-4]], &[2.0, 0.5]);
    assert_eq!(actual, [2.0, 2.5, 3e-4]);
    // Compliances add, up to ten times the largest one searched.
    assert_close(of("needle_compliance", &[&[1500.0]], &[2.0])[0], 750.0);
    assert_close(of("needle_compliance", &[&[1500.0]], &[1e4])[0], 5.0);
    assert_close(of("needle_compliance", &[&[1500.0]], &[-1.0])[0], 1e12);
}
