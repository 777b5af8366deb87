use super::*;
use crate::test_fixtures::{assumed_layers, blocks_of, fit_simulated, search_stage};
use std::collections::BTreeMap;
use std::sync::Arc;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::{FitData, Residuals};
use stylet_identify::model::{EffectTerm, Model};
use stylet_identify::noise::Noise;
use stylet_tissue::{AnyEffect, Effect, ForceBias};

fn cause(effect: &str, gain_nats: f64) -> Cause {
    Cause {
        effect: effect.to_owned(),
        equivalent: Vec::new(),
        confidence: 1.0,
        parameters: BTreeMap::new(),
        gain_nats,
        share: 0.0,
        ..Cause::default()
    }
}

fn search(effects: &[AnyEffect]) -> Search {
    let assumed = assumed_layers(&[]);
    let mut model = Model::base(assumed, 2);
    model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    // One recording at 100 Hz and one at 50 Hz, positions to 20 micrometres.
    let blocks = [100.0, 50.0].map(|hz: f64| {
        let t: Vec<f64> = (0..400).map(|k| f64::from(k) / hz).collect();
        let z = t
            .iter()
            .enumerate()
            .map(|(k, t)| 1e-3 * t + 2e-5 * (((k * 7919) % 101) as f64 / 101.0 - 0.5))
            .collect();
        blocks_of(t, z, vec![0.0; 400])
    });
    let data = FitData::new(Arc::new(blocks.to_vec()), Noise::white(0.02), 0.0);
    let residuals =
        Residuals { residual_n: Vec::new(), innovations: Vec::new(), ruptures: Vec::new(), nats: 0.0 };
    Search::from_fit(Fit { model, residuals }, data)
}

#[test]
fn cause_is_uncertain_when_its_interval_gives_less_than_the_required_gain() {
    let mut s = search(&[]);
    s.stages = vec![search_stage(Some(("force_bias", 30.0)), 8.0, &[])];
    let uncertain =
        |effect: &str, nats: f64| is_uncertain(&cause(effect, 0.0), &[("force_bias".to_owned(), nats)], &s);
    assert!(uncertain("force_bias", 7.9) && !uncertain("force_bias", 8.0) && !uncertain("force_drift", 1.0));
    assert!(!is_uncertain(&cause("force_bias", 0.0), &[], &s));
}

/// Result for a bias of this size (N) when the held-out error (N) is a function of the error without the bias and
/// of the noise.
fn result_with_held_out(bias_n: f64, with_n: impl Fn(f64, f64) -> f64) -> Option<String> {
    let bias: AnyEffect = ForceBias { force_n: bias_n }.into();
    let f = fit_simulated(std::slice::from_ref(&bias), &[], &[[4e-3, 0.0], [6e-3, 0.0]], |_| bias_n);
    let mut model = f.fit.model;
    (model.free.recording_surface, model.free.recording_friction) = (false, false);
    let fitted = |m: &Model, effort| fit(m, &f.data, effort).expect("a fit");
    let search = Search::from_fit(fitted(&model, Effort::FULL), f.data.clone());
    let without =
        fitted(&search.best.model.without_effect(0), Effort { max_iterations: 4, min_gain_nats: 0.5 });
    let residual_n = pooled_rms(&held_out_residuals_with_random_effects(&without, &f.data), &f.data);
    let square_n2 = with_n(residual_n, sample_noise_sd_n(&f.data)).powi(2)
        - f.data.recordings[0].within_block_sd_n().powi(2);
    let after = [
        Some(FreeRunResidual { mean_square_n2: square_n2, compared_blocks: 1, ..FreeRunResidual::default() }),
        None,
    ];
    negligible_effects(&search, &after, &[cause(bias.id(), 0.0)], &[]).pop().map(|s| s.reason)
}

#[test]
fn weak_cause_must_improve_held_out_predictions() {
    let reason = |share: f64| result_with_held_out(3e-3, |residual_n, noise| residual_n - share * noise);
    assert_eq!(reason(-0.1).as_deref(), Some("does not improve the prediction of held-out recordings"));
    assert_eq!(
        reason(0.0015).as_deref(),
        Some("changes the prediction of held-out recordings by less than 0.2 % of the noise")
    );
    assert_eq!((reason(0.0025), reason(0.02)), (None, None));
    // A strong cause needs no held-out gain.
    assert_eq!(result_with_held_out(0.05, |residual_n, _| 2.0 * residual_n), None);
}

#[test]
fn held_out_random_effects_are_known() {
    let bias: AnyEffect = ForceBias { force_n: 1e-5 }.into();
    let f = fit_simulated(std::slice::from_ref(&bias), &[], &[[4e-3, 0.0], [6e-3, 0.0]], |_| 0.0);
    let mut search = Search::from_fit(f.fit, f.data);
    let cause = cause(bias.id(), 0.0);
    // Without their random effects the held-out errors are large.
    let after = [
        Some(FreeRunResidual { mean_square_n2: 1.0, compared_blocks: 1, ..FreeRunResidual::default() }),
        None,
    ];
    let mut count = |own_surface: bool, own_friction: bool| {
        let free = &mut search.best.model.free;
        (free.recording_surface, free.recording_friction) = (own_surface, own_friction);
        negligible_effects(&search, &after, std::slice::from_ref(&cause), &[]).len()
    };
    assert_eq!((count(true, true), count(true, false), count(false, false)), (0, 0, 1));
}
