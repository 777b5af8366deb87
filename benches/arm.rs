//! Time of a physics step of the arm: rapier's multibody, control, disturbance observer, tissue law
//! and virtual sensor; and MuJoCo's `mj_step` of the same arm (rigid bodies only) in the same
//! run, as a ratio.
//!
//! Run with `STYLET_PEERS_PYTHON=.../venv/bin/python cargo bench --bench arm`, the path being that of a
//! Python that has the package `mujoco`; without it the comparison is skipped, loudly.

use criterion::{Criterion, Throughput};
use nalgebra::Vector3;
use std::fmt::Write;
use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use stylet_dynamics::{Arm, EARTH_GRAVITY_MPS2, JointVector, RigidBody, panda};
use stylet_scenario::{ArmConfig, ArmInsertionLine, MotionPlan, Scenario, VirtualSensor};
use stylet_testbed::{ArmSimulation, RapierArm};
use stylet_tissue::{ForceLaw, ForceLawState};

const DT_S: f64 = 1e-3;
const STEPS: usize = 2000;
/// The bar for arm, control and observer together.
const BAR_US: f64 = 25.0;

struct Insertion {
    plan: MotionPlan,
    line: ArmInsertionLine,
    law: ForceLaw,
    sensor: VirtualSensor,
}

fn insertion() -> Result<Insertion, Box<dyn std::error::Error>> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/bovine_liver_constant_virtual.ron");
    let scenario = Scenario::load(&file)?;
    let plan = scenario.motion.plan().ok_or("the scenario has a motion")?;
    let sensor = VirtualSensor { torque_noise_nm: 0.0, ..VirtualSensor::default() };
    let line =
        ArmConfig::default().insertion_line(&plan, 0.0, 200.0, Some(&sensor)).map_err(|p| p.message)?;
    let law = ForceLaw::new(&scenario.tissue, &scenario.effects)?;
    Ok(Insertion { plan, line, law, sensor })
}

/// Everything: the arm carries the needle into the tissue, both observers listen; the virtual sensor's
/// force is asked for at every fifth step.
fn whole(i: &Insertion, sensor: bool) -> f64 {
    let first = i.plan.at(0.0);
    let sensor = sensor.then_some(&i.sensor);
    let config = ArmConfig::default();
    let rig = ArmSimulation::new(&config, sensor, &i.line, &first, first.position_m, DT_S, 1);
    let Ok(mut rig) = rig else { return f64::NAN };
    let mut state = ForceLawState::default();
    let mut sum = 0.0;
    for k in 0..STEPS {
        // From 2 s on: the tip enters the tissue on the way.
        let t = k as f64 * DT_S;
        let moment = rig
            .step(&i.plan.at(t), k % 5 == 0, |z, v| i.law.step(&mut state, t, z + 0.003, v, |_| {}).total_n);
        let Ok(moment) = moment else { return f64::NAN };
        sum += moment.virtual_force_n.unwrap_or(moment.position_m);
    }
    sum
}

/// rapier alone, under the torques that hold the arm's weight at the start.
fn rapier_alone(arm: &Arm<7>) -> f64 {
    let still = JointVector::zeros();
    let Ok(mut body) = RapierArm::new(arm, &panda::READY_RAD, &still, DT_S) else { return f64::NAN };
    let at = arm.at(&panda::READY_RAD);
    let (frames, tip) = (at.link_poses(), at.tip().position_m);
    let weight = at.gravity_torques(&EARTH_GRAVITY_MPS2);
    for _ in 0..STEPS {
        body.step(&frames, &weight, &tip, &Vector3::zeros());
    }
    body.joints().0.sum()
}

fn us_per_step(f: &mut dyn FnMut() -> f64) -> f64 {
    let start = Instant::now();
    black_box(f());
    start.elapsed().as_secs_f64() / STEPS as f64 * 1e6
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The same arm for MuJoCo: same masses, inertias and frames, gravity, step; explicit in the rates.
fn mjcf(arm: &Arm<7>) -> String {
    let model = arm.model();
    let mut xml = format!(
        "<mujoco><option timestep=\"{DT_S}\" gravity=\"0 0 -9.81\" integrator=\"Euler\"/>\
         <compiler angle=\"radian\" balanceinertia=\"false\"/><worldbody>"
    );
    for (i, link) in model.links.iter().enumerate() {
        let mut body: RigidBody = link.body;
        if i == 6 {
            let tool = model.flange.compose(&model.tool.mount);
            body = body.combined(&model.tool.payload.in_parent_frame(&tool));
        }
        let (p, r, c, m) =
            (link.placement.position_m, link.placement.rotation, body.com_m, body.inertia_kgm2);
        let _ = write!(
            xml,
            "<body pos=\"{} {} {}\" xyaxes=\"{} {} {} {} {} {}\"><joint type=\"hinge\" axis=\"0 0 1\"/>\
             <inertial pos=\"{} {} {}\" mass=\"{}\" fullinertia=\"{} {} {} {} {} {}\"/>",
            p.x,
            p.y,
            p.z,
            r[(0, 0)],
            r[(1, 0)],
            r[(2, 0)],
            r[(0, 1)],
            r[(1, 1)],
            r[(2, 1)],
            c.x,
            c.y,
            c.z,
            body.mass_kg,
            m[(0, 0)],
            m[(1, 1)],
            m[(2, 2)],
            m[(0, 1)],
            m[(0, 2)],
            m[(1, 2)],
        );
    }
    xml.push_str(&"</body>".repeat(7));
    xml.push_str("</worldbody></mujoco>");
    xml
}

/// Rounds of MuJoCo, us per step each.
fn mujoco(python: &str, arm: &Arm<7>) -> Result<Vec<f64>, Box<dyn std::error::Error>> {
    let file = std::env::temp_dir().join(format!("stylet-arm-{}.xml", std::process::id()));
    std::fs::write(&file, mjcf(arm))?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/mujoco_step.py");
    let start: Vec<String> = panda::READY_RAD.iter().map(f64::to_string).collect();
    let output = Command::new(python)
        .arg(&script)
        .arg(&file)
        .args([start.join(","), STEPS.to_string(), "5".to_owned()])
        .output();
    let _ = std::fs::remove_file(&file);
    let output = output?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    Ok(String::from_utf8_lossy(&output.stdout).lines().filter_map(|l| l.parse().ok()).collect())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let insertion = insertion()?;
    let arm = Arm::new(&panda::with_needle())?;

    let mut criterion = Criterion::default().configure_from_args();
    let mut group = criterion.benchmark_group("arm_2000_steps");
    group.throughput(Throughput::Elements(STEPS as u64));
    group.sample_size(20);
    group.bench_function("rapier_alone", |b| b.iter(|| rapier_alone(&arm)));
    group.bench_function("with_control", |b| b.iter(|| whole(&insertion, false)));
    group.bench_function("with_control_and_virtual_sensor", |b| b.iter(|| whole(&insertion, true)));
    group.finish();
    criterion.final_summary();

    let python = std::env::var("STYLET_PEERS_PYTHON").ok();
    let (mut alone, mut controlled, mut all, mut peer) = (vec![], vec![], vec![], vec![]);
    for _ in 0..12 {
        for _ in 0..3 {
            alone.push(us_per_step(&mut || rapier_alone(&arm)));
            controlled.push(us_per_step(&mut || whole(&insertion, false)));
            all.push(us_per_step(&mut || whole(&insertion, true)));
        }
        if let Some(python) = &python {
            peer.extend(mujoco(python, &arm)?);
        }
    }
    let best = all.iter().copied().fold(f64::INFINITY, f64::min);
    let (alone, controlled, all) = (median(alone), median(controlled), median(all));
    println!("arm, rapier alone: {alone:.1} us per step");
    println!("arm with control: {controlled:.1} us per step");
    println!(
        "arm with control and virtual sensor: {all:.1} us per step, median ({best:.1} best; bar {BAR_US} us)"
    );
    if peer.is_empty() {
        println!(
            "SKIPPED: the comparison with MuJoCo. Set STYLET_PEERS_PYTHON to a Python with the package `mujoco`."
        );
    } else {
        let peer = median(peer);
        println!(
            "MuJoCo mj_step of the same arm: {peer:.1} us per step; rapier alone {:.2} times that, all of ours {:.2} times",
            alone / peer,
            all / peer
        );
    }
    Ok(())
}
