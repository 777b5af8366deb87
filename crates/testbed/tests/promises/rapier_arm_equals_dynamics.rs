//! The arm in rapier is the arm of `stylet-dynamics`: same mass matrix, same accelerations under joint torques, gravity and a force at the tip.
//! Virtual sensor and controller rely on it.

use nalgebra::{SMatrix, Vector3};
use stylet_dynamics::{Arm, EARTH_GRAVITY_MPS2, JointVector, Wrench, panda};
use stylet_testbed::{ArmBody, RapierArm};

/// A repeatable spread of states: additive recurrences over the inner ranges of the joints.
fn states() -> impl Iterator<Item = (JointVector<7>, JointVector<7>, JointVector<7>, Vector3<f64>)> {
    let arm = Arm::new(&panda::with_needle()).expect("valid");
    let limits = arm.limits();
    (1..=50).map(move |k| {
        let unit = |i: usize| (f64::from(k) * 0.618_033_988_75 * (1.0 + 0.137 * i as f64)).fract();
        let q = JointVector::<7>::from_fn(|i, _| {
            limits[i].lower_rad + (0.1 + 0.8 * unit(i)) * (limits[i].upper_rad - limits[i].lower_rad)
        });
        let qd = JointVector::<7>::from_fn(|i, _| 0.2 * (unit(i + 7) - 0.5));
        let torque = JointVector::<7>::from_fn(|i, _| 40.0 * (unit(i + 14) - 0.5));
        let push = Vector3::from_fn(|i, _| 20.0 * (unit(i + 21) - 0.5));
        (q, qd, torque, push)
    })
}

#[test]
fn rapier_uses_the_mass_matrix_of_the_dynamics_crate() {
    let arm = Arm::new(&panda::with_needle()).expect("valid");
    let mut worst = 0.0f64;
    for (q, qd, torque, push) in states() {
        let mut body = RapierArm::new(&arm, &q, &qd, 1e-3).expect("a chain");
        let at = arm.at(&q);
        body.step(&at, &torque, &push);
        let inverse = body.inverse_mass_matrix().expect("seven coordinates");
        let identity = inverse * at.mass_matrix();
        worst = worst.max((identity - SMatrix::<f64, 7, 7>::identity()).amax());
    }
    println!("inverse mass matrix of rapier times ours: off the identity by {worst:.1e}");
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn rapier_gives_the_accelerations_of_the_dynamics_crate_under_torques_gravity_and_a_tip_force() {
    let arm = Arm::new(&panda::with_needle()).expect("valid");
    // rapier's Coriolis terms are implicit in the step: the difference is of the order of the step.
    for (dt, bar) in [(1e-3, 1e-4), (1e-6, 1e-7)] {
        let (mut worst, mut size) = (0.0f64, 0.0f64);
        for (q, qd, torque, push) in states() {
            let mut body = RapierArm::new(&arm, &q, &qd, dt).expect("a chain");
            let at = arm.at(&q);
            body.step(&at, &torque, &push);
            let (q_after, qd_after) = body.joints();
            let bias = at.inverse_dynamics(
                &qd,
                &JointVector::zeros(),
                &EARTH_GRAVITY_MPS2,
                &Wrench::pure_force(push),
            );
            let expected = at.mass_matrix().cholesky().expect("positive definite").solve(&(torque - bias));
            worst = worst.max(((qd_after - qd) / dt - expected).amax());
            size = size.max(expected.amax());
            assert!((q_after - q - qd_after * dt).amax() < 1e-12, "semi-implicit step");
        }
        println!("accelerations at a step of {dt} s: off by {worst:.1e} of {size:.0} rad/s^2");
        assert!(worst < bar * size, "step {dt}: {worst:e} of {size}");
        assert!(size > 100.0, "the torques must really have moved the arm");
    }
}

#[test]
fn a_supported_arm_hangs_still() {
    let arm = Arm::new(&panda::with_needle()).expect("valid");
    let mut body = RapierArm::new(&arm, &panda::READY_RAD, &JointVector::zeros(), 1e-3).expect("a chain");
    for _ in 0..2000 {
        let (q, _) = body.joints();
        let at = arm.at(&q);
        body.step(&at, &at.gravity_torques(&EARTH_GRAVITY_MPS2), &Vector3::zeros());
    }
    let (q, qd) = body.joints();
    println!("after 2 s: moved {:.1e} rad, {:.1e} rad/s", (q - panda::READY_RAD).amax(), qd.amax());
    assert!((q - panda::READY_RAD).amax() < 1e-9 && qd.amax() < 1e-9);
}
