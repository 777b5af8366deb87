use super::*;
use alloc::vec::Vec;

const DT_S: f64 = 0.005;

impl VelocityEstimator {
    /// With a log identified as smoothed.
    pub(in super::super) fn known_late() -> Self {
        Self { accurate_positions: true, smoothed_log: true, ..Self::default() }
    }
}

/// After the first sample.
fn started(velocity_mps: f64) -> (VelocityEstimator, Sample) {
    let (mut velocity, first) = (VelocityEstimator::default(), Sample { velocity_mps, ..Sample::default() });
    assert_eq!(velocity.update(&first, &first, 0.0, 0.0), (velocity_mps, false));
    (velocity, first)
}

/// Estimates for each sample of a motion and its log.
fn estimates(
    motion_mps: impl Fn(usize) -> f64,
    logged_mps: impl Fn(usize) -> f64,
    count: usize,
) -> Vec<(f64, bool)> {
    let (mut velocity, mut last) = started(logged_mps(0));
    let mut found = Vec::new();
    for k in 1..count {
        let v = 0.5 * (motion_mps(k - 1) + motion_mps(k));
        let sample = Sample {
            time_s: DT_S * k as f64,
            position_m: last.position_m + v * DT_S,
            velocity_mps: logged_mps(k),
            force_n: 0.0,
        };
        found.push(velocity.update(&last, &sample, 0.002, DT_S / (DT_S + DISAGREEMENT_MEMORY_S)));
        last = sample;
    }
    found
}

#[test]
fn a_logged_velocity_that_agrees_with_the_positions_is_used() {
    let v = |k: usize| 0.002 + 0.001 * (0.05 * k as f64).sin();
    for (k, (found, disagree)) in estimates(v, v, 1000).into_iter().enumerate() {
        assert_eq!((found, disagree), (v(k + 1), false));
    }
}

#[test]
fn after_a_delayed_log_positions_are_used() {
    // A step from 2 to 4 mm/s at sample 500, logged with a first-order lag of 10 samples, and one back at 700.
    let v = |k: usize| if (500..700).contains(&k) { 0.004 } else { 0.002 };
    let lag = |k: usize, step: f64| 1.0 - (-(k as f64 - step).max(0.0) / 10.0).exp();
    let logged = |k: usize| 0.002 + 0.002 * (lag(k, 500.0) - lag(k, 700.0));
    let found = estimates(v, logged, 900);
    for (k, (mps, disagree)) in found.iter().enumerate() {
        let sample = k + 1;
        if sample < 500 {
            assert_eq!((*mps, *disagree), (0.002, false));
        } else if sample > 501 && sample != 700 {
            assert!((mps - v(sample)).abs() < 1e-9, "{mps} m/s at sample {sample}");
        }
        // The step of the jump and the next two.
        assert_eq!(*disagree, (500..=502).contains(&sample) || (700..=702).contains(&sample), "{sample}");
    }
}

#[test]
fn accurate_positions_recover_a_smoothed_velocity() {
    // 1 Hz of ripple on 4 mm/s, logged as the mean of 21 samples, which damps it by 4 % and smears a stop over 21 samples.
    let v = |k: usize| {
        if k < 1000 { 0.004 + 0.002 * (core::f64::consts::TAU * DT_S * k as f64).sin() } else { 0.0 }
    };
    let logged = |k: usize| (0..21).map(|i| v((k + i).saturating_sub(10))).sum::<f64>() / 21.0;
    let found = estimates(v, logged, 1100);
    for (k, (mps, disagree)) in found.iter().enumerate().skip(200) {
        let sample = k + 1;
        assert!(sample == 1000 || (mps - v(sample)).abs() < 5e-6, "{mps} m/s at sample {sample}");
        assert!(!disagree || (1000..=1002).contains(&sample), "sample {sample}");
    }
}

#[test]
fn a_smoothed_log_is_identified_and_jumps_or_noise_are_not() {
    let late = |v: &dyn Fn(usize) -> f64, logged: &dyn Fn(usize) -> f64, noise_m: f64| {
        let ((mut velocity, mut last), mut at_m) = (started(logged(0)), 0.0);
        for k in 1..2000_usize {
            at_m += 0.5 * (v(k - 1) + v(k)) * DT_S;
            let position_m = at_m + noise_m * ((k * 7919 % 1009) as f64 / 504.0 - 1.0);
            let sample =
                Sample { time_s: DT_S * k as f64, position_m, velocity_mps: logged(k), force_n: 0.0 };
            velocity.update(&last, &sample, 0.002, DT_S / (DT_S + DISAGREEMENT_MEMORY_S));
            last = sample;
        }
        velocity.uses_positions()
    };
    let step = |k: usize| if k < 1000 { 0.002 } else { 0.004 };
    let ramp = |k: usize| (0.002 + 0.0001 * (k as f64 - 990.0)).clamp(0.002, 0.004);
    assert!(!late(&step, &step, 0.0));
    assert!(late(&step, &ramp, 0.0));
    assert!(!late(&step, &ramp, 1e-6), "a micrometre at 200 Hz is a tenth of the speed");
    // From rest: the log moves two samples before the needle.
    let from = |first: usize| move |k: usize| if k < first { 0.0 } else { 0.002 };
    assert!(!late(&from(100), &from(100), 0.0) && late(&from(100), &from(98), 0.0));
}

#[test]
fn a_jump_within_a_step_is_reported_and_the_log_used() {
    // From 2 to 4 mm/s between two samples: the mean velocity lies between those at the ends.
    let v = |k: usize| if k < 500 { 0.002 } else { 0.004 };
    let ((mut velocity, mut last), mut disagree) = (started(0.002), Vec::new());
    for k in 1..600 {
        let mean = if k == 500 { 0.0022 } else { v(k) };
        let sample = Sample {
            time_s: DT_S * k as f64,
            position_m: last.position_m + mean * DT_S,
            velocity_mps: v(k),
            force_n: 0.0,
        };
        let (mps, sudden) = velocity.update(&last, &sample, 0.002, 0.0025);
        assert_eq!(mps, v(k), "at sample {k}");
        if sudden {
            disagree.push(k);
        }
        last = sample;
    }
    assert_eq!(disagree, [500]);
}

#[test]
fn encoder_noise_becomes_the_usual_difference() {
    // 5 um of position noise give 1.4 mm/s in the mean velocities; the log has the true 2 mm/s.
    let ((mut velocity, mut last), mut late) = (started(0.002), 0);
    for k in 1..4000_usize {
        let noise_m = 5e-6 * ((k * 7919 % 1009) as f64 / 504.0 - 1.0);
        let sample = Sample {
            time_s: DT_S * k as f64,
            position_m: 0.002 * DT_S * k as f64 + noise_m,
            velocity_mps: 0.002,
            force_n: 0.0,
        };
        let (mps, disagree) = velocity.update(&last, &sample, 0.002, DT_S / (DT_S + DISAGREEMENT_MEMORY_S));
        if k >= 2000 {
            late += usize::from(disagree);
            assert!(disagree || mps == 0.002);
        }
        last = sample;
    }
    assert!(late < 20, "{late} of 2000 samples after ten seconds");
}

#[test]
fn a_needle_is_at_rest_until_its_position_changes() {
    // The log begins to rise at sample 90, the needle moves from 100 on.
    let v = |k: usize| if k < 100 { 0.0 } else { 0.002 };
    let logged = |k: usize| (0.0001 * (k as f64 - 90.0)).clamp(0.0, 0.002);
    let found = estimates(v, logged, 200);
    assert!(found[..98].iter().all(|f| *f == (0.0, false)), "{:?}", &found[85..99]);
    assert!(found[99].1, "starts at an unknown time: {:?}", found[99]);
    let (mps, disagree) = found[150];
    assert!(!disagree && (mps - 0.002).abs() < 1e-9);
}

/// Update with the logged velocities before and now and the mean velocity over 5 ms.
fn next(velocity: &mut VelocityEstimator, (before, logged): (f64, f64), stepped: f64) -> (f64, bool) {
    let last = Sample { velocity_mps: before, ..Sample::default() };
    let sample =
        Sample { time_s: DT_S, position_m: stepped * DT_S, velocity_mps: logged, ..Sample::default() };
    velocity.update(&last, &sample, 0.002, 0.25)
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} for {expected}");
}

#[test]
fn log_and_positions_agree_within_four_times_their_usual_difference() {
    // Limit: four times half a percent of 2 mm/s, 40 um/s; or four times the usual 60 um/s.
    for (usual, limit) in [(0.0, 4e-5), (6e-5, 2.4e-4), (1e-6, 4e-5)] {
        for (share, agree) in [(0.99, true), (-0.99, true), (1.01, false), (-1.01, false)] {
            let mut velocity =
                VelocityEstimator { usual: usual * usual, logged_mps: 0.002, ..VelocityEstimator::default() };
            let off = share * limit;
            // Mean of the logged velocities before and now.
            let (mps, disagree) = next(&mut velocity, (0.002, 0.0022), 0.0021 + off);
            assert_eq!(disagree, !agree, "{share} of {limit} m/s");
            assert_eq!(mps, 0.0022, "a jump within the step explains it");
            let square = (off * off).min(limit * limit);
            near(velocity.usual, 0.75 * usual * usual + 0.25 * square);
            assert_eq!(velocity.logged_mps, 0.0022);
        }
    }
    // Exact agreement reduces the usual difference, except at rest.
    let at_once = |before: f64, logged: f64| {
        let mut velocity =
            VelocityEstimator { usual: 4e-10, logged_mps: before, ..VelocityEstimator::default() };
        let last = Sample { velocity_mps: before, ..Sample::default() };
        let stepped_m = 0.5 * (logged + before) * DT_S;
        let sample =
            Sample { time_s: DT_S, position_m: stepped_m, velocity_mps: logged, ..Sample::default() };
        assert_eq!(velocity.update(&last, &sample, 0.002, 0.25), (logged, false));
        velocity.usual
    };
    near(at_once(0.002, 0.003), 3e-10);
    assert_eq!(at_once(0.002, 0.0), 4e-10);
}

#[test]
fn positions_are_used_until_two_samples_agree_twice_as_closely() {
    // Within 40 um/s of the range between both logged velocities; within 20 during a disagreement.
    let logged = (0.002, 0.0022);
    let mut velocity = VelocityEstimator { logged_mps: 0.002, ..VelocityEstimator::default() };
    let mut update_and_count = |off_mps: f64, expected_mps: f64| {
        (velocity.usual, velocity.logged_mps) = (0.0, 0.002);
        let (mps, disagree) = next(&mut velocity, logged, 0.0022 + off_mps);
        assert!(disagree);
        near(mps, expected_mps);
        velocity.disagreeing
    };
    assert_eq!(update_and_count(3.9e-5, 0.0022), 0);
    assert_eq!(update_and_count(4.1e-5, 0.0022 + 4.1e-5), 2);
    assert_eq!(update_and_count(2.1e-5, 0.0022 + 2.1e-5), 2);
    assert_eq!(update_and_count(1.9e-5, 0.0022 + 1.9e-5), 1);
    assert_eq!(update_and_count(2.1e-5, 0.0022 + 2.1e-5), 2);
    assert_eq!(update_and_count(1.9e-5, 0.0022 + 1.9e-5), 1);
    assert_eq!(update_and_count(-1e-4, 0.0022), 0);
    // Below the smaller as above the larger.
    assert_eq!(update_and_count(-0.0002 - 3.9e-5, 0.0022), 0);
    assert_eq!(update_and_count(-0.0002 - 4.1e-5, 0.002 - 4.1e-5), 2);
}

#[test]
fn a_needle_is_at_rest_where_neither_position_nor_logged_velocity_shows_motion() {
    for (logged, at_rest) in [(9e-6, true), (-9e-6, true), (1e-5, true), (1.1e-5, false), (-1.1e-5, false)] {
        let mut velocity = VelocityEstimator { logged_mps: 1e-5, ..VelocityEstimator::default() };
        let (mps, disagree) = next(&mut velocity, (1e-5, logged), 0.0);
        assert_eq!(
            (mps, disagree, velocity.at_rest),
            (if at_rest { 0.0 } else { logged }, false, at_rest),
            "{logged}"
        );
        assert_eq!(velocity.logged_mps, logged);
    }
    // It stands until the position changes, whatever the log.
    let mut velocity = VelocityEstimator { at_rest: true, ..VelocityEstimator::default() };
    assert_eq!(next(&mut velocity, (0.0, 0.002), 0.0), (0.0, false));
    assert_eq!(next(&mut velocity, (0.002, 0.002), 1e-6), (0.002, true));
    assert!(!velocity.at_rest && velocity.usual == 0.0);
    // Two samples at the same time give no velocity.
    let mut velocity =
        VelocityEstimator { disagreeing: 2, logged_mps: 0.002, ..VelocityEstimator::default() };
    let last = Sample { velocity_mps: 0.002, ..Sample::default() };
    let jumped = Sample { position_m: 1e-5, ..last };
    assert_eq!(velocity.update(&last, &jumped, 0.002, 0.25), (0.002, false));
}
