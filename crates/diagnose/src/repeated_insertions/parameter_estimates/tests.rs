use super::{base_parameters, jackknife_estimates, parameter_values};
use crate::repeated_insertions::cross_validation::HeldOutPrediction;
use crate::repeated_insertions::multistart_fit::SetFit;
use crate::repeated_insertions::random_effects_population::Population;
use crate::repeated_insertions::random_effects_population::QUANTILES;
use std::sync::Arc;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::{FitData, Residuals};
use stylet_identify::model::{Assumptions, EffectTerm, Model, TiedParameter};
use stylet_identify::noise::Noise;
use stylet_identify::rupture_likelihood::RuptureEvent;
use stylet_stats::student_t;
use stylet_tissue::{AnyEffect, DelayedPuncture, Effect, Layer, ReleaseDepth, Tissue};

fn tissue() -> Tissue {
    let layer = |d: f64, k: f64, f: Option<f64>| Layer {
        name: String::new(),
        thickness_m: d,
        stiffness_n_per_m: k,
        friction_ns_per_m2: 4000.0,
        puncture_n: f,
    };
    Tissue { surface_m: 0.002, layers: vec![layer(0.02, 150.0, Some(1.1)), layer(0.03, 220.0, None)] }
}

fn model() -> Model {
    let belief = Assumptions {
        tissue: tissue(),
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![0.5; 2],
        thickness_tolerance: vec![0.1; 2],
        surface_tolerance_m: 0.01,
    };
    Model::base(Arc::new(belief), 1)
}

fn fitted(model: Model) -> SetFit {
    let residuals =
        Residuals { residual_n: Vec::new(), innovations: Vec::new(), ruptures: Vec::new(), nats: 0.0 };
    let data = FitData::new(Arc::new(Vec::new()), Noise::white(1.0), 0.0);
    SetFit { fit: Fit { model, residuals }, data, drop_times_s: Vec::new(), starts: (1, 1) }
}

#[test]
fn intervals_are_jackknife_intervals_over_recordings() {
    let left = [148.0, 155.0, 151.0, 158.0];
    let out: Vec<HeldOutPrediction> = left
        .iter()
        .map(|k| {
            let mut law = model();
            law.tissue.layers[0].stiffness_n_per_m = *k;
            law.tissue.layers[0].thickness_m = 0.02 + (k - 153.0) * 1e-5;
            HeldOutPrediction {
                population: Some(Population {
                    model: law,
                    residual_n: [0.0; 4],
                    residual_quantiles_n: [[0.0; QUANTILES]; 4],
                    air_quantiles_n: [0.0; QUANTILES],
                    recordings: 3,
                    days: 1,
                    parameter_information: None,
                }),
                ..HeldOutPrediction::default()
            }
        })
        .chain([HeldOutPrediction::default()])
        .collect();
    let result = jackknife_estimates(&fitted(model()), &out);
    let of = |owner: &str, path: &str| {
        result.iter().find(|t| t.owner == owner && t.path == path).expect("a number")
    };
    let k = of("layer.1", "stiffness_n_per_m");
    let sum: f64 = left.iter().map(|x| (x - 153.0_f64).powi(2)).sum();
    let reach = student_t::quantile(0.975, 3.0) * (sum * 3.0 / 4.0).sqrt();
    assert!((k.value - 150.0).abs() < 1e-12);
    assert!(
        (k.high - 150.0 - reach).abs() < 1e-9 && (150.0 - k.low - reach).abs() < 1e-9,
        "{k:?} for {reach}"
    );
    let front = of("layer.2", "front_m");
    assert!((front.value - 0.022).abs() < 1e-12 && (front.high - 0.022 - reach * 1e-5).abs() < 1e-12);
    let same = of("layer.2", "stiffness_n_per_m");
    assert_eq!((same.low, same.high), (220.0, 220.0));
    assert_eq!((k.estimate().low, k.estimate().value, k.estimate().high), (k.low, k.value, k.high));
    // A single held-out fit: interval as wide as the value.
    let one = jackknife_estimates(&fitted(model()), &out[..1]);
    let k = one.iter().find(|t| t.path == "stiffness_n_per_m").expect("a number");
    assert_eq!((k.low, k.high), (0.0, 300.0));
}

#[test]
fn estimates_follow_the_order_of_the_model() {
    let mut m = model();
    let effects: [AnyEffect; 3] = [
        ReleaseDepth { layer: 1, depth_m: 1e-3 }.into(),
        DelayedPuncture { layer: 1, force_n: 2.0, exponent: 9.0 }.into(),
        ReleaseDepth { layer: 2, depth_m: 2e-3 }.into(),
    ];
    m.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    let all = parameter_values(&m);
    let names: Vec<String> = all.iter().map(|(o, p, _, _)| format!("{o} {p}")).collect();
    assert_eq!(
        names,
        [
            "layer.0 surface_m",
            "layer.1 front_m",
            "layer.1 stiffness_n_per_m",
            "layer.1 friction_ns_per_m2",
            "layer.1 puncture_n",
            "layer.2 front_m",
            "layer.2 stiffness_n_per_m",
            "layer.2 friction_ns_per_m2",
            "release_depth 0.layer",
            "release_depth 0.depth_m",
            "delayed_puncture layer",
            "delayed_puncture force_n",
            "delayed_puncture exponent",
            "release_depth 1.layer",
            "release_depth 1.depth_m",
        ]
    );
    let numbers: Vec<f64> = all.iter().map(|v| v.2).collect();
    assert_eq!(numbers[..8], [0.002, 0.002, 150.0, 4000.0, 1.1, 0.022, 220.0, 4000.0]);
    assert_eq!(numbers[8..], [1.0, 1e-3, 1.0, 2.0, 9.0, 2.0, 2e-3]);
    assert!(all.iter().all(|v| !v.3), "{all:?}");
}

#[test]
fn a_parameter_is_at_its_bound_within_a_thousandth_of_the_range() {
    let m = model();
    for (path, at) in [
        ("surface_m", 0),
        ("stiffness_n_per_m", 2),
        ("friction_ns_per_m2", 3),
        ("puncture_n", 4),
        ("front_m", 5),
    ] {
        let role = match path {
            "surface_m" => stylet_identify::model::ParameterRole::Surface,
            "stiffness_n_per_m" => stylet_identify::model::ParameterRole::Stiffness(0),
            "friction_ns_per_m2" => stylet_identify::model::ParameterRole::Friction(0),
            "puncture_n" => stylet_identify::model::ParameterRole::Puncture(0),
            _ => stylet_identify::model::ParameterRole::Thickness(0),
        };
        let n = m.shared_parameters().into_iter().find(|n| n.role == role).expect("free");
        let near = 1e-3 * (n.high - n.low).min(1.0);
        for (x, reached) in [
            (n.low + 0.9 * near, true),
            (n.low + 1.1 * near, false),
            (n.high - 0.9 * near, true),
            (n.high - 1.1 * near, false),
        ] {
            let mut moved = m.clone();
            moved.set(role, 0, x);
            let all = parameter_values(&moved);
            assert_eq!(all[at].3, reached, "{path} at {x} of {} to {}", n.low, n.high);
            assert!(!all[1].3);
        }
    }
    // A tied parameter is at the bound of the parameter it is tied to.
    let mut m = model();
    let waits =
        |force_n: f64, layer| -> AnyEffect { DelayedPuncture { layer, force_n, exponent: 9.0 }.into() };
    m.effects =
        [waits(2.0, 1), waits(2.0, 2)].iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    m.tied = vec![TiedParameter { effect: 1, parameter: 2, tied_to: Some(0) }];
    let high = m.effects[0].info.parameters[2].high;
    assert!(high.is_finite());
    m.effects[0].values[2] = high;
    let at = |m: &Model, path: &str| parameter_values(m).into_iter().find(|v| v.1 == path).map(|v| v.3);
    assert_eq!(
        (at(&m, "0.exponent"), at(&m, "1.exponent"), at(&m, "1.force_n")),
        (Some(true), Some(true), Some(false))
    );
    m.effects[0].values[1] = m.effects[0].info.parameters[1].low;
    assert_eq!((at(&m, "0.force_n"), at(&m, "1.force_n")), (Some(true), Some(false)));
    assert_eq!(at(&m, "0.layer"), Some(false), "which layer is no number of a fit");
}

#[test]
fn base_parameters_have_their_assumed_values() {
    let mut law = model();
    law.tissue.surface_m = 0.003;
    law.tissue.layers[0].stiffness_n_per_m = 190.0;
    let out: Vec<HeldOutPrediction> = [-1.0, 1.0]
        .iter()
        .map(|x| {
            let mut other = law.clone();
            other.tissue.layers[0].stiffness_n_per_m += 2.5 * x;
            other.tissue.layers[1].stiffness_n_per_m += 2.5 * x;
            HeldOutPrediction {
                population: Some(Population {
                    model: other,
                    residual_n: [0.0; 4],
                    residual_quantiles_n: [[0.0; QUANTILES]; 4],
                    air_quantiles_n: [0.0; QUANTILES],
                    recordings: 3,
                    days: 1,
                    parameter_information: None,
                }),
                ..HeldOutPrediction::default()
            }
        })
        .collect();
    let mut m = law.clone();
    m.effects = vec![EffectTerm::new(ReleaseDepth { layer: 1, depth_m: 1e-3 }.info(), &[1.0, 1e-3])];
    let set = fitted(m);
    let base = base_parameters(&jackknife_estimates(&set, &out), &set.fit, &tissue());
    let result: Vec<(usize, &str, f64, bool)> =
        base.iter().map(|b| (b.layer, b.name.as_str(), b.assumed, b.changed)).collect();
    assert_eq!(
        result,
        [
            (0, "surface_m", 0.002, true),
            (1, "front_m", 0.002, true),
            (1, "stiffness_n_per_m", 150.0, true),
            (1, "friction_ns_per_m2", 4000.0, false),
            (1, "puncture_n", 1.1, false),
            (2, "front_m", 0.022, true),
            (2, "stiffness_n_per_m", 220.0, false),
            (2, "friction_ns_per_m2", 4000.0, false),
        ]
    );
    let k = &base[2];
    // Two values that differ by 5: standard error 2.5, one degree of freedom.
    let reach = student_t::quantile(0.975, 1.0) * 2.5;
    assert!((k.value - 190.0).abs() < 1e-12 && (k.high - 190.0 - reach).abs() < 1e-9, "{k:?}");
    assert!(reach > 30.0 && reach < 40.0);
}

/// The skin of 1.1 N was loaded to 0.6 N in one recording and 0.5 N in the other.
#[test]
fn puncture_force_that_no_recording_reached_is_a_lower_limit() {
    let event = |elastic_n: f64, ruptured: bool| RuptureEvent {
        force_excess: elastic_n / 1.1 - 1.0,
        force_excess_rate: 1.0,
        elastic_n,
        ruptured,
        ..RuptureEvent::INITIAL
    };
    let puncture = |events: [RuptureEvent; 2]| {
        let mut set = fitted(model());
        set.fit.residuals.ruptures = events.map(|e| vec![e]).to_vec();
        let all = base_parameters(&jackknife_estimates(&set, &[]), &set.fit, &tissue());
        all.into_iter().find(|b| b.name == "puncture_n").expect("a puncture force")
    };
    let unreached = puncture([event(0.6, false), event(0.5, false)]);
    assert!(unreached.at_least && !unreached.changed, "{unreached:?}");
    assert!(unreached.low > 0.4 && unreached.low <= 0.6 && unreached.high > 1.1, "{unreached:?}");
    assert!(!puncture([event(1.1, true), event(1.1, true)]).at_least);
}
