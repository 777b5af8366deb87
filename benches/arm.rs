//! Time of a physics step of the arm: dynamics in joint coordinates (and as a rapier multibody, the reference), control, disturbance observer,
//! tissue law and virtual sensor; and MuJoCo's `mj_step` of the same arm (rigid bodies only) in the same run, as a ratio.
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
use stylet_testbed::{ArmBody, ArmSimulation, JointSpaceArm, RapierArm};
use stylet_tissue::{ForceLaw, ForceLawState};

const DT_S: f64 = 1e-3;
const STEPS: usize = 2000;

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
fn whole<Body: ArmBody>(i: &Insertion, sensor: bool) -> f64 {
    let first = i.plan.at(0.0);
    let sensor = sensor.then_some(&i.sensor);
    let config = ArmConfig::default();
    let simulation = ArmSimulation::<Body>::new(&config, sensor, &i.line, &first, first.position_m, DT_S, 1);
    let Ok(mut simulation) = simulation else { return f64::NAN };
    let mut state = ForceLawState::default();
    let mut sum = 0.0;
    for k in 0..STEPS {
        // From 2 s on: the tip enters the tissue on the way.
        let t = k as f64 * DT_S;
        let arm_step = simulation
            .step(&i.plan.at(t), k % 5 == 0, |z, v| i.law.step(&mut state, t, z + 0.003, v, |_| {}).total_n);
        let Ok(arm_step) = arm_step else { return f64::NAN };
        sum += arm_step.virtual_force_n.unwrap_or(arm_step.position_m);
    }
    sum
}

/// The arm alone, under the torques that hold its weight at the start.
fn alone<Body: ArmBody>(arm: &Arm<7>) -> f64 {
    let still = JointVector::zeros();
    let Ok(mut body) = Body::new(arm, &panda::READY_RAD, &still, DT_S) else { return f64::NAN };
    let weight = arm.at(&panda::READY_RAD).gravity_torques(&EARTH_GRAVITY_MPS2);
    for _ in 0..STEPS {
        body.step(&arm.at(&body.joints().0), &weight, &Vector3::zeros());
    }
    body.joints().0.sum()
}

fn us_per_step(f: &dyn Fn() -> f64) -> f64 {
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
    group.bench_function("arm_alone", |b| b.iter(|| alone::<JointSpaceArm>(&arm)));
    group.bench_function("rapier_alone", |b| b.iter(|| alone::<RapierArm>(&arm)));
    group.bench_function("with_control", |b| b.iter(|| whole::<JointSpaceArm>(&insertion, false)));
    group.bench_function("with_control_and_virtual_sensor", |b| {
        b.iter(|| whole::<JointSpaceArm>(&insertion, true));
    });
    group.finish();
    criterion.final_summary();

    let python = std::env::var("STYLET_PEERS_PYTHON").ok();
    let works: [(&str, &dyn Fn() -> f64); 5] = [
        ("arm alone", &|| alone::<JointSpaceArm>(&arm)),
        ("rapier alone", &|| alone::<RapierArm>(&arm)),
        ("arm with control", &|| whole::<JointSpaceArm>(&insertion, false)),
        ("arm with control and virtual sensor", &|| whole::<JointSpaceArm>(&insertion, true)),
        ("the same with rapier", &|| whole::<RapierArm>(&insertion, true)),
    ];
    let (mut times, mut peer) = (vec![vec![]; works.len()], vec![]);
    for _ in 0..12 {
        for _ in 0..3 {
            for (work, times) in works.iter().zip(&mut times) {
                times.push(us_per_step(work.1));
            }
        }
        if let Some(python) = &python {
            peer.extend(mujoco(python, &arm)?);
        }
    }
    for ((name, _), times) in works.iter().zip(&times) {
        println!("{name}: {:.2} us per step, median", median(times.clone()));
    }
    if peer.is_empty() {
        println!(
            "SKIPPED: the comparison with MuJoCo. Set STYLET_PEERS_PYTHON to a Python with the package `mujoco`."
        );
    } else {
        let peer = median(peer);
        println!("MuJoCo mj_step of the same arm: {peer:.2} us per step");
        for ((name, _), times) in works.iter().zip(&times) {
            println!("{name}: {:.2} times mj_step", median(times.clone()) / peer);
        }
    }
    Ok(())
}
