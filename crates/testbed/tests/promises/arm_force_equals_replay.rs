//! Kinematic replay and arm give the same tissue force for the same position and velocity, bit for bit.

use stylet_scenario::{ArmConfig, MotionPlan, Scenario};
use stylet_testbed::ArmSimulation;
use stylet_tissue::{ForceLaw, ForceLawState, TissueForce, replay};

#[test]
fn the_law_replayed_on_the_arms_motion_gives_the_arms_force() {
    let text = r#"Scenario(
        name: "two gels",
        tissue: (layers: [
            (thickness_m: 0.01, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0, puncture_n: 0.5),
            (thickness_m: 0.02, stiffness_n_per_m: 80.0, friction_ns_per_m2: 16000.0),
        ]),
        motion: Constant(start_m: -0.002, velocity_mps: 0.01, duration_s: 4.0),
        robot: Arm(),
    )"#;
    let scenario = Scenario::parse("gels.ron", text).expect("valid");
    let plan: MotionPlan = scenario.motion.plan().expect("a motion");
    let law = ForceLaw::new(&scenario.tissue, &scenario.effects).expect("no effects");
    let config = ArmConfig::default();
    let line = config.insertion_line(&plan, 0.0, 200.0, None).expect("reachable");
    let first = plan.at(0.0);
    let mut simulation: ArmSimulation =
        ArmSimulation::new(&config, None, &line, &first, first.position_m, 1e-3, 1).expect("an arm");

    let (mut state, mut ruptures) = (ForceLawState::default(), 0);
    let (mut motion, mut forces): (Vec<_>, Vec<TissueForce>) = (Vec::new(), Vec::new());
    for k in 0..4000 {
        let t = f64::from(k) * 1e-3;
        simulation
            .step(&plan.at(t), false, |z, v| {
                let force = law.step(&mut state, t, z, v, |_| ruptures += 1);
                motion.push((t, z, v));
                forces.push(force);
                force.total_n
            })
            .expect("on its line");
    }
    assert_eq!(ruptures, 2, "the run must really have had its ruptures");
    let mut replayed = Vec::new();
    replay(&law, motion, |_| {}, |f| replayed.push(f));
    assert_eq!(forces, replayed);
}
