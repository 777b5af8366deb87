use super::*;
use crate::test_fixtures::fit_simulated;
use stylet_identify::fit::fit;
use stylet_tissue::{AnyEffect, ForceBias, ForceDrift};

#[test]
fn penalty_per_parameter_is_half_the_log_of_the_blocks() {
    assert!((bic_penalty(3, 700) - 1.5 * 700.0_f64.ln()).abs() < 1e-12);
    assert!((bic_penalty(2, 1) - 2.0_f64.ln()).abs() < 1e-12);
    assert_eq!(bic_penalty(0, 700), 0.0);
}

#[test]
fn gain_is_measured_under_the_noise_of_the_larger_model() {
    let drift: AnyEffect = ForceDrift { rate_n_per_s: 2e-3 }.into();
    let with = fit_simulated(
        &[drift, ForceBias { force_n: 1e-4 }.into()],
        &[],
        &[[4e-3, 3e-4], [6e-3, -3e-4]],
        |t| 2e-3 * t,
    );
    let data = &with.data;
    let under = |m: &stylet_identify::model::Model| fit(m, data, Effort::FULL).expect("a fit");
    let (no_drift, no_bias) =
        (under(&with.fit.model.without_effect(0)), under(&with.fit.model.without_effect(1)));
    let own = data.with_estimated_noise(&with.fit.residuals.residual_n, NoiseSource::Residual);
    let nats = |m| fit(m, &own, Effort::FULL).expect("a fit").nats();
    let wanted = nats(&no_drift.model) - nats(&with.fit.model);
    let gained = likelihood_gain(&no_drift, &with.fit, data);
    assert!(wanted > 10.0 && (gained / wanted - 1.0).abs() < 0.02, "{gained} for {wanted}");
    let gained = likelihood_gain(&no_bias, &with.fit, data);
    assert!((-0.1..1.5).contains(&gained), "{gained}");
    // A model that cannot be replayed has no gain.
    let mut broken = with.fit.clone();
    broken.model.effects[0].values[0] = f64::NAN;
    assert_eq!(likelihood_gain(&no_bias, &broken, data), f64::NEG_INFINITY);
}
