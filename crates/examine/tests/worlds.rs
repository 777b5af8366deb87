//! Promises of the two worlds: the rich law with nothing in it is the plain one, the plain one follows the equations of the page,
//! events do not depend on the step, and the same seed gives the same case.

use stylet_examine::simulator::effect::Effect;
use stylet_examine::simulator::force_law::ForceLaw;
use stylet_examine::simulator::force_sensor::SensorModel;
use stylet_examine::simulator::insertion::{Insertion, simulate_insertion};
use stylet_examine::simulator::motion_path::{MotionPath, MotionPiece};
use stylet_examine::simulator::plain_world::PlainWorld;
use stylet_examine::simulator::rich_world::{
    Bending, Bristles, Damage, Foundation, Membrane, RichEffects, RichWorld, Tearing,
};
use stylet_examine::simulator::tissue::{Layer, Tissue};
use stylet_examine::{CaseId, Hide, Severity, Size, World, Wrong, make_case};

fn tissue() -> Tissue {
    let layer = |thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n| Layer {
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n,
    };
    Tissue {
        surface_m: 0.001,
        layers: vec![
            layer(0.025, 50.0, 9000.0, Some(0.9)),
            layer(0.030, 80.0, 12000.0, None),
            layer(0.028, 60.0, 7000.0, Some(1.3)),
        ],
    }
}

fn path() -> MotionPath {
    MotionPath::new(
        -0.004,
        vec![
            MotionPiece::constant(0.004, 5.0),
            MotionPiece::Move { speed_mps: 0.003, ripple_mps: 0.002, ripple_hz: 0.7, duration_s: 8.0 },
            MotionPiece::constant(0.0, 1.5),
            MotionPiece::constant(-0.003, 1.2),
            MotionPiece::constant(0.005, 9.0),
            MotionPiece::constant(0.0, 1.0),
            MotionPiece::constant(-0.006, 6.0),
        ],
    )
}

fn go(law: &mut dyn ForceLaw, step_s: f64) -> Insertion {
    let path = path();
    let at: Vec<f64> = (0..(path.duration_s() * 200.0) as usize).map(|k| k as f64 / 200.0).collect();
    simulate_insertion(law, &SensorModel::new(&[], 0.0), None, &path, &at, step_s)
}

fn largest(force: &[f64]) -> f64 {
    force.iter().fold(0.0, |m, f| f.abs().max(m))
}

/// The largest difference, apart from `jumps` samples on which a jump may fall.
fn differs(a: &[f64], b: &[f64], jumps: usize) -> f64 {
    let mut off: Vec<f64> = a.iter().zip(b).map(|(a, b)| (a - b).abs()).collect();
    off.sort_unstable_by(f64::total_cmp);
    off[off.len() - 1 - jumps]
}

#[test]
fn the_rich_law_with_nothing_in_it_is_the_plain_law() {
    let plain = go(&mut PlainWorld::new(&tissue(), &[]), 2e-4);
    let rich = go(&mut RichWorld::new(&tissue(), &RichEffects::default()), 2e-4);
    assert_eq!(plain.ruptures_s.len(), 3);
    for (a, b) in plain.ruptures_s.iter().zip(&rich.ruptures_s) {
        assert!((a - b).abs() < 1e-8, "{a} {b}");
    }
    let off = differs(&plain.force_n, &rich.force_n, 0);
    assert!(off < 1e-9 * largest(&plain.force_n), "{off}");
}

/// Effects that are present but nearly inactive: their contribution vanishes with their parameters.
#[test]
fn nearly_inactive_effects_leave_the_plain_force_within_a_thousandth() {
    let nearly = RichEffects {
        bristles: Some(Bristles { share: 1.0, delta_m: 1e-7, dry_mps: 0.0, creep_s: f64::INFINITY }),
        foundation: Some(Foundation { softness: 1e-5, lag_s: 0.1 }),
        damage: Some(Damage { exponent: 4000.0, time_s: 1e-3 }),
        tearing: Some(Tearing { steps: 3, travel_m: 1e-7 }),
        membrane: Some(Membrane { depth_m: 0.04, stiffness_n_per_m: 1e-3, puncture_n: 1.0 }),
        bending: Some(Bending { ratio: 0.1, compliance_m_per_n: 1e-5, length_m: 0.15, rubbing: 1e-4 }),
    };
    let plain = go(&mut PlainWorld::new(&tissue(), &[]), 2e-4);
    let rich = go(&mut RichWorld::new(&tissue(), &nearly), 2e-4);
    // Bristles do not jump with the speed: the sample on each of six borders of the motion is left out, and two ruptures'.
    let off = differs(&plain.force_n, &rich.force_n, 8);
    assert!(off < 1e-3 * largest(&plain.force_n), "{off} of {}", largest(&plain.force_n));
}

#[test]
fn every_rich_ingredient_changes_the_force() {
    let all = [
        RichEffects {
            bristles: Some(Bristles { share: 0.7, delta_m: 2e-3, dry_mps: 5e-4, creep_s: 4.0 }),
            ..RichEffects::default()
        },
        RichEffects { foundation: Some(Foundation { softness: 0.2, lag_s: 0.5 }), ..RichEffects::default() },
        RichEffects { damage: Some(Damage { exponent: 8.0, time_s: 0.5 }), ..RichEffects::default() },
        RichEffects { tearing: Some(Tearing { steps: 3, travel_m: 1e-3 }), ..RichEffects::default() },
        RichEffects {
            membrane: Some(Membrane { depth_m: 0.034, stiffness_n_per_m: 200.0, puncture_n: 0.6 }),
            ..RichEffects::default()
        },
        RichEffects {
            bending: Some(Bending { ratio: 0.1, compliance_m_per_n: 0.06, length_m: 0.15, rubbing: 0.5 }),
            ..RichEffects::default()
        },
    ];
    let plain = go(&mut PlainWorld::new(&tissue(), &[]), 2e-4);
    for with in all {
        let rich = go(&mut RichWorld::new(&tissue(), &with), 2e-4);
        assert_eq!(rich.ruptures_s.len(), 3, "{with:?}");
        let off = differs(&plain.force_n, &rich.force_n, 0);
        assert!(off > 0.05, "{with:?}: {off}");
        assert!(rich.force_n.iter().all(|f| f.is_finite()));
    }
}

/// The shaft's elements are a refinement, not a law: bristles that all began at the same depth follow one equation.
#[test]
fn steady_sliding_of_bristles_is_the_viscous_friction_of_the_page() {
    let with = RichEffects {
        bristles: Some(Bristles { share: 1.0, delta_m: 1e-3, dry_mps: 0.0, creep_s: f64::INFINITY }),
        ..RichEffects::default()
    };
    let path = MotionPath::new(0.0, vec![MotionPiece::constant(0.003, 40.0)]);
    let at: Vec<f64> = (0..200).map(|k| k as f64 * 0.2).collect();
    let none = SensorModel::new(&[], 0.0);
    let plain = simulate_insertion(&mut PlainWorld::new(&tissue(), &[]), &none, None, &path, &at, 2e-4);
    let rich = simulate_insertion(&mut RichWorld::new(&tissue(), &with), &none, None, &path, &at, 2e-4);
    // Far behind the stack every element has slid for long.
    let (a, b) = (plain.force_n[199], rich.force_n[199]);
    assert!(a > 1.0 && (a - b).abs() < 1e-6 * a, "{a} {b}");
}

#[test]
fn the_force_does_not_depend_on_the_step() {
    let effects = [
        Effect::StressRelaxation { terms: [(0.3, 1.0), (0.0, 1.0)] },
        Effect::RateDependentPuncture { alpha: 0.1 },
        Effect::PreslidingFriction { c_n_per_m: 5.0, delta_m: 5e-4 },
    ];
    let fine = go(&mut PlainWorld::new(&tissue(), &effects), 2e-5);
    let coarse = go(&mut PlainWorld::new(&tissue(), &effects), 2e-4);
    for (a, b) in fine.ruptures_s.iter().zip(&coarse.ruptures_s) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
    let off = differs(&fine.force_n, &coarse.force_n, 3);
    assert!(off < 1e-3 * largest(&fine.force_n), "{off}");
    // ... of a compliant needle after a rupture either.
    let bends = [Effect::NeedleCompliance { stiffness_n_per_m: 300.0 }];
    let fine = go(&mut PlainWorld::new(&tissue(), &bends), 2e-5);
    let coarse = go(&mut PlainWorld::new(&tissue(), &bends), 2e-4);
    let off = differs(&fine.force_n, &coarse.force_n, 0);
    assert!(off < 1e-3 * largest(&fine.force_n), "{off}");
}

/// A constant speed through one layer can be done by hand: `f = K x + b l v`, rupture at `F/K`.
#[test]
fn a_rupture_by_force_comes_where_the_page_says() {
    let one = Tissue {
        surface_m: 0.0,
        layers: vec![Layer {
            thickness_m: 0.03,
            stiffness_n_per_m: 50.0,
            friction_ns_per_m2: 10_000.0,
            puncture_n: Some(1.0),
        }],
    };
    let path = MotionPath::new(-0.004, vec![MotionPiece::constant(0.004, 8.0)]);
    let at: Vec<f64> = (0..1600).map(|k| k as f64 / 200.0).collect();
    let insertion = simulate_insertion(
        &mut PlainWorld::new(&one, &[]),
        &SensorModel::new(&[], 0.0),
        None,
        &path,
        &at,
        2e-4,
    );
    // At 20 mm: 1 s in air and 5 s in tissue.
    assert!((insertion.ruptures_s[0] - 6.0).abs() < 1e-8);
    let force = |t: f64| insertion.force_n[(t * 200.0) as usize];
    assert!((force(3.0) - (50.0 * 0.008 + 10_000.0 * 0.008 * 0.004)).abs() < 1e-12);
    assert!((force(7.0) - 10_000.0 * 0.024 * 0.004).abs() < 1e-12);
}

#[test]
fn the_same_seed_draws_the_same_case_and_another_another() {
    let id = |seed, severity| CaseId {
        world: World::Plain,
        wrong: Wrong::Thickness,
        severity,
        hide: Hide::One,
        size: Size::Strong,
        seed,
        index: 4,
    };
    let a = make_case(&id(1, Severity::Large)).expect("a case");
    let b = make_case(&id(1, Severity::Large)).expect("a case");
    assert_eq!(a.question, b.question);
    assert_ne!(
        a.question.recordings,
        make_case(&id(2, Severity::Large)).expect("a case").question.recordings
    );
    // A smaller severity leaves the assumed layers as they are.
    let small = make_case(&id(1, Severity::Small)).expect("a case");
    assert_eq!(a.setup.assumed, small.setup.assumed);
}
