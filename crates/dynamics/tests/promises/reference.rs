//! Joint torques, mass matrix and tip Jacobian of the Panda with sensor and needle agree with two
//! independent libraries, Pinocchio 4.1 and MuJoCo 4.0, within 1e-10 relative at 1000 random states; `C^T qd`
//! with Pinocchio's Coriolis matrix.
//!
//! Relative error of a quantity at a state: largest absolute difference of its entries over the largest
//! absolute entry. `cargo test -p stylet-dynamics --test promises reference -- --nocapture` prints the largest errors.

use crate::common;
use crate::common::{rows, states};
use stylet_dynamics::{Arm, EARTH_GRAVITY_MPS2, panda};

const TOLERANCE: f64 = 1e-10;

/// Ours at one state in the order of the files: torques 7, mass matrix 28, Jacobian 42, `C^T qd` 7.
fn ours(arm: &Arm<7>, state: &common::State) -> Vec<f64> {
    let at = arm.at(&state.q);
    let torque = at.inverse_dynamics(&state.qd, &state.qdd, &EARTH_GRAVITY_MPS2, &state.wrench);
    let mass = at.mass_matrix();
    let jacobian = at.jacobian();
    let coriolis = at.momentum_terms(&state.qd, &EARTH_GRAVITY_MPS2).coriolis_transposed_nm;
    let mut out: Vec<f64> = torque.iter().copied().collect();
    out.extend((0..7).flat_map(|i| (i..7).map(move |j| (i, j))).map(|at| mass[at]));
    out.extend(jacobian.transpose().iter());
    out.extend(coriolis.iter());
    out
}

fn compare(peer: &str, bytes: &[u8], quantities: &[(&str, std::ops::Range<usize>)]) {
    let width = quantities.last().map_or(0, |(_, range)| range.end);
    let arm = Arm::new(&panda::with_needle()).expect("valid");
    let mut worst = vec![0.0_f64; quantities.len()];
    for (state, theirs) in states().iter().zip(rows(bytes, width)) {
        let ours = ours(&arm, state);
        for ((name, range), worst) in quantities.iter().zip(&mut worst) {
            let (a, b) = (&ours[range.clone()], &theirs[range.clone()]);
            let size = b.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            assert!(size > 0.0, "{peer} {name}: an empty reference");
            let difference = a.iter().zip(b).fold(0.0_f64, |m, (x, y)| m.max((x - y).abs()));
            let error = difference / size;
            assert!(error <= TOLERANCE, "{peer} {name}: {error:e} at {state:?}");
            *worst = worst.max(error);
        }
    }
    for ((name, _), worst) in quantities.iter().zip(worst) {
        println!("{peer}, {name}: max relative error {worst:.1e}");
    }
}

#[test]
fn torques_mass_matrix_jacobian_and_coriolis_terms_agree_with_pinocchio() {
    compare(
        "Pinocchio",
        include_bytes!("../../reference/pinocchio.f64"),
        &[("torques", 0..7), ("mass matrix", 7..35), ("Jacobian", 35..77), ("C^T qd", 77..84)],
    );
}

#[test]
fn torques_mass_matrix_and_jacobian_agree_with_mujoco() {
    compare(
        "MuJoCo",
        include_bytes!("../../reference/mujoco.f64"),
        &[("torques", 0..7), ("mass matrix", 7..35), ("Jacobian", 35..77)],
    );
}

#[test]
fn the_comparison_notices_a_payload_that_is_a_gram_heavier() {
    let mut model = panda::with_needle();
    model.tool.payload.mass_kg += 1e-3;
    let arm = Arm::new(&model).expect("valid");
    let bytes = include_bytes!("../../reference/pinocchio.f64");
    let wrong = states().into_iter().zip(rows(bytes, 84)).filter(|(state, theirs)| {
        let ours = ours(&arm, state);
        let size = theirs[..7].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        (0..7).any(|i| (ours[i] - theirs[i]).abs() > TOLERANCE * size)
    });
    assert_eq!(wrong.count(), common::STATES);
}
