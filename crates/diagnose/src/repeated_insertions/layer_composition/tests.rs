use super::super::start_values::SLIP_RATE_INDEX;
use super::{
    ModelFamily, compose_layers, identified_effects, stack_models, surface_shift_m, with_moved_surface,
};
use crate::repeated_insertions::SegmentedRecording;
use crate::test_fixtures::{self, gel_tissue, simulated_recordings};
use std::sync::Arc;
use stylet_identify::model::{Assumptions, EffectTerm, Model, TiedParameter};
use stylet_tissue::{
    AnyEffect, CoulombFriction, DelayedPuncture, Effect, Layer, ReleaseDepth, ShaftSlip, Tissue,
};

fn tissue(names: &[&str], surface_m: f64, thickness_m: f64, k: f64) -> Tissue {
    let layer = |name: &&str| Layer {
        name: (*name).to_owned(),
        thickness_m,
        stiffness_n_per_m: k,
        friction_ns_per_m2: 1000.0,
        puncture_n: None,
    };
    Tissue { surface_m, layers: names.iter().map(layer).collect() }
}

fn alone(surface_m: f64, k: f64, effects: &[AnyEffect]) -> Model {
    let belief = Assumptions {
        tissue: tissue(&["x"], surface_m, 0.05, k),
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![4.0],
        thickness_tolerance: vec![0.0],
        surface_tolerance_m: 2e-3,
    };
    let mut m = Model::base(Arc::new(belief), 1);
    m.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    m.free.recording_effects = true;
    m
}

#[test]
fn stacked_layers_keep_their_boundaries_and_effects() {
    let whole = |c: f64| -> AnyEffect { CoulombFriction { c_n_per_m: c }.into() };
    let slip = |push_n: f64| -> AnyEffect { ShaftSlip { layer: 1, push_n, ..ShaftSlip::default() }.into() };
    let release = |depth_m: f64| -> AnyEffect { ReleaseDepth { layer: 1, depth_m }.into() };
    let mut first = alone(0.004, 100.0, &[slip(1.1), release(1e-3), whole(2.0)]);
    let mut second = alone(0.0155, 250.0, &[slip(2.2), release(2e-3), whole(7.0)]);
    first.scatter.varying[0] = 3e-4;
    second.scatter.varying[0] = 5e-4;
    let assumed = tissue(&["skin", "muscle"], 0.0, 0.03, 1.0);
    let m = stack_models(&assumed, &[&first, &second], 7e-4).expect("a law");
    assert!((m.tissue.surface_m - 0.0047).abs() < 1e-15);
    let [a, b] = &m.tissue.layers[..] else { unreachable!("two layers") };
    assert_eq!((a.name.as_str(), b.name.as_str(), b.thickness_m), ("skin", "muscle", 0.05));
    // Thickness to the next surface, at least 1 mm.
    assert!((a.thickness_m - 0.0108).abs() < 1e-15, "{}", a.thickness_m);
    assert_eq!((a.stiffness_n_per_m, b.stiffness_n_per_m), (100.0, 250.0));
    let near = alone(0.0048, 250.0, &[]);
    assert_eq!(
        stack_models(&assumed, &[&first, &near], 0.0).expect("a law").tissue.layers[0].thickness_m,
        1e-3
    );
    // Effects without a layer come from the first model.
    let ids: Vec<(&str, f64)> = m.effects.iter().map(|e| (e.info.id, e.values[0])).collect();
    assert_eq!(
        ids,
        [
            ("shaft_slip", 1.0),
            ("release_depth", 1.0),
            ("coulomb_friction", 2.0),
            ("shaft_slip", 2.0),
            ("release_depth", 2.0)
        ]
    );
    assert_eq!(m.scatter.varying[..3], [3e-4, 5e-4, 0.0]);
    assert_eq!(
        (m.assumed.tolerance.as_slice(), m.assumed.thickness_tolerance.as_slice()),
        (&[4.0, 4.0][..], &[0.0, 0.0][..])
    );
    assert!(m.days.is_empty() && m.day_of.is_empty() && m.tied.is_empty());
    // Unknown puncture force of the upper layer: rupture at the far boundary.
    let far = |m: &Model| m.effects.iter().find(|e| e.info.id == "deep_indentation").map(|e| e.values[0]);
    assert_eq!(far(&m), None);
    let mut known = first.clone();
    known.tissue.layers[0].puncture_n = Some(3.0);
    let result = stack_models(&assumed, &[&known, &second], 0.0).expect("a law");
    assert_eq!((far(&result), result.tissue.layers[0].puncture_n), (Some(1.0), Some(3.0)));
    let waits: AnyEffect = DelayedPuncture { layer: 1, force_n: 3.0, exponent: 10.0 }.into();
    first.effects.push(EffectTerm::new(waits.info(), &waits.parameters()));
    assert_eq!(far(&stack_models(&assumed, &[&first, &second], 0.0).expect("a law")), Some(1.0));
    // A weaker second layer ruptures with the first, at the force that it holds then.
    for (force_n, wanted_n) in [(4.0, 4.0), (2.9, 2.2)] {
        let mut lower = second.clone();
        lower.tissue.layers[0].puncture_n = Some(force_n);
        let m = stack_models(&assumed, &[&known, &lower], 0.0).expect("a law");
        assert_eq!(m.tissue.layers[1].puncture_n, Some(wanted_n), "{force_n}");
        let waits: AnyEffect = DelayedPuncture { layer: 1, force_n, exponent: 10.0 }.into();
        lower.tissue.layers[0].puncture_n = None;
        lower.effects.insert(0, EffectTerm::new(waits.info(), &waits.parameters()));
        let m = stack_models(&assumed, &[&known, &lower], 0.0).expect("a law");
        let waiting = m.effects.iter().filter(|e| e.info.id == waits.info().id).count();
        assert_eq!(
            (m.tissue.layers[1].puncture_n, waiting),
            if force_n > 3.0 { (None, 1) } else { (Some(wanted_n), 0) }
        );
        assert_eq!(m.scatter.varying[..3], [3e-4, 5e-4, 0.0]);
    }
    assert!(stack_models(&assumed, &[], 0.0).is_none());
    assert!(stack_models(&tissue(&["one"], 0.0, 0.03, 1.0), &[&first, &second], 0.0).is_none());
}

#[test]
fn a_single_speed_gives_rate_independent_sliding() {
    let slip = ShaftSlip { push_n: 2.0, pull_n: 1.5, exponent: 8.0, ..ShaftSlip::default() };
    let mut m = alone(0.004, 100.0, &[slip.clone().into(), ReleaseDepth { layer: 1, depth_m: 1e-3 }.into()]);
    let result = |m: &Model| match identified_effects(m, 2e-3, None)[0].effect() {
        Some(AnyEffect::ShaftSlip(s)) => s,
        other => unreachable!("{other:?}"),
    };
    assert_eq!(result(&m), slip);
    m.tied = vec![TiedParameter { effect: 0, parameter: SLIP_RATE_INDEX, tied_to: None }];
    let s = result(&m);
    assert!((s.plateau_n(2e-3) - slip.plateau_n(2e-3)).abs() < 1e-12);
    for v_mps in [1e-3, 4e-3] {
        assert!((s.plateau_n(v_mps) - slip.plateau_n(2e-3)).abs() < 1e-12);
        assert!((s.plateau_n(-v_mps) - slip.plateau_n(-2e-3)).abs() < 1e-12);
    }
    assert_eq!(
        (s.exponent, s.retained_share, identified_effects(&m, 2e-3, None).len()),
        (slip.exponent, slip.retained_share, 2)
    );
}

/// Stacks with a layer 0.5 mm deeper than modelled, whatever their force does after the rupture.
#[test]
fn the_surface_shift_is_fitted_to_the_loading() {
    let mut law = Model::base(
        test_fixtures::fit_from_truth(
            &[],
            &simulated_recordings(&[], &[[0.008, 0.0]]).iter().collect::<Vec<_>>(),
        )
        .fit
        .model
        .assumed,
        1,
    );
    law.tissue = gel_tissue();
    for deeper_m in [5e-4, -8e-4, 0.0] {
        let mut run = simulated_recordings(&[], &[[0.008, deeper_m]]).remove(0);
        let result = surface_shift_m(&law, &run);
        assert!((result - deeper_m).abs() < 3e-5, "{result} for {deeper_m}");
        let first_s = run.ruptures_s[0];
        for (t, f) in run.recording.time_s.iter().zip(&mut run.recording.force_n) {
            *f += f64::from(u8::from(*t > first_s));
        }
        assert!((surface_shift_m(&law, &run) - result).abs() < 1e-9);
    }
    let moved = with_moved_surface(
        &stack_models(
            &tissue(&["a", "b"], 0.0, 0.03, 1.0),
            &[&alone(0.004, 1.0, &[]), &alone(0.015, 1.0, &[])],
            0.0,
        )
        .expect("a law"),
        7e-4,
    );
    assert!(
        (moved.tissue.surface_m - 0.0047).abs() < 1e-15 && (moved.tissue.front_m(1) - 0.015).abs() < 1e-15
    );
}

#[test]
fn parameters_at_their_bounds_come_from_the_first_layer() {
    let like = ShaftSlip {
        push_n: 2.0,
        pull_n: 1.0,
        exponent: 7.0,
        wear_per_m: 40.0,
        retained_share: 0.5,
        ..ShaftSlip::default()
    };
    let result = |slip: &ShaftSlip| {
        let m = alone(0.004, 100.0, &[slip.clone().into()]);
        match identified_effects(&m, 2e-3, Some(&like))[0].effect() {
            Some(AnyEffect::ShaftSlip(s)) => s,
            other => unreachable!("{other:?}"),
        }
    };
    let known = ShaftSlip { push_n: 1.5, pull_n: 1.2, retained_share: 0.8, wear_per_m: 60.0, ..like.clone() };
    assert_eq!(result(&known), known);
    let push_n = 8.0 + 3.0 * (8.0 - 0.05);
    let open =
        ShaftSlip { push_n, exponent: 200.0, wear_per_m: 0.0, retained_share: 0.6 / push_n, ..known.clone() };
    let s = result(&open);
    // Twice its pull plateau, of which a quarter is the 0.6 N after the rupture.
    assert!((s.push_n - 2.4).abs() < 1e-12 && (s.retained_share - 0.25).abs() < 1e-12, "{s:?}");
    assert_eq!((s.pull_n, s.exponent, s.wear_per_m), (1.2, 7.0, 40.0));
    let m = alone(0.004, 100.0, &[open.clone().into()]);
    assert_eq!(identified_effects(&m, 2e-3, None)[0].effect(), Some(AnyEffect::ShaftSlip(open)));
}

#[test]
fn a_single_layer_predicts_itself_at_a_shifted_surface() {
    let alone = simulated_recordings(&[], &[[0.008, 0.0], [0.016, 1e-4], [0.008, 0.0]]);
    let whole = simulated_recordings(&[], &[[0.008, 1e-3], [0.016, 1e-3], [0.008, 1e-3]]);
    let recordings: Vec<&SegmentedRecording> = whole.iter().collect();
    let result = compose_layers(ModelFamily::Base, &gel_tissue(), &[("gel".to_owned(), alone)], &recordings)
        .expect("a law");
    let [(name, floor_n, error_n)] = &result.single_layers[..] else { unreachable!("one layer") };
    // A single recording at its speed has no floor.
    assert_eq!((name.as_str(), *floor_n), ("gel", None));
    assert!(*error_n > 0.0 && *error_n < 0.3, "{error_n}");
    assert_eq!(result.composed_n.len(), 2);
    assert!(result.composed_n.iter().all(|e| *e > 0.005 && *e < 0.3), "{:?}", result.composed_n);
    assert!((result.mean_n - 0.5 * (result.composed_n[0] + result.composed_n[1])).abs() < 1e-12);
    // Duplicates do not change the mean of a speed.
    let [twice, thrice] = [&[recordings[0]; 2][..], &[recordings[0]; 3]].map(|recordings| {
        let alone = simulated_recordings(&[], &[[0.008, 0.0], [0.016, 1e-4], [0.008, 0.0]]);
        compose_layers(ModelFamily::Base, &gel_tissue(), &[("gel".to_owned(), alone)], recordings)
            .expect("a law")
            .mean_n
    });
    assert_eq!(twice, thrice);
    assert!(compose_layers(ModelFamily::Base, &gel_tissue(), &[], &recordings).is_none());
}
