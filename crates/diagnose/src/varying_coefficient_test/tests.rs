use super::*;
use crate::test_fixtures::fit_simulated;
use stylet_identify::fit::{Effort, fit};
use stylet_tissue::{AnyEffect, ForceBias, ForceDrift};

#[test]
fn force_is_multiplied_by_the_standardised_feature() {
    let test = interaction_column(&[vec![2.0, 2.0], vec![3.0, -1.0]], &[vec![1.0, 3.0], vec![1.0, 3.0]]);
    let sd = (4.0_f64 / 3.0).sqrt();
    assert_eq!(test, [vec![-2.0 / sd, 2.0 / sd], vec![-3.0 / sd, -1.0 / sd]]);
    assert_eq!(interaction_column(&[vec![2.0]], &[vec![5.0]]), [[0.0]]);
    // One outlier in a thousand is clipped.
    let mut with: Vec<f64> = (0..1000).map(|k| f64::from(k % 2)).collect();
    let (ones, like) = (vec![vec![1.0; 1000]], with.clone());
    with[501] = 1e6;
    assert_eq!(interaction_column(&ones, &[with])[0], interaction_column(&ones, &[like])[0]);
}

#[test]
fn travel_feature_halves_in_a_millimetre_and_acceleration_is_unsigned() {
    let f = fit_simulated(&[], &[], &[[4e-3, 0.0]], |_| 0.0);
    let b = &f.data.recordings[0];
    let test = features(b, &vec![0.5; b.len()]);
    // In by 16 mm in 4 s, hold of one second, and back.
    let at = |t: f64| b.block_at(t);
    let (since, rest, back) = (&test[7], &test[4], &test[3]);
    assert!((since[at(2.0)] - 1.0 / 9.0).abs() < 0.01 && (since[at(4.5)] - 1.0 / 17.0).abs() < 0.01);
    assert!((since[at(5.25)] - 0.5).abs() < 0.03, "{}", since[at(5.25)]);
    assert_eq!((rest[at(4.5)], rest[at(2.0)], back[at(6.0)], back[at(2.0)]), (1.0, 0.0, 1.0, 0.0));
    assert!(test[6].iter().all(|a| *a >= 0.0) && test[5].iter().all(|f| *f == 0.5));
}

/// Test of an effect in recordings with an added force.
fn test(effect: AnyEffect, more_n: impl Fn(f64) -> f64) -> VaryingCoefficient {
    let f = fit_simulated(&[effect], &[], &[[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]], more_n);
    let reduced =
        fit(&f.fit.model.without_effect(0), &f.data, Effort { max_iterations: 3, min_gain_nats: 1.0 })
            .expect("a fit");
    varying_coefficient_test(&ScoreTest::new(&f.fit, &f.data), 0, reduced.nats() - f.fit.nats())
        .expect("a force")
}

#[test]
fn true_effects_pass_and_imitations_fail() {
    let drift = || ForceDrift { rate_n_per_s: 0.2 }.into();
    let bias = || ForceBias { force_n: 1.0 }.into();
    // By chance a feature gains half a nat, and the test takes the largest of eight. The predicted force of a bias
    // has no noise.
    for there in [test(drift(), |t| 0.2 * t), test(bias(), |_| 1.0)] {
        assert!((0.0..10.0).contains(&there.nats) && there.share < 1e-3, "{there:?}");
    }
    // A drift that returns is no linear drift, and a drift is no bias.
    for imitation in [test(drift(), |t| 1.0 * (0.3 * t).sin()), test(bias(), |t| 0.2 * t)] {
        assert!(imitation.share > 0.2 && imitation.feature == "time", "{imitation:?}");
    }
    // In the presence of an unmodelled force the effect still follows its equation.
    let with_unmodelled = test(drift(), |t| 0.2 * t + 0.1 * (3.0 * t).sin());
    assert!((0.0..0.05).contains(&with_unmodelled.share), "{with_unmodelled:?}");
}
