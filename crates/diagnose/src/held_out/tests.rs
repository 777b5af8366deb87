use super::*;
use crate::repeated_insertions::multistart_fit::SetFit;
use crate::test_fixtures::{blocks_of, data_of, fit_simulated};
use stylet_identify::block_averages::BlockAverages;
use stylet_tissue::{AnyEffect, CoulombFriction};

/// Four samples per block that alternate by `within_n`.
fn blocks(within_n: f64) -> BlockAverages {
    let t: Vec<f64> = (0..800).map(|k| f64::from(k) / 200.0).collect();
    let z = t.iter().map(|t| 1e-3 * t).collect();
    let f = (0..800).map(|k| if k % 2 == 0 { within_n } else { -within_n }).collect();
    blocks_of(t, z, f)
}

#[test]
fn rms_and_noise_include_the_scatter_within_blocks() {
    let (a, b) = (blocks(0.03), blocks(0.07));
    let (wa, wb) = (a.within_block_sd_n(), b.within_block_sd_n());
    assert!(wa > 0.02 && wb > 2.0 * wa, "{wa} {wb}");
    let data = data_of(vec![a, b], 0.02);
    let left = |square_n2: f64, blocks: usize| {
        Some(FreeRunResidual {
            mean_square_n2: square_n2,
            compared_blocks: blocks,
            ..FreeRunResidual::default()
        })
    };
    let fitted = pooled_rms(&[left(0.0025, 30), left(0.0016, 70)], &data);
    let wanted = ((30.0 * (0.0025 + wa * wa) + 70.0 * (0.0016 + wb * wb)) / 100.0).sqrt();
    assert!((fitted - wanted).abs() < 1e-12, "{fitted} for {wanted}");
    // A recording without a prediction does not count.
    let fitted = pooled_rms(&[None, left(0.0016, 70)], &data);
    assert!((fitted - (0.0016 + wb * wb).sqrt()).abs() < 1e-12);
    assert_eq!(pooled_rms(&[None, None], &data), 0.0);
    let wanted = (data.noise.sd_n().powi(2) + 0.5 * (wa * wa + wb * wb)).sqrt();
    assert!((sample_noise_sd_n(&data) - wanted).abs() < 1e-12);
}

fn fit_with_friction(moved_m: &[f64]) -> SetFit {
    let dry_friction: AnyEffect = CoulombFriction { c_n_per_m: 150.0 }.into();
    let all: Vec<[f64; 2]> = moved_m.iter().enumerate().map(|(k, m)| [[0.008, 0.016][k % 2], *m]).collect();
    fit_simulated(std::slice::from_ref(&dry_friction), std::slice::from_ref(&dry_friction), &all, |_| 0.0)
}

/// A small error of the puncture force makes the rupture early or late by about a sample.
#[test]
fn predicted_rupture_may_shift_by_two_samples() {
    let fitted = fit_with_friction(&[0.0]);
    let data = &fitted.data;
    let b = &data.recordings[0];
    let mut moved = 0;
    for factor in [0.96, 0.98, 1.0, 1.02, 1.04] {
        let mut model = fitted.fit.model.clone();
        model.tissue.layers[0].puncture_n = model.tissue.layers[0].puncture_n.map(|f| f * factor);
        let mut trail = ReplayCache::new(&model, data, 0).expect("a trail");
        let predicted_s = trail.free_rupture_times();
        trail.rebase(data, 0, &predicted_s);
        let left = predict_free_run(&model, data, 0).expect("a replay");
        let at = |rupture_times_s: &[f64]| trail.nats_with_ruptures(&model, data, 0, rupture_times_s);
        let best = at(&left.rupture_times_s);
        let samples = (left.rupture_times_s[0] - predicted_s[0]) / b.sample_step_s;
        assert!([0.0, 0.5, 1.0, 2.0].iter().any(|k| (samples.abs() - k).abs() < 1e-6), "{samples}");
        for k in [0.0, -0.5, 0.5, -1.0, 1.0, -2.0, 2.0] {
            assert!(at(&[predicted_s[0] + k * b.sample_step_s]) >= best - 1e-9, "{factor}: {k}");
        }
        moved += usize::from(samples != 0.0);
        let kept: Vec<f64> = (0..b.len()).filter(|k| b.used[*k]).map(|k| left.residual_n[k]).collect();
        let square = kept.iter().map(|e| e * e).sum::<f64>() / kept.len() as f64;
        assert!((left.mean_square_n2 - square).abs() < 1e-15 && left.compared_blocks == kept.len());
    }
    assert!(moved >= 2, "{moved}");
    // A layer that never ruptures stays intact.
    let mut model = fitted.fit.model.clone();
    model.tissue.layers[0].puncture_n = Some(1e3);
    assert_eq!(predict_free_run(&model, data, 0).expect("a replay").rupture_times_s, [f64::INFINITY]);
}

#[test]
fn recording_is_predicted_from_the_others_with_or_without_its_random_effects() {
    let fitted = fit_with_friction(&[4e-4, 0.0, -3e-4]);
    let (best, data) = (&fitted.fit, &fitted.data);
    let (plain, granted) =
        (held_out_residuals(best, data), held_out_residuals_with_random_effects(best, data));
    for r in 0..3 {
        let others: Vec<usize> = (0..3).filter(|k| *k != r).collect();
        let wanted = fit(
            &best.model.subset(&others),
            &data.subset(&others),
            Effort { max_iterations: 2, min_gain_nats: 0.5 },
        );
        let mut model = refit_without(best, data, r).expect("a fit");
        assert_eq!(model.tissue, wanted.expect("a fit").model.tissue);
        let of = |l: &Option<FreeRunResidual>| l.as_ref().expect("a prediction").residual_n.clone();
        assert_eq!(of(&plain[r]), of(&predict_free_run(&model, data, r)), "{r}");
        model.per_recording[r] = best.model.per_recording[r];
        assert_eq!(of(&granted[r]), of(&predict_free_run(&model, data, r)), "{r}");
    }
    assert!(pooled_rms(&granted, data) < pooled_rms(&plain, data));
    // With a single recording the prediction is that of the fit.
    let alone = fit_with_friction(&[4e-4]);
    let fitted = held_out_residuals(&alone.fit, &alone.data);
    let wanted = predict_free_run(&alone.fit.model, &alone.data, 0).expect("a prediction");
    assert_eq!(fitted[0].as_ref().map(|l| &l.residual_n), Some(&wanted.residual_n));
}

#[test]
fn effect_has_its_jackknife_error_and_held_out_gain() {
    let fitted = fit_with_friction(&[1e-4, 0.0, -1e-4, 2e-4]);
    let (best, data) = (&fitted.fit, &fitted.data);
    let of = &jackknife_effects(best, data, 0.003)[0];
    let strength = |r: usize| refit_without(best, data, r).expect("a fit").effects[0].values[0];
    let values: Vec<f64> = (0..4).map(strength).collect();
    let mean = stylet_stats::mean(&values);
    let error = (0.75 * values.iter().map(|v| (v - mean).powi(2)).sum::<f64>()).sqrt() / mean;
    assert!((of.relative_se / error - 1.0).abs() < 1e-9 && error < 0.2, "{} for {error}", of.relative_se);
    let square = |left: &[Option<FreeRunResidual>]| {
        let all: Vec<&FreeRunResidual> = left.iter().flatten().collect();
        let blocks: usize = all.iter().map(|l| l.compared_blocks).sum();
        all.iter().map(|l| l.mean_square_n2 * l.compared_blocks as f64).sum::<f64>() / blocks as f64
    };
    let reduced_n2 =
        fit(&best.model.without_effect(0), data, Effort { max_iterations: 3, min_gain_nats: 1.0 })
            .expect("a fit");
    let (with, reduced_n2) =
        (square(&held_out_residuals(best, data)), square(&held_out_residuals(&reduced_n2, data)));
    let wanted = (reduced_n2 - with) / (reduced_n2 - 0.003 * 0.003);
    assert!(
        (of.held_out_gain / wanted - 1.0).abs() < 1e-9 && wanted > 0.1,
        "{} for {wanted}",
        of.held_out_gain
    );
    // With a single recording there is no jackknife.
    let alone = fit_with_friction(&[0.0]);
    let fitted = jackknife_effects(&alone.fit, &alone.data, 0.003);
    assert_eq!((fitted.len(), fitted[0].relative_se, fitted[0].held_out_gain), (1, 0.0, 0.0));
}
