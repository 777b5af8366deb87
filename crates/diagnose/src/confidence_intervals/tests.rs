use super::*;
use crate::test_fixtures::{blocks_of, data_of};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::fit;
use stylet_identify::likelihood::{ReplayCache, replay, residuals};
use stylet_identify::model::{Assumptions, EffectTerm};
use stylet_identify::noise::Noise;
use stylet_tissue::{Layer, Tissue};

fn assumptions() -> Assumptions {
    let layer = Layer {
        thickness_m: 0.02,
        stiffness_n_per_m: 90.0,
        friction_ns_per_m2: 6000.0,
        puncture_n: None,
        name: String::new(),
    };
    Assumptions {
        tissue: Tissue { surface_m: 0.002, layers: vec![layer] },
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![0.3],
        thickness_tolerance: vec![0.1],
        surface_tolerance_m: 0.05,
    }
}

/// Half way into the layer, and out again.
fn blocks() -> BlockAverages {
    let (mut t, mut z, mut at) = (Vec::new(), Vec::new(), -0.004);
    for k in 0..1600 {
        let s = f64::from(k) / 200.0;
        at += if s < 5.0 { 0.003 + 0.001 * (3.0 * s).sin() } else { -0.004 } / 200.0;
        t.push(s);
        z.push(at);
    }
    let f = vec![0.0; t.len()];
    blocks_of(t, z, f)
}

/// Recordings that differ in one random effect, set by `set`, with a little noise.
fn insertions(offsets: &[f64], set: impl Fn(&mut Model, f64)) -> (Model, FitData) {
    into(assumptions(), offsets, set)
}

/// The same with another prior.
fn into(assumed: Assumptions, offsets: &[f64], set: impl Fn(&mut Model, f64)) -> (Model, FitData) {
    let blank = FitData::new(Arc::new(vec![blocks(); offsets.len()]), Noise::white(1e-3), 0.0);
    let model = Model::base(Arc::new(assumed), offsets.len());
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut full: Vec<BlockAverages> = blank.recordings.to_vec();
    for (r, x) in offsets.iter().enumerate() {
        let mut there = model.clone();
        set(&mut there, *x);
        let rupture_times_s = ReplayCache::new(&there, &blank, r).expect("a trail").free_rupture_times();
        there.rupture_times_s[r] = rupture_times_s;
        full[r].force_n = replay(&there, &blank, r).expect("a replay").force_n;
        full[r].force_n.iter_mut().for_each(|f| *f += 3.4e-3 * (rng.random::<f64>() - 0.5));
    }
    (model, data_of(full, 1e-3))
}

/// A layer of 6 mm reaches 0.54 N at its end and ruptures there, whatever its puncture force above.
#[test]
fn puncture_force_that_was_not_reached_is_open_above() {
    let of = |believed_n: f64, true_n: f64| {
        let mut b = assumptions();
        b.tissue.layers[0].thickness_m = 0.006;
        b.tissue.layers[0].puncture_n = Some(believed_n);
        into(b, &[0.0, 0.0], |m, _| m.tissue.layers[0].puncture_n = Some(true_n))
    };
    let at = |model: &Model, data: &FitData, f_n: f64| {
        let mut model = model.clone();
        for r in 0..2 {
            model.rupture_times_s[r] =
                ReplayCache::new(&model, data, r).expect("a trail").free_rupture_times();
        }
        model.tissue.layers[0].puncture_n = Some(f_n);
        fit(&model, data, Effort::FULL).expect("a fit")
    };
    let role = ParameterRole::Puncture(0);
    let (model, data) = of(0.7, 0.7);
    let tied = at(&model, &data, 0.54);
    let open = Covariance::with_known_noise(&tied, &data).unreached_puncture(role).expect("open");
    assert!((open.prior_upper_end - 1.0 - 0.3 * 1.96).abs() < 1e-3, "{}", open.prior_upper_end);
    let free = release_unreached_punctures(tied.clone(), &data);
    assert!((free.model.get(role, 0) - 1.0).abs() < 1e-6, "{}", free.model.get(role, 0));
    assert!(free.nats() < tied.nats() + 1.93);
    // A rupture before the end of the layer bounds the puncture force.
    let (model, data) = of(0.4, 0.4);
    let estimated = at(&model, &data, 0.4);
    let covariance = Covariance::with_known_noise(&estimated, &data);
    assert!(covariance.unreached_puncture(role).is_none());
    assert!(covariance.unreached_puncture(ParameterRole::Stiffness(0)).is_none());
    assert_eq!(
        release_unreached_punctures(estimated.clone(), &data).model.get(role, 0),
        estimated.model.get(role, 0)
    );
}

/// The mean of four values has Student's interval with three degrees of freedom.
#[test]
fn mean_of_a_random_effect_has_students_interval() {
    let offsets = [-4e-4, 7e-4, 1e-4, -8e-4];
    let wanted = |offsets: &[f64]| {
        CALIBRATION_FACTOR * student_t::quantile(0.975, 3.0) * stylet_stats::sd(offsets) / 2.0
    };
    let (mut model, data) = insertions(&offsets, |m, x| m.tissue.surface_m += x);
    model.free.recording_surface = true;
    model.per_recording.iter_mut().zip(offsets).for_each(|(o, x)| o.surface_m = x);
    let estimated = fit(&model, &data, Effort::FULL).expect("a fit");
    let (_, half) = Covariance::with_known_noise(&estimated, &data)
        .shared_parameter(ParameterRole::Surface)
        .expect("free");
    assert!((half / wanted(&offsets) - 1.0).abs() < 0.1, "{half} for {}", wanted(&offsets));

    let offsets = [-0.03, 0.05, 0.02, -0.05];
    let (mut model, data) =
        insertions(&offsets, |m, x| m.tissue.layers[0].friction_ns_per_m2 *= libm::exp(x));
    model.free.recording_friction = true;
    model.per_recording.iter_mut().zip(offsets).for_each(|(o, x)| o.ln_friction = x);
    let estimated = fit(&model, &data, Effort::FULL).expect("a fit");
    let (_, half) = Covariance::with_known_noise(&estimated, &data)
        .shared_parameter(ParameterRole::Friction(0))
        .expect("free");
    assert!((half / wanted(&offsets) - 1.0).abs() < 0.1, "{half} for {}", wanted(&offsets));
}
/// With known noise the deviate is normal; with estimated noise it is Student's, which is smaller.
#[test]
fn nats_against_zero_use_the_degrees_of_freedom_of_the_interval() {
    let (mut model, data) = insertions(&[0.0, 0.0], |_, _| ());
    let mut drifting: Vec<BlockAverages> = data.recordings.to_vec();
    for b in &mut drifting {
        b.force_n.iter_mut().zip(&b.start_s).for_each(|(f, t)| *f += 0.005 * t);
    }
    let mut noise = Noise::white(0.004);
    noise.bins[0].ar[0] = 0.9;
    let data = FitData::new(Arc::new(drifting), noise, 0.0);
    model.free.thickness = false;
    let drift = stylet_tissue::effect_info("force_drift").expect("in the library");
    let estimated =
        fit(&model.with_effect(EffectTerm::new(drift, &[0.005])), &data, Effort::FULL).expect("a fit");
    let nats = |s: &Covariance, dof: f64| {
        let e = s.effect_parameter(0, 0);
        0.5 * (CALIBRATION_FACTOR * e.value / (e.high - e.low) * 2.0 * student_t::quantile(0.975, dof))
            .powi(2)
    };
    let with_known_noise = Covariance::with_known_noise(&estimated, &data);
    let by_normal = with_known_noise.nats_against_zero(0).expect("a strength");
    assert!(by_normal > 8.0 && (by_normal / nats(&with_known_noise, 1e4) - 1.0).abs() < 0.01, "{by_normal}");
    let offsets = Covariance::new(&estimated, &data, &mut ChaCha8Rng::seed_from_u64(3));
    let by_student = offsets.nats_against_zero(0).expect("a strength");
    assert!(by_student < 0.97 * nats(&offsets, 1e4), "{by_student} of {}", nats(&offsets, 1e4));
}

/// Under slow noise the position of a kink is far less certain than a local derivative suggests; under white noise
/// both agree.
#[test]
fn kink_position_is_as_certain_as_the_noise_allows() {
    let (mut model, mut data) = insertions(&[0.0, 0.0], |_, _| ());
    // The end of the layer is never reached.
    model.free.thickness = false;
    for (slow, least, most) in [(0.0, 0.97, 1.06), (0.98, 1.5, 20.0)] {
        let mut noise = Noise::white(0.02);
        noise.bins[0].ar[0] = slow;
        data = data.with_noise(noise);
        let estimated = fit(&model, &data, Effort::FULL).expect("a fit");
        let linearization = Linearization::new(&estimated.model, &data, &estimated.residuals);
        let at = linearization.shared.iter().position(|n| n.role == ParameterRole::Surface).expect("free");
        let by_derivative =
            CALIBRATION_FACTOR * stylet_stats::Z95 * linearization.factor().inverse_diagonal()[at].sqrt();
        let (_, half) = Covariance::with_known_noise(&estimated, &data)
            .shared_parameter(ParameterRole::Surface)
            .expect("free");
        let ratio = half / by_derivative;
        assert!(ratio > least && ratio < most, "{slow}: {ratio}");
    }
}

/// A random effect contributes the square of its share over its degrees of freedom, the estimated noise half the
/// squared scatter of the variance (Welch and Satterthwaite).
#[test]
fn degrees_of_freedom_follow_welch_and_satterthwaite() {
    let (model, data) = insertions(&[0.0, 0.0], |_, _| ());
    let estimated = fit(&model, &data, Effort { max_iterations: 1, min_gain_nats: 1.0 }).expect("a fit");
    let of = |raised: &[(f64, f64)], bootstrap: &[f64]| {
        let with_known_noise = Covariance::with_known_noise(&estimated, &data);
        let size = with_known_noise.linearization.normal_matrix.size;
        // Equal variances for all parameters.
        let even = |variance: f64| {
            let mut m = SymmetricMatrix::zeros(size);
            (0..size).for_each(|i| m.add(i, i, 1.0 / variance));
            m.cholesky()
        };
        let covariance = Covariance {
            factor: even(0.5),
            with_increased_variance: raised
                .iter()
                .map(|(s, f)| (even(0.5 * (1.0 + VARIANCE_INCREASE * s)), *f))
                .collect(),
            bootstrap: bootstrap.iter().map(|a| even(0.5 * a)).collect(),
            ..with_known_noise
        };
        let mut gradient = vec![0.0; size];
        (gradient[0], gradient[1]) = (0.8, 0.6);
        covariance.deviation(&gradient)
    };
    let near = |(sd, freedom): (f64, f64), variance: f64, wanted: f64| {
        assert!((sd / variance.sqrt() - 1.0).abs() < 1e-4, "{sd} for {}", variance.sqrt());
        assert!((freedom / wanted - 1.0).abs() < 1e-3, "{freedom} for {wanted}");
    };
    near(of(&[], &[]), 0.5, 1e4);
    near(of(&[(0.5, 3.0), (0.25, 5.0)], &[]), 0.5, 1.0 / (0.25 / 3.0 + 0.0625 / 5.0));
    // Shares are limited to 0 to 1, and degrees of freedom to at least one.
    near(of(&[(3.0, 7.0)], &[]), 0.5, 7.0);
    near(of(&[(-0.5, 7.0)], &[]), 0.5, 1e4);
    near(of(&[(1.0, 0.4)], &[]), 0.5, 1.0);
    // Bootstrap variances of 0.8 on average, with a standard deviation of 0.2.
    near(of(&[], &[0.6, 0.8, 1.0]), 0.5 / 0.8, 2.0 * 16.0);
    near(of(&[(0.5, 3.0)], &[0.6, 0.8, 1.0]), 0.5 / 0.8, 1.0 / (0.25 / 3.0 + 1.0 / 32.0));
    // A larger bootstrap variance does not narrow the interval; a single replicate is ignored.
    near(of(&[], &[1.2, 1.4]), 0.5, 2.0 * (1.3 / 0.02_f64.sqrt()).powi(2));
    near(of(&[], &[0.5]), 0.5, 1e4);
}

/// A model at its present values, fitted or not.
fn at_present_values(model: Model, data: &FitData) -> Fit {
    Fit { residuals: residuals(&model, data).expect("a replay"), model }
}

#[test]
fn parameter_is_at_a_bound_within_a_millionth_of_its_range() {
    let (model, data) = insertions(&[0.0], |_, _| ());
    let n = *model.shared_parameters().iter().find(|n| n.role == ParameterRole::Stiffness(0)).expect("free");
    let near = 1e-6 * (n.high - n.low).min(1.0);
    for (x, at) in [
        (n.low + 0.9 * near, true),
        (n.low + 1.1 * near, false),
        (n.prior_mean, false),
        (n.high - 1.1 * near, false),
        (n.high - 0.9 * near, true),
    ] {
        let mut moved = model.clone();
        moved.set(n.role, 0, x);
        let fit = at_present_values(moved, &data);
        let covariance = Covariance::with_known_noise(&fit, &data);
        assert_eq!(covariance.at_bound(n.role), at, "{x}");
        assert!(!covariance.at_bound(ParameterRole::Puncture(0)), "nothing punctures");
    }
}

/// Time constants use the logarithm, compliances the reciprocal.
#[test]
fn intervals_are_symmetric_in_the_scale_of_the_fit() {
    let (model, data) = insertions(&[0.0, 0.0], |_, _| ());
    let of = |id: &str, values: &[f64], parameter: usize| {
        let choice = EffectTerm::new(stylet_tissue::effect_info(id).expect("in the library"), values);
        let fit = at_present_values(model.with_effect(choice), &data);
        let covariance = Covariance::with_known_noise(&fit, &data);
        (covariance.effect_parameter(0, parameter), covariance.nats_against_zero(0))
    };
    let (e, _) = of("periodic_interference", &[3e-4, 1.7, 0.2], 1);
    assert!(e.low < 1.7 && e.high < 3.0, "{e:?}");
    assert!((e.low * e.high / (1.7 * 1.7) - 1.0).abs() < 1e-9, "{e:?}");
    let (e, against) = of("needle_compliance", &[40_000.0], 0);
    let (below, above) = (1.0 / e.value - 1.0 / e.high, 1.0 / e.low - 1.0 / e.value);
    assert!(below > 0.0 && (below / above - 1.0).abs() < 1e-9, "{e:?}");
    let deviations = CALIBRATION_FACTOR / e.value / above * stylet_stats::Z95;
    let wanted = 0.5 * deviations * deviations;
    let against = against.expect("a strength");
    assert!((against / wanted - 1.0).abs() < 0.02, "{against} for {wanted}");
    // Practically rigid.
    let (e, against) = of("needle_compliance", &[1e9], 0);
    assert!(e.high == 1e300 && e.low > 1e4 && e.low < 1e9, "{e:?}");
    assert!(against.is_some_and(|nats| nats < 0.5), "{against:?}");
    let (e, _) = of("needle_compliance", &[f64::INFINITY], 0);
    assert!(e.value == 1e300 && e.high == 1e300 && e.low > 1e4 && e.low < 1e9, "{e:?}");
    // Not negative.
    let (e, against) = of("coulomb_friction", &[1e-4], 0);
    assert!(e.low == 0.0 && e.high > 1e-3 && against.is_some_and(|nats| nats < 0.5), "{e:?}");
}

#[test]
fn fixed_parameters_have_no_interval_and_undetermined_ones_that_of_the_prior() {
    let (mut model, data) = insertions(&[0.0, 0.0], |_, _| ());
    let fit = at_present_values(model.clone(), &data);
    let covariance = Covariance::with_known_noise(&fit, &data);
    assert!(covariance.shared_parameter(ParameterRole::Puncture(0)).is_none());
    let (value, half) = covariance.shared_parameter(ParameterRole::Stiffness(0)).expect("free");
    assert!(value == fit.model.get(ParameterRole::Stiffness(0), 0) && half > 0.0 && half < 0.1, "{half}");
    // A layer that the needle never leaves.
    let n = *model.shared_parameters().iter().find(|n| n.role == ParameterRole::Thickness(0)).expect("free");
    let (_, half) = covariance.shared_parameter(n.role).expect("free");
    assert!(
        (half / (CALIBRATION_FACTOR * n.prior_sd * stylet_stats::Z95) - 1.0).abs() < 0.01,
        "{half} for {}",
        n.prior_sd
    );
    model.free.thickness = false;
    let fit = at_present_values(model, &data);
    assert!(Covariance::with_known_noise(&fit, &data).shared_parameter(n.role).is_none());
}
