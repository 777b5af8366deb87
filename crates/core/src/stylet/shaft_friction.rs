//! Friction where the law of layers does not hold: dry, building up over travel, staying in holds.
//!
//! Measured insertions do not follow `f = D v + K x + b x v`: friction hardly depends on speed, and what is left of the force is curved. What
//! can be said there without a law:
//!
//! - Just after a rupture nothing acts at the tip: the next layer is not loaded yet. Over [`MEMORY_M`] of travel, in which friction
//!   builds up again after the needle has slipped, all of the force is friction.
//! - While the needle advances, the force of a layer that does not give way does not fall. Where the measured force falls slowly, friction
//!   falls; and friction is never more than the whole force.
//! - In a hold both relax, and nothing tells one from the other: their ratio stays.
//! - On the way back the tip feels nothing unless it is caught: the force is friction, from the force of the hold over zero to a pull of its own,
//!   `P(x) = -S + (F + S) exp(-x/delta)`. The way in cannot teach `S` and `delta`; [`PULL`] and [`RELAX_M`] are prior means.
//!   What the way back itself shows is added by a tracker (`track.rs`).

use super::force_predictor::MEMORY_M;
use super::gaussian::{at_least, at_most};
use super::retraction_tracker::{ModelFriction, RetractionTracker, TRACKING_TRAVEL_M};

/// Pull of the friction on the way back as a share of the largest force: with a puncture that leaves half of its force as friction, and a pull of
/// half the push (Okamura 2004: asymmetric friction), a quarter.
const PULL: f64 = 0.25;
/// Travel over which the force of the hold relaxes to zero on the way back, in m: presliding of soft tissue reaches over millimetres.
pub(super) const PRESLIDING_TRAVEL_M: f64 = 2.5e-3;
/// Smoothing of the force in s, shorter than a drop.
pub(crate) const FORCE_TIME_CONSTANT_S: f64 = 0.05;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DryShaftFriction {
    /// Friction in N while advancing or holding.
    level_n: f64,
    smooth_n: f64,
    rupture_m: f64,
    passed: bool,
    back: Option<Back>,
    told: ModelFriction,
}

/// The way back.
#[derive(Clone, Copy, Debug)]
struct Back {
    turn_m: f64,
    force_n: f64,
    pull_n: f64,
    delta_m: f64,
    /// By how much friction pulls less than it is taught to, in N, where no tracker says that.
    less_n: f64,
    tracker: RetractionTracker,
}

/// One sample, as the shaft's friction needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShaftSample {
    /// Share that the sample has in the smoothed force.
    pub(crate) gain: f64,
    pub(crate) position_m: f64,
    /// Force without the sensor's zero in N.
    pub(crate) force_n: f64,
    pub(crate) advancing: bool,
    pub(crate) retracting: bool,
    /// Largest force so far in N.
    pub(crate) peak_force_n: f64,
    /// The force has just jumped up.
    pub(crate) released: bool,
    /// Variance of the noise in N².
    pub(crate) noise_variance_n2: f64,
    pub(crate) track_retraction: bool,
}

impl DryShaftFriction {
    /// A rupture, or one that goes on.
    pub(crate) fn rupture(&mut self, position_m: f64, force_n: f64) {
        self.passed = true;
        self.rupture_m = position_m;
        self.smooth_n = force_n;
        self.level_n = force_n.max(0.0);
        self.back = None;
    }

    /// Takes a sample; returns the friction in N and its standard deviation.
    #[inline(always)]
    pub(crate) fn update(&mut self, felt: &ShaftSample) -> (f64, f64) {
        let before = self.smooth_n;
        self.smooth_n += felt.gain * (felt.force_n - before);
        if felt.retracting && self.back.is_none() {
            self.turn(felt, before);
        }
        if let Some(back) = &mut self.back {
            if felt.advancing && felt.position_m >= back.turn_m {
                self.back = None;
                self.level_n = self.level_n.min(self.smooth_n.max(0.0));
            } else {
                return back.take(felt, self.smooth_n);
            }
        }
        if !self.passed {
            return (0.0, 0.0);
        }
        let change = self.smooth_n - before;
        if felt.position_m - self.rupture_m < MEMORY_M {
            self.level_n = self.smooth_n;
        } else if felt.advancing {
            if change < 0.0 {
                self.level_n += change;
            }
        } else if before > 0.0 {
            self.level_n *= (self.smooth_n / before).clamp(0.0, 2.0);
        }
        self.level_n = at_least(0.0, at_most(self.smooth_n, self.level_n));
        // Friction may still build up, or have been the new layer's force: not known better than to a quarter.
        (self.level_n, 0.25 * self.level_n)
    }

    /// The same of the sample that was taken last, of which a law fitted elsewhere says that `law_n` is friction.
    pub(crate) fn update_with_model(&mut self, felt: &ShaftSample, law_n: f64) -> (f64, f64) {
        self.told.update(felt, self.smooth_n, law_n)
    }

    #[cold]
    fn turn(&mut self, felt: &ShaftSample, force_n: f64) {
        let pull = (PULL * felt.peak_force_n).max(libm::sqrt(felt.noise_variance_n2)).max(1e-9);
        let force = force_n.max(0.05 * pull);
        self.back = Some(Back {
            turn_m: felt.position_m,
            force_n: force,
            pull_n: pull,
            delta_m: PRESLIDING_TRAVEL_M / libm::log(1.0 + force / pull),
            less_n: 0.0,
            tracker: RetractionTracker::new(TRACKING_TRAVEL_M, felt.position_m, 0.0),
        });
    }
}

impl Back {
    #[inline(never)]
    fn take(&mut self, felt: &ShaftSample, smooth_n: f64) -> (f64, f64) {
        let travel = self.tracker.retracted_by(felt.position_m);
        let x = (self.turn_m - self.tracker.shallowest_m).max(0.0);
        let taught = -self.pull_n + (self.force_n + self.pull_n) * libm::exp(-x / self.delta_m);
        if felt.track_retraction {
            return self.tracker.update(felt, travel, taught);
        }
        // No tip pushes on the way back: friction pulls no more than the force does, and less than it is taught to for a while after.
        self.less_n = (self.less_n * libm::exp(-travel / TRACKING_TRAVEL_M)).max(smooth_n - taught);
        (taught + self.less_n, 0.25 * felt.peak_force_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Advancing with a force that needs no smoothing.
    fn felt(position_m: f64, force_n: f64) -> ShaftSample {
        ShaftSample {
            gain: 1.0,
            position_m,
            force_n,
            advancing: true,
            retracting: false,
            peak_force_n: 4.0,
            released: false,
            noise_variance_n2: 1e-4,
            track_retraction: true,
        }
    }

    fn hold(position_m: f64, force_n: f64) -> ShaftSample {
        ShaftSample { advancing: false, ..felt(position_m, force_n) }
    }

    fn back(position_m: f64, force_n: f64) -> ShaftSample {
        ShaftSample { advancing: false, retracting: true, ..felt(position_m, force_n) }
    }

    /// After a rupture at 20 mm that has left 1 N, and the travel in which all of the force is friction.
    fn ruptured() -> DryShaftFriction {
        let mut shaft = DryShaftFriction::default();
        shaft.rupture(0.02, 1.0);
        shaft.update(&felt(0.0205, 1.2));
        shaft
    }

    #[test]
    fn no_friction_is_known_before_the_first_rupture() {
        let mut shaft = DryShaftFriction::default();
        for k in 0..10 {
            assert_eq!(shaft.update(&felt(0.001 * f64::from(k), f64::from(k))), (0.0, 0.0));
        }
    }

    #[test]
    fn all_of_the_force_is_friction_over_the_first_millimetre_after_a_rupture_and_no_rise_after() {
        let mut shaft = DryShaftFriction::default();
        shaft.rupture(0.02, 1.0);
        for (position_m, force_n, friction_n) in [
            (0.0201, 1.0, 1.0),
            (0.0205, 1.3, 1.3),
            (0.0208, 1.1, 1.1),
            (0.0209, 1.2, 1.2),
            (0.0215, 1.7, 1.2),
            (0.0230, 3.0, 1.2),
            // What the force falls by, friction falls by.
            (0.0235, 2.9, 1.1),
            (0.0240, 3.5, 1.1),
            // Friction is not below zero, nor more than the whole force.
            (0.0245, 2.0, 0.0),
            (0.0250, 2.5, 0.0),
        ] {
            let (found_n, sd_n) = shaft.update(&felt(position_m, force_n));
            assert!((found_n - friction_n).abs() < 1e-12, "{found_n} N at {position_m} m");
            assert!((sd_n - 0.25 * friction_n).abs() < 1e-12, "known to a quarter: {sd_n} N");
        }
    }

    #[test]
    fn in_a_hold_friction_keeps_its_share_of_the_force() {
        let mut shaft = ruptured();
        shaft.update(&felt(0.023, 3.0));
        for force_n in [2.7, 2.4, 2.1, 1.5, 1.8] {
            let (friction_n, _) = shaft.update(&hold(0.023, force_n));
            assert!((friction_n / force_n - 0.4).abs() < 1e-12, "{friction_n} of {force_n} N");
        }
    }

    #[test]
    fn the_smoothed_force_takes_the_share_of_a_sample_that_it_is_told() {
        let mut shaft = DryShaftFriction::default();
        shaft.rupture(0.02, 1.0);
        let mut expected_n = 1.0;
        for force_n in [2.0, 2.0, 0.0, 5.0] {
            expected_n += 0.25 * (force_n - expected_n);
            let (friction_n, _) = shaft.update(&ShaftSample { gain: 0.25, ..felt(0.0201, force_n) });
            assert!((friction_n - expected_n).abs() < 1e-12);
        }
    }

    #[test]
    fn the_way_back_goes_from_the_force_of_the_hold_over_zero_at_two_and_a_half_millimetres_to_a_pull() {
        let mut shaft = ruptured();
        shaft.update(&felt(0.03, 3.0));
        let mut at = |x: f64, force_n: f64| {
            shaft.update(&ShaftSample { track_retraction: false, ..back(0.03 - x, force_n) })
        };
        let (begin_n, sd_n) = at(0.0, 3.0);
        assert!((begin_n - 3.0).abs() < 1e-12 && (sd_n - 1.0).abs() < 1e-12, "{begin_n} {sd_n}");
        let (middle_n, _) = at(0.00125, 0.0);
        // Half way to zero the exponential has gone by the root of what it goes by in all: -1 + 4/2.
        assert!((middle_n - 1.0).abs() < 1e-9, "{middle_n}");
        assert!(at(0.0025, 0.0).0.abs() < 1e-9);
        // A quarter of the largest force pulls in the end, however much the sensor shows.
        assert!((at(0.03, -3.0).0 + 1.0).abs() < 1e-3);
        // What was travelled back is not travelled back again.
        assert!((at(0.02, -3.0).0 + 1.0).abs() < 1e-3);
    }

    #[test]
    fn on_the_way_back_friction_never_pulls_more_than_the_force_does_and_less_for_two_millimetres_after() {
        let mut shaft = ruptured();
        shaft.update(&felt(0.03, 3.0));
        let mut at = |x: f64, force_n: f64| {
            shaft.update(&ShaftSample { track_retraction: false, ..back(0.03 - x, force_n) }).0
        };
        at(0.0, 3.0);
        at(0.02, -3.0);
        // A shaft that has let go.
        assert!((at(0.02, -0.2) + 0.2).abs() < 1e-12);
        // What is pulled then is the tip's, and friction comes back to what it is taught to be.
        let later_n = at(0.022, -1.5);
        assert!((later_n + 1.0 - 0.8 * (-1.0_f64).exp()).abs() < 1e-3, "{later_n}");
    }

    #[test]
    fn a_needle_that_goes_in_again_has_the_way_back_behind_it_where_it_turned() {
        let mut shaft = ruptured();
        shaft.update(&felt(0.03, 3.0));
        for k in 0..100 {
            shaft.update(&back(0.03 - 1e-4 * f64::from(k), -1.0));
        }
        let (below_n, _) = shaft.update(&felt(0.025, -1.0));
        assert!((below_n + 1.0).abs() < 0.1, "still as on the way back: {below_n} N");
        let (behind_n, _) = shaft.update(&felt(0.0301, 2.0));
        assert!((0.0..=2.0).contains(&behind_n), "friction again between none and the force: {behind_n} N");
        let (later_n, _) = shaft.update(&felt(0.0311, 3.0));
        assert!((later_n - behind_n).abs() < 1e-12, "a rise is the tip's: {later_n} N");
    }

    /// The force of the way back as it is taught, from a hold of 3 N to a pull of 1 N.
    fn taught_n(x: f64) -> f64 {
        -1.0 + 4.0 * (-x / 0.0025 * 4.0_f64.ln()).exp()
    }

    /// Enhanced force over a way back by 50 um steps in which the force is off what is taught by `off_n(x)`.
    fn tip_n(mut off_n: impl FnMut(f64) -> f64, mut hear: impl FnMut(f64, f64, f64)) {
        let mut shaft = ruptured();
        shaft.update(&felt(0.03, 3.0));
        for k in 0..400 {
            let x = 5e-5 * f64::from(k);
            let force_n = taught_n(x) + off_n(x);
            let (friction_n, sd_n) = shaft.update(&back(0.03 - x, force_n));
            hear(x, force_n - friction_n, sd_n);
        }
    }

    #[test]
    fn on_the_way_back_what_is_taught_is_friction_and_what_stays_becomes_it() {
        tip_n(|_| 0.0, |x, tip, sd| assert!(tip.abs() < 1e-9 && sd < 1e-9, "{tip} {sd} at {x}"));
        // A pull that is 0.5 N stronger all along is friction in the end; a line is so, too.
        for off in [|_| -0.5, |x: f64| -30.0 * x] as [fn(f64) -> f64; 2] {
            let mut last = 1.0;
            tip_n(off, |_, tip, _| last = tip);
            assert!(last.abs() < 0.1, "{last} N left");
        }
    }

    #[test]
    fn friction_on_the_way_back_is_known_to_what_the_tip_has_seemed_to_feel_of_late() {
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
    fn a_tip_that_is_caught_on_the_way_back_keeps_most_of_its_pull_over_a_millimetre() {
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
        // exp(-1/2) of it, and the slope has learned an eighth.
        assert!((-0.5 * 0.61..-0.5 * 0.5).contains(&after), "{after}");
    }

    #[test]
    fn on_the_way_back_no_tip_pushes_and_a_sudden_release_is_the_shafts() {
        // An excess push is given in to over one millimetre, half of the way of a pull.
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
        // The jump of a release is friction at once.
        let mut shaft = ruptured();
        shaft.update(&felt(0.03, 3.0));
        shaft.update(&back(0.03, 3.0));
        let x = 0.01;
        shaft.update(&back(0.03 - x, taught_n(x)));
        let force_n = taught_n(x) + 0.6;
        let (friction_n, _) = shaft.update(&ShaftSample { released: true, ..back(0.03 - x, force_n) });
        assert!((friction_n - force_n).abs() < 1e-9, "{friction_n} of {force_n}");
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-11 * expected.abs().max(1e-3), "{found} for {expected}");
    }

    #[test]
    fn the_pull_of_the_way_back_is_by_the_largest_force_or_the_noise_and_begins_at_the_force_of_the_hold() {
        // Largest force, noise, force of the hold; pull and first force that follow.
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
                ..back(0.03 - x, if x > 0.0 { -9.0 } else { hold_n })
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
    fn the_tracker_gives_in_to_a_pull_over_two_millimetres_to_a_push_over_one_and_to_a_release_at_once() {
        let mut shaft = DryShaftFriction::default();
        shaft.rupture(0.02, 3.0);
        // How far off what is taught and tracked the force is; the travel before it; whether it jumped.
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
            // Going in again is no travel back; what the tip has felt is bounded by the largest force.
            (0.4, -2e-4, false, 0.0),
            (-5.0, 4e-4, false, 0.0),
            (7.0, 3e-4, false, 0.0),
        ] {
            let travel = f64::max(travel_m, 0.0);
            x += travel;
            off_n += slope * travel;
            let force_n = taught_n(x) + off_n + rest_n;
            let place = if travel_m < 0.0 { 0.03 - x - travel_m } else { 0.03 - x };
            let (friction_n, sd_n) = shaft.update(&ShaftSample { released: jumped, ..back(place, force_n) });
            off_n += released_n;
            let rest_n: f64 = rest_n - released_n;
            near(friction_n, taught_n(x) + off_n);
            let reach_m = if rest_n < 0.0 { 2e-3 } else { 1e-3 };
            off_n += (1.0 - (-travel / reach_m).exp()) * rest_n;
            slope += travel * rest_n / (2e-3 * 8e-3);
            let bounded = rest_n.clamp(-4.0, 4.0);
            scatter_n2 += travel / (travel + 2e-3) * (bounded * bounded - scatter_n2);
            near(sd_n, scatter_n2.sqrt());
        }
    }

    #[test]
    fn friction_turns_with_the_needle_and_begins_anew_at_a_rupture() {
        let mut shaft = ruptured();
        shaft.update(&felt(0.023, 3.0));
        near(shaft.update(&hold(0.023, 2.5)).0, 1.0);
        // Above where it turned it is still on the way back, there it is on the way in again, with no more friction than force.
        shaft.update(&back(0.023, 2.0));
        shaft.update(&back(0.0225, 1.0));
        assert!(shaft.back.is_some());
        shaft.update(&felt(0.0229, 0.7));
        assert!(shaft.back.is_some());
        shaft.update(&hold(0.024, 0.7));
        assert!(shaft.back.is_some(), "only an advance goes in again");
        near(shaft.update(&felt(0.023, 0.7)).0, 0.7);
        assert!(shaft.back.is_none());
        near(shaft.update(&felt(0.0232, 3.0)).0, 0.7);
        shaft.update(&back(0.0225, -1.0));
        shaft.rupture(0.0225, -0.5);
        assert!(shaft.back.is_none());
        near(shaft.update(&felt(0.0226, 1.5)).0, 1.5);
        shaft.rupture(0.0225, 0.8);
        near(shaft.update(&felt(0.0226 + MEMORY_M, 0.9)).0, 0.8);
    }

    #[test]
    fn in_a_hold_friction_grows_with_the_force_at_most_twofold_a_sample_and_not_from_none() {
        let level = |from_n: f64, to_n: f64| {
            let mut shaft = DryShaftFriction::default();
            shaft.rupture(0.02, 0.4);
            shaft.update(&felt(0.0202, 0.4));
            shaft.update(&felt(0.0215, from_n));
            shaft.update(&hold(0.0215, to_n)).0
        };
        near(level(0.8, 1.2), 0.6);
        near(level(0.8, 4.0), 0.8);
        near(level(0.8, 0.2), 0.1);
        near(level(0.8, -0.2), 0.0);
        near(level(-0.2, 0.5), 0.0);
    }
}
