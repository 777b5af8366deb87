//! What the way back itself shows: changes over more than a given travel count as friction, faster ones as the tip's, and a sudden release of the
//! pull, which a tip that is only pulled cannot make, as friction. It corrects what is expected of friction, whoever says that.

use super::force_predictor::MEMORY_M;
use super::shaft_friction::{PRESLIDING_TRAVEL_M, ShaftSample};

/// Travel of the tracker, in m: a change at the tip keeps `exp(-x/2 mm)` of itself after a travel `x`.
pub(super) const TRACKING_TRAVEL_M: f64 = 2e-3;
/// Travel over which the tracker's slope is learned, as a share of its own: level and slope together are critically damped.
const SLOPE: f64 = 4.0;
/// Travel over which it gives in to an excess push, which no tip can make on the way back, as a share of its own.
const EXCESS: f64 = 0.5;

/// How far off what is expected of friction is.
#[derive(Clone, Copy, Debug)]
pub(super) struct RetractionTracker {
    /// Travel over which a change becomes friction, in m.
    memory_m: f64,
    pub(super) shallowest_m: f64,
    offset_n: f64,
    slope: f64,
    last_residual_n: f64,
    scatter_n2: f64,
}

impl RetractionTracker {
    pub(super) fn new(reach_m: f64, position_m: f64, off_n: f64) -> Self {
        Self {
            memory_m: reach_m,
            shallowest_m: position_m,
            offset_n: off_n,
            slope: 0.0,
            last_residual_n: 0.0,
            scatter_n2: 0.0,
        }
    }

    /// Travel back since the sample before, in m; what was travelled back is not travelled back again.
    pub(super) fn retracted_by(&mut self, position_m: f64) -> f64 {
        let travel = (self.shallowest_m - position_m).max(0.0);
        if travel > 0.0 {
            self.shallowest_m = position_m;
        }
        travel
    }

    /// Takes a sample of which `expected_n` is said to be friction; returns the friction in N and its standard deviation.
    pub(super) fn update(&mut self, felt: &ShaftSample, travel: f64, expected_n: f64) -> (f64, f64) {
        self.offset_n += self.slope * travel;
        let mut rest = felt.force_n - expected_n - self.offset_n;
        if felt.released && rest > 0.0 {
            let released = (rest - self.last_residual_n).clamp(0.0, rest);
            self.offset_n += released;
            rest -= released;
        }
        self.last_residual_n = rest;
        let friction = expected_n + self.offset_n;
        let reach = if rest < 0.0 { self.memory_m } else { EXCESS * self.memory_m };
        self.offset_n += (1.0 - libm::exp(-travel / reach)) * rest;
        self.slope += travel / (self.memory_m * (SLOPE * self.memory_m)) * rest;
        let bounded = rest.clamp(-felt.peak_force_n, felt.peak_force_n);
        self.scatter_n2 += travel / (travel + self.memory_m) * (bounded * bounded - self.scatter_n2);
        (friction, libm::sqrt(self.scatter_n2))
    }
}

/// Friction that a law says which was fitted elsewhere.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ModelFriction {
    /// Where the way back began, and how far off the law is on it.
    back: Option<(f64, RetractionTracker)>,
    /// The smoothed force and the law's friction of the sample before, in N.
    before: Option<(f64, f64)>,
}

impl ModelFriction {
    /// Takes a sample of which the law says that `law_n` is friction, with the smoothed force `smooth_n`; returns the friction in N and its
    /// standard deviation.
    ///
    /// On the way in friction is as the law says, between none and the force. On the way back the tracker corrects it, from what the law missed
    /// of the force before the turn on, all of which is friction: where the law jumps with the speed, so does the force. What a law misses are features of presliding in a wrong place or size, as long as those. That the shaft lets go is for the law to say, where it does for the force: places
    /// vary between insertions, and a release too early or too late would look like a tip that is caught.
    pub(super) fn update(&mut self, felt: &ShaftSample, smooth_n: f64, law_n: f64) -> (f64, f64) {
        let (force_before_n, mut before_n) =
            self.before.replace((smooth_n, law_n)).unwrap_or((smooth_n, law_n));
        if let Some((turn_m, _)) = self.back
            && felt.advancing
            && felt.position_m >= turn_m
        {
            self.back = None;
        }
        if self.back.is_none() && felt.retracting {
            let off_n = force_before_n - before_n;
            self.back =
                Some((felt.position_m, RetractionTracker::new(PRESLIDING_TRAVEL_M, felt.position_m, off_n)));
            before_n = law_n;
        }
        let Some((_, tracker)) = &mut self.back else {
            let friction = law_n.clamp(0.0, felt.force_n.max(0.0));
            return (friction, 0.25 * friction);
        };
        if !felt.track_retraction {
            return (law_n, 0.25 * felt.peak_force_n);
        }
        let travel = tracker.retracted_by(felt.position_m);
        let released = law_n - before_n;
        // It goes by more than all of itself in a millimetre: presliding takes several.
        if released > 0.0 && released * MEMORY_M > before_n.abs() * travel {
            tracker.offset_n -= released;
        }
        tracker.update(felt, travel, law_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    fn back(position_m: f64, force_n: f64) -> ShaftSample {
        ShaftSample {
            gain: 1.0,
            position_m,
            force_n,
            advancing: false,
            retracting: true,
            peak_force_n: 4.0,
            released: false,
            noise_variance_n2: 1e-4,
            track_retraction: true,
        }
    }

    /// Over a way back by 50 um steps from 30 mm on, the enhanced force of what is measured with what a law says.
    fn tip_n(measured: impl Fn(f64) -> f64, law: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let mut told = ModelFriction::default();
        let mut jumped_m = f64::NEG_INFINITY;
        let mut last_n = measured(0.0);
        (0..400)
            .map(|k| {
                let x = 5e-5 * f64::from(k);
                let force_n = measured(x);
                if force_n - last_n > 0.1 {
                    jumped_m = x;
                }
                last_n = force_n;
                let felt = ShaftSample { released: x - jumped_m < 3e-4, ..back(0.03 - x, force_n) };
                (x, force_n - told.update(&felt, force_n, law(x)).0)
            })
            .collect()
    }

    /// Friction that is stretched over millimetres and lets go at `at`.
    fn grip(at: f64) -> impl Fn(f64) -> f64 {
        move |x| if x < at { -1.5 + 3.5 * (-x / 2.5e-3).exp() } else { -0.4 }
    }

    fn largest(tip: &[(f64, f64)]) -> f64 {
        tip.iter().map(|(_, t)| t.abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_law_that_holds_leaves_nothing_of_the_way_back() {
        assert!(largest(&tip_n(grip(0.009), grip(0.009))) < 1e-9);
    }

    /// Where friction goes with the speed, force and law jump together at the turn, whether it turns from a hold or at once.
    #[test]
    fn a_law_that_jumps_with_the_speed_leaves_nothing_of_the_way_back() {
        for before_n in [2.0, 0.0] {
            let mut told = ModelFriction::default();
            let into = ShaftSample { advancing: before_n > 0.0, retracting: false, ..back(0.03, before_n) };
            told.update(&into, before_n, before_n);
            for k in 0..200 {
                // The smoothed force follows in some samples.
                let smooth_n = -3.0 + (3.0 + before_n) * 0.9_f64.powi(k + 1);
                let (friction_n, _) = told.update(&back(0.03 - 2e-5 * f64::from(k), -3.0), smooth_n, -3.0);
                assert!((friction_n + 3.0).abs() < 1e-9, "{friction_n} after {before_n} at {k}");
            }
        }
    }

    /// A law replayed leaves 1.1 N from where it lets go to where the shaft does.
    #[test]
    fn a_shaft_that_lets_go_a_millimetre_before_or_after_the_law_looks_like_no_tip() {
        for at in [0.008, 0.0085, 0.0095, 0.010] {
            let found = largest(&tip_n(grip(at), grip(0.009)));
            assert!(found < 0.2, "{found} N where it lets go at {at} m");
        }
    }

    #[test]
    fn a_law_whose_shaft_lets_go_where_the_measured_one_does_not_is_corrected_for_good() {
        let found = largest(&tip_n(grip(1.0), grip(0.009)));
        assert!(found < 0.2, "{found} N");
    }

    #[test]
    fn a_law_of_friction_that_is_a_fifth_off_is_corrected_over_millimetres() {
        let tip = tip_n(grip(1.0), |x| 1.2 * grip(1.0)(x));
        assert!(largest(&tip) < 0.2, "{}", largest(&tip));
        let last = tip.iter().rev().take(40).map(|(_, t)| t.abs()).fold(0.0, f64::max);
        assert!(last < 0.05, "{last} of 0.3 N");
    }

    #[test]
    fn a_tip_that_is_caught_keeps_two_thirds_of_its_pull_over_a_millimetre_with_a_law() {
        let pulled = |x: f64| grip(1.0)(x) - if x > 0.0099 { 0.5 } else { 0.0 };
        let tip = tip_n(pulled, grip(1.0));
        let at = |x: f64| tip.iter().find(|t| (t.0 - x).abs() < 1e-5).map_or(f64::NAN, |t| t.1);
        assert!((-0.5..-0.47).contains(&at(0.01)), "{}", at(0.01));
        // exp(-1/2.5) of it, and the slope has learned a tenth.
        assert!((-0.5 * 0.67..-0.5 * 0.6).contains(&at(0.011)), "{}", at(0.011));
    }

    #[test]
    fn on_the_way_in_a_law_says_friction_between_none_and_the_force_and_in_again_behind_the_turn() {
        let mut told = ModelFriction::default();
        let into = |z: f64, f: f64| ShaftSample { advancing: true, retracting: false, ..back(z, f) };
        for (force_n, law_n, friction_n) in
            [(3.0, 1.0, 1.0), (0.5, 1.0, 0.5), (-0.2, 1.0, 0.0), (3.0, -1.0, 0.0)]
        {
            let found = told.update(&into(0.02, force_n), force_n, law_n);
            assert_eq!(found, (friction_n, 0.25 * friction_n));
        }
        // All of the force of the hold is friction, and so it stays until the needle is where it turned.
        told.update(&ShaftSample { retracting: false, ..back(0.02, 2.0) }, 2.0, 1.4);
        assert_eq!(told.update(&back(0.02, 2.0), 2.0, 1.4).0, 2.0);
        assert_eq!(told.update(&into(0.019, 2.0), 2.0, 1.4).0, 2.0);
        assert_eq!(told.update(&into(0.02, 2.0), 2.0, 1.4).0, 1.4);
        // Without the tracker a law is taken as it is.
        let plain = ShaftSample { track_retraction: false, ..back(0.02, 2.0) };
        assert_eq!(told.update(&plain, 2.0, -0.7), (-0.7, 1.0));
    }
}
