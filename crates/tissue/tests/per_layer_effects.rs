//! Promise: the per-layer effects follow their equations, inactive ones leave the
//! base law bit for bit, and the special cases in which they become older effects hold.

use crate::common;
use common::*;
use stylet_tissue::*;

/// One layer of 10 mm with a puncture force, thick ground behind it.
fn skin() -> Tissue {
    tissue(&[layer(0.01, 100.0, 50_000.0, Some(0.8)), layer(0.05, 20.0, 0.0, None)])
}

fn holds(share: f64, delta_m: f64, time_constant_s: f64) -> AnyEffect {
    ViscoelasticPresliding { layer: 1, share, delta_m, time_constant_s, retained_share: 1.0, release_m: 0.0 }
        .into()
}

/// In to 20 mm at 2 mm/s, held for 5 s, back out at 2 mm/s.
fn in_hold_out() -> Vec<Sample> {
    (0..2700)
        .map(|k| f64::from(k) * 0.01)
        .map(|t| match t {
            t if t < 10.0 => (t, 0.002 * t, 0.002),
            t if t < 15.0 => (t, 0.02, 0.0),
            t => (t, 0.02 - 0.002 * (t - 15.0), -0.002),
        })
        .collect()
}

#[test]
fn inactive_effects_leave_the_base_law_bit_for_bit() {
    let inactive: [AnyEffect; 9] = [
        ShaftSlip { exponent: 3.0, curvature_n_per_m2: 1e5, fractions: [0.5, 0.1], ..ShaftSlip::default() }
            .into(),
        ShaftSlip { layer: 9, push_n: 2.0, pull_n: 1.0, ..ShaftSlip::default() }.into(), // there is no such layer
        DelayedPuncture { layer: 2, force_n: f64::INFINITY, exponent: 3.0 }.into(),
        LayerCoupling { layer: 1, compliance_m_per_n: 0.0 }.into(),
        ReleaseDepth { layer: 1, depth_m: 0.0 }.into(),
        DeepIndentation { reach_m: 0.0 }.into(),
        LayerStiffening { layer: 2, kappa_per_m: 0.0 }.into(),
        holds(0.0, 0.005, 2.0),
        LayerStiffening { layer: 9, kappa_per_m: 50.0 }.into(), // there is no such layer
    ];
    let base = run(&three_gels(), &[], &usual_motion());
    assert_eq!(run(&three_gels(), &inactive, &usual_motion()), base);
    for info in per_layer_effects() {
        let values: Vec<f64> = info.parameters.iter().map(|p| p.inactive).collect();
        let effect = AnyEffect::from_parameters(info.id, &values).expect("its own parameters");
        assert!(effect.is_inactive() && effect.check().is_ok(), "{}", info.id);
        assert_eq!(effect.parameters(), values);
        assert!(general_effects().all(|general| general.id != info.id));
        assert_eq!(stylet_tissue::effect_info(info.id), Some(info));
    }
}

#[test]
fn a_deeply_indented_layer_ruptures_by_force_behind_its_far_face() {
    let mut soft = skin();
    soft.layers[0].puncture_n = Some(1.4); // reached 14 mm in, 4 mm behind the far face
    let (_, at_the_face) = run(&soft, &[], &in_hold_out());
    assert!((at_the_face[0].position_m - 0.01).abs() < 1e-9 && !at_the_face[0].by_force);
    let (forces, deeper) = run(&soft, &[DeepIndentation { reach_m: 0.01 }.into()], &in_hold_out());
    assert!((deeper[0].position_m - 0.014).abs() < 1e-9 && deeper[0].by_force, "{deeper:?}");
    let highest = forces.iter().map(|f| f.elastic_n).fold(0.0, f64::max);
    near(highest, 1.4, 0.003);
}

#[test]
fn stiffening_of_each_layer_adds_to_that_of_all() {
    let block = block(30.0, 0.0);
    let one = forces(&block, &[LayerStiffening { layer: 1, kappa_per_m: 60.0 }.into()], &in_hold_out());
    let all = forces(&block, &[NonlinearElasticity { kappa_per_m: 60.0 }.into()], &in_hold_out());
    assert!(worst(&one, &all) < 1e-12 && all.iter().any(|f| *f > 1.0));
    let both = [
        LayerStiffening { layer: 1, kappa_per_m: 20.0 }.into(),
        NonlinearElasticity { kappa_per_m: 40.0 }.into(),
    ];
    assert!(worst(&forces(&block, &both, &in_hold_out()), &all) < 1e-12);
}

#[test]
fn a_punctured_layer_has_its_sliding_friction_presliding_after_reversal_and_a_release() {
    let motion = in_hold_out();
    let f = run(&skin(), &[holds(1.0, 0.004, 1e6)], &motion).0;
    let grip: Vec<f64> = f.iter().map(|f| f.friction_n).collect();
    // Punctured at 8 mm with 0.8 N, of which sliding friction holds b d v = 1 N: it keeps 0.8 N and rises.
    assert_eq!(grip[350], 0.0, "no friction before the puncture");
    near(grip[410], 0.8 + (0.0082 - 0.008) / 0.004, 0.02);
    near(grip[900], 1.0, 1e-12);
    near(grip[1490], 1.0, 1e-5); // a hold of 5 s is nothing to a creep of 1e6 s
    // Back by 4 mm: from 1 N to 0; by 8 mm: to -1 N, and there it slides.
    near(grip[1700], 0.0, 0.002);
    near(grip[1950], -1.0, 1e-12);
    // Released at the front face, 20 mm further back, at once.
    near(grip[2480], -1.0, 1e-12);
    assert_eq!(grip[2510], 0.0);
    // It is no part of the tip force.
    near(f[900].tip_n, f[900].total_n - grip[900], 1e-12);
}

#[test]
fn a_creeping_branch_fades_in_the_hold_with_its_time_constant_and_is_the_same_at_every_rate() {
    let motion = in_hold_out();
    let branches = [holds(0.6, 0.004, 1e6), holds(0.4, 0.004, 2.0)];
    let f = forces(&skin(), &branches, &motion);
    let elastic = 20.0 * 0.01; // the ground behind the skin
    let at_stop = f[999] - elastic;
    let share = at_stop - 0.6;
    assert!(share > 0.3, "{share}");
    near(f[1199] - elastic, 0.6 + share * (-2.0f64 / 2.0).exp(), 0.01);
    let coarse: Vec<Sample> = motion.iter().copied().step_by(5).collect();
    let every: Vec<f64> = f.iter().copied().step_by(5).collect();
    // In the step of the puncture the whole travel counts; it is forgotten once the layer slides.
    let slow = forces(&skin(), &branches, &coarse);
    assert!(worst(&every[130..], &slow[130..]) < 1e-3, "{}", worst(&every[130..], &slow[130..]));
}

#[test]
fn scaling_friction_and_puncture_changes_the_effects_with_such_parameters() {
    let waits = |force_n| AnyEffect::from(DelayedPuncture { layer: 2, force_n, exponent: 3.0 });
    let mut tough = waits(2.0);
    tough.scale_puncture(1, 1.5);
    assert_eq!(tough, waits(2.0), "another layer");
    tough.scale_puncture(2, 1.5);
    assert_eq!(tough, waits(3.0));
    let slip = |push_n, pull_n| AnyEffect::from(ShaftSlip { push_n, pull_n, ..ShaftSlip::default() });
    let mut rough = slip(2.0, 1.0);
    rough.scale_friction(1.5);
    assert_eq!(rough, slip(3.0, 1.5));
    // Others take what the layers hold.
    let mut other = holds(0.5, 0.004, 2.0);
    other.scale_friction(1.5);
    other.scale_puncture(1, 1.5);
    assert_eq!(other, holds(0.5, 0.004, 2.0));
}

#[test]
fn relaxing_shares_add_up_to_at_most_one_and_the_error_names_the_rest() {
    let relaxes = |fractions| AnyEffect::from(ShaftSlip { push_n: 1.0, fractions, ..ShaftSlip::default() });
    assert!(relaxes([0.75, 0.25]).check().is_ok());
    let error = relaxes([0.75, 0.5]).check().expect_err("more than the whole");
    assert_eq!((error.path, error.value, error.allowed), ("fractions.1", 0.5, (0.0, 0.25)));
    // In coordinates the second share is one of what the first leaves, so that any two are allowed.
    assert_eq!(relaxes([0.75, 0.125]).coordinates()[8..10], [0.75, 0.5]);
    assert_eq!(relaxes([1.0, 0.0]).coordinates()[8..10], [1.0, 0.0]);
    let whole = AnyEffect::from_coordinates("shaft_slip", &relaxes([0.75, 0.25]).coordinates());
    assert_eq!(whole, Some(relaxes([0.75, 0.25])));
    let term = |fraction| PronyTerm { fraction, time_constant_s: 1.0 };
    let prony = |first, second| AnyEffect::from(StressRelaxation { terms: vec![term(first), term(second)] });
    assert!(prony(0.75, 0.25).check().is_ok());
    assert_eq!(prony(0.75, 0.5).check().expect_err("more than the whole").allowed, (0.0, 0.25));
}

#[test]
fn damage_grows_with_the_mean_power_of_the_force_whatever_the_step() {
    // Damage 1 breaks the layer: of a ramp to 2 F_1 in T with exponent n, T 2^n/(n + 1) at its end.
    let layer = tissue(&[layer(0.5, 100.0, 0.0, None)]);
    for exponent in [1.0, 2.5, 8.0] {
        let seconds = (exponent + 1.0) / 2.0_f64.powf(exponent);
        for steps in [3, 400] {
            let effect = AnyEffect::from(DelayedPuncture { layer: 1, force_n: 0.5, exponent });
            let law = ForceLaw::new(&layer, &[effect]).expect("one effect");
            let (mut state, mut broke) = (ForceLawState::default(), None);
            for k in 0..=steps + 1 {
                // 1 N, which is 2 F_1, at 10 mm.
                let share = 1.000_001 * f64::from(k) / f64::from(steps);
                law.step(&mut state, seconds * share, 0.01 * share, 0.01 / seconds, |r| {
                    broke = broke.or(Some((k, r.time_s)))
                });
            }
            assert_eq!(broke.map(|b| b.0), Some(steps), "{exponent} {steps}");
        }
    }
}

#[test]
fn a_puncture_passes_the_retained_share_into_the_branch() {
    // 0.8 N are released at 8 mm, the shaft stands still there: what is retained of them holds, and creeps away with its time constant.
    let motion: Vec<Sample> = (0..=1600)
        .map(|k| f64::from(k) * 0.005)
        .map(|t| if t <= 4.001 { (t, 0.002_000_1 * t, 0.002_000_1) } else { (t, 0.008_002, 0.0) })
        .collect();
    for (share, retained) in [(0.5, 0.5), (1.0, 0.25), (0.8, 1.0)] {
        let delta_m = 0.05;
        let creeps = ViscoelasticPresliding {
            layer: 1,
            share,
            delta_m,
            time_constant_s: 2.0,
            retained_share: retained,
            release_m: 0.0,
        };
        let f = run(&skin(), &[creeps.into()], &motion).0;
        // Two steps of creep take 5 ms/2 s each, a little travel adds less.
        near(f[801].friction_n, share * retained * 0.8, 0.005);
        near(f[1201].friction_n / f[801].friction_n, (-1.0f64).exp(), 1e-9);
    }
}

#[test]
fn branch_force_follows_travel_to_first_order_however_small() {
    // Steps of a nanometre, a micrometre and a tenth of a millimetre: the hold's limit follows by 1 - exp(-travel/delta).
    for steps in [10, 10_000, 1_000_000] {
        let way = 0.001;
        let effect = holds(1.0, 0.004, 1e6);
        let law = ForceLaw::new(&skin(), &[effect]).expect("one effect");
        let mut state = ForceLawState::default();
        let mut at = |t: f64, z: f64, v: f64| law.step(&mut state, t, z, v, |_| {});
        // Slid in at 2 mm/s until it holds 1 N; then on at 1 mm/s, at which it slides at 0.5 N.
        for k in 0..=2000 {
            at(0.01 * f64::from(k), 2e-5 * f64::from(k), 0.002);
        }
        let mut force = 0.0;
        for k in 1..=steps {
            let share = f64::from(k) / f64::from(steps);
            force = at(20.0 + share, 0.04 + way * share, 0.001).friction_n;
        }
        near(force, 0.5 + 0.5 * (-way / 0.004).exp(), 1e-6);
    }
}
