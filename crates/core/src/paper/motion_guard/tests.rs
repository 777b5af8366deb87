use super::*;

const STANDSTILL_MPS: f64 = 5e-5;
const DT_S: f64 = 0.005;

/// Whether detection is disabled after each sample, starting at zero.
fn enabled(count: usize, mut v: impl FnMut(usize) -> f64) -> alloc::vec::Vec<bool> {
    let (config, mut guard, mut z) = (GuardConfig::default(), MotionGuard::default(), 0.0);
    let share = |tau_s: f64| 1.0 - (-DT_S / tau_s).exp();
    let shares = [share(config.acceleration_time_constant_s), share(SCATTER_TIME_CONSTANT_S)];
    (0..count)
        .map(|k| {
            let velocity_mps = v(k);
            z += velocity_mps * DT_S;
            let sample = Sample { velocity_mps, position_m: z, ..Sample::default() };
            if k == 0 {
                guard.start(&config, STANDSTILL_MPS, sample);
            } else {
                guard.update(&config, STANDSTILL_MPS, DT_S, shares, sample);
            }
            guard.allows_detection()
        })
        .collect()
}

/// First and last sample with detection disabled, and their number.
fn disabled_range(enabled: &[bool]) -> Option<(usize, usize, usize)> {
    let at = |i: Option<usize>| i.map(|i| i + 1);
    let first = at(enabled.iter().position(|q| !q))?;
    let last = at(enabled.iter().rposition(|q| !q))?;
    Some((first - 1, last - 1, enabled.iter().filter(|q| !**q).count()))
}

#[test]
fn detection_is_disabled_in_a_hold_and_a_quarter_of_a_second_after() {
    assert_eq!(disabled_range(&enabled(2000, |_| 0.0023)), None);
    let (first, last, count) =
        disabled_range(&enabled(2000, |k| if (500..900).contains(&k) { 0.0 } else { 0.0023 }))
            .expect("a hold");
    // 0.25 s are 50 samples; the filter of 10 ms delays by two.
    assert!((500..=504).contains(&first) && (945..=965).contains(&last), "{first} to {last}");
    assert_eq!(count, last + 1 - first);
}

#[test]
fn a_sudden_change_of_speed_disables_detection_and_a_gentle_one_does_not() {
    let (first, last, _) =
        disabled_range(&enabled(2000, |k| if k < 700 { 0.0023 } else { 0.0046 })).expect("a sudden change");
    // The change is 0.2 m/s² over the filter's 10 ms.
    assert!((700..=701).contains(&first) && (748..=770).contains(&last), "{first} to {last}");
    // 0.02 m/s² is below the limit of 0.05 m/s².
    let gentle = |k: usize| 0.0023 + 0.02 * DT_S * (k as f64 - 700.0).clamp(0.0, 100.0);
    assert_eq!(disabled_range(&enabled(2000, gentle)), None);
    // 0.09 m/s² is above it.
    let strong = |k: usize| 0.0023 + 0.09 * DT_S * (k as f64 - 700.0).clamp(0.0, 20.0);
    assert!(disabled_range(&enabled(2000, strong)).is_some());
}

#[test]
fn noise_on_the_speed_is_no_sudden_change_once_its_scatter_is_known() {
    let noisy = |k: usize| 0.0023 + 2e-4 * ((k * 7919 % 1009) as f64 / 504.0 - 1.0);
    let found = enabled(4000, noisy);
    assert!(found[2000..].iter().all(|q| *q));
    // A jump that exceeds the scatter is sudden.
    let found = enabled(4000, |k| noisy(k) + if k >= 3000 { 0.004 } else { 0.0 });
    let (first, ..) = disabled_range(&found[2000..]).expect("a sudden change");
    assert!((1000..=1001).contains(&first), "{first}");
}

#[test]
fn detection_is_disabled_until_the_tip_is_within_a_tenth_of_a_millimetre_of_its_deepest_point() {
    let (config, mut guard) = (GuardConfig::default(), MotionGuard::default());
    let sample = |position_m: f64| Sample { position_m, ..Sample::default() };
    guard.start(&config, STANDSTILL_MPS, sample(0.01));
    guard.start(&config, STANDSTILL_MPS, sample(0.008));
    assert!(guard.is_revisiting(&config, 0.0098) && !guard.is_revisiting(&config, 0.00995));
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{found} for {expected}");
}

/// Moving at 2 mm/s with this acceleration scatter in m/s².
fn moving(scatter_mps2: f64) -> MotionGuard {
    MotionGuard {
        raw_mps: 0.002,
        velocity_mps: 0.0021,
        acceleration_mps2: 0.03,
        scatter_mps2_squared: scatter_mps2 * scatter_mps2,
        deepest_m: 0.01,
        ..MotionGuard::default()
    }
}

#[test]
fn a_low_passed_acceleration_above_scatter_and_limit_is_sudden() {
    let config = GuardConfig::default();
    // Scatter, speed, and whether it is sudden: above six times the scatter and 0.05 m/s².
    for (scatter, v, sudden) in [
        (0.02, 0.0023, false),
        (0.0, 0.0023, false),
        (0.0, 0.00241, true),
        (0.0, 0.00239, false),
        (0.0, -0.0005, true),
        (0.02, 0.0032, false),
        (0.02, 0.0033, true),
        (0.007, 0.00241, true),
        (0.009, 0.00241, false),
    ] {
        let mut guard = moving(scatter);
        // Gain 2/5 for (v - 2 mm/s)/5 ms.
        let acceleration = 0.6 * 0.03 + 0.4 * (v - 0.002) / 0.005;
        let limit = f64::max(36.0 * scatter * scatter, 0.0025);
        let size = acceleration * acceleration;
        assert_eq!(guard.filter(&config, 0.005, 0.4, 0.1, v), sudden, "{scatter} m/s², {v} m/s");
        near(guard.velocity_mps, 0.6 * 0.0021 + 0.4 * v);
        near(guard.acceleration_mps2, acceleration);
        near(guard.scatter_mps2_squared, 0.9 * scatter * scatter + 0.1 * size.min(limit));
        assert!(!guard.steady);
    }
}

#[test]
fn a_motion_is_steady_from_settled_filters_to_the_next_change_of_speed() {
    let config = GuardConfig::default();
    let sample = |velocity_mps: f64| Sample { velocity_mps, position_m: 0.01, ..Sample::default() };
    let steady = MotionGuard {
        raw_mps: 0.002,
        velocity_mps: 0.002,
        acceleration_mps2: 0.0,
        scatter_mps2_squared: 0.0,
        ..MotionGuard::default()
    };
    for (guard, v, expected) in [
        (steady, 0.002, true),
        (MotionGuard { velocity_mps: 0.0021, ..steady }, 0.002, false),
        (MotionGuard { acceleration_mps2: 1e-9, ..steady }, 0.002, false),
        (MotionGuard { scatter_mps2_squared: 1e-9, ..steady }, 0.002, false),
        (steady, 0.0021, false),
    ] {
        let mut filtered = guard;
        filtered.filter(&config, DT_S, 0.4, 0.1, v);
        assert_eq!(filtered.steady, expected);
    }
    // Steady motion is not filtered, a changed one is.
    let mut guard = MotionGuard { acceleration_mps2: 0.01, steady: true, ..steady };
    guard.update(&config, STANDSTILL_MPS, DT_S, [0.4, 0.1], sample(0.002));
    assert_eq!(guard.acceleration_mps2, 0.01);
    guard.update(&config, STANDSTILL_MPS, DT_S, [0.4, 0.1], sample(0.0021));
    near(guard.acceleration_mps2, 0.006 + 0.4 * 0.02);
    assert_eq!(guard.raw_mps, 0.0021);
    guard.steady = false;
    guard.update(&config, STANDSTILL_MPS, DT_S, [0.4, 0.1], sample(0.0021));
    near(guard.acceleration_mps2, 0.6 * 0.014);
}

#[test]
fn detection_is_disabled_for_the_hold_off_time() {
    let config = GuardConfig::default();
    for (sudden, v, position_m, rests) in [
        (false, 0.002, 0.011, false),
        (true, 0.002, 0.011, true),
        (false, 4e-5, 0.011, true),
        (false, 5e-5, 0.011, false),
        (false, -0.002, 0.011, true),
        (false, 0.002, 0.00989, true),
        (false, 0.002, 0.00991, false),
    ] {
        let mut guard = MotionGuard { velocity_mps: v, deepest_m: 0.01, ..MotionGuard::default() };
        let sample = Sample { position_m, velocity_mps: 0.003, ..Sample::default() };
        guard.update_hold_off(&config, STANDSTILL_MPS, sudden, sample);
        assert_eq!(guard.allows_detection(), !rests, "{sudden} {v} m/s {position_m} m");
        assert_eq!((guard.raw_mps, guard.deepest_m), (0.003, position_m.max(0.01)));
        assert_eq!(guard.hold_off_s, if rests { 0.25 } else { 0.0 });
    }
    let mut guard = MotionGuard { hold_off_s: 0.011, steady: true, ..moving(0.0) };
    let sample = Sample { position_m: 0.01, velocity_mps: 0.002, ..Sample::default() };
    for enabled in [false, false, true] {
        guard.update(&config, STANDSTILL_MPS, DT_S, [0.4, 0.1], sample);
        assert_eq!(guard.allows_detection(), enabled);
    }
}

#[test]
fn a_needle_is_slowing_where_its_speed_falls_by_more_than_a_tenth_per_second() {
    let config = GuardConfig::default();
    for (v, a, slowing) in [
        (0.002, -1.9e-4, false),
        (0.002, -2.1e-4, true),
        (-0.002, -1.9e-4, false),
        (-0.002, -2.1e-4, true),
        (0.002, 2.1e-4, false),
        (0.0, 0.0, false),
    ] {
        let guard = MotionGuard { velocity_mps: v, acceleration_mps2: a, ..MotionGuard::default() };
        assert_eq!(guard.is_slowing(&config), slowing, "{v} m/s, {a} m/s²");
    }
}
