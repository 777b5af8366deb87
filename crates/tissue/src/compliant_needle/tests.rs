use super::*;
use crate::effects::{CoulombFriction, NeedleCompliance, PowerLawFriction};
use crate::layer::{Layer, Tissue};
use crate::{AnyEffect, ForceLawState};
use alloc::string::String;
use alloc::vec::Vec;

const NEEDLE_N_PER_M: f64 = 800.0;

/// Two layers of 10 and 20 mm under a needle that gives, the first ruptured, with the tip at 15 mm.
fn law(effects: &[AnyEffect]) -> (ForceLaw, ForceLawState) {
    let layer = |thickness_m, stiffness_n_per_m, friction_ns_per_m2| Layer {
        name: String::new(),
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n: None,
    };
    let tissue =
        Tissue { surface_m: 0.0, layers: alloc::vec![layer(0.01, 40.0, 5000.0), layer(0.02, 90.0, 7000.0)] };
    let mut all: Vec<AnyEffect> = effects.to_vec();
    all.push(NeedleCompliance { stiffness_n_per_m: NEEDLE_N_PER_M }.into());
    let state =
        ForceLawState { ruptured: 1, started: true, z_m: 0.015, v_mps: 0.004, ..ForceLawState::default() };
    (ForceLaw::new(&tissue, &all).expect("few effects"), state)
}

#[track_caller]
fn near(found: f64, wanted: f64, within: f64) {
    assert!((found - wanted).abs() <= within, "{found} instead of {wanted}");
}

#[test]
fn a_step_is_exact_for_an_exponentially_decaying_speed() {
    // v = exp(-t/tau) travels tau (1 - exp(-dt/tau)), which (1 - theta) v(0) + theta v(dt) has to be per unit of time.
    for ratio in [1e-6, 9e-4, 1.1e-3, 0.02, 0.5, 3.0, 40.0, 699.0] {
        let (end, travel) = (libm::exp(-ratio), -libm::expm1(-ratio) / ratio);
        let weight = theta(0.005 * ratio, 0.005);
        near(1.0 - weight + weight * end, travel, 1e-12);
        assert!((0.5..=1.0).contains(&weight), "{ratio}: {weight}");
    }
    // Short steps are the trapezoidal rule to second order; without friction it is backward Euler, in a step of no time, too.
    near(theta(6e-4, 1.0), 0.5 + 5e-5, 1e-11);
    assert_eq!([theta(701.0, 1.0), theta(0.1, 0.0), theta(0.0, 0.0)], [1.0; 3]);
}

#[test]
fn the_travel_is_the_weighted_mean_speed_and_a_step_of_zero_length_sets_the_position() {
    let step = Step { dt: 0.1, theta: 0.7, base_m: 9.0, from_m: 2.0, v_before: 3.0, lead_m: 0.25 };
    let (z, v) = step.tip(5.0);
    assert_eq!(v, 5.0);
    near(z, 2.0 + 0.25 + 0.1 * (0.3 * 3.0 + 0.7 * 5.0), 1e-15);
    assert_eq!(Step { dt: 0.0, ..step }.tip(5.0), (5.0, 3.0));
}

#[test]
fn a_search_evaluates_both_sides_of_a_dead_band_edge_before_crossing_it() {
    let step = Step { dt: 0.1, theta: 0.7, base_m: 0.0, from_m: 0.0, v_before: 0.0, lead_m: 0.0 };
    let edge = SGN_DEAD_BAND_MPS;
    for side in [1.0, -1.0] {
        // From outside to the inside or to the other side: just outside first, then the edge, which is inside.
        for target in [0.0, -side * 0.01] {
            assert_eq!(step.limit_to_dead_band_edge(side * 0.01, target), side * SLIDING_MPS);
            assert_eq!(step.limit_to_dead_band_edge(side * SLIDING_MPS, target), side * edge);
        }
        // The reverse, from inside to outside.
        assert_eq!(step.limit_to_dead_band_edge(0.3 * edge, side * 0.01), side * edge);
        assert_eq!(step.limit_to_dead_band_edge(side * edge, side * 0.01), side * SLIDING_MPS);
        assert!(sgn(side * edge) == 0.0 && sgn(side * SLIDING_MPS) == side);
        // On the same side, and in a step of zero length, the target stands.
        assert_eq!(step.limit_to_dead_band_edge(side * 0.01, side * 0.02), side * 0.02);
        assert_eq!(Step { dt: 0.0, ..step }.limit_to_dead_band_edge(side * 0.01, -side), -side);
    }
}

#[test]
fn resistance_is_the_friction_of_all_layers_and_the_stiffness_of_the_active_one() {
    let (law, mut state) = law(&[]);
    let resistance = |state: &ForceLawState| law.resistance(state);
    assert_eq!(resistance(&state), (5000.0 * 0.01 + 7000.0 * 0.005, 90.0));
    // The spring of the active layer acts behind its front face only, and not behind the last rupture.
    state.z_m = 0.01;
    assert_eq!(resistance(&state), (50.0, 0.0));
    state = ForceLawState { ruptured: 2, z_m: 0.02, ..state };
    assert_eq!(resistance(&state), (120.0, 0.0));
}

#[test]
fn the_slope_is_the_derivative_of_the_residual_where_the_force_increases() {
    let (law, mut state) = law(&[]);
    let base = Step { dt: 0.005, theta: 0.6, base_m: 0.017, from_m: 0.015, v_before: 0.004, lead_m: 0.0 };
    let mut residual = |step: &Step, u: f64| {
        let effect_states = state.effects;
        let force = law.trial(&mut state, step, u);
        state.effects = effect_states;
        step.tip(u).0 + force.total_n / NEEDLE_N_PER_M - step.base_m
    };
    // Advancing and gently retracting; in no time where the tip is anywhere in the stack or behind it.
    let in_time = [0.012, 0.0001, -0.002].map(|v| (base, v));
    let at_once = [0.004, 0.012, 0.029, 0.031].map(|z| (Step { dt: 0.0, ..base }, z));
    for (step, u) in in_time.into_iter().chain(at_once) {
        let h = 1e-7;
        let derivative = (residual(&step, u + h) - residual(&step, u - h)) / (2.0 * h);
        near(
            law.slope(&ForceLawState { ruptured: 1, ..ForceLawState::default() }, &step, u),
            derivative,
            1e-7 * derivative,
        );
    }
}

#[test]
fn where_the_force_decreases_with_depth_the_slope_is_that_of_friction_only() {
    let (law, state) = law(&[]);
    let step = Step { dt: 0.005, theta: 0.6, base_m: 0.017, from_m: 0.015, v_before: 0.0, lead_m: 0.0 };
    // Out of the tissue at 20 mm/s friction on the growing length outweighs the spring of 90 N/m.
    let u = -0.02;
    let friction = 5000.0 * 0.01 + 7000.0 * (step.tip(u).0 - 0.01);
    near(law.slope(&state, &step, u), 0.6 * 0.005 + friction / NEEDLE_N_PER_M, 1e-12);
}

#[test]
fn the_slip_speed_balances_friction_and_needle_force() {
    // 2 mm behind its base the tip is pressed with 1.6 N; 85 Ns/m rub, and the spring still holds 0.45 N.
    for (v_before, exponent, exact) in
        [(0.004, 1.0, true), (0.004, 1.5, true), (0.0, 3.0, true), (0.3, 1.7, true), (0.004, 0.6, false)]
    {
        let (law, state) = law(&[PowerLawFriction { exponent }.into()]);
        let mut at = ForceLawState { v_mps: v_before, ..state };
        let viscous = law.resistance(&state).0;
        let v = law.slip_speed(&mut at, 0.017, viscous);
        let left = 0.002 * NEEDLE_N_PER_M - 90.0 * 0.005 - 1e-3 * libm::pow(v / 1e-3, exponent) * viscous;
        if exact {
            near(left, 0.0, 1e-7);
        } else {
            // Friction that grows less than its speed: the plain speed stays.
            assert!(left > 0.1, "{left}");
        }
    }
}

#[test]
fn at_a_rupture_the_tip_keeps_its_position_and_gets_the_slip_speed() {
    let rupture = Rupture { layer: 2, time_s: 0.004, position_m: 0.0152, released_n: 0.4, by_force: true };
    let (mut law, state) = law(&[]);
    let gone = |law: &ForceLaw, state: ForceLawState| {
        let mut at = ForceLawState { ruptured: 2, dv_mps: 0.001, ..state };
        law.release_layer(&mut at, &rupture, 0.017, 0.009, 0.4);
        assert_eq!((at.z_m, at.time_s), (0.0152, 0.004));
        (at.v_mps, at.dv_mps)
    };
    // Friction of 50 + 7000 x 5.2 mm Ns/m takes over what the needle presses with, 1.8 mm behind its base.
    let (v, dv) = gone(&law, state);
    near(v, 0.0018 * NEEDLE_N_PER_M / (50.0 + 36.4), 1e-9);
    assert_eq!(dv, 0.0);
    // Without friction the tip keeps the interpolated speed, between 4 and 9 mm/s.
    for slab in &mut law.slabs {
        slab.friction_ns_per_m2 = 0.0;
    }
    let (v, dv) = gone(&law, state);
    near(v, 0.006, 1e-15);
    assert_eq!(dv, 0.001);
}

#[test]
fn the_force_of_a_sticking_tip_is_shared_in_proportion_to_the_jump() {
    let side = |friction_n, tip_extra_n, tip_n| TissueForce {
        total_n: friction_n + tip_extra_n,
        friction_n,
        tip_extra_n,
        tip_n,
        ..TissueForce::default()
    };
    // From -0.3 N of friction and 0.1 N at the tip to 0.9 and 0.5 N: 1.6 N in total, of which the tip force is 1 N.
    let sides = [side(-0.3, 0.1, 0.0), side(0.9, 0.5, 1.0)];
    for (from, total_n) in [(sides[0], 0.2), (sides[1], 0.2), (side(0.1, 0.3, 0.4), 0.2)] {
        let mut force = from;
        stick(&mut force, total_n, sides);
        let share = (total_n - from.total_n) / 1.6;
        near(force.friction_n, from.friction_n + share * 1.2, 1e-15);
        near(force.tip_extra_n, from.tip_extra_n + share * 0.4, 1e-15);
        near(force.tip_n, from.tip_n + share, 1e-15);
        assert_eq!(force.total_n, total_n);
    }
    // A rest that no jump explains is rounding; friction takes it.
    let mut force = sides[0];
    stick(&mut force, -0.15, [sides[0]; 2]);
    near(force.friction_n, -0.25, 1e-15);
    assert_eq!((force.tip_extra_n, force.tip_n, force.total_n), (0.1, 0.0, -0.15));
}

#[test]
fn a_balance_is_exact_or_the_tip_sticks_in_the_jump_of_dry_friction() {
    for (v_before, base_m, sticks) in [(0.004, 0.0165, false), (-0.004, 0.0145, false), (0.0, 0.015_45, true)]
    {
        let (law, state) = law(&[CoulombFriction { c_n_per_m: 20.0 }.into()]);
        let mut at = ForceLawState { v_mps: v_before, ..state };
        let step = Step { dt: 0.005, theta: 0.6, base_m, from_m: 0.015, v_before, lead_m: 0.0 };
        let balance = law.balance(&mut at, step);
        assert_eq!(balance.stuck.is_some(), sticks, "{base_m}");
        assert_eq!(step.tip(balance.v), (balance.z, balance.v));
        let spring = (base_m - balance.z) * NEEDLE_N_PER_M;
        match balance.stuck {
            Some((stuck, _)) => {
                near(stuck, spring, 0.0);
                assert!(balance.v.abs() <= SLIDING_MPS, "{}", balance.v);
            }
            None => near(law.trial(&mut at, &step, balance.v).total_n, spring, 1e-10),
        }
    }
}
