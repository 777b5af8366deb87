use super::*;
use crate::test_fixtures::{
    assumed_layers, blocks_of, fit_from_truth, fit_simulated, recordings_with_added_force, search_stage,
};
use std::collections::BTreeMap;
use std::sync::Arc;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::{FitData, Residuals};
use stylet_identify::model::{EffectTerm, Model};
use stylet_identify::noise::Noise;
use stylet_tissue::{AnyEffect, CoulombFriction, Effect, ForceBias, ForceDrift, Respiration};

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
fn motions_below_the_resolution_of_the_encoder_are_negligible() {
    let noise_m = search(&[]).data.recordings.iter().map(|b| b.motion.noise_m).fold(0.0, f64::max);
    assert!(noise_m > 1e-6, "{noise_m}");
    let breath = |amplitude_m: f64| {
        let e = Respiration { amplitude_m, frequency_hz: 0.3, phase_rad: 0.0 };
        unresolved(&search(&[CoulombFriction { c_n_per_m: 1.0 }.into(), e.into()]), 1)
    };
    assert_eq!(breath(0.09 * noise_m).as_deref(), Some("below a tenth of the encoder noise"));
    assert_eq!(breath(0.11 * noise_m), None);
    // Only lengths of tissue motions are compared with the encoder.
    assert_eq!(unresolved(&search(&[CoulombFriction { c_n_per_m: 1e-9 }.into()]), 0), None);
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

#[test]
fn effects_at_ruptures_boundaries_and_breaks_do_not_act_in_every_sample() {
    let acts = |id: &str| acts_in_every_sample(stylet_tissue::effect_info(id).expect("in the library"));
    for id in [
        "coulomb_friction",
        "force_drift",
        "time_delay",
        "respiration",
        "position_scale",
        "stress_relaxation",
    ] {
        assert!(acts(id), "{id}");
    }
    for id in [
        "rate_dependent_puncture",
        "incomplete_release",
        "boundary_shift",
        "hidden_membrane",
        "force_spikes",
        "saturation",
    ] {
        assert!(!acts(id), "{id}");
    }
}

/// Result for a drift of 20 mN/s with this gain (nats), and a bias of this size (N) that the model includes.
fn result(bias_n: f64, drift_nats: f64) -> (Search, Vec<(String, String)>) {
    let at = [[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]];
    let runs = recordings_with_added_force(&[], &at, |t| bias_n + 0.02 * t);
    let effects: [AnyEffect; 2] =
        [ForceDrift { rate_n_per_s: 0.02 }.into(), ForceBias { force_n: bias_n }.into()];
    let f = fit_from_truth(&effects, &runs.iter().collect::<Vec<_>>());
    let search = Search::from_fit(f.fit, f.data);
    let after = held_out_residuals_with_random_effects(&search.best, &search.data);
    let causes = [cause(effects[0].id(), drift_nats), cause(effects[1].id(), 0.0)];
    let negligible = negligible_effects(&search, &after, &causes, &[]);
    (search, negligible.into_iter().map(|s| (s.effect, s.reason)).collect())
}

/// A gain below 7 % of the force of a greater cause, 0.49 % of its nats, may be its model error.
#[test]
fn cause_within_the_model_error_of_a_greater_one_is_negligible() {
    // Held-out recordings show both, whether the bias is as large as the drift or as the noise.
    assert!(result(0.2, 0.0).1.is_empty());
    let (search, reasons) = result(0.02, 0.0);
    assert!(reasons.is_empty(), "{reasons:?}");
    let without = fit(
        &search.best.model.without_effect(1),
        &search.data,
        Effort { max_iterations: 4, min_gain_nats: 0.5 },
    )
    .expect("a fit");
    let loss_nats = without.nats() - search.best.nats();
    assert!(loss_nats > 10.0, "{loss_nats}");
    for (share, small) in [(0.9, false), (1.1, true)] {
        let (_, reasons) = result(0.02, loss_nats / 0.0049 * share);
        assert_eq!(!reasons.is_empty(), small, "{reasons:?}");
        assert!(
            reasons.iter().all(|t| t.0 == "force_bias" && t.1.contains("far greater cause")),
            "{reasons:?}"
        );
    }
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
