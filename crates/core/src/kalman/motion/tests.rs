use super::*;

const SPEED_MPS: f64 = 0.002;
const DRY_MPS: f64 = 0.01;

/// Friction drive after each of these travels at constant speed, 49 samples each; zero travel is a hold.
fn drives(law: FrictionLaw, travels_m: &[f64]) -> alloc::vec::Vec<f64> {
    let mut config = EnhanceConfig::default();
    config.stylet.friction_law = law;
    let mut stylet = KalmanEnhancer::new(&config, 0.0);
    stylet.in_tissue = true;
    let mut last = Sample::default();
    travels_m
        .iter()
        .map(|travel_m| {
            for _ in 0..49 {
                let sample = Sample {
                    time_s: last.time_s + 0.005,
                    position_m: last.position_m + travel_m / 49.0,
                    velocity_mps: if *travel_m == 0.0 { 0.0 } else { SPEED_MPS.copysign(*travel_m) },
                    force_n: 0.0,
                };
                let step = stylet.motion_step(&config, &last, &sample, false);
                stylet.update_friction_drive(&config, &step, &sample);
                last = sample;
            }
            stylet.friction_drive_mps
        })
        .collect()
}

fn assert_near(found: &[f64], expected: &[f64]) {
    let near = found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-9);
    assert!(near && found.len() == expected.len(), "{found:?} for {expected:?}");
}

#[test]
fn viscous_friction_follows_the_speed_and_dry_friction_its_sign() {
    let travels = [0.004, 0.0, -0.001, 0.002];
    for law in [FrictionLaw::Auto, FrictionLaw::Viscous] {
        assert_near(&drives(law, &travels), &[SPEED_MPS, 0.0, -SPEED_MPS, SPEED_MPS]);
    }
    let law = FrictionLaw::CoulombViscous { dry_mps: DRY_MPS };
    let both = SPEED_MPS + DRY_MPS;
    assert_near(&drives(law, &travels), &[both, 0.0, -both, both]);
}

#[test]
fn presliding_friction_builds_up_over_its_travel_and_persists_in_a_hold() {
    // xi' = (v/travel)(1 - xi sgn v): towards the direction of motion by exp(-x/travel).
    let travel_m = 0.001;
    let law = FrictionLaw::Presliding { dry_mps: DRY_MPS, travel_m };
    let faded = |x: f64| (-x / travel_m).exp();
    let first = 1.0 - faded(0.0005);
    let second = 1.0 - faded(0.003);
    let back = -1.0 + (second + 1.0) * faded(0.0007);
    let expected = [
        SPEED_MPS + DRY_MPS * first,
        SPEED_MPS + DRY_MPS * second,
        DRY_MPS * second,
        -SPEED_MPS + DRY_MPS * back,
    ];
    assert_near(&drives(law, &[0.0005, 0.0025, 0.0, -0.0007]), &expected);
}

use crate::kalman::test_support::{inside, near, sample};

#[test]
fn a_logged_start_is_accepted_if_the_force_shows_half_of_its_friction_or_more_than_noise() {
    let noise_n = 4.0 * libm::sqrt(2.0 * inside().noise.marginal_variance());
    assert!(0.03 < noise_n && noise_n < 0.115);
    // 115 N s/m at 10 mm: 0.23 N at 2 mm/s, 0.023 N at 0.2 mm/s.
    for (logged, jump_n, starts) in [
        (0.002, 1.01 * noise_n, true),
        (0.002, 0.99 * noise_n, false),
        (0.002, -0.12, false),
        (-0.002, -1.01 * noise_n, true),
        (-0.002, 0.12, false),
        (-0.002, -0.99 * noise_n, false),
        (0.0002, 0.012, true),
        (0.0002, 0.011, false),
        (1.1e-5, 0.12, true),
        (9e-6, 0.12, false),
    ] {
        let (last, moved) = (sample(0.01, 1.3), sample(0.01, 1.3 + jump_n));
        let moved = Sample { velocity_mps: logged, ..moved };
        let found = inside().resolve_motion_start(&last, &moved, 0.0, false);
        assert_eq!(found, if starts { (logged, true) } else { (0.0, false) }, "{logged} m/s, {jump_n} N");
        // No change for a moving needle or in air.
        assert_eq!(inside().resolve_motion_start(&last, &moved, 0.001, false), (0.001, false));
        let mut air = inside();
        air.in_tissue = false;
        assert_eq!(air.resolve_motion_start(&last, &moved, 0.0, true), (0.0, true));
    }
}

#[test]
fn a_step_is_the_difference_of_two_samples_and_the_speed_is_low_passed_in_motion() {
    let config = EnhanceConfig::default();
    let mut stylet = inside();
    let last = sample(0.01, 1.3);
    let at = |dt_s: f64, velocity_mps: f64| Sample {
        time_s: last.time_s + dt_s,
        position_m: 0.0103,
        velocity_mps,
        force_n: 1.4,
    };
    let step = stylet.motion_step(&config, &last, &at(0.01, 0.0032), true);
    near(step.dt_s, 0.01);
    near(step.dz_m, 3e-4);
    near(step.dv_mps, 0.0012);
    assert!(step.sudden && step.rho == 0.0);
    // Time constants: speed 0.2 s, force 50 ms, disagreement 2 s.
    near(step.speed_mps, 0.002 + 0.0012 * 0.01 / 0.21);
    assert_eq!(step.speed_mps, stylet.speed_mps);
    for (share, tau_s) in stylet.low_pass_gains[1..].iter().zip([0.2, 0.05, 2.0]) {
        near(*share, 0.01 / (0.01 + tau_s));
    }
    near(stylet.noise.interval_s, 0.0051);
    // The sign does not matter; at standstill the speed stays.
    let step = stylet.motion_step(&config, &last, &at(0.01, -0.0032), false);
    assert!(!step.sudden && step.speed_mps > 0.002);
    let before = stylet.speed_mps;
    stylet.motion_step(&config, &last, &at(0.01, 4e-5), false);
    assert_eq!(stylet.speed_mps, before);
    stylet.motion_step(&config, &last, &at(0.01, 6e-5), false);
    assert!(stylet.speed_mps < before);
    // The first speed initialises the low-pass, which has a lower bound.
    stylet.speed_mps = 0.0;
    let step = stylet.motion_step(&config, &last, &at(0.01, 4e-5), false);
    assert_eq!((stylet.speed_mps, step.speed_mps), (0.0, config.drop.standstill_mps));
    stylet.motion_step(&config, &last, &at(0.01, -0.0032), false);
    assert_eq!(stylet.speed_mps, 0.0032);
    // Rounded time stamps keep the gains, and so does a zero interval.
    let (shares, step_s) = (stylet.low_pass_gains, stylet.noise.interval_s);
    stylet.motion_step(&config, &last, &at(0.01 + 5e-10, 0.002), false);
    assert_eq!(stylet.low_pass_gains, shares);
    stylet.motion_step(&config, &last, &at(0.01 + 3e-9, 0.002), false);
    assert_ne!(stylet.low_pass_gains, shares);
    let (shares, was_s) = (stylet.low_pass_gains, stylet.noise.interval_s);
    assert!(was_s > step_s);
    let step = stylet.motion_step(&config, &last, &at(0.0, 0.002), false);
    assert_eq!((step.dt_s, stylet.low_pass_gains, stylet.noise.interval_s), (0.0, shares, was_s));
}

#[test]
fn noise_correlation_scales_with_the_step() {
    let mut stylet = inside();
    stylet.noise = crate::kalman::noise_estimator::NoiseEstimator::known(0.6, 4e-4, 0.0, 400.0);
    let last = sample(0.01, 1.3);
    let next = Sample { time_s: last.time_s + 0.01, ..last };
    let step = stylet.motion_step(&EnhanceConfig::default(), &last, &next, false);
    near(step.rho, stylet.noise.rho_over(0.01));
    assert!(step.rho > 0.4 && step.rho < 0.5);
}

#[test]
fn dry_friction_has_the_sign_of_the_velocity_and_vanishes_at_rest() {
    let step =
        |dz_m: f64| MotionStep { dt_s: 0.005, dz_m, dv_mps: 0.0, rho: 0.0, sudden: false, speed_mps: 0.0025 };
    let moving = |velocity_mps: f64| Sample { velocity_mps, ..Sample::default() };
    let mut config = EnhanceConfig::default();
    config.stylet.friction_law = FrictionLaw::CoulombViscous { dry_mps: DRY_MPS };
    for (v, xi) in [(1.1e-5, 1.0), (1e-5, 0.0), (9e-6, 0.0), (-9e-6, 0.0), (-1e-5, 0.0), (-1.1e-5, -1.0)] {
        let mut stylet = inside();
        stylet.update_friction_drive(&config, &step(1e-5), &moving(v));
        near(stylet.friction_drive_mps, v + DRY_MPS * xi);
        near(stylet.steady_drive_mps, 0.0125);
    }
    // Presliding builds up with travel inside tissue, in the direction of motion.
    config.stylet.friction_law = FrictionLaw::Presliding { dry_mps: DRY_MPS, travel_m: 2e-5 };
    let faded = (-0.5_f64).exp();
    for (v, dz_m, in_tissue, xi) in [
        (0.002, 1e-5, true, 1.0 - 0.7 * faded),
        (-0.002, -1e-5, true, -1.0 + 1.3 * faded),
        (0.002, -1e-5, true, 1.0 - 0.7 * faded),
        (0.002, 0.0, true, 0.3),
        (9e-6, 1e-5, true, 0.3),
        (0.002, 1e-5, false, 0.3),
    ] {
        let mut stylet = inside();
        (stylet.presliding_state, stylet.in_tissue) = (0.3, in_tissue);
        stylet.update_friction_drive(&config, &step(dz_m), &moving(v));
        near(stylet.presliding_state, xi);
        near(stylet.friction_drive_mps, v + DRY_MPS * xi);
    }
}
