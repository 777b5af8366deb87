//! The kinematic replay and the rapier simulation give the same tissue force for the same position and velocity, and the slide follows its command
//! under load.

use stylet_scenario::{Motion, Segment};
use stylet_testbed::{
    InsertionSample, NEEDLE_MASS_KG, SampleRates, Slide, simulate_on_slide, simulate_replay,
};
use stylet_tissue::{ForceLaw, ForceLawState, Layer, PronyTerm, StressRelaxation, Tissue, replay};

const DT_S: f64 = 1e-3;

fn law() -> ForceLaw {
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
    ForceLaw::new(&tissue, &[relaxation.into()]).expect("one effect")
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
    let program = Motion::Program {
        start_m: -0.005,
        segments: vec![
            Segment::Ripple {
                velocity_mps: 0.003,
                amplitude_mps: 0.001,
                frequency_hz: 0.5,
                duration_s: 40.0,
            },
            Segment::Hold { duration_s: 2.0 },
            Segment::Move { velocity_mps: -0.004, duration_s: 10.0 },
        ],
    };
    let plan = program.plan().expect("a motion of its own");
    // Every physics step is a sample, so that the replay sees the same motion as the law.
    let rates = SampleRates { sample_hz: 1000.0, steps_per_sample: 1, samples: 52_000 };
    let mut ruptures = 0;
    let mut on_slide: Vec<InsertionSample> = Vec::new();
    simulate_on_slide(&plan, &law, &rates, |_| ruptures += 1, |s| on_slide.push(*s));
    let mut forces = Vec::new();
    replay(
        &law,
        on_slide.iter().map(|s| (s.time_s, s.position_m, s.velocity_mps)),
        |_| {},
        |f| forces.push(f),
    );
    assert!(on_slide.iter().map(|s| s.force).eq(forces.iter().copied()));
    assert_eq!(ruptures, 3, "every layer has ruptured");
    assert!(forces.iter().any(|f| f.total_n < -1.0), "the needle has been retracted");
    let commanded = on_slide.iter().filter(|s| s.position_m == plan.at(s.time_s).position_m).count();
    assert!(
        commanded < on_slide.len() / 2,
        "the slide must really move under load, not exactly as commanded"
    );
}

#[test]
fn the_kinematic_replay_is_where_the_motion_commands_it_and_close_to_the_slide() {
    let law = law();
    let plan = Motion::Constant { start_m: -0.005, velocity_mps: 0.0023, duration_s: 46.0 }
        .plan()
        .expect("a motion");
    let rates = SampleRates { sample_hz: 200.0, steps_per_sample: 5, samples: 9200 };
    let (mut ideal, mut on_slide) = (Vec::new(), Vec::new());
    simulate_replay(
        &plan,
        &law,
        &rates,
        |r| ideal.push(r.time_s),
        |s| assert_eq!(s.position_m, plan.at(s.time_s).position_m),
    );
    simulate_on_slide(&plan, &law, &rates, |r| on_slide.push(r.time_s), |_| {});
    assert_eq!((ideal.len(), on_slide.len()), (3, 3));
    for (a, b) in ideal.iter().zip(&on_slide) {
        assert!((a - b).abs() < 0.02, "ruptures by replay {ideal:?}, on the slide {on_slide:?}");
    }
}

#[test]
fn the_slide_follows_a_smooth_command_within_a_tenth_of_a_micrometre_rms() {
    let law = law();
    let mut state = ForceLawState::default();
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
    assert!(rms < 1e-7, "{rms}");
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

#[test]
fn position_velocity_and_acceleration_of_a_sample_belong_to_the_same_time() {
    let program = Motion::Program {
        start_m: -0.005,
        segments: vec![
            Segment::Ripple {
                velocity_mps: 0.004,
                amplitude_mps: 0.003,
                frequency_hz: 2.0,
                duration_s: 10.0,
            },
            Segment::Hold { duration_s: 1.0023 },
            Segment::Move { velocity_mps: -0.004, duration_s: 5.0 },
        ],
    };
    let plan = program.plan().expect("a motion of its own");
    for steps_per_sample in [1, 5] {
        let sample_hz = 1000.0 / steps_per_sample as f64;
        let rates = SampleRates { sample_hz, steps_per_sample, samples: (16.0 * sample_hz) as usize };
        let mut moving = 0;
        simulate_on_slide(
            &plan,
            &law(),
            &rates,
            |_| {},
            |s| {
                let command = plan.at(s.time_s);
                let error = |what: f64, commanded: f64, limit: f64| {
                    assert!((what - commanded).abs() < limit, "{s:?}")
                };
                error(s.position_m, command.position_m, 1e-7);
                error(s.velocity_mps, command.velocity_mps, 1e-5);
                error(s.acceleration_mps2, command.acceleration_mps2, 1e-2);
                moving += usize::from(command.acceleration_mps2.abs() > 0.03);
            },
        );
        assert!(moving > 1000 / steps_per_sample, "{moving} samples with a changing velocity");
    }
}
