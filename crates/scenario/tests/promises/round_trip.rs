//! A scenario written with every default (`scenario.ron`, `extended.ron`) reads back as the same scenario, bit for bit.
#![allow(clippy::unwrap_used, clippy::panic)]

use proptest::prelude::*;
use stylet_core::EnhanceConfig;
use stylet_core::config::{
    Algorithm, Contact, ContactConfig, CusumConfig, Depths, DerivativeConfig, DerivativeSense, DropConfig,
    DropEstimator, GuardConfig, Model, Reset, StyletConfig,
};
use stylet_scenario::{
    ArmConfig, ForceTorque, Motion, ObserverGain, Robot, Scenario, Segment, Sensor, VirtualSensor,
};
use stylet_tissue::{AnyEffect, Layer, Tissue, general_effects};

/// Text of any kind: quotes, backslashes, line ends, brackets, other scripts.
fn text() -> impl Strategy<Value = String> {
    prop_oneof![
        "[a-zA-Z0-9 %]{1,20}".prop_map(|s| format!("a{s}")),
        "(?s).{0,20}".prop_map(|s| format!("x{s}")),
        r#"[\\"'\n\r\t(){}\[\]:,#/*rµ針]{0,12}"#.prop_map(|s| format!("{s}x")),
    ]
}

/// Positive numbers of all sizes that a file may hold.
fn positive() -> impl Strategy<Value = f64> {
    prop_oneof![1e-3..10.0f64, (-12.0..12.0f64).prop_map(|e| 10f64.powf(e))]
}

fn layer() -> impl Strategy<Value = Layer> {
    (text(), 1e-4..0.2, 0.0..1e4, 0.0..1e5, prop::option::of(0.01..20.0)).prop_map(
        |(name, thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n)| Layer {
            name,
            thickness_m,
            stiffness_n_per_m,
            friction_ns_per_m2,
            puncture_n,
        },
    )
}

fn tissue() -> impl Strategy<Value = Tissue> {
    (-0.01..0.01, prop::collection::vec(layer(), 2..5))
        .prop_map(|(surface_m, layers)| Tissue { surface_m, layers })
}

/// Any effect of the library, its parameters within the range of a fit.
fn effect() -> impl Strategy<Value = AnyEffect> {
    let entries: Vec<_> = general_effects().flat_map(|info| [Some(info), info.extended]).flatten().collect();
    prop::sample::select(entries)
        .prop_flat_map(|info| (Just(info), prop::collection::vec(0.0..1.0f64, info.parameters.len())))
        .prop_filter_map("parameters that do not go together", |(info, shares)| {
            let values: Vec<f64> = info
                .parameters
                .iter()
                .zip(shares)
                .map(|(parameter, share)| {
                    let (low, high) = parameter.search;
                    let value = (low + share * (high - low)).clamp(parameter.low, parameter.high);
                    if parameter.integer { 1.0 } else { value }
                })
                .collect();
            AnyEffect::from_parameters(info.id, &values).filter(|effect| effect.check().is_ok())
        })
}

fn segment() -> impl Strategy<Value = Segment> {
    prop_oneof![
        (0.001..0.02, 0.5..5.0)
            .prop_map(|(velocity_mps, duration_s)| Segment::Move { velocity_mps, duration_s }),
        (0.5..5.0).prop_map(|duration_s| Segment::Hold { duration_s }),
        (0.001..0.02, -0.02..0.02, 0.05..5.0, 0.5..5.0).prop_map(
            |(velocity_mps, amplitude_mps, frequency_hz, duration_s)| Segment::Ripple {
                velocity_mps,
                amplitude_mps,
                frequency_hz,
                duration_s
            }
        ),
    ]
}

/// Motions that reach a surface at up to 10 mm.
fn motion() -> impl Strategy<Value = Motion> {
    let first = Segment::Move { velocity_mps: 0.01, duration_s: 3.5 };
    prop_oneof![
        (-0.01..0.0, 0.003..0.02, 8.0..20.0).prop_map(|(start_m, velocity_mps, duration_s)| {
            Motion::Constant { start_m, velocity_mps, duration_s }
        }),
        (-0.01..0.0, 0.05..0.12, 0.05..0.1, -2.0..-1.0, 5.0..20.0).prop_map(
            |(start_m, amplitude_m, frequency_hz, phase_rad, duration_s)| Motion::Sinusoidal {
                start_m,
                amplitude_m,
                frequency_hz,
                phase_rad,
                duration_s
            }
        ),
        (-0.01..0.0, prop::collection::vec(segment(), 0..5)).prop_map(move |(start_m, mut segments)| {
            segments.insert(0, first);
            Motion::Program { start_m, segments }
        }),
        Just(Motion::Recorded),
    ]
}

fn force_torque() -> impl Strategy<Value = ForceTorque> {
    (0.0..1.0, -0.99..0.99, -5.0..5.0, -0.1..0.1, 0.0..0.1, prop::option::of(1.0..500.0)).prop_map(
        |(noise_n, ar1, bias_n, drift_n_per_s, quantisation_n, range_n)| ForceTorque {
            noise_n,
            ar1,
            bias_n,
            drift_n_per_s,
            quantisation_n,
            range_n,
        },
    )
}

fn robot() -> impl Strategy<Value = Robot> {
    prop_oneof![Just(Robot::Slide), Just(Robot::Replay), Just(Robot::Arm(ArmConfig::default()))]
}

/// Sensors with suitable robots: the virtual one needs an arm.
fn robot_and_sensor() -> impl Strategy<Value = (Robot, Sensor)> {
    let virtual_sensor = || {
        (0.5..50.0).prop_map(|gain| VirtualSensor {
            gain_per_s: ObserverGain::Uniform(gain),
            ..VirtualSensor::default()
        })
    };
    let arm = || Just(Robot::Arm(ArmConfig::default()));
    prop_oneof![
        (robot(), force_torque().prop_map(Sensor::ForceTorque)),
        (arm(), virtual_sensor().prop_map(Sensor::Virtual)),
        (
            arm(),
            (force_torque(), virtual_sensor())
                .prop_map(|(force_torque, virtual_sensor)| Sensor::Both { force_torque, virtual_sensor })
        ),
    ]
}

fn model() -> impl Strategy<Value = Model> {
    prop::sample::select(vec![Model::KelvinVoigt, Model::MultiLayer])
}

fn detection() -> impl Strategy<Value = (CusumConfig, DerivativeConfig, GuardConfig)> {
    let cusum = (any::<bool>(), 1e-4..0.1, 1e-4..0.5).prop_map(|(enabled, low, more)| CusumConfig {
        enabled,
        sigma_ordinary_n: low,
        sigma_rupture_n: low + more,
    });
    let sense = prop::sample::select(vec![DerivativeSense::Rise, DerivativeSense::Drop]);
    let derivative = (any::<bool>(), sense, 0.01..1.0, -1.0..0.0, 0.01..1.0, 0.01..0.2, any::<bool>())
        .prop_map(|(enabled, sense, on_n_per_s, less, force, derivative, trailing_edge)| DerivativeConfig {
            enabled,
            sense,
            on_n_per_s,
            off_n_per_s: less,
            force_time_constant_s: force,
            derivative_time_constant_s: derivative,
            trailing_edge,
        });
    let guard = (0.0..0.01, 0.001..0.1, 0.001..1.0, 0.0..1.0, 0.0..1.0).prop_map(
        |(blind_travel_m, time, sudden_mps2, rest_s, slowing_per_s)| GuardConfig {
            blind_travel_m,
            acceleration_time_constant_s: time,
            sudden_mps2,
            revisit_margin_m: blind_travel_m / 20.0,
            rest_s,
            slowing_per_s,
        },
    );
    (cusum, derivative, guard)
}

fn drop_config() -> impl Strategy<Value = DropConfig> {
    let estimator = prop::sample::select(vec![DropEstimator::Lines, DropEstimator::Extremes]);
    let times = (0.001..0.01, 0.5..10.0, 0.0..0.01, 0.0..1.0, 1e-6..1e-3);
    let switches = (estimator, any::<bool>(), any::<bool>(), any::<bool>());
    (times, switches, 0.001..0.4, 0.5..0.999, 1usize..1000).prop_map(
        |(
            (travel_m, max_duration_s, compensation_travel_m, settle_s, standstill_mps),
            (estimator, reweight, replay, compensate),
            low,
            high,
            replay_per_tick,
        )| DropConfig {
            travel_m,
            max_duration_s,
            compensation_travel_m,
            settle_s,
            standstill_mps,
            estimator,
            reweight,
            replay,
            compensate,
            share_limits: [low, high],
            replay_per_tick,
        },
    )
}

fn enhance() -> impl Strategy<Value = EnhanceConfig> {
    let reset = prop_oneof![
        (1.0..90.0).prop_map(|hz| Reset::Frequency { hz }),
        positive().prop_map(|below| Reset::Trace { below }),
        Just(Reset::Ruptures),
    ];
    let depths =
        prop_oneof![Just(Depths::Unknown), prop::collection::vec(1e-3..0.1, 1..4).prop_map(Depths::Known),];
    let search = (0.01..0.5, 1.0..10.0, 1usize..50, 1e-5..0.01, 0.0..0.5, 0.0..0.01).prop_map(
        |(time_constant_s, noise_sds, samples, min_noise_n, learn_s, extrapolate_over_m)| ContactConfig {
            time_constant_s,
            noise_sds,
            samples,
            min_noise_n,
            learn_s,
            extrapolate_over_m,
        },
    );
    let kind = (
        prop::sample::select(vec![Algorithm::Paper, Algorithm::Literal, Algorithm::Stylet]),
        model(),
        prop::sample::select(vec![Contact::Detected, Contact::Known]),
    );
    (kind, reset, depths, 0.5..=1.0, positive(), positive(), detection(), drop_config(), search).prop_map(
        |(
            (algorithm, model, contact),
            reset,
            depths,
            forgetting,
            prior_stiffness,
            prior_friction,
            (cusum, derivative, guard),
            drop,
            contact_search,
        )| {
            EnhanceConfig {
                algorithm,
                model,
                reset,
                contact,
                depths,
                forgetting,
                prior_stiffness,
                prior_friction,
                cusum,
                derivative,
                drop,
                contact_search,
                guard,
                stylet: StyletConfig { min_drop_share: 0.5 * forgetting, ..StyletConfig::default() },
            }
        },
    )
}

fn scenario() -> impl Strategy<Value = Scenario> {
    (
        (text(), text(), tissue(), prop::collection::vec(effect(), 0..4), motion(), robot_and_sensor()),
        (enhance(), prop::collection::vec(model(), 0..2)),
        (prop::sample::select(vec![190.5, 200.0, 250.0, 1000.0 / 3.0]), 1u32..6, 0.01..0.99, any::<u64>()),
    )
        .prop_map(
            |(
                (name, source, tissue, effects, motion, (robot, sensor)),
                (enhance, compare),
                (sample_hz, steps, tolerance, seed),
            )| {
                Scenario {
                    name,
                    source,
                    tissue,
                    effects,
                    candidates: Vec::new(),
                    motion,
                    robot,
                    sensor,
                    enhance,
                    enhance_virtual: None,
                    compare,
                    sample_hz,
                    physics_hz: sample_hz * f64::from(steps),
                    tolerance,
                    thickness_tolerance: 0.5 * tolerance,
                    surface_tolerance_m: 0.01 * tolerance,
                    seed,
                }
            },
        )
        .prop_filter("a scenario that is refused", |s| s.check().is_ok())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn a_scenario_written_out_reads_back_equal(scenario in scenario()) {
        let text = scenario.to_ron().unwrap();
        let again = Scenario::parse("resolved.ron", &text)
            .map_err(|e| TestCaseError::fail(format!("{e}\n{text}")))?;
        prop_assert_eq!(&again, &scenario);
        // And the text is settled: writing it once more changes nothing.
        prop_assert_eq!(again.to_ron().unwrap(), text);
    }

    #[test]
    fn any_text_is_read_or_refused_and_never_panics(text in "(?s).{0,80}") {
        if let Err(error) = Scenario::parse("any.ron", &text) {
            prop_assert!(error.to_string().starts_with("any.ron"));
        }
    }

    #[test]
    fn a_scenario_with_a_piece_cut_out_is_read_or_refused_within_its_text(
        scenario in scenario(),
        from in 0.0..1.0f64,
        length in 0usize..40,
    ) {
        let text: Vec<char> = scenario.to_ron().unwrap().chars().collect();
        let from = (from * text.len() as f64) as usize;
        let cut: String =
            text[..from].iter().chain(&text[(from + length).min(text.len())..]).collect();
        if let Err(error) = Scenario::parse("cut.ron", &cut) {
            let lines = cut.lines().count() + 1;
            if let Some((line, column)) = error.position {
                prop_assert!(line >= 1 && line <= lines && column >= 1, "{error}");
            }
            prop_assert!(error.to_string().starts_with("cut.ron"));
        }
    }
}

#[test]
fn every_effect_of_the_library_reads_back_equal() {
    for info in general_effects().flat_map(|info| [Some(info), info.extended]).flatten() {
        let values: Vec<f64> = info
            .parameters
            .iter()
            .map(|p| if p.integer { 1.0 } else { p.start.clamp(p.low, p.high) })
            .collect();
        let effect = AnyEffect::from_parameters(info.id, &values).unwrap_or_else(|| panic!("{}", info.id));
        let text = format!(
            "(name: \"x\", tissue: (layers: [{0}, {0}]), effects: [{1}], motion: Recorded)",
            "(thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0)",
            stylet_scenario::ron_options().to_string(&effect).unwrap(),
        );
        let read =
            Scenario::parse("effect.ron", &text).unwrap_or_else(|e| panic!("{}: {e}\n{text}", info.id));
        assert_eq!(read.effects, [effect], "{}", info.id);
        let again = Scenario::parse("again.ron", &read.to_ron().unwrap()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(again, read, "{}", info.id);
    }
}
