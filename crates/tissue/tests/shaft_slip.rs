//! Promise: `shaft_slip` is presliding far below its holding force, steady sliding by a power of the speed, and power-law
//! creep in a hold; `delayed_puncture`, `layer_coupling` and `release_depth` follow their equations.

use crate::common;
use common::*;
use proptest::prelude::*;
use stylet_tissue::*;

/// 10 mm of 300 N/m that rupture at 1.5 N, a thick layer without stiffness behind.
fn skin() -> Tissue {
    tissue(&[layer(0.01, 300.0, 20_000.0, Some(1.5)), layer(0.2, 0.0, 0.0, None)])
}

fn slip(exponent: f64) -> ShaftSlip {
    ShaftSlip {
        layer: 1,
        push_n: 1.0,
        pull_n: 0.6,
        retained_share: 0.7,
        exponent,
        curvature_n_per_m2: 2e4,
        ..ShaftSlip::default()
    }
}

/// In by `depth_m` at `speed_mps`, held for 5 s, back out, `rate` samples per second.
fn in_hold_out(depth_m: f64, speed_mps: f64, rate: f64) -> Vec<Sample> {
    let travel_s = depth_m / speed_mps;
    (0..((2.0 * travel_s + 5.0) * rate) as usize)
        .map(|k| k as f64 / rate)
        .map(|t| match t {
            t if t < travel_s => (t, speed_mps * t, speed_mps),
            t if t < travel_s + 5.0 => (t, depth_m, 0.0),
            t => (t, depth_m - speed_mps * (t - travel_s - 5.0), -speed_mps),
        })
        .collect()
}

#[test]
fn steady_sliding_force_is_the_hold_times_a_power_of_the_speed() {
    for (exponent, speed) in [(1.0, 2e-3), (4.0, 3e-3), (10.0, 1e-3), (10.0, 4e-3), (60.0, 2e-3)] {
        let effect = ShaftSlip { rate: -0.2, ..slip(exponent) };
        let motion = in_hold_out(0.1, speed, 100.0);
        let f = forces(&skin(), &[effect.clone().into()], &motion);
        let in_slides = (0.095 / speed * 100.0) as usize;
        near(f[in_slides], effect.plateau_n(speed), 1e-6);
        let out_slides = ((0.18 / speed + 5.0) * 100.0) as usize;
        near(f[out_slides], effect.plateau_n(-speed), 1e-6);
        assert!(f[in_slides] > 0.5 && f[out_slides] < -0.3);
    }
}

#[test]
fn far_below_its_holding_force_a_layer_is_a_spring() {
    // After a reversal the force follows the travel with the spring's stiffness, nearly without slip.
    let effect = ShaftSlip { curvature_n_per_m2: 0.0, ..slip(20.0) };
    let motion = in_hold_out(0.05, 2e-3, 200.0);
    let f = forces(&skin(), &[effect.into()], &motion);
    let turn = (30.3 * 200.0) as usize;
    let travelled = motion[turn].1 - motion[turn + 200].1;
    near(f[turn] - f[turn + 200], 300.0 * travelled, 2e-3 * 300.0 * travelled);
    assert!(f[turn] > 0.3 && f[turn + 200] > -0.35, "far from sliding: {} {}", f[turn], f[turn + 200]);
}

#[test]
fn in_a_hold_the_force_creeps_by_the_power_law() {
    // F' = -K v0 (F/L)^m: F^(1-m) grows with the time, linearly.
    let (k, m) = (300.0, 6.0);
    let effect = ShaftSlip { curvature_n_per_m2: 0.0, ..slip(m) };
    let motion = in_hold_out(0.05, 2e-3, 2000.0);
    let f = forces(&skin(), &[effect.into()], &motion);
    let stop = (25.0 * 2000.0) as usize;
    let after = |s: f64| f[stop + (s * 2000.0) as usize];
    let predicted =
        |s: f64| (after(0.01).powf(1.0 - m) + (m - 1.0) * k * 1e-3 * (s - 0.01)).powf(1.0 / (1.0 - m));
    for s in [0.1, 1.0, 4.0] {
        near(after(s), predicted(s), 2e-4);
    }
    assert!(after(4.0) < 0.9 * after(0.01), "it creeps");
}

#[test]
fn a_large_exponent_is_dry_friction() {
    let effect = ShaftSlip { retained_share: 1.0, ..slip(200.0) };
    let f = |speed| forces(&skin(), &[effect.clone().into()], &in_hold_out(0.05, speed, 100.0));
    let (slow, fast) = (f(1e-3), f(5e-3));
    // Five times the speed, the same force; in the hold it stays.
    near(slow[4500], fast[900], 0.01);
    near(slow[4500], 1.0, 0.01);
    assert!(slow[5400] > 0.96 * slow[4990], "{}", slow[5400]);
}

#[test]
fn a_rupture_leaves_the_retained_share_and_wear_lowers_the_plateau() {
    let motion = in_hold_out(0.05, 2e-3, 1000.0);
    let law = ForceLaw::new(&skin(), &[slip(10.0).into()]).expect("one effect");
    let (mut state, mut before, mut pair) = (ForceLawState::default(), 0.0, None);
    for (t, z, v) in &motion {
        let mut broke = false;
        let f = law.step(&mut state, *t, *z, *v, |_| broke = true).total_n;
        if broke {
            pair = Some((before, f));
        }
        before = f;
    }
    let (before, after) = pair.expect("it ruptures");
    near(before, 1.5, 0.01);
    near(after, 0.7, 1e-9);
    let worn = |wear_per_m| {
        let effect = ShaftSlip { wear_per_m, ..slip(10.0) };
        forces(&skin(), &[effect.into()], &motion)[24_900]
    };
    assert!(worn(20.0) < 0.7 * worn(0.0) && worn(1e4) > 0.19 * worn(0.0), "{} {}", worn(20.0), worn(0.0));
}

#[test]
fn relaxation_continues_through_the_rupture() {
    // All of the force relaxes in a hold, pressed or dragged; with shares of zero the time constants mean nothing.
    let relaxing = |g| ShaftSlip { fractions: [g, 0.0], time_constants_s: [0.5, 9.0], ..slip(200.0) };
    for depth in [0.0035, 0.006] {
        let motion = in_hold_out(depth, 2e-3, 200.0);
        let (f, ruptures) = run(&skin(), &[relaxing(0.4).into()], &motion);
        let f: Vec<f64> = f.iter().map(|f| f.total_n).collect();
        let stop = (depth / 2e-3 * 200.0) as usize;
        assert_eq!(ruptures.is_empty(), depth < 0.005);
        let (first, last) = (f[stop + 1], f[stop + 990]);
        assert!(last < 0.98 * first && last > 0.5 * first, "{first} {last}");
        let plain = forces(&skin(), &[slip(200.0).into()], &motion);
        assert_eq!(worst(&plain, &forces(&skin(), &[relaxing(0.0).into()], &motion)), 0.0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn the_force_hardly_depends_on_the_step_and_less_so_the_finer_it_is(
        exponent in 2.0..40.0_f64,
        speed in 1e-3..5e-3_f64,
        wear in 0.0..60.0_f64,
        fraction in 0.0..0.5_f64,
        curve in 0.0..1e5_f64,
    ) {
        let effect = ShaftSlip { wear_per_m: wear, fractions: [fraction, 0.3], curvature_n_per_m2: curve, ..slip(exponent) };
        let at = |rate: f64| {
            let all = forces(&skin(), &[effect.clone().into()], &in_hold_out(0.04, speed, rate));
            // A sample every fifth of a second, away from the rupture, the stop, the reversal and the end.
            let every = (0.2 * rate) as usize;
            let travel_s = 0.04 / speed;
            let quiet = |t: f64| {
                t > 0.01 / speed && (t - travel_s).abs() > 0.3 && (t - travel_s - 5.0).abs() > 0.1 && t < 2.0 * travel_s + 4.0
            };
            (0..).map_while(|k| all.get(k * every).copied()).enumerate()
                .filter(|(k, _)| quiet(*k as f64 * 0.2)).map(|(_, f)| f).collect::<Vec<f64>>()
        };
        let (fine, coarse, coarsest) = (at(2000.0), at(200.0), at(50.0));
        let n = fine.len().min(coarse.len()).min(coarsest.len());
        let (near, far) = (worst(&fine[..n], &coarse[..n]), worst(&fine[..n], &coarsest[..n]));
        prop_assert!(n > 20 && near < 0.02 && far < 0.15, "{near} {far}");
        prop_assert!(near < 0.7 * far + 1e-3, "{near} {far}");
    }

    #[test]
    fn the_force_is_finite_for_whatever_parameters_are_allowed(
        push in 0.0..1e4_f64,
        pull in 0.0..1e4_f64,
        retained in 0.0..2.0_f64,
        exponent in 1.0..200.0_f64,
        wear in 0.0..1e4_f64,
        curve in 0.0..1e9_f64,
    ) {
        let effect = ShaftSlip {
            push_n: push, pull_n: pull, retained_share: retained, exponent, wear_per_m: wear, curvature_n_per_m2: curve,
            fractions: [0.5, 0.5], time_constants_s: [1e-3, 1e4], ..ShaftSlip::default()
        };
        for rate in [10.0, 300.0] {
            let f = forces(&skin(), &[effect.clone().into()], &in_hold_out(0.03, 0.01, rate));
            prop_assert!(f.iter().all(|f| f.is_finite()));
        }
    }
}

#[test]
fn a_layer_with_delayed_puncture_ruptures_in_a_hold_at_full_damage() {
    let waits = |force_n, exponent| -> AnyEffect { DelayedPuncture { layer: 1, force_n, exponent }.into() };
    let motion = in_hold_out(0.004, 2e-3, 500.0); // 1.2 N in the hold: below the puncture force
    assert!(run(&skin(), &[], &motion).1.is_empty());
    let (_, ruptures) = run(&skin(), &[waits(1.6, 4.0)], &motion);
    // Damage in s: of the ramp 2 s (0.75)^4/5, then 0.75^4 a second.
    let rate = 0.75_f64.powi(4);
    near(ruptures[0].time_s, 2.0 + (1.0 - 0.4 * rate) / rate, 0.005);
    assert!(ruptures[0].by_force);
    // A large exponent is a threshold of the force, faces do not count.
    let deep = in_hold_out(0.03, 2e-3, 500.0);
    let (_, at_a_force) = run(&skin(), &[waits(4.5, 200.0)], &deep);
    near(at_a_force[0].position_m, 0.015, 3e-4);
    assert!((run(&skin(), &[], &deep).1[0].position_m - 0.005).abs() < 1e-9);
    // And faster means under more force.
    let force = |speed| run(&skin(), &[waits(1.0, 5.0)], &in_hold_out(0.03, speed, 500.0)).1[0].released_n;
    let (slow, fast): (f64, f64) = (force(1e-3), force(8e-3));
    near((fast / slow).ln() / 8.0_f64.ln(), 1.0 / 6.0, 0.01);
}

#[test]
fn a_layer_on_a_compliant_foundation_is_indented_by_less_than_the_travel() {
    let motion = in_hold_out(0.004, 2e-3, 100.0);
    let stiffness = |compliance_m_per_n, curvature_n_per_m2| {
        let soft = LayerCoupling { layer: 1, compliance_m_per_n };
        let effects = [soft.into(), ShaftSlip { curvature_n_per_m2, ..slip(10.0) }.into()];
        forces(&skin(), &effects, &motion)[200] / 0.004
    };
    near(stiffness(0.0, 0.0), 300.0, 1e-9);
    near(1.0 / stiffness(2e-3, 0.0), 1.0 / 300.0 + 2e-3, 1e-9);
    // With a curved spring the two travels still add up.
    let f = 0.004 * stiffness(2e-3, 5e4);
    let own = 0.004 - 2e-3 * f;
    near(f, 300.0 * own + 5e4 * own * own, 1e-9);
}

#[test]
fn a_layer_is_released_at_its_release_depth_in_retraction_only() {
    let motion = in_hold_out(0.03, 2e-3, 500.0);
    for (effects, within) in [(vec![], 1e-9), (vec![AnyEffect::from(slip(10.0))], 2e-4)] {
        let mut all = effects;
        all.push(ReleaseDepth { layer: 1, depth_m: 0.006 }.into());
        let with = forces(&skin(), &all, &motion);
        all.pop();
        let without = forces(&skin(), &all, &motion);
        let mut ended = false;
        for ((_, z, v), (a, b)) in motion.iter().zip(with.iter().zip(&without)) {
            if *v >= 0.0 || *z > 0.006 + within {
                assert_eq!(a, b);
            } else if *z < 0.006 {
                assert_eq!(*a, 0.0);
                ended |= *b < -0.05;
            }
        }
        assert!(ended, "without the effect it holds on");
    }
}
