//! Promise: the effects on elastic force, ruptures and the tip follow their equations in docs/reference/model.md.

use crate::common;
use common::*;
use stylet_tissue::*;

fn constant(v: f64, rate: f64, seconds: f64) -> Vec<Sample> {
    (0..(seconds * rate) as usize).map(|k| k as f64 / rate).map(|t| (t, v * t, v)).collect()
}

#[test]
fn nonlinear_elasticity_is_quadratic_and_the_same_at_all_speeds() {
    let stiffening: AnyEffect = NonlinearElasticity { kappa_per_m: 20.0 }.into();
    for v in [0.001, 0.01] {
        let (f, _) = run(&block(40.0, 0.0), std::slice::from_ref(&stiffening), &constant(v, 100.0, 3.0));
        let last = &f[f.len() - 1];
        let x = v * 2.99;
        near(last.total_n, 40.0 * x * (1.0 + 20.0 * x), 1e-14);
    }
}

#[test]
fn nonlinear_elasticity_moves_a_puncture_by_force_to_where_the_parabola_meets_it() {
    let tissue = tissue(&[layer(0.1, 40.0, 0.0, Some(1.0))]);
    let (_, ruptures) =
        run(&tissue, &[NonlinearElasticity { kappa_per_m: 20.0 }.into()], &constant(0.002, 500.0, 30.0));
    let x = ((1.0f64 + 4.0 * 20.0 / 40.0).sqrt() - 1.0) / 40.0;
    near(ruptures[0].position_m, x, 1e-7);
    assert!(ruptures[0].by_force);
    near(ruptures[0].released_n, 1.0, 1e-12);
}

#[test]
fn relaxation_of_a_ramp_is_exact_at_any_sampling_rate() {
    // E = K v t: q = g K v (t - tau (1 - exp(-t/tau))).
    let terms = [(0.3, 0.3), (0.2, 2.7)];
    let effect: AnyEffect = StressRelaxation {
        terms: terms.map(|(fraction, time_constant_s)| PronyTerm { fraction, time_constant_s }).to_vec(),
    }
    .into();
    let v = 0.002;
    for rate in [3.7, 50.0, 200.0, 1000.0] {
        let motion = constant(v, rate, 10.0);
        let f = forces(&block(60.0, 0.0), std::slice::from_ref(&effect), &motion);
        for (&(t, _, _), force) in motion.iter().zip(&f) {
            let relaxed: f64 = terms.iter().map(|(g, tau)| g * (t - tau * (1.0 - (-t / tau).exp()))).sum();
            near(*force, 60.0 * v * (t - relaxed), 1e-11);
        }
    }
}

#[test]
fn relaxation_restarts_in_the_next_layer_and_its_force_ruptures() {
    let layers = [layer(0.05, 60.0, 0.0, Some(0.5)), layer(0.05, 60.0, 0.0, None)];
    let effect: AnyEffect =
        StressRelaxation { terms: vec![PronyTerm { fraction: 0.5, time_constant_s: 1.0 }] }.into();
    let v = 0.002;
    let (f, ruptures) = run(&tissue(&layers), &[effect], &constant(v, 200.0, 40.0));
    let relaxed = |t: f64| 60.0 * v * (t - 0.5 * (t - (1.0 - (-t).exp())));
    near(relaxed(ruptures[0].time_s), 0.5, 1e-5);
    let enter = 0.05 / v;
    let k = (35.0f64 * 200.0) as usize;
    near(f[k].elastic_n, relaxed(35.0 - enter), 1e-6);
}

#[test]
fn friction_does_not_relax_in_a_hold_and_relaxation_needs_no_motion() {
    let effect: AnyEffect =
        StressRelaxation { terms: vec![PronyTerm { fraction: 0.4, time_constant_s: 1.0 }] }.into();
    let mut motion = constant(0.01, 200.0, 1.0);
    motion.extend((0..1000).map(|k| (1.0 + f64::from(k) / 200.0, 0.01, 0.0)));
    let (f, _) = run(&block(100.0, 9000.0), &[effect], &motion);
    assert!(f[200..].windows(2).all(|w| w[1].total_n < w[0].total_n), "decays in the hold");
    assert!(f[200..].iter().all(|f| f.friction_n == 0.0));
    near(f[1199].total_n, 0.6, 5e-3);
}

#[test]
fn rate_dependent_puncture_shifts_the_peak_with_speed_but_not_the_loading_curve() {
    let tissue = tissue(&[layer(0.5, 50.0, 0.0, Some(1.0))]);
    let peak = |alpha, v: f64| {
        let (_, ruptures) =
            run(&tissue, &[RateDependentPuncture { alpha }.into()], &constant(v, 200.0, 0.1 / v));
        ruptures.first().map_or(f64::NAN, |r| r.released_n)
    };
    near(peak(0.2, 0.001), 1.0, 1e-12);
    near(peak(0.2, 0.005), 1.0 + 0.2 * 5f64.ln(), 1e-12);
    near(peak(-0.2, 0.005), 1.0 - 0.2 * 5f64.ln(), 1e-12);
    near(peak(-2.0, 0.01), 0.1, 1e-12);
    near(peak(0.2, 0.00005), 1.0 + 0.2 * 0.1f64.ln(), 1e-12);
    near(peak(0.0, 0.005), 1.0, 1e-12);
}

#[test]
fn incomplete_release_keeps_its_share_until_the_next_rupture_or_reversal() {
    let layers =
        [layer(0.02, 50.0, 0.0, None), layer(0.02, 50.0, 0.0, Some(0.5)), layer(0.02, 10.0, 0.0, None)];
    let mut motion = constant(0.01, 100.0, 3.5);
    motion.extend((0..100).map(|k| (3.5 + f64::from(k) / 100.0, 0.0349, 0.0)));
    motion.extend((0..100).map(|k| (4.5 + f64::from(k) / 100.0, 0.0349 - 1e-4 * f64::from(k), -0.01)));
    motion.extend((0..50).map(|k| (5.5 + f64::from(k) / 100.0, 0.025 + 1e-4 * f64::from(k), 0.01)));
    let (f, r) = run(&tissue(&layers), &[IncompleteRelease { fraction: 0.3 }.into()], &motion);
    assert_eq!(r.len(), 2);
    near(r[0].released_n, 1.0, 1e-12); // at its far face, whatever the sampling
    near(f[150].tip_extra_n, 0.0, 0.0);
    near(f[250].tip_extra_n, 0.3, 1e-12);
    near(f[320].tip_extra_n, 0.15, 1e-12);
    near(f[400].tip_extra_n, 0.15, 1e-12);
    assert!(f[451..].iter().all(|f| f.tip_extra_n == 0.0), "gone at the reversal, for good");
}

#[test]
fn soft_boundary_releases_with_the_deepest_travel_and_never_takes_back() {
    let tissue = tissue(&[layer(0.05, 50.0, 0.0, Some(1.0))]);
    let mut motion = constant(0.01, 100.0, 2.3); // ruptures at 20 mm, to 22.9 mm
    motion.extend((0..20).map(|k| (2.3 + f64::from(k) / 100.0, 0.0229 - 1e-4 * f64::from(k), -0.01)));
    motion.extend((0..100).map(|k| (2.5 + f64::from(k) / 100.0, 0.021 + 1e-4 * f64::from(k), 0.01)));
    let (f, r) = run(&tissue, &[SoftBoundary { width_m: 0.004 }.into()], &motion);
    near(r[0].position_m, 0.02, 1e-12);
    let mut deepest = 0.0f64;
    for (&(_, z, _), force) in motion.iter().zip(&f).skip(202) {
        deepest = deepest.max(z);
        near(force.tip_extra_n, (1.0 - (deepest - 0.02) / 0.004).max(0.0), 1e-9);
    }
    near(f[f.len() - 1].total_n, 0.0, 0.0);
}

#[test]
fn soft_boundaries_overlap_and_what_incomplete_release_keeps_is_not_spread() {
    let layers =
        [layer(0.002, 500.0, 0.0, None), layer(0.002, 500.0, 0.0, None), layer(0.002, 500.0, 0.0, None)];
    let soft: AnyEffect = SoftBoundary { width_m: 0.01 }.into();
    let motion = constant(0.001, 100.0, 20.0);
    let (f, r) = run(&tissue(&layers), std::slice::from_ref(&soft), &motion);
    assert_eq!(r.len(), 3);
    for z in [0.003, 0.005, 0.008, 0.0125, 0.018] {
        let sum: f64 = [0.002, 0.004, 0.006]
            .iter()
            .filter(|&&at| at < z)
            .map(|at| (1.0 - (z - at) / 0.01f64).max(0.0))
            .sum();
        near(f[(z * 1e5f64).round() as usize].tip_extra_n, sum, 1e-9);
    }
    let both = [soft, IncompleteRelease { fraction: 0.25 }.into()];
    let (f, _) = run(&tissue(&layers[..1]), &both, &motion);
    near(f[201].tip_extra_n, 1.0, 2e-3); // nothing is lost at once
    near(f[700].tip_extra_n, 0.25 + 0.75 * 0.5, 1e-9);
    near(f[1900].tip_extra_n, 0.25, 1e-12);
}

#[test]
fn a_soft_boundary_of_no_width_is_the_base_law() {
    let base = forces(&three_gels(), &[], &usual_motion());
    let thin = forces(&three_gels(), &[SoftBoundary { width_m: 1e-12 }.into()], &usual_motion());
    let different = base.iter().zip(&thin).filter(|(a, b)| a != b).count();
    assert!(different <= 3, "only in the samples of the ruptures: {different}");
}

#[test]
fn cutting_force_acts_while_advancing_in_punctured_layers_and_in_layers_that_need_no_puncture() {
    let layers = [layer(0.02, 50.0, 0.0, Some(0.5)), layer(0.02, 50.0, 0.0, None)];
    let mut motion: Vec<Sample> = vec![
        (0.0, -0.001, 0.005), // air
        (1.0, 0.005, 0.005),  // before the puncture at 10 mm
        (2.0, 0.015, 0.005),  // behind it
        (3.0, 0.015, 0.0),    // hold
        (4.0, 0.014, -0.005), // back
        (5.0, 0.025, 0.005),  // second layer: any tissue
        (6.0, 0.045, 0.005),  // out on the other side
    ];
    let (f, _) = run(&tissue(&layers), &[CuttingForce { force_n: 0.3 }.into()], &motion);
    let cut: Vec<f64> = f.iter().map(|f| f.tip_extra_n).collect();
    assert_eq!(cut, [0.0, 0.0, 0.3, 0.0, 0.0, 0.3, 0.0]);
    motion.iter_mut().for_each(|m| m.2 = -m.2.abs());
    let (f, _) = run(&tissue(&layers), &[CuttingForce { force_n: 0.3 }.into()], &motion);
    assert!(f.iter().all(|f| f.tip_extra_n == 0.0));
}

#[test]
fn a_hidden_membrane_is_a_spring_that_breaks_once_and_is_no_rupture_of_a_layer() {
    let tissue = Tissue { surface_m: 0.01, layers: vec![layer(1.0, 20.0, 0.0, None)] };
    let membrane = HiddenMembrane { depth_m: 0.02, stiffness_n_per_m: 100.0, puncture_n: 0.8 };
    let at = |z: f64| (z, z, 0.001);
    let motion = [
        at(0.029),
        at(0.031),
        at(0.035),
        (0.0355, 0.029, -0.01),
        (0.036, 0.0379, 0.01),
        at(0.0381),
        (0.04, 0.035, -0.01),
    ];
    let (f, ruptures) = run(&tissue, &[membrane.into()], &motion);
    assert!(ruptures.is_empty());
    for (force, expected) in f.iter().zip([0.0, 0.1, 0.5, 0.0, 0.79, 0.0, 0.0]) {
        near(force.tip_extra_n, expected, 1e-12);
        assert_eq!(force.active_layer, 1);
    }
    let two = [membrane_at(0.02), membrane_at(0.04)];
    let (f, _) = run(&tissue, &two, &[at(0.035), at(0.055)]);
    near(f[1].tip_extra_n, 0.5, 1e-12);
}

fn membrane_at(depth_m: f64) -> AnyEffect {
    HiddenMembrane { depth_m, stiffness_n_per_m: 100.0, puncture_n: 0.8 }.into()
}

#[test]
fn boundary_shift_moves_one_face_and_leaves_the_others() {
    let law = |layer, shift_m| {
        ForceLaw::new(&three_gels(), &[BoundaryShift { layer, shift_m }.into()]).expect("one")
    };
    let faces =
        |law: &ForceLaw| law.slabs().iter().flat_map(|s| [s.front_m, s.far_m()]).collect::<Vec<f64>>();
    let expect = |law: &ForceLaw, expected: [f64; 6]| {
        assert!(worst(&faces(law), &expected) < 1e-15, "{:?}", faces(law))
    };
    expect(&law(1, 0.003), [0.0, 0.023, 0.023, 0.05, 0.05, 0.07]);
    expect(&law(2, -0.004), [0.0, 0.02, 0.02, 0.046, 0.046, 0.07]);
    expect(&law(1, 0.9), [0.0, 0.05, 0.05, 0.05, 0.05, 0.07]);
    expect(&law(1, -0.9), [0.0, 0.0, 0.0, 0.05, 0.05, 0.07]);
    for layer in [0, 3, 4] {
        expect(&law(layer, 0.003), [0.0, 0.02, 0.02, 0.05, 0.05, 0.07]);
    }
    // The same as a scenario with the face moved.
    let shifted = tissue(&[
        layer(0.023, 50.0, 9000.0, None),
        layer(0.027, 70.0, 12000.0, Some(1.5)),
        layer(0.02, 80.0, 16000.0, None),
    ]);
    let effect: AnyEffect = BoundaryShift { layer: 1, shift_m: 0.003 }.into();
    assert!(
        worst(&forces(&three_gels(), &[effect], &usual_motion()), &forces(&shifted, &[], &usual_motion()))
            < 1e-12
    );
}

#[test]
fn respiration_is_relative_motion_moving_tissue_and_held_needle_or_the_other_way_round() {
    let breath = Respiration { amplitude_m: 0.003, frequency_hz: 0.3, phase_rad: 0.4 };
    let omega = std::f64::consts::TAU * 0.3;
    let held: Vec<Sample> = (0..4000).map(|k| (f64::from(k) / 200.0, 0.0185, 0.0)).collect();
    let moving: Vec<Sample> = held
        .iter()
        .map(|&(t, z, _)| {
            let angle = omega * t + 0.4;
            (t, z - 0.003 * angle.sin(), -0.003 * omega * angle.cos())
        })
        .collect();
    let more: AnyEffect = PreslidingFriction { c_n_per_m: 10.0, delta_m: 1e-3 }.into();
    let (a, ra) = run(&three_gels(), &[breath.into(), more.clone()], &held);
    let (b, rb) = run(&three_gels(), &[more], &moving);
    let totals = |f: &[TissueForce]| f.iter().map(|f| f.total_n).collect::<Vec<f64>>();
    assert!(worst(&totals(&a), &totals(&b)) < 1e-10);
    assert_eq!((ra.len(), rb.len()), (1, 1), "the breath alone carries the tissue through the first face");
}
