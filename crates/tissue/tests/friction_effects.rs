//! Promise: each friction effect follows its equation in docs/reference/model.md, and the special cases in which one
//! friction becomes another hold.

use crate::common;
use common::*;
use stylet_tissue::*;

#[test]
fn coulomb_friction_keeps_its_size_at_any_speed_and_flips_at_reversal() {
    let coulomb: AnyEffect = CoulombFriction { c_n_per_m: 5.0 }.into();
    let block = block(0.0, 0.0);
    let motion =
        [(0.0, 0.01, 0.001), (1.0, 0.02, 0.01), (2.0, 0.02, 0.0), (3.0, 0.02, 0.99e-5), (4.0, 0.015, -0.003)];
    let f = forces(&block, &[coulomb], &motion);
    for (force, expected) in f.iter().zip([0.05, 0.1, 0.0, 0.0, -0.075]) {
        near(*force, expected, 1e-15);
    }
}

#[test]
fn stribeck_friction_is_higher_at_low_speed_and_coulomb_when_both_levels_agree() {
    let stribeck = |c_static_n_per_m| {
        AnyEffect::from(StribeckFriction { c_n_per_m: 4.0, c_static_n_per_m, v_stribeck_mps: 0.002 })
    };
    let block = block(0.0, 0.0);
    let f = forces(&block, &[stribeck(6.0)], &[(0.0, 0.01, 0.002), (1.0, 0.01, -0.0001), (2.0, 0.01, 0.1)]);
    near(f[0], 0.01 * (4.0 + 2.0 * (-1.0f64).exp()), 1e-15);
    near(f[1], -0.01 * (4.0 + 2.0 * (-0.0025f64).exp()), 1e-15);
    near(f[2], 0.04, 1e-15);
    let coulomb = CoulombFriction { c_n_per_m: 4.0 }.into();
    assert_eq!(
        forces(&three_gels(), &[stribeck(4.0)], &usual_motion()),
        forces(&three_gels(), &[coulomb], &usual_motion())
    );
}

#[test]
fn presliding_friction_follows_the_travel_since_reversal_exactly_at_any_sampling() {
    let dahl: AnyEffect = PreslidingFriction { c_n_per_m: 10.0, delta_m: 0.002 }.into();
    // 10 mm in from the surface, 5 mm back; xi in closed form.
    let motion = |rate: f64, v: f64| -> Vec<Sample> {
        let n = (0.01 / v * rate).round() as usize;
        let back = n / 2;
        let there = (0..=n).map(|k| (k as f64 / rate, 0.01 * k as f64 / n as f64, v));
        let again = (1..=back).map(|k| ((n + k) as f64 / rate, 0.01 * (1.0 - k as f64 / n as f64), -v));
        there.chain(again).collect()
    };
    for (rate, v) in [(20.0, 0.001), (200.0, 0.001), (200.0, 0.01)] {
        let motion = motion(rate, v);
        let f = forces(&block(0.0, 0.0), std::slice::from_ref(&dahl), &motion);
        let turn = 1.0 - (-0.01f64 / 0.002).exp();
        for (&(_, z, vel), force) in motion.iter().zip(&f) {
            let xi = if vel > 0.0 {
                1.0 - (-z / 0.002).exp()
            } else {
                -1.0 + (turn + 1.0) * (-(0.01 - z) / 0.002).exp()
            };
            near(*force, 10.0 * xi * z, 1e-12);
        }
    }
}

#[test]
fn presliding_friction_stays_in_a_hold_and_does_not_build_up_in_air() {
    let dahl: AnyEffect = PreslidingFriction { c_n_per_m: 10.0, delta_m: 0.005 }.into();
    let motion =
        [(0.0, -0.05, 0.01), (5.0, 0.0, 0.01), (6.0, 0.01, 0.01), (7.0, 0.01, 0.0), (70.0, 0.01, 0.0)];
    let f = forces(&block(0.0, 0.0), &[dahl], &motion);
    assert_eq!(f[1], 0.0);
    let expected = 0.1 * (1.0 - (-2.0f64).exp());
    for force in &f[2..] {
        near(*force, expected, 1e-15);
    }
}

#[test]
fn presliding_friction_becomes_coulomb_friction_where_the_needle_slides() {
    let dahl = PreslidingFriction { c_n_per_m: 5.0, delta_m: 1e-7 }.into();
    let coulomb = CoulombFriction { c_n_per_m: 5.0 }.into();
    let motion = usual_motion();
    let (a, b) = (forces(&three_gels(), &[dahl], &motion), forces(&three_gels(), &[coulomb], &motion));
    let mut sliding = 0;
    for k in 1..motion.len() {
        let dz = motion[k].1 - motion[k - 1].1;
        if dz * motion[k].2 > 0.0 && dz.abs() > 5e-6 && motion[k].2.abs() > 2e-5 {
            near(a[k], b[k], 1e-12);
            sliding += 1;
        }
    }
    assert!(sliding > 2000, "most of the motion slides: {sliding}");
}

#[test]
fn asymmetric_friction_scales_every_layer_and_the_cumulative_friction_with_the_direction() {
    let asymmetric: AnyEffect = AsymmetricFriction { eps: 0.25 }.into();
    let motion = usual_motion();
    let (base, _) = run(&three_gels(), &[], &motion);
    let (with, _) = run(&three_gels(), &[asymmetric], &motion);
    for ((b, w), &(_, _, v)) in base.iter().zip(&with).zip(&motion) {
        let factor = if v > 1e-5 {
            1.25
        } else if v < -1e-5 {
            0.75
        } else {
            1.0
        };
        near(w.friction_n, b.friction_n * factor, 1e-12);
        near(w.cumulative_friction_ns_per_m, b.cumulative_friction_ns_per_m * factor, 1e-9);
        near(w.tip_n, w.total_n - w.cumulative_friction_ns_per_m * v, 1e-12);
    }
}

#[test]
fn power_law_friction_meets_the_base_law_at_1_mm_per_s_and_bends_around_it() {
    let power = |exponent| AnyEffect::from(PowerLawFriction { exponent });
    let block = block(0.0, 9000.0);
    let f = forces(
        &block,
        &[power(0.5)],
        &[(0.0, 0.01, 0.001), (1.0, 0.01, 0.004), (2.0, 0.01, -0.009), (3.0, 0.01, 0.0)],
    );
    for (force, expected) in f.iter().zip([0.09, 0.18, -0.27, 0.0]) {
        near(*force, expected, 1e-14);
    }
    // n -> 1 is the base law outside the dead band.
    let motion: Vec<Sample> = usual_motion().into_iter().filter(|m| m.2.abs() > 1e-5).collect();
    let almost = forces(&three_gels(), &[power(1.0 + 1e-12)], &motion);
    assert!(worst(&almost, &forces(&three_gels(), &[], &motion)) < 1e-9);
}

#[test]
fn frictions_compose_power_law_and_asymmetry_act_on_the_viscous_part_only() {
    let effects: [AnyEffect; 3] = [
        PowerLawFriction { exponent: 0.5 }.into(),
        AsymmetricFriction { eps: 0.2 }.into(),
        CoulombFriction { c_n_per_m: 5.0 }.into(),
    ];
    let f = forces(&block(0.0, 9000.0), &effects, &[(0.0, 0.01, 0.004), (1.0, 0.01, -0.004)]);
    near(f[0], 0.18 * 1.2 + 0.05, 1e-14);
    near(f[1], -0.18 * 0.8 - 0.05, 1e-14);
}
