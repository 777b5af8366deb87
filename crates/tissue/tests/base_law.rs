//! Promise: the base law of docs/reference/model.md: rupture by force or at the far face, friction only in retraction,
//! rupture times interpolated between the samples.

use proptest::prelude::*;
use stylet_tissue::{ForceLaw, ForceLawState, Layer, Rupture, Tissue, TissueForce, replay};

fn layer(
    thickness_m: f64,
    stiffness_n_per_m: f64,
    friction_ns_per_m2: f64,
    puncture_n: Option<f64>,
) -> Layer {
    Layer { name: String::new(), thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n }
}

fn insert(tissue: &Tissue, motion: &[(f64, f64, f64)]) -> (Vec<TissueForce>, Vec<Rupture>) {
    let mut ruptures = Vec::new();
    let mut forces = Vec::new();
    replay(&ForceLaw::base(tissue), motion.iter().copied(), |r| ruptures.push(r), |f| forces.push(f));
    (forces, ruptures)
}

fn constant(start_m: f64, v_mps: f64, sample_hz: f64, samples: usize) -> Vec<(f64, f64, f64)> {
    (0..samples).map(|k| k as f64 / sample_hz).map(|t| (t, start_m + v_mps * t, v_mps)).collect()
}

#[test]
fn force_in_each_layer_is_its_own_spring_plus_the_friction_of_all_layers_around_the_shaft() {
    let (forces, _) = insert(&Tissue::three_gels(), &constant(-0.005, 0.0023, 200.0, 10_000));
    let v = 0.0023;
    let at = |z: f64| forces[((z + 0.005) / v * 200.0).round() as usize];
    let near = |a: f64, b: f64| assert!((a - b).abs() < 2e-3, "{a} against {b}");
    near(at(-0.002).total_n, 0.0);
    near(at(0.02).total_n, 40.0 * 0.02 + v * 9000.0 * 0.02);
    near(at(0.05).total_n, 60.0 * 0.0218 + v * (9000.0 * 0.0282 + 12000.0 * 0.0218));
    near(at(0.1).total_n, v * (9000.0 * 0.0282 + 12000.0 * 0.0377 + 16000.0 * 0.0322));
    near(at(0.1).tip_n, 0.0);
    near(at(0.05).tip_n, 60.0 * 0.0218 + v * 12000.0 * 0.0218);
}

#[test]
fn a_layer_ruptures_at_its_puncture_force_or_at_its_far_face_whichever_comes_first() {
    let (_, ruptures) = insert(&Tissue::three_gels(), &constant(-0.005, 0.0023, 200.0, 10_000));
    let found: Vec<(usize, bool)> = ruptures.iter().map(|r| (r.layer, r.by_force)).collect();
    assert_eq!(found, [(1, false), (2, true), (3, false)]);
    let expected_m = [0.0282, 0.0282 + 2.2 / 60.0, 0.0981];
    for (r, z) in ruptures.iter().zip(expected_m) {
        assert!((r.position_m - z).abs() < 1e-12, "{r:?} expected at {z}");
        assert!((r.time_s - (z + 0.005) / 0.0023).abs() < 1e-9, "{r:?}");
    }
}

#[test]
fn in_retraction_a_ruptured_layer_gives_friction_only() {
    let mut motion = constant(0.0, 0.002, 100.0, 2000); // to 40 mm: the first layer is through
    let deepest = motion[motion.len() - 1].1;
    motion.extend((1..=1000).map(|k| (20.0 + f64::from(k) / 100.0, deepest - 2e-5 * f64::from(k), -0.002)));
    let tissue = Tissue { surface_m: 0.0, layers: vec![layer(0.0282, 40.0, 9000.0, None)] };
    let (forces, ruptures) = insert(&tissue, &motion);
    assert_eq!(ruptures.len(), 1);
    let last = forces[forces.len() - 1];
    let z = deepest - 0.02;
    assert_eq!(last.elastic_n, 0.0);
    assert!((last.total_n - -0.002 * 9000.0 * z).abs() < 1e-9, "{last:?}");
    assert!(last.tip_n.abs() < 1e-9, "the tip force is zero: {last:?}");
}

#[test]
fn a_step_across_several_faces_reports_every_rupture_in_order() {
    let (forces, ruptures) = insert(&Tissue::three_gels(), &[(0.0, -0.01, 1.0), (0.2, 0.19, 1.0)]);
    assert_eq!(ruptures.iter().map(|r| r.layer).collect::<Vec<_>>(), [1, 2, 3]);
    assert!(ruptures.windows(2).all(|w| w[0].time_s < w[1].time_s), "{ruptures:?}");
    for (r, z) in ruptures.iter().zip([0.0282, 0.0282 + 2.2 / 60.0, 0.0981]) {
        assert!((r.position_m - z).abs() < 1e-3, "{r:?} expected near {z}");
    }
    assert_eq!(forces[1].elastic_n, 0.0);
    assert_eq!(forces[1].active_layer, 4);
}

proptest! {
    /// Force scales with the tissue: K, b and F times a power of two give exactly that multiple of the force.
    #[test]
    fn force_is_linear_in_the_coefficients(power in -3i32..4, v in 1e-4f64..0.01) {
        let s = f64::from(power).exp2();
        let base = Tissue::three_gels();
        let mut scaled = base.clone();
        for l in &mut scaled.layers {
            l.stiffness_n_per_m *= s;
            l.friction_ns_per_m2 *= s;
            l.puncture_n = l.puncture_n.map(|f| f * s);
        }
        let motion = constant(-0.005, v, 200.0, 2000);
        let (a, ra) = insert(&base, &motion);
        let (b, rb) = insert(&scaled, &motion);
        prop_assert_eq!(ra.len(), rb.len());
        for (x, y) in a.iter().zip(&b) {
            prop_assert_eq!(x.total_n * s, y.total_n);
        }
    }

    /// Total force is tip force plus cumulative friction, at every sample.
    #[test]
    fn tip_force_and_cumulative_friction_add_up(v in 1e-4f64..0.02, start in -0.01f64..0.0) {
        let motion = constant(start, v, 200.0, 3000);
        let (forces, _) = insert(&Tissue::three_gels(), &motion);
        for f in &forces {
            prop_assert!((f.tip_n + f.cumulative_friction_ns_per_m * v - f.total_n).abs() < 1e-12);
            prop_assert!((f.elastic_n + f.friction_n - f.total_n).abs() < 1e-12);
        }
    }

    /// Rupture times do not depend on how finely the same constant motion is sampled.
    #[test]
    fn rupture_times_do_not_depend_on_the_sampling(rate in 20.0f64..2000.0) {
        let samples = (48.0 * rate) as usize;
        let (_, coarse) = insert(&Tissue::three_gels(), &constant(-0.005, 0.0023, rate, samples));
        let (_, fine) = insert(&Tissue::three_gels(), &constant(-0.005, 0.0023, 1000.0, 48_000));
        prop_assert_eq!(coarse.len(), 3);
        for (a, b) in coarse.iter().zip(&fine) {
            prop_assert!((a.time_s - b.time_s).abs() < 1e-9, "{:?} {:?}", a, b);
        }
    }
}

#[test]
fn a_state_can_be_copied_and_continued() {
    let law = ForceLaw::base(&Tissue::three_gels());
    let motion = constant(-0.005, 0.0023, 200.0, 8000);
    let mut state = ForceLawState::default();
    for &(t, z, v) in &motion[..4000] {
        law.step(&mut state, t, z, v, |_| {});
    }
    let mut copy = state;
    for &(t, z, v) in &motion[4000..] {
        let a = law.step(&mut state, t, z, v, |_| {});
        let b = law.step(&mut copy, t, z, v, |_| {});
        assert_eq!(a, b);
    }
    assert_eq!(state.ruptured(), 2, "the copy was taken before a rupture that really came");
}

#[test]
fn imposed_ruptures_at_the_times_of_the_force_law_give_the_same_bits() {
    let layer = |d: f64, k: f64, f: Option<f64>| stylet_tissue::Layer {
        name: String::new(),
        thickness_m: d,
        stiffness_n_per_m: k,
        friction_ns_per_m2: 9e3,
        puncture_n: f,
    };
    let tissue = stylet_tissue::Tissue {
        surface_m: 0.0,
        layers: vec![layer(0.01, 40.0, None), layer(0.02, 60.0, Some(0.6)), layer(0.01, 80.0, None)],
    };
    for spring in [f64::INFINITY, 900.0] {
        let effects = [
            stylet_tissue::NeedleCompliance { stiffness_n_per_m: spring }.into(),
            stylet_tissue::IncompleteRelease { fraction: 0.3 }.into(),
        ];
        let law = stylet_tissue::ForceLaw::new(&tissue, &effects).expect("two effects");
        let (mut free, mut imposed) = Default::default();
        let mut met = 0;
        for i in 0..12_000 {
            let (t, v) = (f64::from(i) * 0.002, 0.002);
            let z = v * t - 0.001;
            let expected = law.step(&mut free, t, z, v, |_| {});
            let found = law.step_imposed(&mut imposed, t, z, v, free.ruptured(), |criterion| {
                met += usize::from(criterion.is_met());
            });
            assert_eq!(expected, found, "sample {i}");
        }
        assert_eq!((free.ruptured(), met), (3, 3));
    }
}

#[test]
fn one_long_step_finds_every_rupture_where_short_ones_do() {
    // The third layer is punctured, too; the springs hold 40 x 28.2 mm, 2.2 N and 1 N at the rupture.
    let mut tissue = Tissue::three_gels();
    tissue.layers[2].puncture_n = Some(1.0);
    let expected = [(0.0282, 40.0 * 0.0282), (0.0282 + 2.2 / 60.0, 2.2), (0.0659 + 1.0 / 80.0, 1.0)];
    let v = 0.01;
    let steps: [&[f64]; 4] =
        [&[-0.01, 0.12], &[0.0, 0.01, 0.03, 0.1, 0.11], &[-0.003, 0.0282, 0.0659], &[0.02]];
    for positions in steps {
        // Then in steps of 1 mm to the end.
        let deepest = positions[positions.len() - 1];
        let rest = (1..=90).map(|k| deepest + 0.001 * f64::from(k));
        let motion: Vec<_> = positions.iter().copied().chain(rest).map(|z| (z / v, z, v)).collect();
        // The same with an effect that does not change ruptures.
        for effects in [vec![], vec![stylet_tissue::CoulombFriction { c_n_per_m: 1.0 }.into()] as Vec<_>] {
            let (law, mut ruptures) = (ForceLaw::new(&tissue, &effects).expect("few effects"), Vec::new());
            replay(&law, motion.iter().copied(), |r| ruptures.push(r), |_| {});
            assert_eq!(ruptures.iter().map(|r| r.by_force).collect::<Vec<_>>(), [false, true, true]);
            for (r, (z, released_n)) in ruptures.iter().zip(expected) {
                assert!((r.position_m - z).abs() < 1e-12 && (r.time_s - z / v).abs() < 1e-9, "{r:?} at {z}");
                assert!((r.released_n - released_n).abs() < 1e-12, "{r:?} {released_n}");
            }
        }
    }
}

#[test]
fn a_time_stamp_that_repeats_or_runs_backward_is_a_step_of_zero_length() {
    let tissue = Tissue::three_gels();
    for effects in [vec![], vec![stylet_tissue::CoulombFriction { c_n_per_m: 1.0 }.into()] as Vec<_>] {
        let law = ForceLaw::new(&tissue, &effects).expect("few effects");
        for again_s in [3.0, 1.0] {
            let (mut state, mut ruptures) = (ForceLawState::default(), Vec::new());
            law.step(&mut state, 3.0, 0.01, 0.0, |r| ruptures.push(r));
            let force = law.step(&mut state, again_s, 0.03, 0.0, |r| ruptures.push(r));
            assert_eq!((ruptures.len(), ruptures[0].time_s, state.ruptured()), (1, 3.0, 1));
            assert!(
                (ruptures[0].position_m - 0.0282).abs() < 1e-15
                    && (force.elastic_n - 60.0 * 0.0018).abs() < 1e-12
            );
            // Time continues from the latest stamp.
            law.step(&mut state, 5.0, 0.0282 + 0.0377 + 0.0018, 0.0, |r| ruptures.push(r));
            let way = (2.2 / 60.0 - 0.0018) / 0.0377;
            assert!((ruptures[1].time_s - (3.0 + 2.0 * way)).abs() < 1e-12, "{ruptures:?}");
        }
    }
}

#[test]
fn running_many_samples_equals_stepping_them_one_by_one() {
    let mut samples: Vec<[f64; 3]> =
        constant(-0.005, 0.0023, 50.0, 2500).into_iter().map(|(t, z, v)| [t, z, v]).collect();
    samples[700][1] = f64::NAN;
    samples[1400][2] = f64::INFINITY;
    for effects in [vec![], vec![stylet_tissue::CoulombFriction { c_n_per_m: 1.0 }.into()] as Vec<_>] {
        let law = ForceLaw::new(&Tissue::three_gels(), &effects).expect("few effects");
        let (mut one, mut all) = (ForceLawState::default(), ForceLawState::default());
        let (mut expected, mut found) = ((Vec::new(), Vec::new()), (Vec::new(), Vec::new()));
        for [t, z, v] in &samples {
            let force = law.step(&mut one, *t, *z, *v, |r| expected.1.push(r));
            expected.0.push(format!("{force:?}"));
        }
        law.run(&mut all, samples.iter().copied(), |r| found.1.push(r), |f| found.0.push(format!("{f:?}")));
        assert_eq!(found, expected);
        assert_eq!((one, found.1.len()), (all, 3));
        assert!(found.0[700].contains("total_n: NaN") && found.0[1400].contains("total_n: NaN"));
        assert_eq!((all.tip_m(), all.tip_velocity_mps()), (samples[2499][1], 0.0023));
    }
}

#[test]
fn the_tip_follows_the_base_unless_an_effect_moves_it() {
    use stylet_tissue::{
        AnyEffect, CoulombFriction, CuttingForce, IncompleteRelease, NeedleCompliance, Respiration,
    };
    let of = |effect: AnyEffect| ForceLaw::new(&Tissue::three_gels(), &[effect]).expect("an effect");
    let base = ForceLaw::base(&Tissue::three_gels());
    assert!(base.tip_follows_base() && !base.has_compliant_needle());
    assert!(of(CoulombFriction { c_n_per_m: 1.0 }.into()).tip_follows_base());
    let needle = of(NeedleCompliance { stiffness_n_per_m: 500.0 }.into());
    assert!(!needle.tip_follows_base() && needle.has_compliant_needle());
    for moves in [
        Respiration { amplitude_m: 1e-3, frequency_hz: 0.3, phase_rad: 0.0 }.into(),
        CuttingForce { force_n: 0.1 }.into(),
        IncompleteRelease { fraction: 0.2 }.into(),
    ] {
        let law = of(moves);
        assert!(!law.tip_follows_base() && !law.has_compliant_needle(), "{law:?}");
    }
    assert_eq!(base.slabs().len(), 3);
}

#[test]
fn the_viscous_velocity_includes_all_friction_effects() {
    use stylet_tissue::{AsymmetricFriction, PowerLawFriction};
    let effects = [PowerLawFriction { exponent: 0.5 }.into(), AsymmetricFriction { eps: 0.2 }.into()];
    for chosen in [&effects[..0], &effects[..1], &effects[1..], &effects[..]] {
        let law = ForceLaw::new(&Tissue::three_gels(), chosen).expect("few effects");
        for v in [0.004, -0.004, 0.0] {
            // Against the law itself: the tip at 20 mm in 9000 Ns/m2.
            let force = law.step(&mut ForceLawState::default(), 0.0, 0.02, v, |_| {});
            let friction = force.total_n - 40.0 * 0.02;
            assert!((law.viscous_velocity(v) * 9000.0 * 0.02 - friction).abs() < 1e-12, "{chosen:?} {v}");
        }
    }
}

#[test]
fn dry_friction_is_shared_by_the_length_inside_the_layers() {
    let tissue =
        Tissue { surface_m: 0.0, layers: vec![layer(0.03, 0.0, 2000.0, None), layer(0.1, 0.0, 0.0, None)] };
    let law = ForceLaw::new(&tissue, &[stylet_tissue::CoulombFriction { c_n_per_m: 10.0 }.into()])
        .expect("an effect");
    let (mut state, v) = (ForceLawState::default(), 0.005);
    law.step(&mut state, 0.0, 0.0, v, |_| {});
    let inside = law.step(&mut state, 5.0, 0.025, v, |_| {});
    assert!((inside.total_n - (v * 2000.0 * 0.025 + 0.25)).abs() < 1e-12 && inside.tip_n == inside.total_n);
    // 50 mm in: 0.5 N of dry friction, 0.3 N of them and all viscous friction in the layer passed.
    let passed = law.step(&mut state, 10.0, 0.05, v, |_| {});
    assert!(
        (passed.total_n - (v * 60.0 + 0.5)).abs() < 1e-12 && (passed.tip_n - 0.2).abs() < 1e-12,
        "{passed:?}"
    );
    // No friction in the air.
    assert_eq!(law.step(&mut ForceLawState::default(), 0.0, -0.01, v, |_| {}).tip_n, 0.0);
}

#[test]
fn ruptures_may_be_imposed_before_the_criterion_is_met() {
    let law = ForceLaw::base(&Tissue::three_gels());
    let (mut state, mut criteria) = (ForceLawState::default(), Vec::new());
    law.step_imposed(&mut state, 0.0, 0.01, 0.0, 0, |s| criteria.push(s));
    let force = law.step_imposed(&mut state, 1.0, 0.02, 0.0, 1, |s| criteria.push(s));
    // The first layer ruptures at 20 mm although the criterion is not met; the second is not reached yet.
    assert_eq!((force.total_n, force.active_layer, state.ruptured()), (0.0, 2, 1));
    let found: Vec<_> = criteria.iter().map(|s| (s.layer, s.elastic_n, s.tip_m, s.is_met())).collect();
    assert_eq!(found, [(1, 0.4, 0.01, false), (1, 0.8, 0.02, false), (2, 0.0, 0.02, false)]);
    assert_eq!((criteria[1].puncture_n, criteria[1].far_m), (f64::INFINITY, 0.0282));
    // A layer may also stay intact although the criterion is met.
    let later = law.step_imposed(&mut state, 2.0, 0.09, 0.0, 1, |s| criteria.push(s));
    assert!((later.elastic_n - 60.0 * (0.09 - 0.0282)).abs() < 1e-12 && criteria[3].is_met());
}

#[test]
fn faces_are_where_the_layers_before_them_end() {
    let tissue = Tissue { surface_m: -0.004, ..Tissue::three_gels() };
    for (index, front) in [-0.004, 0.0242, 0.0619, 0.0941].into_iter().enumerate() {
        assert!((tissue.front_m(index) - front).abs() < 1e-15, "{index}");
    }
    assert_eq!(tissue.end_m(), tissue.front_m(3));
}
