use super::*;
use crate::test_fixtures::{search_result, search_stage};
use std::sync::Arc;
use stylet_identify::model::EffectTerm;
use stylet_tissue::{AnyEffect, Effect, ForceBias, ForceDrift, Respiration};

/// `m (1 + x)^(1 - m)` for a tone `x` times all others among `m` frequencies, half the number of blocks.
#[test]
fn p_value_of_a_tone_follows_fisher() {
    let wanted = 25.0 * 1.4_f64.powi(-24);
    assert!((tone_p_value(0.4, 50) / wanted - 1.0).abs() < 1e-12, "{} for {wanted}", tone_p_value(0.4, 50));
    assert_eq!(tone_p_value(0.001, 50), 1.0);
    assert_eq!(tone_p_value(9.0, 9000), f64::MIN_POSITIVE);
}

fn drift() -> AnyEffect {
    ForceDrift { rate_n_per_s: 0.02 }.into()
}

fn slow(amplitude_n: f64) -> impl Fn(f64) -> f64 {
    move |t| amplitude_n * (1.6 * t).sin()
}

/// A slow wave common to all recordings: several recordings need an excess of 0.8 and significance, a single one an
/// excess of 3.
#[test]
fn large_common_structure_gives_the_verdict_unknown() {
    let rows = [(4, 0.0, false), (4, 0.003, false), (4, 0.015, true), (1, 0.012, false), (1, 0.03, true)];
    for (runs, amplitude_n, unknown) in rows {
        let mut search = search_result(&[], runs, slow(amplitude_n));
        let left = excess(&search.data, &search.best.residuals.residual_n);
        let result = assess_search(&mut search, &[]);
        assert_eq!(result.unknown, unknown, "{runs} {amplitude_n} {left}");
        assert!(
            !result.has_tones
                && result.causes.is_empty()
                && (result.residual_structure.share - 1.0).abs() < 1e-3
        );
        if runs == 4 {
            // Neither large enough on its own, nor an outlier segment.
            assert!(left < 6.0 && unknown == (left > 0.8), "{left}");
            assert_eq!(result.residual_structure.depends_on, if unknown { vec!["time"] } else { Vec::new() });
            assert_eq!(result.residual_structure.p_value < 1e-6, unknown);
        }
    }
}

#[test]
fn tone_in_the_residual_depends_on_frequency_and_is_excluded_from_the_noise() {
    let mut search = search_result(&[], 4, |t| 0.03 * (14.0 * t).sin());
    let before = search.data.noise.sd_n();
    let result = assess_search(&mut search, &[]);
    assert!(result.unknown && result.has_tones && search.data.noise.sd_n() < 0.5 * before);
    assert_eq!(result.residual_structure.depends_on, ["frequency"]);
    let after = excess(&search.data, &search.best.residuals.residual_n);
    let chance = tone_p_value(after, search.data.compared_block_count());
    assert!(result.residual_structure.p_value == chance && chance < 1e-50, "{chance}");
    // Later fits use the same noise.
    for f in [&search.base, &search.best] {
        let nats = residuals(&f.model, &search.data).expect("a replay").nats;
        assert_eq!(f.nats(), nats);
    }
}

#[test]
fn accelerating_drift_is_an_unmodelled_effect() {
    for (bent_n_per_s2, with) in [(0.0, None), (0.0025, Some("time"))] {
        let drift = ForceDrift { rate_n_per_s: 0.1 }.into();
        let mut search = search_result(&[drift], 4, move |t| 0.1 * t + bent_n_per_s2 * t * t);
        let less = fit(
            &search.best.model.without_effect(0),
            &search.data,
            Effort { max_iterations: 3, min_gain_nats: 1.0 },
        );
        let result = find_imitation(&search.best, &search.data, &[less], (&search.best, &search.data));
        assert_eq!(result.map(|o| o.feature), with, "{result:?}");
        assert_eq!(assess_search(&mut search, &[]).unknown, with.is_some());
    }
}

#[test]
fn cause_next_to_an_unmodelled_effect_must_be_stable_and_follow_its_equation() {
    let jackknife = |relative_se: f64, held_out_gain: f64, varying: f64| JackknifeResult {
        relative_se,
        held_out_gain,
        varying_coefficient_share: varying,
    };
    let (drift, breathes) = (drift(), AnyEffect::from(Respiration::default()));
    let kept = |b: JackknifeResult| is_kept(drift.info(), &b, None);
    assert!(kept(jackknife(0.09, 0.2, 9e-4)));
    assert!(!kept(jackknife(0.11, 0.2, 9e-4)) && !kept(jackknife(0.09, 0.2, 1.1e-3)));
    assert!(!kept(jackknife(0.09, 0.09, 0.0)));
    // In the fit with equal weights the thresholds are wider.
    let with =
        |info, unweighted: JackknifeResult| is_kept(info, &jackknife(0.09, 0.2, 4e-4), Some(&unweighted));
    let unweighted = |b: JackknifeResult| with(drift.info(), b);
    assert!(
        unweighted(jackknife(0.4, 0.2, 0.02))
            && !unweighted(jackknife(0.05, 0.2, 0.04))
            && !unweighted(jackknife(0.05, 0.0, 0.02))
    );
    // A breathing motion imitates every periodic force.
    let breath = |varying: f64| with(breathes.info(), jackknife(0.4, 0.2, varying));
    assert!(breath(4e-4) && !breath(6e-4));
}

fn rival(effect: &AnyEffect, behind: f64) -> CompetingEffect {
    CompetingEffect {
        name: effect.id(),
        nats_behind: behind,
        choice: EffectTerm::new(effect.info(), &effect.parameters()),
    }
}

#[test]
fn confidence_follows_from_competitors_and_surplus_gain() {
    let bias: AnyEffect = ForceBias { force_n: 0.05 }.into();
    let mut search = search_result(&[bias.clone(), drift()], 2, |t| 0.02 * t + 0.05);
    search.stages[1] = search_stage(Some(("force_drift", 70.0)), 69.0, &[]);
    let competitors = vec![rival(&bias, 1.0), rival(&drift(), 3.0), rival(&bias, -5.0)];
    let result = assess_search(&mut search, &[competitors, Vec::new()]);
    let ids: Vec<&str> = result.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(ids, ["force_drift", "force_bias"], "the one that gained most comes first");
    let (first, second) = (&result.causes[0], &result.causes[1]);
    assert!((first.confidence - 1.0 / (1.0 + (-4.0_f64).exp())).abs() < 1e-12);
    // A competitor counts as at most three nats ahead.
    let weights = (-1.0_f64).exp() + (-3.0_f64).exp() + 3.0_f64.exp();
    assert!((second.confidence - 1.0 / (1.0 + weights + (-5.0_f64).exp())).abs() < 1e-12);
    assert_eq!((first.gain_nats, second.gain_nats), (70.0, 50.0));
    // At three nats an effect is no longer equivalent.
    assert_eq!(
        (first.equivalent.len(), &second.equivalent[..]),
        (0, &["force_bias".to_owned(), "force_bias".to_owned()][..])
    );
    let mut against: Vec<&str> = result.nats_against_zero.iter().map(|a| a.0.as_str()).collect();
    against.sort_unstable();
    assert_eq!(against, ["force_bias", "force_drift"]);
    let e = first.parameters["rate_n_per_s"];
    assert!(e.low < 0.02 && 0.02 < e.high && e.high - e.low < 4e-3, "{e:?}");
    let of = |f: &Fit| excess(&search.data, &f.residuals.residual_n);
    let less = fit(
        &search.best.model.without_effect(1),
        &search.data,
        Effort { max_iterations: 3, min_gain_nats: 1.0 },
    );
    let share = (of(&less.expect("a fit")) - of(&search.best)) / of(&search.base);
    assert!((first.share / share - 1.0).abs() < 1e-9 && second.share < share && share < 0.9, "{share}");
    assert!(!result.unknown && !result.has_tones && result.residual_structure.depends_on.is_empty());
}

#[test]
fn base_parameters_are_reported_with_the_assumed_values() {
    let mut search = search_result(&[], 3, |_| 0.0);
    let mut assumed = search.best.model.assumed.as_ref().clone();
    assumed.tissue.layers[0].stiffness_n_per_m *= 0.8;
    assumed.tissue.layers[0].friction_ns_per_m2 *= 1.3;
    search.best.model.assumed = Arc::new(assumed);
    let covariance = Covariance::new(&search.best, &search.data, &mut ChaCha8Rng::seed_from_u64(1));
    let result = base_parameters(&covariance);
    let names: Vec<(usize, &str)> = result.iter().map(|p| (p.layer, p.name.as_str())).collect();
    let of_layer = ["stiffness_n_per_m", "friction_ns_per_m2", "puncture_n"].map(|n| (1, n));
    assert_eq!(names, [&of_layer[..], &[(0, "surface_m")]].concat());
    // The truth is that of the simulated recordings.
    for (p, (there, changed)) in result.iter().zip([(250.0, true), (2e4, true), (2.0, false), (4e-3, false)])
    {
        assert!((p.value / there - 1.0).abs() < 0.01, "{p:?}");
        assert!(p.low < p.value && (p.high + p.low - 2.0 * p.value).abs() < 1e-9 * p.value, "{p:?}");
        assert_eq!((p.changed, p.at_bound), (changed, false), "{p:?}");
    }
    let role = ParameterRole::Thickness(0);
    search.best.model.free.thickness = true;
    let unsure = Covariance::new(&search.best, &search.data, &mut ChaCha8Rng::seed_from_u64(1));
    let result = base_parameters(&unsure);
    assert_eq!(
        unsure.shared_parameter(role).is_some(),
        result.iter().any(|p| (p.layer, &p.name[..]) == (1, "thickness_m"))
    );
}

#[test]
fn negligible_causes_are_moved() {
    let mut search = search_result(&[drift(), ForceBias { force_n: 0.05 }.into()], 2, |t| 0.02 * t + 0.05);
    let mut assessment = assess_search(&mut search, &[]);
    let small = |effect: &str| Negligible { effect: effect.to_owned(), reason: "a reason".to_owned() };
    let result = move_negligible(&mut assessment, vec![small("time_delay"), small("force_bias")]);
    assert_eq!(
        result.iter().map(|t| (&t.effect[..], &t.reason[..])).collect::<Vec<_>>(),
        [("force_bias", "a reason")]
    );
    assert!(result[0].parameters.contains_key("force_n"));
    assert_eq!(assessment.causes.iter().map(|c| &c.effect[..]).collect::<Vec<_>>(), ["force_drift"]);
}
