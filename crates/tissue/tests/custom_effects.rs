//! A custom effect gives the forces of the library's effect with the same equation, and an error in a formula names its
//! place.

use crate::common;

use common::{run, three_gels, usual_motion, worst};
use stylet_tissue::*;

/// A text with one formula.
fn text(
    place: Place,
    force: &str,
    parameters: &[(&str, ParameterText)],
    state: &[(&str, &str)],
) -> CustomText {
    CustomText {
        name: "mine".into(),
        place,
        force: Some(force.into()),
        parameters: NamedList(parameters.iter().map(|(n, p)| ((*n).into(), p.clone())).collect()),
        state: NamedList(state.iter().map(|(n, e)| ((*n).into(), (*e).into())).collect()),
        source: String::new(),
    }
}

fn strength(value: f64, unit: &str) -> ParameterText {
    ParameterText { inactive: Some(0.0), ..shape(value, unit) }
}

fn shape(start: f64, unit: &str) -> ParameterText {
    ParameterText {
        start,
        value: None,
        prior: Some(Prior::Normal { mean: start, sd: start.abs() }),
        unit: unit.into(),
        inactive: None,
        meaning: String::new(),
    }
}

fn custom(text: &CustomText) -> AnyEffect {
    Custom::from_text(text).expect("a custom effect").into()
}

/// Recorded forces through law and measurement chain.
fn recorded(effects: &[AnyEffect]) -> Vec<f64> {
    let (forces, _) = run(&three_gels(), effects, &usual_motion());
    let chain = MeasurementChain::new(effects);
    let mut state = chain.start(200.0);
    let motion = usual_motion();
    forces
        .iter()
        .zip(motion)
        .map(|(f, (time_s, position_m, velocity_mps))| {
            let input = SensorInput {
                time_s,
                position_m,
                velocity_mps,
                tissue_n: f.total_n,
                ..SensorInput::default()
            };
            chain.step(&mut state, &input)
        })
        .collect()
}

#[test]
fn eight_effects_of_the_library_written_as_formulas_give_the_same_forces() {
    use Place::{Elastic, Friction, Motion, Sensor};
    let relaxation = StressRelaxation { terms: vec![PronyTerm { fraction: 0.4, time_constant_s: 1.3 }] };
    let stribeck = StribeckFriction { c_n_per_m: 4.0, c_static_n_per_m: 9.0, v_stribeck_mps: 0.003 };
    let respiration = Respiration { amplitude_m: 0.002, frequency_hz: 0.25, phase_rad: 0.4 };
    let pairs: [(AnyEffect, CustomText); 8] = [
        (
            NonlinearElasticity { kappa_per_m: 15.0 }.into(),
            text(Elastic, "elastic * kappa * max(0, z_layer)", &[("kappa", strength(15.0, "1/m"))], &[]),
        ),
        (
            relaxation.into(),
            text(
                Elastic,
                "-q",
                &[("g", strength(0.4, "")), ("tau", shape(1.3, "s"))],
                &[("q", "dq/dt = (g*elastic - q)/tau")],
            ),
        ),
        (
            CoulombFriction { c_n_per_m: 6.0 }.into(),
            text(Friction, "c * sgn(v) * inserted", &[("c", strength(6.0, "N/m"))], &[]),
        ),
        (
            stribeck.into(),
            text(
                Friction,
                "sgn(v) * inserted * (c + (s - c) * exp(-(v/vs)^2))",
                &[("c", strength(4.0, "N/m")), ("s", strength(9.0, "N/m")), ("vs", shape(0.003, "m/s"))],
                &[],
            ),
        ),
        (
            DriveFriction { force_n: 0.3 }.into(),
            text(Sensor, "force + f * sgn(v)", &[("f", strength(0.3, "N"))], &[]),
        ),
        (
            ForceDrift { rate_n_per_s: 0.02 }.into(),
            text(Sensor, "force + rate * t", &[("rate", strength(0.02, "N/s"))], &[]),
        ),
        (
            PositionDependentForce { stiffness_n_per_m: 12.0, rest_m: -0.004 }.into(),
            text(
                Sensor,
                "force + k * (z - rest)",
                &[("k", strength(12.0, "N/m")), ("rest", shape(-0.004, "m"))],
                &[],
            ),
        ),
        (
            respiration.into(),
            text(
                Motion,
                "x * sin(2*pi*f*t + phase)",
                &[("x", strength(0.002, "m")), ("f", shape(0.25, "Hz")), ("phase", shape(0.4, "rad"))],
                &[],
            ),
        ),
    ];
    let base = recorded(&[]);
    for (built_in, formulas) in pairs {
        let name = built_in.id();
        let (expected, found) = (recorded(&[built_in]), recorded(&[custom(&formulas)]));
        let apart = worst(&expected, &found);
        assert!(apart < 1e-9, "{name}: {apart:e} N apart");
        assert!(worst(&expected, &base) > 1e-3, "{name} acts");
    }
}

#[test]
fn an_inactive_custom_effect_changes_no_bit() {
    let mut none = text(Place::Friction, "c * sgn(v) * inserted", &[("c", strength(6.0, "N/m"))], &[]);
    none.parameters.0[0].1.value = Some(0.0);
    assert_eq!(recorded(&[custom(&none)]), recorded(&[]));
}

#[test]
fn a_state_is_integrated_exactly_at_any_sampling_rate() {
    let relaxing = text(
        Place::Friction,
        "c * w",
        &[("c", strength(10.0, "N s/m")), ("tau", shape(0.7, "s"))],
        &[("w", "dw/dt = (v - w)/tau")],
    );
    // At constant speed from rest: w = v (1 - exp(-t/tau)).
    for rate in [3.0, 50.0, 1000.0] {
        let law = ForceLaw::new(&common::block(0.0, 0.0), &[custom(&relaxing)]).expect("one effect");
        let mut state = ForceLawState::default();
        let steps = (2.0 * rate) as usize;
        let mut force = 0.0;
        for k in 0..=steps {
            let t = k as f64 / rate;
            force = law.step(&mut state, t, -0.01 + 0.004 * t, 0.004, |_| {}).total_n;
        }
        let exact = 10.0 * 0.004 * (1.0 - (-2.0_f64 / 0.7).exp());
        common::near(force, exact, 1e-14);
    }
}

#[test]
fn travel_counts_from_the_last_change_of_direction() {
    let by_travel = text(Place::Friction, "k * travel", &[("k", strength(1.0, "N/m"))], &[]);
    let law = ForceLaw::new(&common::block(0.0, 0.0), &[custom(&by_travel)]).expect("one effect");
    let mut state = ForceLawState::default();
    let path = [0.0, 0.01, 0.02, 0.02, 0.03, 0.025, 0.01, 0.012];
    // At rest only noise moves.
    let speed = [1.0, 1.0, 1.0, -1e-6, 1.0, -1.0, -1.0, 1.0];
    let found: Vec<f64> = path
        .iter()
        .enumerate()
        .map(|(k, z)| law.step(&mut state, k as f64, *z, speed[k], |_| {}).total_n)
        .collect();
    let expected = [0.0, 0.01, 0.02, 0.02, 0.03, 0.005, 0.02, 0.002];
    assert!(worst(&found, &expected) < 1e-15, "{found:?}");
}

#[test]
fn an_error_names_the_field_and_the_part_of_the_formula() {
    let c = [("c", strength(6.0, "N/m"))];
    let of = |force: &str, parameters: &[(&str, ParameterText)], state: &[(&str, &str)]| {
        Custom::from_text(&text(Place::Friction, force, parameters, state)).expect_err("an error")
    };
    for (error, path, part, says) in [
        (of("c * v", &c, &[]), "force", Some((0, 5)), "N is expected"),
        (of("c * inserted + v", &c, &[]), "force", Some((15, 16)), "`v`: units do not fit: this has m/s"),
        (of("c * inserted * force", &c, &[]), "force", Some((15, 20)), "not available at `Friction`"),
        (of("c * depth", &c, &[]), "force", Some((4, 9)), "`depth` is not known"),
        (of("c * inserted + friction", &c, &[]), "force", None, "must be zero where every strength"),
        (of("0.5 * v0", &[("v0", shape(2.0, "N"))], &[]), "parameters", None, "no parameter is a strength"),
        (
            of("c * (inserted + q)", &c, &[("q", "dq/dt = v + q")]),
            "state.q",
            Some((12, 13)),
            "units do not fit",
        ),
        (of("c * inserted", &c, &[("q", "q' = v")]), "state.q", None, "dq/dt"),
        (of("c * z", &[("c", strength(6.0, "N/mm"))], &[]), "parameters.c.unit", None, "no unit"),
        (of("t * z", &[("t", strength(6.0, "N/m"))], &[]), "parameters.t", None, "already the name"),
        (of("c * z", &[("c", strength(0.0, "N/m"))], &[]), "parameters.c.start", None, "typical value"),
    ] {
        assert_eq!((error.path.as_str(), error.place), (path, part), "{error}");
        assert!(error.message.contains(says), "{error}");
    }
    let mut taken = text(Place::Friction, "c * inserted", &c, &[]);
    taken.name = "coulomb_friction".into();
    assert!(Custom::from_text(&taken).expect_err("taken").message.contains("effect of the library"));
}

#[test]
fn a_formula_without_a_value_gives_a_force_that_is_not_finite_and_no_panic() {
    for force in [
        "c * inserted / (v - v)",
        "c * sqrt(z - 1000*inserted) * sqrt(inserted)",
        "c*inserted*exp(1e5*inserted/l)",
    ] {
        let parameters = [("c", strength(6.0, "N/m")), ("l", shape(0.01, "m"))];
        let Ok(effect) = Custom::from_text(&text(Place::Friction, force, &parameters, &[])) else { continue };
        let (forces, _) = run(&three_gels(), &[effect.into()], &usual_motion());
        assert!(forces.iter().any(|f| !f.total_n.is_finite()), "{force}");
    }
}

#[test]
fn an_equation_in_code_is_an_effect_like_a_formula() {
    #[derive(Debug)]
    struct Dry;
    impl Equation for Dry {
        fn value(&self, sample: &EquationSample, parameters: &[f64], _states: &[f64]) -> f64 {
            parameters[0] * effect::sgn(sample.v_mps) * sample.inserted_m
        }
    }
    let written = text(Place::Friction, "c * sgn(v) * inserted", &[("c", strength(6.0, "N/m"))], &[]);
    let in_code = CustomText { force: None, ..written };
    let effect: AnyEffect = Custom::define(&in_code, Box::new(Dry)).expect("a definition").into();
    let built_in: AnyEffect = CoulombFriction { c_n_per_m: 6.0 }.into();
    assert!(worst(&recorded(&[effect]), &recorded(&[built_in])) < 1e-12);
}

/// A force of as many newtons as its parameter times the number that is compiled in.
#[derive(Debug)]
struct Times(f64);

impl Equation for Times {
    fn value(&self, _: &EquationSample, parameters: &[f64], _: &[f64]) -> f64 {
        self.0 * parameters[0]
    }
}

#[test]
fn a_text_without_a_formula_refers_to_the_last_definition_of_its_name() {
    let named = |name: &str, value: Option<f64>| CustomText {
        name: name.into(),
        parameters: NamedList(vec![("c".into(), ParameterText { value, ..strength(2.0, "N") })]),
        ..CustomText::default()
    };
    let first = Custom::define(&named("times", None), Box::new(Times(1.0))).expect("a definition");
    let read = Custom::from_text(&named("times", Some(5.0))).expect("defined");
    assert_eq!((read.entry(), read.values()), (first.entry(), &[5.0][..]));
    assert_eq!(read.text(), named("times", Some(5.0)), "written as it was read");

    // A later definition is for later texts; the earlier effect keeps its force.
    let second = Custom::define(&named("times", None), Box::new(Times(10.0))).expect("a definition");
    let again = Custom::from_text(&named("times", Some(5.0))).expect("defined");
    assert_eq!(again.entry(), second.entry());
    let force = |effect: Custom| recorded(&[effect.into()])[0] - recorded(&[])[0];
    assert!((force(read) - 5.0).abs() < 1e-9 && (force(again) - 50.0).abs() < 1e-9);

    // A formula of the same name is another effect.
    let formula = CustomText { force: Some("3 * c".into()), ..named("times", None) };
    assert_ne!(Custom::from_text(&formula).expect("a formula").entry(), second.entry());
    assert_eq!(Custom::from_text(&named("times", None)).expect("defined").entry(), second.entry());
}

#[test]
fn a_text_without_a_formula_that_fits_no_definition_says_which_field_and_what_to_do() {
    let c = [("c", strength(2.0, "N"))];
    let named = |name: &str, place, c: &[(&str, ParameterText)]| CustomText {
        name: name.into(),
        force: None,
        ..text(place, "", c, &[])
    };
    Custom::define(&named("known", Place::Friction, &c), Box::new(Times(1.0))).expect("a definition");
    let other_unit = [("c", strength(2.0, "N/m"))];
    for (wrong, path, says) in [
        (
            named("nowhere", Place::Friction, &c),
            "force",
            "this program defines no effect `nowhere`; give a formula",
        ),
        (named("known", Place::Tip, &c), "place", "differs from the definition of `known`"),
        (named("known", Place::Friction, &[]), "parameters", "differs from the definition"),
        (named("known", Place::Friction, &other_unit), "parameters.c.unit", "only values may"),
    ] {
        let error = Custom::from_text(&wrong).expect_err("an error");
        assert_eq!(error.path, path, "{error}");
        assert!(error.message.contains(says), "{error}");
    }
    // What is defined is checked like what is read.
    let twice = CustomText { force: Some("c".into()), ..named("twice", Place::Friction, &c) };
    let state = CustomText {
        state: NamedList(vec![("q".into(), "dq/dt = v".into())]),
        ..named("twice", Place::Friction, &c)
    };
    for (wrong, path) in
        [(twice, "force"), (state, "state.q"), (named("twice", Place::Friction, &[]), "parameters")]
    {
        let error = Custom::define(&wrong, Box::new(Times(1.0))).expect_err("an error");
        assert_eq!(error.path, path, "{error}");
    }
}
