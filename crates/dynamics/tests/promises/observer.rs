//! The residual of the momentum observer converges to `J^T F` of an external wrench on the tip with time constant `1/G` during any motion, and contains
//! friction and model errors with the documented sign.

use crate::common::{bias_torques, forward_dynamics};
use nalgebra::Vector3;
use stylet_dynamics::{
    Arm, EARTH_GRAVITY_MPS2, Error, JointGain, JointVector, Observer, ObserverConfig, ObserverState, Wrench,
    friction::JointFriction, panda,
};

const DT: f64 = 1e-3;

/// A Panda held by a joint impedance around a moving target; torques are constant over a sample, motion by
/// Runge-Kutta.
struct SimulatedArm {
    arm: Arm<7>,
    friction: JointFriction<7>,
    swing: f64,
    t: f64,
    q: JointVector<7>,
    qd: JointVector<7>,
    torque: JointVector<7>,
}

impl SimulatedArm {
    fn new(swing: f64, friction: JointFriction<7>) -> Self {
        let arm = Arm::new(&panda::with_needle()).expect("valid");
        let q = panda::READY_RAD;
        let mut arm_sim =
            Self { arm, friction, swing, t: 0.0, q, qd: JointVector::zeros(), torque: JointVector::zeros() };
        arm_sim.qd = arm_sim.target(0.0).1;
        arm_sim
    }

    fn target(&self, t: f64) -> (JointVector<7>, JointVector<7>) {
        let w = 4.0;
        let swing = JointVector::<7>::from_fn(|i, _| self.swing * (1.0 - 0.1 * i as f64));
        (panda::READY_RAD + swing * (w * t).sin(), swing * (w * (w * t).cos()))
    }

    fn step(&mut self, tip: &Wrench) {
        let (q, qd) = self.target(self.t);
        let at = self.arm.at(&self.q);
        let pull = (q - self.q) * 400.0 + (qd - self.qd) * 40.0;
        self.torque = at.mass_matrix() * pull + bias_torques(&at, &self.qd, &EARTH_GRAVITY_MPS2);
        let f = |q: &JointVector<7>, qd: &JointVector<7>| {
            let net = self.torque - self.friction.torques(qd);
            forward_dynamics(&self.arm.at(q), qd, &net, tip)
        };
        let (q, qd, h) = (self.q, self.qd, DT);
        let a1 = f(&q, &qd);
        let (q2, v2) = (q + qd * (h / 2.0), qd + a1 * (h / 2.0));
        let a2 = f(&q2, &v2);
        let (q3, v3) = (q + v2 * (h / 2.0), qd + a2 * (h / 2.0));
        let a3 = f(&q3, &v3);
        let (q4, v4) = (q + v3 * h, qd + a3 * h);
        let a4 = f(&q4, &v4);
        self.q += (qd + (v2 + v3) * 2.0 + v4) * (h / 6.0);
        self.qd += (a1 + (a2 + a3) * 2.0 + a4) * (h / 6.0);
        self.t += DT;
    }

    fn observe(
        &self,
        assumed: &Arm<7>,
        observer: &Observer<7>,
        state: &mut ObserverState<7>,
    ) -> JointVector<7> {
        let terms = assumed.at(&self.q).momentum_terms(&self.qd, &EARTH_GRAVITY_MPS2);
        observer.step(state, &terms, &self.torque, DT).expect("finite")
    }
}

fn push() -> Wrench {
    Wrench { force_n: Vector3::new(1.0, -2.0, 5.0), moment_nm: Vector3::new(0.1, 0.0, -0.1) }
}

#[test]
fn residual_converges_to_the_joint_torques_of_a_tip_wrench_with_time_constant_one_over_gain() {
    for gain in [5.0, 50.0] {
        let observer = ObserverConfig { gain_per_s: JointGain::Uniform(gain) }.build().expect("valid");
        let mut state = ObserverState::default();
        let mut arm_sim = SimulatedArm::new(0.3, JointFriction::default());
        arm_sim.observe(&arm_sim.arm, &observer, &mut state);
        for _ in 0..500 {
            arm_sim.step(&Wrench::default());
            let r = arm_sim.observe(&arm_sim.arm, &observer, &mut state);
            assert!(r.amax() < 2e-3, "free motion: {r}"); // of torques up to 60 N m
        }
        assert!(arm_sim.qd.amax() > 0.1, "the arm must be moving");
        // The truth, low-passed: what the continuous observer shows.
        let mut low_passed = state.residual_nm();
        let mut worst = 0.0_f64;
        for k in 0..2000 {
            let before = arm_sim.arm.at(&arm_sim.q).joint_torques(&push());
            arm_sim.step(&push());
            let r = arm_sim.observe(&arm_sim.arm, &observer, &mut state);
            let truth = arm_sim.arm.at(&arm_sim.q).joint_torques(&push());
            low_passed += ((before + truth) * 0.5 - low_passed) * (1.0 - (-gain * DT).exp());
            worst = worst.max((r - low_passed).amax());
            if k + 1 == (1.0 / gain / DT) as usize {
                // After one time constant 63 %; the arm's pose has changed a little since the step.
                let reached = r.dot(&truth) / truth.norm_squared();
                assert!((reached - 0.632).abs() < 0.1, "gain {gain}: {reached}");
            }
        }
        assert!(worst < 2e-3, "gain {gain}: {worst:e} N m");
    }
}

#[test]
fn a_resting_arm_reads_the_tip_wrench_after_the_residual_has_settled() {
    let observer = ObserverConfig { gain_per_s: JointGain::Uniform(50.0) }.build().expect("valid");
    let mut state = ObserverState::default();
    let mut arm_sim = SimulatedArm::new(0.0, JointFriction::default());
    arm_sim.observe(&arm_sim.arm, &observer, &mut state);
    for _ in 0..3000 {
        arm_sim.step(&push());
        arm_sim.observe(&arm_sim.arm, &observer, &mut state);
    }
    let wrench = arm_sim.arm.at(&arm_sim.q).tip_wrench(&state.residual_nm(), 0.0);
    assert!((wrench.to_vector() - push().to_vector()).amax() < 1e-6, "{wrench:?}");
    assert!((wrench.component_along(&Vector3::z()) - 5.0).abs() < 1e-6);
}

#[test]
fn gains_per_joint_give_each_joint_its_own_time_constant() {
    let gains = [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0];
    let observer = ObserverConfig { gain_per_s: JointGain::PerJoint(gains) }.build().expect("valid");
    let arm = Arm::new(&panda::with_needle()).expect("valid");
    let at = arm.at(&panda::READY_RAD);
    let terms = at.momentum_terms(&JointVector::zeros(), &EARTH_GRAVITY_MPS2);
    let external = at.joint_torques(&push());
    let mut state = ObserverState::default();
    for _ in 0..=100 {
        // The arm stands still because the motors hold gravity and the push: what they see less is external.
        observer.step(&mut state, &terms, &(terms.gravity_nm - external), DT).expect("finite");
    }
    for (i, gain) in gains.iter().enumerate() {
        let expected = external[i] * (1.0 - (-gain * 0.1_f64).exp());
        assert!((state.residual_nm()[i] - expected).abs() < 1e-12);
    }
}

#[test]
fn a_large_gain_and_a_long_sample_stay_stable() {
    let observer = ObserverConfig { gain_per_s: JointGain::Uniform(1e4) }.build().expect("valid");
    let arm = Arm::new(&panda::with_needle()).expect("valid");
    let terms = arm.at(&panda::READY_RAD).momentum_terms(&JointVector::zeros(), &EARTH_GRAVITY_MPS2);
    let push = JointVector::<7>::repeat(1.0);
    let mut state = ObserverState::default();
    for _ in 0..1000 {
        let r = observer.step(&mut state, &terms, &(terms.gravity_nm - push), 0.01).expect("finite");
        assert!(r.amax() < 1.0 + 1e-12);
    }
    assert!((state.residual_nm() - push).amax() < 1e-12);
}

#[test]
fn friction_shows_as_external_torque_against_the_motion_and_a_heavier_link_as_a_static_one() {
    let observer = ObserverConfig { gain_per_s: JointGain::Uniform(200.0) }.build().expect("valid");
    let mut state = ObserverState::default();
    // Soft enough for an explicit simulation at 1 kHz (see `SmoothSign::width_radps`).
    let mut friction = panda::symmetric_friction();
    friction.sign.width_radps = 0.05;
    let mut arm_sim = SimulatedArm::new(0.3, friction);
    arm_sim.observe(&arm_sim.arm, &observer, &mut state);
    for _ in 0..200 {
        arm_sim.step(&Wrench::default());
        arm_sim.observe(&arm_sim.arm, &observer, &mut state);
    }
    let (r, friction) = (state.residual_nm(), arm_sim.friction.torques(&arm_sim.qd));
    assert!((r + friction).amax() < 0.03, "{r} {friction}");

    let assumed = Arm::new(&panda::with_needle().with_link_mass_scaled(0.9)).expect("valid");
    let mut state = ObserverState::default();
    let mut arm_sim = SimulatedArm::new(0.0, JointFriction::default());
    arm_sim.observe(&assumed, &observer, &mut state);
    for _ in 0..200 {
        arm_sim.step(&Wrench::default());
        arm_sim.observe(&assumed, &observer, &mut state);
    }
    let at = arm_sim.arm.at(&arm_sim.q);
    let missing =
        assumed.at(&arm_sim.q).gravity_torques(&EARTH_GRAVITY_MPS2) - at.gravity_torques(&EARTH_GRAVITY_MPS2);
    assert!(missing.amax() > 1.0);
    assert!((state.residual_nm() - missing).amax() < 1e-6);
}

#[test]
fn the_offset_taken_before_contact_removes_a_model_error_and_keeps_the_force() {
    let observer = ObserverConfig { gain_per_s: JointGain::Uniform(50.0) }.build().expect("valid");
    let assumed = Arm::new(&panda::with_needle().with_link_mass_scaled(0.97)).expect("valid");
    let mut state = ObserverState::default();
    let mut arm_sim = SimulatedArm::new(0.0, JointFriction::default());
    let run = |arm_sim: &mut SimulatedArm, state: &mut ObserverState<7>, samples: usize, tip: &Wrench| {
        for _ in 0..samples {
            arm_sim.step(tip);
            arm_sim.observe(&assumed, &observer, state);
        }
    };
    arm_sim.observe(&assumed, &observer, &mut state);
    run(&mut arm_sim, &mut state, 500, &Wrench::default());
    let biased = state.residual_nm();
    state.begin_offset();
    run(&mut arm_sim, &mut state, 200, &Wrench::default());
    let offset = state.finish_offset().expect("samples");
    assert!((offset - biased).amax() < 1e-6 && biased.amax() > 0.5);
    run(&mut arm_sim, &mut state, 2000, &push());
    let wrench = arm_sim.arm.at(&arm_sim.q).tip_wrench(&state.residual_nm(), 0.0);
    // The push moves the arm a little, and with it the gravity error.
    assert!((wrench.to_vector() - push().to_vector()).amax() < 0.05, "{wrench:?}");
}

#[test]
fn wrong_input_is_named_and_leaves_the_state_alone() {
    let refused = |gain| ObserverConfig::<7> { gain_per_s: gain }.build();
    assert!(matches!(
        refused(JointGain::Uniform(-1.0)),
        Err(Error::Parameter { name: "gain_per_s", joint: None, .. })
    ));
    assert!(matches!(
        refused(JointGain::Uniform(f64::NAN)),
        Err(Error::Parameter { name: "gain_per_s", .. })
    ));
    let mut gains = [5.0; 7];
    gains[2] = 0.0;
    assert!(matches!(refused(JointGain::PerJoint(gains)), Err(Error::Parameter { joint: Some(3), .. })));

    let observer = ObserverConfig::<7>::default().build().expect("valid");
    let arm = Arm::new(&panda::with_needle()).expect("valid");
    let terms = arm.at(&panda::READY_RAD).momentum_terms(&JointVector::zeros(), &EARTH_GRAVITY_MPS2);
    let mut state = ObserverState::default();
    observer.step(&mut state, &terms, &JointVector::zeros(), DT).expect("valid");
    let before = state.clone();
    let mut torque = JointVector::<7>::zeros();
    torque[4] = f64::NAN;
    let error = observer.step(&mut state, &terms, &torque, DT).expect_err("NaN");
    assert_eq!(error.to_string(), "`torque_nm` of joint 5 is NaN: must be a finite number");
    assert!(observer.step(&mut state, &terms, &JointVector::zeros(), 0.0).is_err());
    assert!(state.finish_offset().is_err());
    assert_eq!(state, before);
}
