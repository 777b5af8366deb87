//! The arm keeps the tip on its line, within 50 um RMS of the commanded position, in air, tissue and at ruptures, in any reachable direction.

use crate::common::{FILES, noiseless, with_arm};
use stylet_scenario::{ArmConfig, ArmController};
use stylet_testbed::simulate;

/// RMS and largest distance (m) from the command along the line, and the number of ruptures.
fn tracking(file: &str, arm: ArmConfig) -> (f64, f64, usize) {
    let scenario = with_arm(file, arm, noiseless(5.0));
    let plan = scenario.motion.plan().expect("a motion");
    let run = simulate(&scenario, 1).expect("simulated");
    let off: Vec<f64> = run
        .recording
        .time_s
        .iter()
        .zip(&run.recording.position_m)
        .map(|(t, z)| z - plan.at(*t).position_m)
        .collect();
    let rms = (off.iter().map(|e| e * e).sum::<f64>() / off.len() as f64).sqrt();
    (rms, off.iter().fold(0.0, |worst, e| worst.max(e.abs())), run.truth.ruptures.len())
}

#[test]
fn the_tip_stays_within_fifty_micrometres_rms_of_the_command_through_two_ruptures() {
    for file in FILES {
        let (rms, worst, ruptures) = tracking(file, ArmConfig::default());
        println!("{file}: {:.1} um rms, {:.1} um at most", rms * 1e6, worst * 1e6);
        assert!(rms < 50e-6, "{file}: {rms}");
        assert_eq!(ruptures, 2, "the run must really have had its ruptures");
    }
}

#[test]
fn a_slanted_line_is_followed_as_well() {
    let arm = ArmConfig {
        tip_m: Some([0.45, 0.1, 0.4]),
        direction: Some([0.3, -0.2, -1.0]),
        ..ArmConfig::default()
    };
    let (rms, worst, _) = tracking(FILES[0], arm);
    println!("slanted: {:.1} um rms, {:.1} um at most", rms * 1e6, worst * 1e6);
    assert!(rms < 50e-6, "{rms}");
}

#[test]
fn without_the_disturbance_observer_the_force_displaces_the_tip() {
    let controller = ArmController { disturbance_gain_per_s: 0.0, ..ArmController::default() };
    let (rms, _, _) = tracking(FILES[0], ArmConfig { controller, ..ArmConfig::default() });
    println!("without feed-forward: {:.0} um rms", rms * 1e6);
    assert!(rms > 50e-6, "the observer's share must be visible: {rms}");
}
