//! With an exact model the virtual sensor reports the tissue force after a first-order lag of `1/G`, to 20 mN RMS at 50 /s; with the paper's 5 /s
//! the lag of 0.2 s is reported.
//!
//! A lag is an error, too: a drop `D` within `T` seconds alone leaves `D sqrt(1/(2 G T))` RMS against
//! the raw truth, 42 mN for the liver's 2.3 N in 30 s at 50 /s. No observer of that gain comes below it. Compared are
//! the lagged truth, and the raw truth away from the ruptures.

use crate::common::{FILES, noiseless, with_arm};
use stylet_scenario::{ArmConfig, ArmFriction, VirtualSensor, ZeroWindow};
use stylet_testbed::{Simulation, VirtualSensorAccuracy, simulate};

fn run(file: &str, arm: ArmConfig, sensor: VirtualSensor) -> (Simulation, VirtualSensorAccuracy) {
    let run = simulate(&with_arm(file, arm, sensor), 1).expect("simulated");
    let error = run.virtual_sensor_accuracy.expect("a virtual sensor");
    (run, error)
}

/// RMS (N) against the raw truth without `around_s` after each rupture.
fn away_from_ruptures(run: &Simulation, around_s: f64) -> f64 {
    let sensed = run.recording.force_virtual_n.as_ref().expect("a virtual sensor");
    let squares: Vec<f64> = run
        .recording
        .time_s
        .iter()
        .zip(sensed.iter().zip(&run.truth.tissue_force_n))
        .filter(|(t, _)| !run.truth.ruptures.iter().any(|r| (0.0..around_s).contains(&(**t - r.time_s))))
        .map(|(_, (sensed, real))| (sensed - real) * (sensed - real))
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn at_fifty_per_second_the_axial_force_is_within_twenty_millinewtons_rms_of_the_lagged_truth() {
    for file in FILES {
        for noise in [0.0, 0.02] {
            let sensor = VirtualSensor { torque_noise_nm: noise, ..noiseless(50.0) };
            let (run, error) = run(file, ArmConfig::default(), sensor);
            let away_n = away_from_ruptures(&run, 0.2);
            println!(
                "{file}, joint torque noise {noise} N m: {:.1} mN rms against the raw truth, {:.1} mN without 0.2 s \
                 after each rupture, {:.1} mN against the truth lagged by {:.4} s",
                error.rms_n * 1e3,
                away_n * 1e3,
                error.lag_corrected_rms_n * 1e3,
                error.lag_s
            );
            assert!(error.lag_corrected_rms_n <= 0.020, "{file}: {error:?}");
            assert!(away_n <= 0.020, "{file}: {away_n}");
            assert!((error.lag_s - 0.02).abs() < 0.002, "{file}: {error:?}");
            assert_eq!(run.truth.ruptures.len(), 2, "the run must really have had its ruptures");
        }
    }
}

#[test]
fn at_five_per_second_the_force_lags_by_a_fifth_of_a_second() {
    for file in FILES {
        let (_, error) = run(file, ArmConfig::default(), VirtualSensor::default());
        println!("{file}: {error:?}");
        assert!((error.lag_s - 0.2).abs() < 0.01, "{file}: {error:?}");
        assert!(error.rms_n > 0.1, "the lag must be visible: {error:?}");
        assert!(error.lag_corrected_rms_n <= 0.020, "{file}: {error:?}");
    }
}

#[test]
fn joint_friction_and_a_payload_error_appear_unless_the_residual_is_zeroed() {
    let wrong = ArmConfig {
        joint_friction: ArmFriction::Measured,
        payload_error_kg: 0.05,
        link_mass_error: 0.01,
        ..ArmConfig::default()
    };
    let off = |zero: ZeroWindow| {
        run(FILES[0], wrong.clone(), VirtualSensor { zero, ..noiseless(5.0) }).1.lag_corrected_rms_n
    };
    let never = off(ZeroWindow::Never);
    let at_rest = off(ZeroWindow::AtRest { average_s: 0.5 });
    let in_motion = off(ZeroWindow::default());
    println!("never zeroed {never:.3} N, at rest {at_rest:.3} N, in motion {in_motion:.3} N");
    assert!(never > 1.0 && at_rest > 0.5, "friction of the measured size is of the size of the force");
    assert!(in_motion < 0.1 && in_motion < at_rest);
}

#[test]
fn joint_friction_does_not_act_on_the_motion_or_the_force_torque_sensor() {
    let (plain, _) = run(FILES[1], ArmConfig::default(), VirtualSensor::default());
    let friction = ArmConfig { joint_friction: ArmFriction::MeasuredDirectional, ..ArmConfig::default() };
    let (with_friction, _) = run(FILES[1], friction, VirtualSensor::default());
    assert_eq!(plain.recording.position_m, with_friction.recording.position_m);
    assert_eq!(plain.recording.force_n, with_friction.recording.force_n);
    assert_ne!(plain.recording.force_virtual_n, with_friction.recording.force_virtual_n);
    assert_eq!(plain.recording.joint_torque_nm.len(), plain.recording.len());
    plain.recording.check().expect("a recording like any other");
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
    let scenario = with_arm(FILES[1], ArmConfig::default(), VirtualSensor::default());
    let once = simulate(&scenario, 7).expect("simulated");
    // Samples before the zeroing are no numbers, which equal nothing: recordings are compared.
    let again = simulate(&scenario, 7).expect("simulated");
    assert_eq!(once.recording, again.recording);
    assert_eq!(once.truth, again.truth);
    let other = simulate(&scenario, 8).expect("simulated");
    assert_ne!(once.recording.force_virtual_n, other.recording.force_virtual_n);
    assert_ne!(once.recording.joint_torque_nm, other.recording.joint_torque_nm);
    assert_eq!(once.recording.position_m, other.recording.position_m, "noise belongs to the sensors");
}
