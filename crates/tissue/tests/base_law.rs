//! Promise: the base law is SPEC section 2, rupture by force or at the far face, friction only on
//! the way back, and the instants of rupture are interpolated between the samples.

use proptest::prelude::*;
use stylet_tissue::{Law, LawState, Layer, Rupture, Tissue, TissueForce, replay};

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
    replay(&Law::base(tissue), motion.iter().copied(), |r| ruptures.push(r), |f| forces.push(f));
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
fn on_the_way_back_a_ruptured_layer_gives_friction_only() {
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
    assert!(last.tip_n.abs() < 1e-9, "nothing is left at the tip: {last:?}");
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

    /// Total force is what the tip feels plus the cumulative friction, at every sample.
    #[test]
    fn tip_force_and_cumulative_friction_add_up(v in 1e-4f64..0.02, start in -0.01f64..0.0) {
        let motion = constant(start, v, 200.0, 3000);
        let (forces, _) = insert(&Tissue::three_gels(), &motion);
        for f in &forces {
            prop_assert!((f.tip_n + f.cumulative_friction_ns_per_m * v - f.total_n).abs() < 1e-12);
            prop_assert!((f.elastic_n + f.friction_n - f.total_n).abs() < 1e-12);
        }
    }

    /// Rupture instants do not depend on how finely the same constant motion is sampled.
    #[test]
    fn rupture_instants_do_not_depend_on_the_sampling(rate in 20.0f64..2000.0) {
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
    let law = Law::base(&Tissue::three_gels());
    let motion = constant(-0.005, 0.0023, 200.0, 8000);
    let mut state = LawState::default();
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
fn imposed_ruptures_at_the_law_s_own_instants_give_the_same_bits() {
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
        let law = stylet_tissue::Law::new(&tissue, &effects).expect("two effects");
        let (mut free, mut imposed) = Default::default();
        let mut strained = 0;
        for i in 0..12_000 {
            let (t, v) = (f64::from(i) * 0.002, 0.002);
            let z = v * t - 0.001;
            let expected = law.step(&mut free, t, z, v, |_| {});
            let found = law.step_imposed(&mut imposed, t, z, v, free.ruptured(), |strain| {
                strained += usize::from(strain.breaks());
            });
            assert_eq!(expected, found, "sample {i}");
        }
        assert_eq!((free.ruptured(), strained), (3, 3));
    }
}
