//! The arm in joint coordinates moves like the same arm as a rapier multibody: tip, forces and torques of the shipped insertions agree.

use crate::common::{FILES, noiseless, with_arm};
use stylet_scenario::{ArmConfig, Robot, Scenario, Sensor};
use stylet_testbed::{ArmBody, ArmSimulation, ArmStep, JointSpaceArm, RapierArm};
use stylet_tissue::{ForceLaw, ForceLawState};

/// Every physics step of an insertion with the tissue force (N) at the tip.
fn insertion<Body: ArmBody>(scenario: &Scenario) -> Vec<(ArmStep, f64)> {
    let (Robot::Arm(config), Sensor::Both { virtual_sensor, .. }) = (&scenario.robot, &scenario.sensor)
    else {
        unreachable!("an arm with a virtual sensor");
    };
    let plan = scenario.motion.plan().expect("a motion");
    let line = config
        .insertion_line(&plan, 0.0, scenario.sample_hz, Some(virtual_sensor))
        .expect("a line that the arm can reach");
    let law = ForceLaw::new(&scenario.tissue, &scenario.effects).expect("a law");
    let dt_s = 1e-3;
    let mut state = ForceLawState::default();
    let mut simulation: ArmSimulation<Body> = ArmSimulation::new(
        config,
        Some(virtual_sensor),
        &line,
        &plan.at(0.0),
        plan.at(0.0).position_m,
        dt_s,
        1,
    )
    .expect("an arm");
    let steps = (plan.duration_s() / dt_s) as u32;
    (0..steps)
        .map(|k| {
            let time_s = f64::from(k) * dt_s;
            let mut force_n = 0.0;
            let tissue = |z: f64, v: f64| {
                force_n = law.step(&mut state, time_s, z, v, |_| {}).total_n;
                force_n
            };
            let step = simulation.step(&plan.at(time_s), true, tissue).expect("within the limits");
            (step, force_n)
        })
        .collect()
}

#[test]
fn the_shipped_insertions_agree_to_1e_6() {
    for file in FILES {
        let scenario = with_arm(file, ArmConfig::default(), noiseless(5.0));
        let ours = insertion::<JointSpaceArm>(&scenario);
        let rapier = insertion::<RapierArm>(&scenario);
        // Largest difference of any component as a share of the largest component.
        let compare = |name: &str, value: &dyn Fn(&(ArmStep, f64)) -> Vec<f64>| {
            let values = |steps: &[(ArmStep, f64)]| steps.iter().flat_map(value).collect::<Vec<f64>>();
            let (ours, rapier) = (values(&ours), values(&rapier));
            let scale = rapier.iter().map(|x| x.abs()).fold(0.0, f64::max);
            let worst = ours.iter().zip(&rapier).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            println!("{file}: {name} differs by {:.1e} of {scale:.3}", worst / scale);
            assert!(worst < 1e-6 * scale, "{file}, {name}: {worst:e} of {scale}");
        };
        compare("tip position", &|(step, _)| vec![step.position_m]);
        compare("tissue force", &|(_, force_n)| vec![*force_n]);
        compare("virtual sensor", &|(step, _)| vec![step.virtual_force_n.expect("a virtual sensor")]);
        compare("joint angles", &|(step, _)| step.q_rad.as_slice().to_vec());
        compare("joint torques", &|(step, _)| step.joint_torque_nm.as_slice().to_vec());
    }
}
