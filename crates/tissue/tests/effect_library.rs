//! Promise: the library describes every effect of docs/reference/model.md completely, an inactive effect leaves the base law
//! bit for bit on any motion, and all effects together stay finite.

use crate::common;
use common::*;
use proptest::prelude::*;
use stylet_tissue::*;

const GENERAL_EFFECTS: [&str; 30] = [
    "nonlinear_elasticity",
    "stress_relaxation",
    "coulomb_friction",
    "stribeck_friction",
    "presliding_friction",
    "asymmetric_friction",
    "power_law_friction",
    "cutting_force",
    "incomplete_release",
    "rate_dependent_puncture",
    "hidden_membrane",
    "boundary_shift",
    "soft_boundary",
    "respiration",
    "needle_compliance",
    "tool_inertia",
    "drive_friction",
    "force_gain",
    "low_pass_lag",
    "time_delay",
    "force_bias",
    "force_drift",
    "periodic_interference",
    "saturation",
    "quantisation",
    "position_scale",
    "force_spikes",
    "zero_step",
    "position_dependent_force",
    "loading_hysteresis",
];

#[test]
fn the_library_has_every_general_effect_once_in_the_order_of_the_chain() {
    let mut ids: Vec<&str> = general_effects().map(|info| info.id).collect();
    let places: Vec<ChainStage> = general_effects().map(|info| info.stage).collect();
    assert!(places.is_sorted(), "{places:?}");
    let mut expected = GENERAL_EFFECTS;
    ids.sort_unstable();
    expected.sort_unstable();
    assert_eq!(ids, expected);
    assert!(effect_info("coulomb_friction").is_some() && effect_info("magic").is_none());
}

#[test]
fn parameters_of_further_terms_are_known_by_their_path() {
    let relaxation = effect_info("stress_relaxation").expect("an effect");
    for path in ["terms.0.time_constant_s", "terms.1.time_constant_s"] {
        assert_eq!(relaxation.parameter(path).map(|p| p.unit), Some("s"), "{path}");
    }
    assert!(relaxation.parameter("terms.2.fraction").is_none());
}

#[test]
fn every_parameter_has_a_typical_value_inside_its_search_range_inside_its_allowed_range() {
    for effect in typical_effects() {
        let info = effect.info();
        assert!(
            !info.equation.is_empty() && !info.source.is_empty() && info.signature.ends_with('.'),
            "{info:?}"
        );
        assert!(info.parameters.iter().any(|p| p.strength), "{} has no strength", info.id);
        for p in info.parameters {
            let (low, high) = p.search;
            let name = format!("{}.{}", info.id, p.path);
            assert!(p.low <= low && low < high && high <= p.high, "{name}: {p:?}");
            assert!(low <= p.start && p.start <= high, "{name}: {p:?}");
            assert!(p.low <= p.inactive && p.inactive <= p.high, "{name}: {p:?}");
            assert!(!p.log || low > 0.0, "{name}: logarithm of {low}");
        }
    }
}

#[test]
fn parameters_round_trip_and_inactive_values_make_an_effect_inactive() {
    for effect in typical_effects() {
        let info = effect.info();
        assert_eq!(effect.id(), info.id);
        assert_eq!(effect.stage(), info.stage);
        assert!(!effect.is_inactive(), "{effect:?}");
        effect.check().expect("typical values are allowed");
        let values = effect.parameters();
        assert_eq!(values.len(), info.parameters.len());
        assert_eq!(AnyEffect::from_parameters(info.id, &values), Some(effect.clone()));
        assert_eq!(AnyEffect::from_parameters(info.id, &[0.1; 9]), None);
        // The strengths alone make it vanish, whatever the shape parameters.
        let strengths_off: Vec<f64> =
            info.parameters.iter().map(|p| if p.strength { p.inactive } else { p.start }).collect();
        let all_off: Vec<f64> = info.parameters.iter().map(|p| p.inactive).collect();
        for values in [strengths_off, all_off] {
            let inactive = AnyEffect::from_parameters(info.id, &values).expect("right number");
            assert!(inactive.is_inactive(), "{inactive:?}");
            inactive.check().expect("inactive values are allowed");
        }
    }
    assert_eq!(AnyEffect::from_parameters("magic", &[1.0]), None);
}

#[test]
fn a_parameter_out_of_range_is_named_with_its_valid_range() {
    let refuse = |effect: AnyEffect| effect.check().expect_err("out of range");
    let error = refuse(CoulombFriction { c_n_per_m: -1.0 }.into());
    assert_eq!((error.effect, error.path, error.value), ("coulomb_friction", "c_n_per_m", -1.0));
    assert!(error.to_string().contains("between 0 and 10000"), "{error}");
    assert_eq!(refuse(NeedleCompliance { stiffness_n_per_m: 0.0 }.into()).path, "stiffness_n_per_m");
    assert_eq!(refuse(ForceBias { force_n: f64::NAN }.into()).path, "force_n");
    let stribeck = StribeckFriction { c_n_per_m: 5.0, c_static_n_per_m: 4.0, v_stribeck_mps: 1e-3 };
    assert_eq!(refuse(stribeck.into()).allowed.0, 5.0);
    let term = |fraction| PronyTerm { fraction, time_constant_s: 1.0 };
    assert_eq!(
        refuse(StressRelaxation { terms: vec![term(0.6), term(0.6)] }.into()).path,
        "terms.1.fraction"
    );
    assert_eq!(refuse(StressRelaxation { terms: vec![term(0.1); 3] }.into()).path, "terms");
    assert_eq!(refuse(BoundaryShift { layer: 0, shift_m: 0.001 }.into()).path, "layer");
}

fn inactive_effects() -> Vec<AnyEffect> {
    let off = |effect: AnyEffect| {
        let info = effect.info();
        let values: Vec<f64> =
            info.parameters.iter().map(|p| if p.strength { p.inactive } else { p.start }).collect();
        AnyEffect::from_parameters(info.id, &values).expect("right number")
    };
    typical_effects().into_iter().map(off).collect()
}

fn bits(forces: &[TissueForce]) -> Vec<u64> {
    forces
        .iter()
        .flat_map(|f| [f.total_n, f.tip_n, f.cumulative_friction_ns_per_m])
        .map(f64::to_bits)
        .collect()
}

prop_compose! {
    fn any_motion()(
        start in -0.01f64..0.001, mean in 0.0005f64..0.013, ripple in 0.0f64..0.013, hz in 0.05f64..2.0, rate in 20.0f64..500.0,
    ) -> Vec<Sample> {
        ripple_hold_retract(start, mean, ripple, hz, rate)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn each_inactive_effect_leaves_the_base_law_bit_for_bit(motion in any_motion()) {
        let base = bits(&run(&three_gels(), &[], &motion).0);
        for effect in inactive_effects() {
            let with = bits(&run(&three_gels(), std::slice::from_ref(&effect), &motion).0);
            prop_assert!(base == with, "{:?}", effect);
        }
        prop_assert_eq!(&base, &bits(&run(&three_gels(), &inactive_effects(), &motion).0));
        let chain = MeasurementChain::new(&inactive_effects());
        prop_assert!(chain.is_plain());
        let mut state = chain.start(200.0);
        for (k, &(time_s, z, velocity_mps)) in motion.iter().enumerate() {
            let tissue_n = f64::from_bits(base[3 * k]);
            let reading = SensorInput { time_s, position_m: z, velocity_mps, acceleration_mps2: 1.0, tissue_n, noise_n: 0.0 };
            prop_assert_eq!(chain.step(&mut state, &reading).to_bits(), base[3 * k]);
            prop_assert_eq!(chain.recorded_position(z).to_bits(), z.to_bits());
        }
    }

    /// All at once, at a random strength each: finite, bounded, the same twice, in any order.
    #[test]
    fn all_effects_together_are_finite_and_deterministic(
        motion in any_motion(), shares in proptest::collection::vec(0.0f64..1.0, 80), turn in 0usize..20,
    ) {
        let mut shares = shares.into_iter();
        let mut effects: Vec<AnyEffect> = general_effects()
            .map(|info| {
                let values: Vec<f64> = info.parameters.iter().map(|p| {
                    let share = shares.next().unwrap_or(0.5);
                    let (low, high) = p.search;
                    if p.integer { 1.0 } else if p.log { low * (high / low).powf(share) } else { low + share * (high - low) }
                }).collect();
                AnyEffect::from_parameters(info.id, &values).expect("right number")
            })
            .collect();
        let (forces, ruptures) = run(&three_gels(), &effects, &motion);
        for f in &forces {
            prop_assert!(f.total_n.is_finite() && f.total_n.abs() < 1e4, "{:?}", f);
            prop_assert!((f.elastic_n + f.friction_n + f.tip_extra_n - f.total_n).abs() < 1e-6 * (1.0 + f.total_n.abs()), "{:?}", f);
        }
        prop_assert!(ruptures.windows(2).all(|w| w[0].layer < w[1].layer && w[0].time_s <= w[1].time_s));
        let again = run(&three_gels(), &effects, &motion);
        prop_assert_eq!(&bits(&forces), &bits(&again.0));
        effects.rotate_left(turn);
        let turned = run(&three_gels(), &effects, &motion);
        prop_assert_eq!(bits(&forces), bits(&turned.0));
    }
}

#[test]
fn every_typical_effect_of_the_tissue_changes_the_force() {
    let base = forces(&three_gels(), &[], &usual_motion());
    for effect in typical_effects().into_iter().filter(|e| e.stage() < ChainStage::Tool) {
        let changed = forces(&three_gels(), std::slice::from_ref(&effect), &usual_motion());
        assert!(worst(&base, &changed) > 0.02, "{effect:?} changes the force by {}", worst(&base, &changed));
    }
}

#[test]
fn a_sample_that_is_not_finite_has_a_nan_force_and_leaves_the_state_unchanged() {
    let effects: Vec<AnyEffect> =
        typical_effects().into_iter().filter(|e| e.id() != "stress_relaxation").collect();
    let law = ForceLaw::new(&three_gels(), &effects).expect("few effects");
    let mut state = ForceLawState::default();
    for (k, (t, z, v)) in usual_motion().into_iter().enumerate() {
        if k % 100 == 50 {
            let before = state;
            for broken in [(f64::NAN, z, v), (t, f64::NAN, v), (t, z, f64::INFINITY)] {
                let force = law.step(&mut state, broken.0, broken.1, broken.2, |_| {});
                assert!(force.total_n.is_nan());
            }
            assert_eq!(before, state);
        }
        assert!(law.step(&mut state, t, z, v, |_| {}).total_n.is_finite());
    }
    assert_eq!(state.ruptured(), 2, "the motion went through layers");
}

/// Where a condition links two parameters, their coordinates may be anywhere within the bounds of each.
#[test]
fn any_coordinates_within_their_bounds_give_a_valid_effect() {
    for (id, ends) in [
        ("stribeck_friction", vec![[0.0, 40.0], [0.0, 60.0], [1e-4, 0.1]]),
        ("stress_relaxation", vec![[0.0, 1.0], [0.01, 100.0], [0.0, 1.0], [0.01, 100.0]]),
    ] {
        for corner in 0..1_usize << ends.len() {
            let at: Vec<f64> = ends.iter().enumerate().map(|(k, e)| e[corner >> k & 1]).collect();
            let effect = AnyEffect::from_coordinates(id, &at).expect("an effect");
            assert!(effect.check().is_ok(), "{id} at {at:?}: {:?}", effect.parameters());
        }
    }
}

#[test]
fn coordinates_round_trip() {
    for info in general_effects().chain(per_layer_effects()) {
        let start: Vec<f64> = info.parameters.iter().map(|p| p.start).collect();
        let effect = AnyEffect::from_parameters(info.id, &start).expect("its own parameters");
        let coordinates = effect.coordinates();
        let back = AnyEffect::from_coordinates(info.id, &coordinates).expect("its own coordinates");
        for (a, b) in effect.parameters().iter().zip(back.parameters()) {
            near(b, *a, 1e-15 * a.abs());
        }
        assert_eq!(coordinates.len(), start.len());
        // Some effects have other coordinates than their parameters.
        if !["shaft_slip", "hidden_membrane", "stribeck_friction"].contains(&info.id) {
            assert_eq!(coordinates, start, "{}", info.id);
        }
        assert_eq!(AnyEffect::from_coordinates(info.id, &[0.1; 99]), None);
    }
    assert_eq!(AnyEffect::from_coordinates("magic", &[1.0]), None);
}

#[test]
fn the_fit_scale_follows_strength_and_search() {
    let scale =
        |id: &str, path: &str| effect_info(id).and_then(|i| i.parameter(path)).expect("known").fit_scale();
    assert_eq!(scale("coulomb_friction", "c_n_per_m"), FitScale::Linear);
    // A strength stays linear although its search is logarithmic: it may shrink to zero.
    assert_eq!(scale("low_pass_lag", "time_constant_s"), FitScale::Linear);
    assert_eq!(scale("stress_relaxation", "terms.0.time_constant_s"), FitScale::Log);
    assert_eq!(scale("respiration", "phase_rad"), FitScale::Linear);
    // Infinite when inactive.
    assert_eq!(scale("needle_compliance", "stiffness_n_per_m"), FitScale::Reciprocal);
}

#[test]
fn parameter_descriptions_are_those_of_the_effect_s_file() {
    let lag = effect_info("low_pass_lag").and_then(|i| i.parameter("time_constant_s")).expect("known");
    assert!(lag.strength && !lag.integer && lag.low == 0.0 && lag.inactive == 0.0, "{lag:?}");
    let phase = effect_info("respiration").and_then(|i| i.parameter("phase_rad")).expect("known");
    assert!(!phase.strength, "{phase:?}");
    let layer = effect_info("boundary_shift").and_then(|i| i.parameter("layer")).expect("known");
    assert!(layer.integer && !layer.strength && !layer.log, "{layer:?}");
    let exponent = effect_info("power_law_friction").and_then(|i| i.parameter("exponent")).expect("known");
    assert_eq!((exponent.low, exponent.high, exponent.inactive), (-0.9, 3.0, 1.0));
    assert_eq!((exponent.start, exponent.search), (0.7, (0.1, 2.0)));
    // The release depth differs between recordings, the exponent does not.
    let release_depth = effect_info("release_depth")
        .and_then(|i| i.parameters.iter().find(|p| p.between_recordings_sd > 0.0));
    assert_eq!(
        (release_depth.map(|p| p.between_recordings_sd), exponent.between_recordings_sd),
        (Some(5e-4), 0.0)
    );
    assert_eq!(per_layer_effects().count(), 7);
}

#[test]
fn a_range_without_an_upper_end_is_reported_as_a_lower_bound() {
    let with =
        |high| ParameterError { effect: "magic", path: "x", value: -1.0, allowed: (0.0, high) }.to_string();
    assert_eq!(with(f64::INFINITY), "magic: x is -1; it must be at least 0");
    assert_eq!(with(2.0), "magic: x is -1; it must lie between 0 and 2");
}

#[test]
fn at_most_sixteen_effects_act_at_once() {
    let one: AnyEffect = CoulombFriction { c_n_per_m: 1.0 }.into();
    let many = |n: usize| ForceLaw::new(&three_gels(), &vec![one.clone(); n]);
    let law = many(MAX_EFFECTS).expect("as many as can");
    near(
        law.step(&mut ForceLawState::default(), 0.0, 0.01, 1e-4, |_| {}).friction_n,
        16.0 * 0.01 + 9000.0 * 0.01 * 1e-4,
        1e-12,
    );
    assert_eq!(many(MAX_EFFECTS + 1).err(), Some(TooManyEffects { effect_count: 17 }));
    // Sensor effects and a compliant needle do not count.
    let mut more = vec![one.clone(); MAX_EFFECTS];
    more.extend([ForceBias { force_n: 1.0 }.into(), NeedleCompliance { stiffness_n_per_m: 500.0 }.into()]);
    assert!(ForceLaw::new(&three_gels(), &more).is_ok());
}
