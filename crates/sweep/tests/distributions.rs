//! Promise: every distribution has its textbook moments with random, Latin hypercube and Sobol points, and stays in its range.

use proptest::prelude::*;
use stylet_sweep::{Distribution, Sampling, SamplingDesign};

/// Mean and standard deviation of 8192 draws.
fn moments(with: &Distribution, sampling: Sampling) -> (f64, f64) {
    let n = 8192;
    let design = SamplingDesign::new(sampling, 11, n, 1);
    let mut point = [0.0];
    let draws: Vec<f64> = (0..n)
        .map(|k| {
            design.point(k, 0, &mut point);
            with.quantile(point[0])
        })
        .collect();
    let mean = draws.iter().sum::<f64>() / n as f64;
    let variance = draws.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n as f64;
    (mean, variance.sqrt())
}

#[test]
fn sample_moments_match_the_textbook() {
    let ln = |x: f64| x.ln();
    let cases = [
        (Distribution::Uniform(2.0, 5.0), 3.5, 3.0 / 12.0_f64.sqrt()),
        (Distribution::Normal { mean: 60.0, sd: 6.0 }, 60.0, 6.0),
        (
            Distribution::LogNormal { median: 2.0, sd_log: 0.3 },
            2.0 * (0.045_f64).exp(),
            2.0 * (0.045_f64).exp() * ((0.09_f64).exp() - 1.0).sqrt(),
        ),
        (
            Distribution::LogUniform(1.0, 4.0),
            3.0 / ln(4.0),
            (15.0 / (2.0 * ln(4.0)) - (3.0 / ln(4.0)).powi(2)).sqrt(),
        ),
        (
            Distribution::Triangular { min: 0.0, mode: 1.0, max: 4.0 },
            5.0 / 3.0,
            ((0.0 + 1.0 + 16.0 - 0.0 - 0.0 - 4.0) / 18.0_f64).sqrt(),
        ),
        (Distribution::Choice(vec![1.0, 2.0, 6.0]), 3.0, (14.0_f64 / 3.0).sqrt()),
    ];
    for (with, mean, sd) in cases {
        with.check("with").expect("it is right");
        for (sampling, share) in
            [(Sampling::Random, 4.0 / 90.0), (Sampling::LatinHypercube, 0.003), (Sampling::Sobol, 0.003)]
        {
            let found = moments(&with, sampling);
            assert!(
                (found.0 - mean).abs() < share * sd,
                "{with:?} {sampling:?}: mean {} not {mean}",
                found.0
            );
            assert!(
                (found.1 - sd).abs() < 2.0 * share * sd,
                "{with:?} {sampling:?}: sd {} not {sd}",
                found.1
            );
        }
    }
}

proptest! {
    #[test]
    fn quantiles_stay_in_range_and_increase(a in -5.0..5.0, width in 0.0..5.0, mode in 0.0..1.0, u in 1e-9..1.0, v in 1e-9..1.0) {
        let (u, v) = if u < v { (u, v) } else { (v, u) };
        let top = a + width;
        for with in [
            Distribution::Uniform(a, top),
            Distribution::LogUniform(a + 6.0, top + 6.0),
            Distribution::Triangular { min: a, mode: a + mode * width, max: top },
        ] {
            let shift = if matches!(with, Distribution::LogUniform(..)) { 6.0 } else { 0.0 };
            let (x, y) = (with.quantile(u), with.quantile(v));
            prop_assert!(x <= y + 1e-12 && x >= a + shift - 1e-12 && y <= top + shift + 1e-12, "{with:?} {x} {y}");
        }
    }
}
