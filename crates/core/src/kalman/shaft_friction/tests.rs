use super::super::test_support::{advancing, retracting};
use super::*;

fn hold(position_m: f64, force_n: f64) -> ShaftSample {
    ShaftSample { advancing: false, ..advancing(position_m, force_n) }
}

/// After a rupture at 20 mm that left 1 N.
fn ruptured() -> DryShaftFriction {
    let mut shaft = DryShaftFriction::default();
    shaft.rupture(0.02, 1.0);
    shaft.update(&advancing(0.0205, 1.2));
    shaft
}

#[test]
fn friction_is_zero_before_the_first_rupture() {
    let mut shaft = DryShaftFriction::default();
    for k in 0..10 {
        assert_eq!(shaft.update(&advancing(0.001 * f64::from(k), f64::from(k))), (0.0, 0.0));
    }
}

#[test]
fn after_a_rupture_the_force_is_friction_over_a_millimetre_and_later_rises_are_not() {
    let mut shaft = DryShaftFriction::default();
    shaft.rupture(0.02, 1.0);
    for (position_m, force_n, friction_n) in [
        (0.0201, 1.0, 1.0),
        (0.0205, 1.3, 1.3),
        (0.0208, 1.1, 1.1),
        (0.0209, 1.2, 1.2),
        (0.0215, 1.7, 1.2),
        (0.0230, 3.0, 1.2),
        // Friction falls with the force.
        (0.0235, 2.9, 1.1),
        (0.0240, 3.5, 1.1),
        // Friction lies between zero and the force.
        (0.0245, 2.0, 0.0),
        (0.0250, 2.5, 0.0),
    ] {
        let (found_n, sd_n) = shaft.update(&advancing(position_m, force_n));
        assert!((found_n - friction_n).abs() < 1e-12, "{found_n} N at {position_m} m");
        assert!((sd_n - 0.25 * friction_n).abs() < 1e-12, "a quarter: {sd_n} N");
    }
}

#[test]
fn in_a_hold_friction_keeps_its_fraction_of_the_force() {
    let mut shaft = ruptured();
    shaft.update(&advancing(0.023, 3.0));
    for force_n in [2.7, 2.4, 2.1, 1.5, 1.8] {
        let (friction_n, _) = shaft.update(&hold(0.023, force_n));
        assert!((friction_n / force_n - 0.4).abs() < 1e-12, "{friction_n} of {force_n} N");
    }
}

#[test]
fn the_smoothed_force_uses_the_given_gain() {
    let mut shaft = DryShaftFriction::default();
    shaft.rupture(0.02, 1.0);
    let mut expected_n = 1.0;
    for force_n in [2.0, 2.0, 0.0, 5.0] {
        expected_n += 0.25 * (force_n - expected_n);
        let (friction_n, _) = shaft.update(&ShaftSample { gain: 0.25, ..advancing(0.0201, force_n) });
        assert!((friction_n - expected_n).abs() < 1e-12);
    }
}

#[test]
fn retraction_goes_from_the_hold_force_through_zero_to_a_pull() {
    let mut shaft = ruptured();
    shaft.update(&advancing(0.03, 3.0));
    let mut at = |x: f64, force_n: f64| {
        shaft.update(&ShaftSample { track_retraction: false, ..retracting(0.03 - x, force_n) })
    };
    let (begin_n, sd_n) = at(0.0, 3.0);
    assert!((begin_n - 3.0).abs() < 1e-12 && (sd_n - 1.0).abs() < 1e-12, "{begin_n} {sd_n}");
    let (middle_n, _) = at(0.00125, 0.0);
    // Half way to zero the exponential is the root of 1/4: -1 + 4/2.
    assert!((middle_n - 1.0).abs() < 1e-9, "{middle_n}");
    assert!(at(0.0025, 0.0).0.abs() < 1e-9);
    // The final pull is a quarter of the largest force, whatever the force.
    assert!((at(0.03, -3.0).0 + 1.0).abs() < 1e-3);
    // Repeated retraction does not count.
    assert!((at(0.02, -3.0).0 + 1.0).abs() < 1e-3);
}

#[test]
fn untracked_friction_never_exceeds_the_pulling_force() {
    let mut shaft = ruptured();
    shaft.update(&advancing(0.03, 3.0));
    let mut at = |x: f64, force_n: f64| {
        shaft.update(&ShaftSample { track_retraction: false, ..retracting(0.03 - x, force_n) }).0
    };
    at(0.0, 3.0);
    at(0.02, -3.0);
    // A release.
    assert!((at(0.02, -0.2) + 0.2).abs() < 1e-12);
    // A later pull is tip force, and friction returns to the prediction.
    let later_n = at(0.022, -1.5);
    assert!((later_n + 1.0 - 0.8 * (-1.0_f64).exp()).abs() < 1e-3, "{later_n}");
}

/// Predicted friction during retraction, from a hold of 3 N to a pull of 1 N.
fn predicted_n(x: f64) -> f64 {
    -1.0 + 4.0 * (-x / 0.0025 * 4.0_f64.ln()).exp()
}

/// Calls `each(x, tip, sd)` over a retraction in steps of 50 um with the force `offset_n(x)` off the prediction.
fn tip_n(mut off_n: impl FnMut(f64) -> f64, mut each: impl FnMut(f64, f64, f64)) {
    let mut shaft = ruptured();
    shaft.update(&advancing(0.03, 3.0));
    for k in 0..400 {
        let x = 5e-5 * f64::from(k);
        let force_n = predicted_n(x) + off_n(x);
        let (friction_n, sd_n) = shaft.update(&retracting(0.03 - x, force_n));
        each(x, force_n - friction_n, sd_n);
    }
}

#[test]
fn the_prediction_is_friction_and_persistent_offsets_become_friction() {
    tip_n(|_| 0.0, |x, tip, sd| assert!(tip.abs() < 1e-9 && sd < 1e-9, "{tip} {sd} at {x}"));
    // A constant offset of 0.5 N and a linear one become friction.
    for off in [|_| -0.5, |x: f64| -30.0 * x] as [fn(f64) -> f64; 2] {
        let mut last = 1.0;
        tip_n(off, |_, tip, _| last = tip);
        assert!(last.abs() < 0.1, "{last} N left");
    }
}

#[test]
fn the_standard_deviation_is_the_recent_residual() {
    for size_n in [0.05, 0.2] {
        let (mut last_n, mut early_n) = (0.0, f64::NAN);
        let mut sign = 1.0;
        let off = |_| {
            sign = -sign;
            sign * size_n
        };
        tip_n(off, |x, _, sd| {
            if x > 0.0001 && early_n.is_nan() {
                early_n = sd;
            }
            last_n = sd;
        });
        assert!((last_n / size_n - 1.0).abs() < 0.1, "{last_n} N for {size_n} N");
        assert!(early_n < 0.5 * size_n, "over millimetres: {early_n} N");
    }
}

#[test]
fn a_caught_tip_keeps_most_of_its_pull_over_a_millimetre() {
    let (mut at_once, mut after) = (0.0, 0.0);
    let off = |x: f64| if x > 0.0099 { -0.5 } else { 0.0 };
    tip_n(off, |x, tip, _| {
        if (x - 0.01).abs() < 1e-5 {
            at_once = tip;
        } else if (x - 0.011).abs() < 1e-5 {
            after = tip;
        }
    });
    assert!((-0.5..-0.45).contains(&at_once), "{at_once}");
    // exp(-1/2) of it, less an eighth by the slope.
    assert!((-0.5 * 0.61..-0.5 * 0.5).contains(&after), "{after}");
}

#[test]
fn pushes_are_absorbed_faster_and_a_sudden_release_is_friction() {
    // A push is absorbed over one millimetre, half the travel of a pull.
    let mut push = 1.0;
    tip_n(
        |x| if x > 0.0099 { 0.5 } else { 0.0 },
        |x, tip, _| {
            if (x - 0.011).abs() < 1e-5 {
                push = tip;
            }
        },
    );
    assert!((0.0..0.5 * 0.37).contains(&push), "{push}");
    // A release is friction at once.
    let mut shaft = ruptured();
    shaft.update(&advancing(0.03, 3.0));
    shaft.update(&retracting(0.03, 3.0));
    let x = 0.01;
    shaft.update(&retracting(0.03 - x, predicted_n(x)));
    let force_n = predicted_n(x) + 0.6;
    let (friction_n, _) = shaft.update(&ShaftSample { released: true, ..retracting(0.03 - x, force_n) });
    assert!((friction_n - force_n).abs() < 1e-9, "{friction_n} of {force_n}");
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-11 * expected.abs().max(1e-3), "{found} for {expected}");
}

#[test]
fn the_pull_follows_from_the_largest_force_or_the_noise() {
    // Largest force, noise, hold force; expected pull and initial force.
    for (peak_n, noise_n, hold_n, pull_n, force_n) in [
        (4.0, 0.01, 3.0, 1.0, 3.0),
        (4.0, 0.01, 0.02, 1.0, 0.05),
        (4.0, 0.01, -0.5, 1.0, 0.05),
        (0.02, 0.01, 0.3, 0.01, 0.3),
        (0.0, 0.0, 0.0, 1e-9, 5e-11),
    ] {
        let mut shaft = DryShaftFriction::default();
        shaft.rupture(0.02, hold_n);
        let at = |x: f64| ShaftSample {
            peak_force_n: peak_n,
            noise_variance_n2: noise_n * noise_n,
            track_retraction: false,
            ..retracting(0.03 - x, if x > 0.0 { -9.0 } else { hold_n })
        };
        let (begin_n, sd_n) = shaft.update(&at(0.0));
        near(begin_n, force_n);
        near(sd_n, 0.25 * peak_n);
        // Zero after 2.5 mm.
        let faded = (-0.0007 / 0.0025 * (1.0 + force_n / pull_n).ln()).exp();
        near(shaft.update(&at(0.0007)).0, -pull_n + (force_n + pull_n) * faded);
        assert!(shaft.update(&at(0.0025)).0.abs() <= 1e-9 * pull_n);
    }
}

#[test]
fn the_tracker_absorbs_pulls_pushes_and_releases_over_their_travels() {
    let mut shaft = DryShaftFriction::default();
    shaft.rupture(0.02, 3.0);
    // Residual, travel before it, release flag, and expected release.
    let mut off_n = 0.0;
    let (mut slope, mut scatter_n2, mut x) = (0.0, 0.0, 0.0);
    for (rest_n, travel_m, jumped, released_n) in [
        (0.1, 0.0, false, 0.0),
        (-0.2, 3e-4, false, 0.0),
        (0.3, 5e-4, false, 0.0),
        (0.5, 2e-4, true, 0.2),
        (0.1, 1e-4, true, 0.0),
        (-0.2, 1e-4, true, 0.0),
        (0.15, 1e-4, true, 0.15),
        (-0.3, 1e-4, true, 0.0),
        (0.2, 1e-4, false, 0.0),
        // Insertion is no retraction; residuals are clipped at the largest force.
        (0.4, -2e-4, false, 0.0),
        (-5.0, 4e-4, false, 0.0),
        (7.0, 3e-4, false, 0.0),
    ] {
        let travel = f64::max(travel_m, 0.0);
        x += travel;
        off_n += slope * travel;
        let force_n = predicted_n(x) + off_n + rest_n;
        let place = if travel_m < 0.0 { 0.03 - x - travel_m } else { 0.03 - x };
        let (friction_n, sd_n) =
            shaft.update(&ShaftSample { released: jumped, ..retracting(place, force_n) });
        off_n += released_n;
        let rest_n: f64 = rest_n - released_n;
        near(friction_n, predicted_n(x) + off_n);
        let reach_m = if rest_n < 0.0 { 2e-3 } else { 1e-3 };
        off_n += (1.0 - (-travel / reach_m).exp()) * rest_n;
        slope += travel * rest_n / (2e-3 * 8e-3);
        let bounded = rest_n.clamp(-4.0, 4.0);
        scatter_n2 += travel / (travel + 2e-3) * (bounded * bounded - scatter_n2);
        near(sd_n, scatter_n2.sqrt());
    }
}

#[test]
fn retraction_ends_at_the_turn_or_at_a_rupture() {
    let mut shaft = ruptured();
    shaft.update(&advancing(0.023, 3.0));
    near(shaft.update(&hold(0.023, 2.5)).0, 1.0);
    // Above the turn it is still retraction; at the turn it is insertion, with friction limited to the force.
    shaft.update(&retracting(0.023, 2.0));
    shaft.update(&retracting(0.0225, 1.0));
    assert!(shaft.retraction.is_some());
    shaft.update(&advancing(0.0229, 0.7));
    assert!(shaft.retraction.is_some());
    shaft.update(&hold(0.024, 0.7));
    assert!(shaft.retraction.is_some(), "only an advance ends the retraction");
    near(shaft.update(&advancing(0.023, 0.7)).0, 0.7);
    assert!(shaft.retraction.is_none());
    near(shaft.update(&advancing(0.0232, 3.0)).0, 0.7);
    shaft.update(&retracting(0.0225, -1.0));
    shaft.rupture(0.0225, -0.5);
    assert!(shaft.retraction.is_none());
    near(shaft.update(&advancing(0.0226, 1.5)).0, 1.5);
    shaft.rupture(0.0225, 0.8);
    near(shaft.update(&advancing(0.0226 + MEMORY_M, 0.9)).0, 0.8);
}

#[test]
fn in_a_hold_friction_at_most_doubles_per_sample() {
    let level = |from_n: f64, to_n: f64| {
        let mut shaft = DryShaftFriction::default();
        shaft.rupture(0.02, 0.4);
        shaft.update(&advancing(0.0202, 0.4));
        shaft.update(&advancing(0.0215, from_n));
        shaft.update(&hold(0.0215, to_n)).0
    };
    near(level(0.8, 1.2), 0.6);
    near(level(0.8, 4.0), 0.8);
    near(level(0.8, 0.2), 0.1);
    near(level(0.8, -0.2), 0.0);
    near(level(-0.2, 0.5), 0.0);
}
