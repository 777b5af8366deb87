//! Joint friction opposes motion, has the measured size, and wrong coefficients are refused by name.

use stylet_dynamics::{
    Error, JointVector,
    friction::{FrictionLaw, JointFriction, SmoothSign},
    panda,
};

#[test]
fn measured_friction_opposes_motion_in_both_directions_and_vanishes_at_rest() {
    for friction in [panda::symmetric_friction(), panda::directional_friction()] {
        friction.validate().expect("measured values are valid");
        assert_eq!(friction.torques(&JointVector::zeros()).amax(), 0.0);
        // Within the dead band only the viscous part is left.
        assert!(friction.torques(&JointVector::repeat(1e-5)).max() < 2e-6);
        for qd in [0.005, 0.1, 1.0] {
            assert!(friction.torques(&JointVector::repeat(qd)).min() > 0.09);
            assert!(friction.torques(&JointVector::repeat(-qd)).max() < -0.09);
        }
    }
}

#[test]
fn directional_friction_takes_the_coefficients_of_its_direction() {
    let friction = panda::directional_friction();
    let forward = friction.torques(&JointVector::repeat(0.5));
    let backward = friction.torques(&JointVector::repeat(-0.5));
    assert!((forward[0] - (0.2294 + 0.5 * 0.1019)).abs() < 1e-12);
    assert!((backward[0] + 0.4466 + 0.5 * 0.0406).abs() < 1e-12);
    assert!((friction.scaled(0.5).torques(&JointVector::repeat(0.5)) * 2.0 - forward).amax() < 1e-15);
}

#[test]
fn sigmoid_friction_through_zero_is_coulomb_friction_of_half_its_amplitude() {
    let law = FrictionLaw::sigmoid_through_zero(1.37, 100.0, 0.0);
    let friction = JointFriction::<1> { joints: [law], sign: SmoothSign::default() };
    friction.validate().expect("valid");
    let at = |qd| friction.torques(&JointVector::<1>::new(qd))[0];
    assert_eq!(at(0.0), 0.0);
    assert!((at(1.0) - 0.685).abs() < 1e-12 && (at(-1.0) + 0.685).abs() < 1e-12);
    // Far outside the range of exp.
    assert!((at(1e6) - 0.685).abs() < 1e-12 && (at(-1e6) + 0.685).abs() < 1e-12);
}

#[test]
fn a_hard_sign_steps_at_the_dead_band() {
    let sign = SmoothSign { dead_band_radps: 0.01, width_radps: 0.0 };
    assert_eq!([-0.02, -0.01, 0.0, 0.01, 0.02].map(|x| sign.value(x)), [-1.0, 0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn friction_of_the_wrong_sign_is_refused_with_joint_and_parameter() {
    let mut friction = panda::directional_friction();
    if let FrictionLaw::CoulombViscous { negative, .. } = &mut friction.joints[3] {
        negative.viscous_nms_per_rad = -0.1;
    }
    let error = friction.validate().expect_err("negative");
    assert_eq!(
        error.to_string(),
        "`negative.viscous_nms_per_rad` of joint 4 is -0.1: must be zero or positive: friction opposes motion"
    );

    let mut friction = panda::symmetric_friction();
    friction.sign.width_radps = f64::NAN;
    assert!(matches!(friction.validate(), Err(Error::Parameter { name: "width_radps", .. })));
    friction = panda::symmetric_friction();
    friction.joints[0] = FrictionLaw::sigmoid_through_zero(1.0, -1.0, 0.0);
    assert!(matches!(
        friction.validate(),
        Err(Error::Parameter { name: "steepness_s_per_rad", joint: Some(1), .. })
    ));
    friction.joints[0] = FrictionLaw::symmetric(f64::INFINITY, 0.0);
    assert!(matches!(
        friction.validate(),
        Err(Error::Parameter { name: "positive.coulomb_nm", joint: Some(1), .. })
    ));
}
