use super::{ParameterRole as Role, *};
use stylet_tissue::AnyEffect;
use stylet_tissue::{Layer, effect_info};

fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-12 * expected.abs(), "{actual} for {expected}");
}

fn layer(thickness_m: f64, stiffness: f64, friction: f64, puncture_n: Option<f64>) -> Layer {
    Layer {
        thickness_m,
        stiffness_n_per_m: stiffness,
        friction_ns_per_m2: friction,
        puncture_n,
        name: String::new(),
    }
}

fn assumptions() -> Assumptions {
    Assumptions {
        tissue: Tissue {
            surface_m: 0.002,
            layers: vec![
                layer(0.012, 90.0, 4000.0, Some(0.6)),
                layer(0.01, 150.0, 0.0, None),
                layer(0.03, 0.0, 6000.0, Some(1.1)),
            ],
        },
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![0.3, 0.99, 0.25],
        thickness_tolerance: vec![0.1, 0.6, 0.0],
        surface_tolerance_m: 0.0015,
    }
}

fn term(id: &str, values: &[f64]) -> EffectTerm {
    EffectTerm::new(effect_info(id).expect("in the library"), values)
}

fn base() -> Model {
    Model::base(Arc::new(assumptions()), 3)
}

/// Role, bounds, prior mean, prior standard deviation, step.
type Line = (Role, f64, f64, f64, f64, f64);

fn assert_all_close(actual: &[Parameter], expected: &[Line]) {
    assert_eq!(
        actual.iter().map(|n| n.role).collect::<Vec<_>>(),
        expected.iter().map(|w| w.0).collect::<Vec<_>>()
    );
    for (n, w) in actual.iter().zip(expected) {
        for (actual, expected) in
            [(n.low, w.1), (n.high, w.2), (n.prior_mean, w.3), (n.prior_sd, w.4), (n.step, w.5)]
        {
            assert!(
                actual == expected || (actual - expected).abs() <= 1e-12 * expected.abs(),
                "{:?}: {actual} for {expected}",
                n.role
            );
        }
    }
}

const NO: f64 = f64::INFINITY;

#[test]
fn base_parameters_are_bounded_by_the_assumed_tolerances() {
    assert_all_close(
        &base().shared_parameters(),
        &[
            (Role::Stiffness(0), 0.7, 1.3, 1.0, 0.3, 1e-5),
            (Role::Friction(0), 0.7, 1.3, 1.0, 0.3, 1e-5),
            (Role::Puncture(0), 0.7, 1.3, 1.0, 0.3, 1e-5),
            // At least a fiftieth.
            (Role::Stiffness(1), 0.02, 1.99, 1.0, 0.99, 1e-5),
            (Role::Friction(2), 0.75, 1.25, 1.0, 0.25, 1e-5),
            (Role::Puncture(2), 0.75, 1.25, 1.0, 0.25, 1e-5),
            (Role::Surface, -0.001, 0.005, 0.002, 0.0015, 1e-7),
            (Role::Thickness(0), 0.0096, 0.0144, 0.012, 0.0012, 1e-7),
            // At least a twentieth.
            (Role::Thickness(1), 0.0005, 0.022, 0.01, 0.006, 1e-7),
        ],
    );
    let mut fixed = base();
    fixed.free = FreeParameters::default();
    assert_eq!(fixed.shared_parameters().len(), 6);
    // Two tolerances, or five.
    let mut far = base();
    let of =
        |m: &Model| m.shared_parameters().into_iter().find(|n| n.role == Role::Thickness(0)).expect("free");
    for (is_far, low, high) in [(false, 0.0096, 0.0144), (true, 0.006, 0.018)] {
        far.free.wide_thickness = is_far;
        assert_close(of(&far).low, low);
        assert_close(of(&far).high, high);
    }
    for (thickness_m, strained) in [(0.0097, false), (0.0095, true), (0.0143, false), (0.0145, true)] {
        far.tissue.layers[0].thickness_m = thickness_m;
        assert_eq!(far.thickness_out_of_tolerance(0), strained, "{thickness_m}");
    }
    let mut sure = assumptions();
    sure.surface_tolerance_m = 0.0;
    assert!(!Model::base(Arc::new(sure), 1).shared_parameters().iter().any(|n| n.role == Role::Surface));
}

#[test]
fn effect_parameters_are_bounded_by_the_search_range() {
    let model = base()
        .with_effect(term("stress_relaxation", &[0.4, 3.0]))
        .with_effect(term("needle_compliance", &[700.0]))
        .with_effect(term("rate_dependent_puncture", &[-0.2]))
        .with_effect(term("periodic_interference", &[0.02, 4.0, 0.5]))
        .with_effect(term("release_depth", &[2.0, 1e-3]));
    let of = |effect: usize, parameter: usize| Role::Effect { effect, parameter };
    let at = |effect: usize| model.effects[effect].coordinates();
    let ln = libm::log;
    let actual: Vec<Parameter> =
        model.shared_parameters().into_iter().filter(|n| matches!(n.role, Role::Effect { .. })).collect();
    let line = |effect: usize, parameter: usize| {
        let p = &model.effects[effect].info.parameters[parameter];
        let (from, to) = p.search;
        let x = at(effect)[parameter].abs();
        let low = if p.low == 0.0 { 0.0 } else { (2.0 * from - to).max(p.low) };
        (
            of(effect, parameter),
            low,
            (4.0 * to - 3.0 * from).min(p.high),
            0.0,
            NO,
            1e-4 * p.start.abs().max(x).max(1e-4),
        )
    };
    let frequency =
        model.effects[3].info.parameters.iter().position(|p| p.unit == "Hz").expect("a frequency");
    let search = model.effects[3].info.parameters[frequency].search;
    let high = model.effects[3].info.parameters[frequency].high;
    let beat = (
        of(3, frequency),
        ln(search.0 / 10.0),
        ln((10.0 * search.1).min(high)),
        0.0,
        NO,
        1e-6 / at(3)[frequency],
    );
    let interference: Vec<Line> = (0..3).map(|p| if p == frequency { beat } else { line(3, p) }).collect();
    assert_all_close(
        &actual,
        &[
            &[
                (of(0, 0), 0.0, 1.0, 0.0, NO, 4e-5),
                (of(0, 1), ln(0.005), ln(600.0), 0.0, NO, 1e-4),
                (of(1, 0), 0.0, 0.2, 0.0, NO, 1e-7),
                (of(2, 0), -1.5, 2.0, 0.0, NO, 2e-5),
            ][..],
            &interference,
            // The layer index is not fitted; the release depth may range from 25 mm below the search range to
            // 75 mm above.
            &[(of(4, 1), -0.03, 0.095, 0.0, NO, 2e-7)],
        ]
        .concat(),
    );
    assert_eq!(model.effect_parameter_count(), 2 + 1 + 1 + 3 + 1);
    // Tied parameters are not fitted.
    let mut bound = model.clone();
    bound.tied = vec![
        TiedParameter { effect: 0, parameter: 1, tied_to: None },
        TiedParameter { effect: 3, parameter: 0, tied_to: Some(0) },
    ];
    let left: Vec<Role> = bound.shared_parameters().iter().map(|n| n.role).collect();
    assert_eq!(left.len() + 2, model.shared_parameters().len());
    assert!(
        left.contains(&of(0, 0))
            && !left.contains(&of(0, 1))
            && !left.contains(&of(3, 0))
            && left.contains(&of(1, 0))
    );
}

#[test]
fn random_effects_have_the_scatter_as_prior() {
    let mut model = base()
        .with_effect(term("release_depth", &[2.0, 1e-3]))
        .with_effect(term("release_depth", &[1.0, 2e-3]));
    let rupture_times = |n: usize| (0..n).map(|l| (Role::RuptureTime(l), -NO, NO, 0.0, NO, 1e-5));
    assert_all_close(&model.recording_parameters(), &rupture_times(3).collect::<Vec<_>>());
    model.scatter = Scatter {
        surface_m: 7e-4,
        ln_friction: 0.03,
        day_surface_m: 1.1e-3,
        day_ln_friction: 0.07,
        ..Default::default()
    };
    model.scatter.varying[1] = 3e-4;
    (model.free.recording_surface, model.free.recording_friction, model.free.recording_effects) =
        (true, true, true);
    let own = [
        (Role::RecordingSurface, -NO, NO, 0.0, 7e-4, 1e-7),
        (Role::RecordingFriction, -NO, NO, 0.0, 0.03, 1e-5),
        // The library's value without an estimate.
        (Role::RecordingEffect(0), -NO, NO, 0.0, 5e-4, 5e-7),
        (Role::RecordingEffect(1), -NO, NO, 0.0, 3e-4, 5e-7),
    ];
    assert_all_close(
        &model.recording_parameters(),
        &own.into_iter().chain(rupture_times(3)).collect::<Vec<_>>(),
    );
    assert_eq!(
        (model.varying_sd(1), model.library_varying_sd(1), model.library_varying_sd(7)),
        (3e-4, 5e-4, 1.0)
    );
    assert_eq!(model.varying_parameters().collect::<Vec<_>>(), [(0, 1), (1, 1)]);
    let many = (0..11).fold(base(), |m, _| m.with_effect(term("release_depth", &[2.0, 1e-3])));
    assert_eq!(many.varying_parameters().count(), MAX_VARYING_PARAMETERS);
    model.days = vec![DayParameters::default(); 2];
    let before = model.shared_parameters().len();
    (model.free.day_surface, model.free.day_friction) = (true, true);
    assert_all_close(
        &model.shared_parameters()[before..],
        &[
            (Role::DaySurface(0), -NO, NO, 0.0, 1.1e-3, 1e-7),
            (Role::DayFriction(0), -NO, NO, 0.0, 0.07, 1e-5),
            (Role::DaySurface(1), -NO, NO, 0.0, 1.1e-3, 1e-7),
            (Role::DayFriction(1), -NO, NO, 0.0, 0.07, 1e-5),
        ],
    );
}

#[test]
fn setting_a_parameter_changes_no_other() {
    let mut model = base()
        .with_effect(term("stress_relaxation", &[0.4, 3.0]))
        .with_effect(term("needle_compliance", &[700.0]))
        .with_effect(term("respiration", &[1e-3, 0.3, 0.7]))
        .with_effect(term("release_depth", &[2.0, 1e-3]));
    model.free = FreeParameters {
        recording_surface: true,
        recording_friction: true,
        recording_effects: true,
        day_surface: true,
        day_friction: true,
        ..model.free
    };
    model.days = vec![DayParameters::default(); 2];
    model.rupture_times_s = vec![vec![1.5, 2.5, NO_RUPTURE]; 3];
    let parameters: Vec<Parameter> =
        model.shared_parameters().into_iter().chain(model.recording_parameters()).collect();
    assert_eq!(parameters.len(), 9 + 2 + 1 + 3 + 1 + 4 + 3 + 3);
    for (k, n) in parameters.iter().enumerate() {
        let mut moved = model.clone();
        let x = match n.role {
            Role::Stiffness(_) | Role::Friction(_) | Role::Puncture(_) => 1.17,
            Role::Effect { effect: 0, parameter: 1 } => libm::log(1.3),
            Role::Effect { effect: 1, .. } => 1.0 / 900.0,
            Role::Effect { .. } => model.get(n.role, 0) * 1.2,
            _ => 0.0123,
        };
        moved.set(n.role, 2, x);
        assert!((moved.get(n.role, 2) - x).abs() < 1e-12, "{:?}", n.role);
        for (other, o) in parameters.iter().enumerate().filter(|(other, _)| *other != k) {
            let was = model.get(o.role, 2);
            let now = moved.get(o.role, 2);
            assert!(now == was || (now - was).abs() < 1e-12, "{k} moves {other}");
        }
        assert_eq!(moved.get(n.role, 0) == model.get(n.role, 0), n.role.is_per_recording(), "{:?}", n.role);
    }
    // In their own units.
    let mut moved = model.clone();
    moved.set(Role::Stiffness(1), 0, 1.2);
    moved.set(Role::Friction(2), 0, 0.9);
    moved.set(Role::Puncture(2), 0, 1.1);
    moved.set(Role::Puncture(1), 0, 1.1);
    assert_close(moved.tissue.layers[1].stiffness_n_per_m, 180.0);
    assert_close(moved.tissue.layers[2].friction_ns_per_m2, 5400.0);
    assert_close(moved.tissue.layers[2].puncture_n.expect("a force"), 1.21);
    assert_eq!(moved.tissue.layers[1].puncture_n, None);
    assert_eq!(model.get(Role::Puncture(1), 0), 1.0);
    moved.set(Role::Effect { effect: 1, parameter: 0 }, 0, 0.0);
    assert_eq!(moved.effects[1].values, [f64::INFINITY]);
    assert_eq!(moved.get(Role::Effect { effect: 1, parameter: 0 }, 0), 0.0);
    moved.set(Role::Effect { effect: 1, parameter: 0 }, 0, -0.1);
    assert_eq!(moved.effects[1].values, [f64::INFINITY]);
}

#[test]
fn a_tied_parameter_follows_the_other_one() {
    let mut model = base()
        .with_effect(term("release_depth", &[1.0, 1e-3]))
        .with_effect(term("release_depth", &[2.0, 2e-3]))
        .with_effect(term("release_depth", &[3.0, 3e-3]));
    model.tied = vec![
        TiedParameter { effect: 2, parameter: 1, tied_to: Some(0) },
        TiedParameter { effect: 1, parameter: 1, tied_to: None },
    ];
    model.set(Role::Effect { effect: 0, parameter: 1 }, 0, 4e-3);
    let values: Vec<Vec<f64>> = model.effects.iter().map(|e| e.values.clone()).collect();
    assert_eq!(values, [vec![1.0, 4e-3], vec![2.0, 2e-3], vec![3.0, 4e-3]]);
}

#[test]
fn ties_survive_the_removal_of_another_effect() {
    let mut model = base();
    for k in 0..4 {
        model = model.with_effect(term("release_depth", &[1.0, f64::from(k) * 1e-3]));
    }
    let bound = |effect: usize, like: Option<usize>| TiedParameter { effect, parameter: 1, tied_to: like };
    model.tied =
        vec![bound(0, None), bound(1, Some(2)), bound(2, Some(0)), bound(3, Some(2)), bound(3, Some(1))];
    let left = model.without_effect(1);
    assert_eq!(left.effects.iter().map(|e| e.values[1]).collect::<Vec<_>>(), [0.0, 2e-3, 3e-3]);
    assert_eq!(left.tied, [bound(0, None), bound(1, Some(0)), bound(2, Some(1))]);
    assert_eq!(model.without_effect(0).tied, [bound(0, Some(1)), bound(2, Some(1)), bound(2, Some(0))]);
    assert_eq!(model.without_effect(2).tied, [bound(0, None), bound(2, Some(1))]);
    assert_eq!(model.without_effect(3).tied, model.tied[..3]);
}

#[test]
fn a_subset_keeps_parameters_and_days() {
    let mut model = base();
    for r in 0..3 {
        model.per_recording[r].surface_m = 1e-3 * r as f64;
        model.rupture_times_s[r] = vec![r as f64; 3];
    }
    assert_eq!(model.subset(&[2, 0]).day_of, Vec::<usize>::new());
    (model.day_of, model.days) = (vec![1, 0, 2], vec![DayParameters { surface_m: 0.5, ln_friction: 0.1 }; 2]);
    model.days[1].surface_m = 0.7;
    let two = model.subset(&[2, 0]);
    assert_eq!(two.per_recording.iter().map(|o| o.surface_m).collect::<Vec<_>>(), [2e-3, 0.0]);
    assert_eq!(two.rupture_times_s, [vec![2.0; 3], vec![0.0; 3]]);
    assert_eq!((two.day_of.clone(), two.days.clone()), (vec![2, 1], model.days.clone()));
    // A missing day has no parameters.
    assert_eq!(
        (two.day_parameters(0), two.day_parameters(1).surface_m, two.day_parameters(5)),
        (DayParameters::default(), 0.7, DayParameters::default())
    );
    assert_eq!(two.layers(), 3);
}

#[test]
fn a_compiled_law_contains_recording_and_day_parameters() {
    let mut model = base()
        .with_effect(term("release_depth", &[1.0, 1e-3]))
        .with_effect(term("position_scale", &[0.02]))
        .with_effect(term("time_delay", &[0.03]));
    let plain = model.compile(1).expect("a law");
    assert_eq!(plain.law.slabs()[0].front_m, 0.002);
    assert_eq!(plain.puncture_n, [0.6, f64::INFINITY, 1.1]);
    assert_eq!(plain.stiffness_n_per_m, [90.0, 150.0, 0.0]);
    assert_eq!(
        (plain.delay_s, plain.has_measurement_chain, plain.smears_jumps, plain.jump_delay_s),
        (0.03, true, false, None)
    );
    assert_close(plain.true_over_recorded, 1.0 / 1.02);
    assert!(plain.break_positions_m.is_empty());
    model.per_recording[1] = RecordingParameters { surface_m: 4e-4, ln_friction: 0.2, ..Default::default() };
    (model.day_of, model.days) = (vec![0; 3], vec![DayParameters { surface_m: -1e-4, ln_friction: 0.1 }]);
    model.per_recording[1].varying[0] = 5e-4;
    let own = model.compile(1).expect("a law");
    assert_close(own.law.slabs()[0].front_m, 0.0023);
    assert_close(own.law.slabs()[0].friction_ns_per_m2, 4000.0 * libm::exp(0.3));
    assert_eq!(own.law.slabs()[0].release_m, 1e-3);
    assert_close(model.compile(0).expect("a law").law.slabs()[2].friction_ns_per_m2, 6000.0 * libm::exp(0.1));
    model.free.recording_effects = true;
    assert_close(model.compile(1).expect("a law").law.slabs()[0].release_m, 1.5e-3);
    assert_eq!(model.compile(0).expect("a law").law.slabs()[0].release_m, 1e-3);
    // In addition to known effects.
    let mut given = assumptions();
    given.known_effects = vec![AnyEffect::from_parameters("coulomb_friction", &[2.0]).expect("an effect")];
    model.assumed = Arc::new(given);
    assert_close(model.compile(1).expect("a law").law.slabs()[0].release_m, 1.5e-3);
    // A day alone changes the law as well.
    let mut days = base();
    (days.day_of, days.days) = (vec![0; 3], vec![DayParameters { surface_m: 1e-4, ln_friction: 0.0 }]);
    assert_close(days.compile(0).expect("a law").law.slabs()[0].front_m, 0.0021);
}

#[test]
fn break_positions_are_membranes_and_interfaces_of_tip_effects() {
    let mut model = base().with_effect(term("hidden_membrane", &[0.005, 100.0, 0.2]));
    model.per_recording[0].surface_m = 1e-3;
    // 0.2 N stretch it by 2 mm; tip forces change at every interface, too.
    let breaks = model.compile(0).expect("a law").break_positions_m;
    for (actual, expected) in breaks.iter().zip([0.003 + 0.007, 0.015, 0.025, 0.055]) {
        assert_close(*actual, expected);
    }
    assert_eq!(breaks.len(), 4);
    let neutral = base().with_effect(term("hidden_membrane", &[0.005, 0.0, 0.2]));
    assert!(neutral.compile(0).expect("a law").break_positions_m.len() < 4);
    let smears =
        |id: &str, x: f64| base().with_effect(term(id, &[x])).compile(0).expect("a law").smears_jumps;
    assert!(smears("low_pass_lag", 0.02) && smears("needle_compliance", 900.0) && !smears("force_gain", 1.1));
    assert!(
        !base().has_friction_effects()
            && base().with_effect(term("coulomb_friction", &[2.0])).has_friction_effects()
    );
    assert!(!base().with_effect(term("force_gain", &[1.1])).has_friction_effects());
    let mut given = assumptions();
    given.known_effects = vec![AnyEffect::from_parameters("coulomb_friction", &[2.0]).expect("an effect")];
    assert!(Model::base(Arc::new(given), 1).has_friction_effects());
}

#[test]
fn per_recording_roles_are_distinguished() {
    for role in
        [Role::RecordingSurface, Role::RecordingFriction, Role::RecordingEffect(3), Role::RuptureTime(1)]
    {
        assert!(role.is_per_recording());
    }
    for role in [
        Role::Surface,
        Role::Stiffness(0),
        Role::DaySurface(0),
        Role::DayFriction(1),
        Role::Effect { effect: 0, parameter: 0 },
    ] {
        assert!(!role.is_per_recording());
    }
}

/// Library values with a known distribution are priors; all others are flat.
#[test]
fn library_expectations_are_priors() {
    let slips = effect_info("shaft_slip").expect("in the library");
    let values: Vec<f64> = slips.parameters.iter().map(|p| p.start).collect();
    let model = base().with_effect(EffectTerm::new(slips, &values));
    for n in model.shared_parameters() {
        let Role::Effect { parameter, .. } = n.role else { continue };
        let path = slips.parameters[parameter].path;
        let expected = if path == "rate" { (-0.1, 0.1) } else { (0.0, f64::INFINITY) };
        assert_eq!((n.prior_mean, n.prior_sd), expected, "{path}");
    }
}
