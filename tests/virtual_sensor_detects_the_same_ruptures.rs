//! The paper's claim: without joint friction, force/torque sensor and virtual sensor detect the same two ruptures in liver and abdomen, without
//! false alarms. Its limit: with the joint friction of a Panda, a start from rest and a residual zeroed before the motion, the claim does not
//! hold.
//!
//! Table of the intermediate conditions: `cargo run --release -p stylet-reproduce --example virtual_sensor_table`.

use std::path::{Path, PathBuf};
use std::process::Command;
use stylet_scenario::{ArmFriction, Robot, Scenario, Sensor, ZeroWindow};
use stylet_score::{Score, score_run};
use stylet_testbed::simulate;

const FILES: [&str; 2] = ["bovine_liver_constant_virtual.ron", "abdomen_sinusoidal_virtual.ron"];

fn path(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(file)
}

fn scores(scenario: &Scenario, seed: u64) -> Vec<(&'static str, Score)> {
    let run = simulate(scenario, seed).expect("simulated");
    let layers = run.true_layers();
    run.readings
        .iter()
        .map(|reading| {
            let config = match reading.sensor {
                "virtual" => scenario.enhance_for_virtual(),
                _ => &scenario.enhance,
            };
            (reading.sensor, score_run(&run.recording, &reading.force_n, &run.truth, &layers, config).1)
        })
        .collect()
}

#[test]
fn liver_and_abdomen_show_two_ruptures_each_by_both_sensors() {
    for file in FILES {
        let scenario = Scenario::load(&path(file)).expect("valid");
        for seed in 1..=5 {
            let scores = scores(&scenario, seed);
            assert_eq!(scores.iter().map(|(s, _)| *s).collect::<Vec<_>>(), ["force_torque", "virtual"]);
            for (sensor, score) in scores {
                let delay_s = score.median_delay_s().expect("detections");
                println!("{file}, seed {seed}, {sensor}: delay {:.0} ms", delay_s * 1e3);
                assert_eq!(
                    (score.ruptures.len(), score.missed, score.false_alarms),
                    (2, 0, 0),
                    "{file} {sensor}"
                );
                assert!(if sensor == "virtual" { delay_s > 0.1 } else { delay_s < 0.02 }, "{delay_s}");
            }
        }
    }
}

#[test]
fn with_joint_friction_and_zeroing_at_rest_the_abdomen_has_false_alarms() {
    let mut scenario = Scenario::load(&path(FILES[1])).expect("valid");
    if let Robot::Arm(arm) = &mut scenario.robot {
        arm.joint_friction = ArmFriction::MeasuredDirectional;
    }
    let wrong = |scenario: &Scenario, sensor: &str| -> (usize, usize) {
        let scores = scores(scenario, 1);
        let score = &scores.iter().find(|(s, _)| *s == sensor).expect("it recorded").1;
        (score.missed, score.false_alarms)
    };
    assert_eq!(wrong(&scenario, "virtual"), (0, 0), "zeroed in motion, steady friction goes with the zero");
    if let Sensor::Both { virtual_sensor, .. } = &mut scenario.sensor {
        virtual_sensor.zero = ZeroWindow::AtRest { average_s: 0.5 };
    }
    assert!(wrong(&scenario, "virtual").1 > 5, "{:?}", wrong(&scenario, "virtual"));
    assert_eq!(wrong(&scenario, "force_torque"), (0, 0), "the force/torque sensor does not feel the joints");
}

#[test]
fn stylet_run_scores_both_sensors_and_repeats_itself_byte_for_byte() {
    let out = |name: &str| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        let run = Command::new(env!("CARGO_BIN_EXE_stylet"))
            .arg("run")
            .arg(path(FILES[1]))
            .arg("--out")
            .arg(&folder)
            .output()
            .expect("stylet runs");
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let text = String::from_utf8_lossy(&run.stdout).into_owned();
        assert!(text.contains("paper/ml/force_torque") && text.contains("paper/ml/virtual"), "{text}");
        assert!(text.contains("The virtual sensor lags by 0.19") || text.contains("lags by 0.2"), "{text}");
        ["score.json", "recording.csv", "report.html"]
            .map(|file| std::fs::read(folder.join(file)).expect("written"))
    };
    let once = out("arm_once");
    assert_eq!(once, out("arm_again"));
    let score: serde_json::Value = serde_json::from_slice(&once[0]).expect("JSON");
    for run in ["paper/ml/force_torque", "paper/ml/virtual"] {
        assert_eq!(score["runs"][run]["missed"], 0, "{run}");
    }
    assert!(score["virtual_sensor"]["lag_s"].as_f64().is_some_and(|lag| (lag - 0.2).abs() < 0.01));
    let header = String::from_utf8_lossy(&once[1]).lines().next().unwrap_or_default().to_owned();
    for column in ["force_virtual_n", "joint_torque_7_nm"] {
        assert!(header.contains(column), "{header}");
    }
}

#[test]
fn an_unreachable_line_ends_with_exit_code_two_before_anything_is_written() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("arm_unreachable");
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("unreachable.ron");
    let text = std::fs::read_to_string(path(FILES[0])).expect("readable");
    let text = text.replace("robot: Arm(", "robot: Arm(tip_m: (1.5, 0.0, 0.4), ");
    std::fs::write(&file, text).expect("writable");
    let run = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .arg("run")
        .arg(&file)
        .arg("--out")
        .arg(&folder)
        .output()
        .expect("stylet runs");
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert!(said.contains("robot.tip_m"), "{said}");
    assert!(!folder.exists());
}
