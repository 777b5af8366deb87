//! Properties of any rigid arm, at the committed random states:
//! the mass matrix is symmetric and positive definite, `dM/dt = C + C^T`, momentum and power balance, and the
//! algorithms agree with each other.

use crate::common::{bias_torques, states};
use nalgebra::{Matrix3, SMatrix, Vector3, Vector6};
use stylet_dynamics::{
    Arm, ArmModel, EARTH_GRAVITY_MPS2, JointLimits, JointVector, Link, Pose, RigidBody, Tool, Wrench, panda,
};

type Matrix7 = SMatrix<f64, 7, 7>;

fn arm() -> Arm<7> {
    Arm::new(&panda::with_needle()).expect("valid")
}

/// Derivative along the motion by central differences of fourth order.
fn rate<T>(f: impl Fn(f64) -> T) -> T
where
    T: std::ops::Sub<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let h = 1e-3;
    ((f(h) - f(-h)) * 8.0 - (f(2.0 * h) - f(-2.0 * h))) * (1.0 / (12.0 * h))
}

/// Christoffel form of the Coriolis matrix, from Newton-Euler by polarisation.
fn coriolis(arm: &Arm<7>, q: &JointVector<7>, qd: &JointVector<7>) -> Matrix7 {
    let at = arm.at(q);
    let bias = |x: &JointVector<7>| bias_torques(&at, x, &Vector3::zeros());
    let mut c = Matrix7::zeros();
    for j in 0..7 {
        let mut unit = JointVector::<7>::zeros();
        unit[j] = 1.0;
        c.set_column(j, &((bias(&(qd + unit)) - bias(qd) - bias(&unit)) * 0.5));
    }
    c
}

#[test]
fn mass_matrix_is_symmetric_and_positive_definite() {
    for s in states() {
        let m = arm().at(&s.q).mass_matrix();
        assert_eq!(m, m.transpose());
        assert!(m.cholesky().is_some(), "{:?}", s.q);
    }
}

#[test]
fn mass_matrix_changes_by_the_coriolis_matrix_and_its_transpose() {
    let arm = arm();
    for s in states() {
        let m_dot = rate(|t| arm.at(&(s.q + s.qd * t)).mass_matrix());
        let c = coriolis(&arm, &s.q, &s.qd);
        let error = (m_dot - c - c.transpose()).amax();
        assert!(error < 1e-9, "{error:e}");
        let terms = arm.at(&s.q).momentum_terms(&s.qd, &EARTH_GRAVITY_MPS2);
        let error = (c.transpose() * s.qd - terms.coriolis_transposed_nm).amax();
        assert!(error < 1e-12, "{error:e}");
    }
}

#[test]
fn momentum_changes_by_torque_coriolis_and_gravity_terms_and_tip_wrench() {
    let arm = arm();
    for s in states() {
        let at = arm.at(&s.q);
        let tau = at.inverse_dynamics(&s.qd, &s.qdd, &EARTH_GRAVITY_MPS2, &s.wrench);
        let p_dot = rate(|t| {
            let qd = s.qd + s.qdd * t;
            arm.at(&(s.q + s.qd * t + s.qdd * (0.5 * t * t)))
                .momentum_terms(&qd, &EARTH_GRAVITY_MPS2)
                .momentum_nms
        });
        let terms = at.momentum_terms(&s.qd, &EARTH_GRAVITY_MPS2);
        let expected = tau + terms.coriolis_transposed_nm - terms.gravity_nm + at.joint_torques(&s.wrench);
        let error = (p_dot - expected).amax() / expected.amax();
        assert!(error < 1e-8, "{error:e}");
    }
}

#[test]
fn power_into_the_joints_and_the_tip_is_the_change_of_kinetic_and_potential_energy() {
    let arm = arm();
    for s in states() {
        let at = arm.at(&s.q);
        let tau = at.inverse_dynamics(&s.qd, &s.qdd, &EARTH_GRAVITY_MPS2, &s.wrench);
        let power = tau.dot(&s.qd) + s.wrench.to_vector().dot(&(at.jacobian() * s.qd));
        let m_dot = rate(|t| arm.at(&(s.q + s.qd * t)).mass_matrix());
        let kinetic = s.qd.dot(&(at.mass_matrix() * s.qdd)) + 0.5 * s.qd.dot(&(m_dot * s.qd));
        let potential = rate(|t| {
            let q = s.q + s.qd * t;
            potential_energy(&arm, &q)
        });
        assert!((power - kinetic - potential).abs() < 1e-7 * power.abs().max(1.0));
    }
}

fn potential_energy(arm: &Arm<7>, q: &JointVector<7>) -> f64 {
    let at = arm.at(q);
    let poses = at.link_poses();
    let model = arm.model();
    let links =
        model.links.iter().zip(poses).map(|(l, pose)| l.body.mass_kg * pose.transform_point(&l.body.com_m).z);
    let tool =
        model.tool.payload.in_parent_frame(&poses[6].compose(&model.flange).compose(&model.tool.mount));
    9.81 * (links.sum::<f64>() + tool.mass_kg * tool.com_m.z)
}

#[test]
fn the_single_pass_agrees_with_mass_matrix_and_inverse_dynamics() {
    let arm = arm();
    for s in states() {
        let at = arm.at(&s.q);
        let terms = at.momentum_terms(&s.qd, &EARTH_GRAVITY_MPS2);
        assert!((terms.momentum_nms - at.mass_matrix() * s.qd).amax() < 1e-13);
        let still = bias_torques(&at, &JointVector::zeros(), &EARTH_GRAVITY_MPS2);
        assert!((terms.gravity_nm - still).amax() < 1e-13);
        assert!((at.gravity_torques(&EARTH_GRAVITY_MPS2) - still).amax() < 1e-13);
    }
}

#[test]
fn jacobian_and_tip_acceleration_are_derivatives_of_the_tip_pose() {
    let arm = arm();
    for s in states() {
        let at = arm.at(&s.q);
        let along = |t: f64| arm.at(&(s.q + s.qd * t + s.qdd * (0.5 * t * t)));
        let twist = at.jacobian() * s.qd;
        let velocity = rate(|t| along(t).tip().position_m);
        assert!((velocity - twist.fixed_rows::<3>(0)).amax() < 1e-9);
        let turning = rate(|t| at.tip().rotation_vector_to(&along(t).tip()));
        assert!((turning - twist.fixed_rows::<3>(3)).amax() < 1e-9);
        let acceleration = rate(|t| along(t).jacobian() * (s.qd + s.qdd * t));
        assert!((acceleration - at.tip_acceleration(&s.qd, &s.qdd)).amax() < 1e-7);
    }
}

#[test]
fn the_wrench_comes_back_from_its_joint_torques() {
    let arm = arm();
    let mut checked = 0;
    for s in states() {
        let at = arm.at(&s.q);
        if at.singular_values().smallest() < 0.05 {
            continue;
        }
        checked += 1;
        let torque = at.joint_torques(&s.wrench);
        assert!((at.tip_wrench(&torque, 0.0).to_vector() - s.wrench.to_vector()).amax() < 1e-10);
        let force = Wrench::pure_force(s.wrench.force_n);
        let torque = at.joint_torques(&force);
        assert!((at.tip_point_force(&torque, 0.0) - force.force_n).amax() < 1e-10);
        // Damping 1e-3 costs at most (1e-3/sigma)^2.
        assert!(
            (at.tip_wrench(&torque, 1e-3).to_vector() - force.to_vector()).norm()
                < 4.1e-4 * force.force_n.norm()
        );
    }
    assert!(checked > 500, "{checked}");
}

#[test]
fn singular_values_are_those_of_the_jacobian() {
    let arm = arm();
    for s in states() {
        let at = arm.at(&s.q);
        let ours = at.singular_values();
        let theirs = at.jacobian().singular_values();
        for k in 0..6 {
            assert!((ours.sorted[k] - theirs[k]).abs() < 1e-13);
        }
        assert_eq!(ours.smallest(), ours.sorted[5]);
    }
}

#[test]
fn joint_rates_move_the_tip_as_asked() {
    let at_arm = arm();
    let at = at_arm.at(&panda::READY_RAD);
    let twist = Vector6::new(0.0, 0.0, -0.0023, 0.0, 0.0, 0.0);
    let qd = at.joint_rates(&twist, 0.0);
    assert!((at.jacobian() * qd - twist).amax() < 1e-15);
}

#[test]
fn a_two_joint_arm_has_the_textbook_mass_matrix() {
    let (l, m) = (0.4, 2.0);
    let link = |x| Link {
        placement: Pose::translation(x, 0.0, 0.0),
        body: RigidBody { mass_kg: m, com_m: Vector3::new(l, 0.0, 0.0), inertia_kgm2: Matrix3::zeros() },
        limits: JointLimits { lower_rad: -3.0, upper_rad: 3.0, velocity_radps: 1.0, torque_nm: 10.0 },
    };
    let model = ArmModel::<2> {
        links: [link(0.0), link(l)],
        flange: Pose::translation(l, 0.0, 0.0),
        tool: Tool::default(),
    };
    let arm = Arm::new(&model).expect("valid");
    let q2 = 0.7_f64;
    let m_of_q = arm.at(&JointVector::<2>::new(0.3, q2)).mass_matrix();
    let a = m * l * l;
    let expected = SMatrix::<f64, 2, 2>::new(
        a + 2.0 * a * (1.0 + q2.cos()),
        a * (1.0 + q2.cos()),
        a * (1.0 + q2.cos()),
        a,
    );
    assert!((m_of_q - expected).amax() < 1e-15);
}
