//! Promise: the kinematic replay and the rapier run give the same tissue force for the same position
//! and velocity, and the slide follows its command and feels the tissue.

use stylet_testbed::{NEEDLE_MASS_KG, Slide};
use stylet_tissue::{Law, LawState, Layer, PronyTerm, StressRelaxation, Tissue, TissueForce, replay};

const DT_S: f64 = 1e-3;

fn law() -> Law {
    let layer = |thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n| Layer {
        name: String::new(),
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n,
    };
    let tissue = Tissue {
        surface_m: 0.0,
        layers: vec![
            layer(0.0282, 40.0, 9000.0, None),
            layer(0.0377, 60.0, 12000.0, Some(2.2)),
            layer(0.0322, 80.0, 16000.0, None),
        ],
    };
    let relaxation = StressRelaxation { terms: vec![PronyTerm { fraction: 0.1, time_constant_s: 3.0 }] };
    Law::new(&tissue, &[relaxation.into()]).expect("one effect")
}

/// A commanded motion: rippled advance, then a retraction.
fn command(t: f64) -> (f64, f64) {
    let omega = std::f64::consts::TAU * 0.5;
    let turn = 40.0;
    if t < turn {
        (-0.005 + 0.003 * t + 0.001 / omega * (1.0 - (omega * t).cos()), 0.003 + 0.001 * (omega * t).sin())
    } else {
        (-0.005 + 0.003 * turn - 0.004 * (t - turn), -0.004)
    }
}

#[test]
fn replay_and_rapier_give_the_same_force_for_the_same_motion_bit_for_bit() {
    let law = law();
    let mut state = LawState::default();
    let mut slide = Slide::new(command(0.0).0, command(0.0).1, DT_S);
    let mut motion = Vec::new();
    let mut forces: Vec<TissueForce> = Vec::new();
    let mut ruptures = 0;
    for k in 0..50_000 {
        let t = f64::from(k) * DT_S;
        let (z, v) = slide.tip();
        let force = law.step(&mut state, t, z, v, |_| ruptures += 1);
        motion.push((t, z, v));
        forces.push(force);
        let (z, v) = command(t + DT_S);
        slide.step(z, v, force.total_n);
    }
    let mut replayed = Vec::new();
    replay(&law, motion, |_| {}, |f| replayed.push(f));
    assert_eq!(forces, replayed);
    assert_eq!(ruptures, 3, "the run must really have had its ruptures");
    assert!(forces.iter().any(|f| f.total_n < -1.0), "the run must really have been pulled back");
}

#[test]
fn the_slide_follows_a_smooth_command_within_twenty_micrometres_rms() {
    let law = law();
    let mut state = LawState::default();
    let mut slide = Slide::new(command(0.0).0, command(0.0).1, DT_S);
    let mut sum = 0.0;
    let mut steps = 0.0;
    for k in 0..39_000 {
        let t = f64::from(k) * DT_S;
        let (z, v) = slide.tip();
        sum += (z - command(t).0).powi(2);
        steps += 1.0;
        let force = law.step(&mut state, t, z, v, |_| {});
        let (z, v) = command(t + DT_S);
        slide.step(z, v, force.total_n);
    }
    let rms: f64 = f64::sqrt(sum / steps);
    println!("tracking error {:.2} um rms", rms * 1e6);
    assert!(rms < 20e-6, "{rms}");
}

#[test]
fn the_drive_force_is_the_tissue_force_plus_mass_times_acceleration() {
    let mut slide = Slide::new(0.0, 0.0, DT_S);
    let mut before = slide.tip().1;
    let mut worst = 0.0f64;
    for k in 0..2000 {
        let t = f64::from(k + 1) * DT_S;
        let tissue_n = 2.0 + (3.0 * t).sin();
        slide.step(0.001 * (1.0 - t.cos()), 0.001 * t.sin(), tissue_n);
        let v = slide.tip().1;
        let expected = tissue_n + NEEDLE_MASS_KG * (v - before) / DT_S;
        before = v;
        worst = worst.max((slide.drive_force_n() - expected).abs());
    }
    println!("drive force against tissue force plus m a: {worst:.1e} N at most");
    assert!(worst < 1e-9, "{worst}");
}
