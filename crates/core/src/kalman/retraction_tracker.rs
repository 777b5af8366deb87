//! Correction of a friction prediction during retraction. Differences that persist over a given travel count as friction,
//! faster ones as tip force; a sudden release of the pull counts as friction, because a tip that is only pulled cannot cause
//! it.

use super::force_predictor::MEMORY_M;
use crate::bounds::{at_least, at_most};

/// Travel over which a difference becomes friction, in m: a tip force decays as `exp(-x/2 mm)`.
pub(super) const TRACKING_TRAVEL_M: f64 = 2e-3;
/// Travel over which the slope is learned, relative to that of the level: critically damped.
const SLOPE_TRAVEL_RATIO: f64 = 4.0;
/// Travel over which an excess push is absorbed, relative to that of a pull: no tip pushes during retraction.
const PUSH_TRAVEL_RATIO: f64 = 0.5;
/// Travel over which the force of a hold relaxes to zero during retraction, in m: presliding in soft tissue extends over
/// millimetres.
pub(super) const PRESLIDING_TRAVEL_M: f64 = 2.5e-3;

/// A sample as the shaft-friction models need it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShaftSample {
    /// Low-pass gain of the smoothed force.
    pub(crate) gain: f64,
    pub(crate) position_m: f64,
    /// Force without sensor bias in N.
    pub(crate) force_n: f64,
    pub(crate) advancing: bool,
    pub(crate) retracting: bool,
    /// Largest force so far in N.
    pub(crate) peak_force_n: f64,
    /// The force has just jumped up.
    pub(crate) released: bool,
    /// Noise variance in N².
    pub(crate) noise_variance_n2: f64,
    pub(crate) track_retraction: bool,
}

/// Offset of a friction prediction.
#[derive(Clone, Copy, Debug)]
pub(super) struct RetractionTracker {
    /// Travel over which a difference becomes friction, in m.
    memory_m: f64,
    pub(super) shallowest_m: f64,
    offset_n: f64,
    slope: f64,
    last_residual_n: f64,
    residual_n2: f64,
}

impl RetractionTracker {
    pub(super) fn new(memory_m: f64, position_m: f64, offset_n: f64) -> Self {
        Self {
            memory_m,
            shallowest_m: position_m,
            offset_n,
            slope: 0.0,
            last_residual_n: 0.0,
            residual_n2: 0.0,
        }
    }

    /// Retraction since the previous sample in m; travel that was retracted before does not count again.
    pub(super) fn retracted_by(&mut self, position_m: f64) -> f64 {
        let travel = (self.shallowest_m - position_m).max(0.0);
        if travel > 0.0 {
            self.shallowest_m = position_m;
        }
        travel
    }

    /// Takes a sample with its predicted friction; returns friction in N and its standard deviation.
    pub(super) fn update(&mut self, sample: &ShaftSample, travel: f64, predicted_n: f64) -> (f64, f64) {
        self.offset_n += self.slope * travel;
        let mut residual = sample.force_n - predicted_n - self.offset_n;
        if sample.released && residual > 0.0 {
            let released = at_most(residual, at_least(0.0, residual - self.last_residual_n));
            self.offset_n += released;
            residual -= released;
        }
        self.last_residual_n = residual;
        let friction = predicted_n + self.offset_n;
        let memory = if residual < 0.0 { self.memory_m } else { PUSH_TRAVEL_RATIO * self.memory_m };
        self.offset_n += (1.0 - libm::exp(-travel / memory)) * residual;
        self.slope += travel / (self.memory_m * (SLOPE_TRAVEL_RATIO * self.memory_m)) * residual;
        let bounded = at_least(-sample.peak_force_n, at_most(sample.peak_force_n, residual));
        self.residual_n2 += travel / (travel + self.memory_m) * (bounded * bounded - self.residual_n2);
        (friction, libm::sqrt(self.residual_n2))
    }
}

/// Friction along the shaft from an identified model.
///
/// During insertion the model's friction is used, limited to between zero and the force. During retraction a tracker corrects
/// it, starting from the difference between force and model before the turn, all of which is friction. Typical model errors
/// are presliding features of wrong size or position, so the tracker's memory is the presliding travel. Releases of the shaft
/// differ in place between insertions; the model's release is therefore withheld until the force shows one, because a release
/// at the wrong place would look like a tip force.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ModelFriction {
    /// Where retraction began, and the correction since.
    retraction: Option<(f64, RetractionTracker)>,
    /// Smoothed force and model friction at the previous sample, in N.
    before: Option<(f64, f64)>,
}

impl ModelFriction {
    /// Takes a sample with the smoothed force and the model's friction; returns friction in N and its standard deviation.
    pub(super) fn update(&mut self, sample: &ShaftSample, smoothed_n: f64, model_n: f64) -> (f64, f64) {
        let (force_before_n, mut before_n) =
            self.before.replace((smoothed_n, model_n)).unwrap_or((smoothed_n, model_n));
        if let Some((turn_m, _)) = self.retraction
            && sample.advancing
            && sample.position_m >= turn_m
        {
            self.retraction = None;
        }
        if self.retraction.is_none() && sample.retracting {
            let offset_n = force_before_n - before_n;
            let tracker = RetractionTracker::new(PRESLIDING_TRAVEL_M, sample.position_m, offset_n);
            self.retraction = Some((sample.position_m, tracker));
            before_n = model_n;
        }
        let Some((_, tracker)) = &mut self.retraction else {
            let friction = at_least(0.0, at_most(sample.force_n, model_n));
            return (friction, 0.25 * friction);
        };
        if !sample.track_retraction {
            return (model_n, 0.25 * sample.peak_force_n);
        }
        let travel = tracker.retracted_by(sample.position_m);
        let released = model_n - before_n;
        // A release: a change by more than the whole friction within a millimetre. Presliding takes several millimetres.
        if released > 0.0 && released * MEMORY_M > before_n.abs() * travel {
            tracker.offset_n -= released;
        }
        tracker.update(sample, travel, model_n)
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_support::retracting;
    use super::*;
    use alloc::vec::Vec;

    /// Enhanced force over a retraction from 30 mm in steps of 50 um, for this measured force and model friction.
    fn tip_n(measured: impl Fn(f64) -> f64, model_n: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let mut model = ModelFriction::default();
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
                let shaft_sample =
                    ShaftSample { released: x - jumped_m < 3e-4, ..retracting(0.03 - x, force_n) };
                (x, force_n - model.update(&shaft_sample, force_n, model_n(x)).0)
            })
            .collect()
    }

    /// Friction that stretches over millimetres and releases at `at`.
    fn stretching_friction(at: f64) -> impl Fn(f64) -> f64 {
        move |x| if x < at { -1.5 + 3.5 * (-x / 2.5e-3).exp() } else { -0.4 }
    }

    fn largest(tip: &[(f64, f64)]) -> f64 {
        tip.iter().map(|(_, t)| t.abs()).fold(0.0, f64::max)
    }

    #[test]
    fn an_exact_model_leaves_no_residual() {
        assert!(largest(&tip_n(stretching_friction(0.009), stretching_friction(0.009))) < 1e-9);
    }

    /// Viscous friction: force and model jump together at the turn, with or without a hold.
    #[test]
    fn a_model_that_jumps_with_the_speed_leaves_no_residual() {
        for before_n in [2.0, 0.0] {
            let mut model = ModelFriction::default();
            let into =
                ShaftSample { advancing: before_n > 0.0, retracting: false, ..retracting(0.03, before_n) };
            model.update(&into, before_n, before_n);
            for k in 0..200 {
                // The smoothed force lags.
                let smoothed_n = -3.0 + (3.0 + before_n) * 0.9_f64.powi(k + 1);
                let (friction_n, _) =
                    model.update(&retracting(0.03 - 2e-5 * f64::from(k), -3.0), smoothed_n, -3.0);
                assert!((friction_n + 3.0).abs() < 1e-9, "{friction_n} after {before_n} at {k}");
            }
        }
    }

    /// Replayed as it is, the model would leave 1.1 N between both releases.
    #[test]
    fn a_release_a_millimetre_off_the_model_is_no_tip_force() {
        for at in [0.008, 0.0085, 0.0095, 0.010] {
            let found = largest(&tip_n(stretching_friction(at), stretching_friction(0.009)));
            assert!(found < 0.2, "{found} N with a release at {at} m");
        }
    }

    #[test]
    fn a_release_in_the_model_alone_is_withheld() {
        let found = largest(&tip_n(stretching_friction(1.0), stretching_friction(0.009)));
        assert!(found < 0.2, "{found} N");
    }

    #[test]
    fn a_model_off_by_a_fifth_is_corrected_over_millimetres() {
        let tip = tip_n(stretching_friction(1.0), |x| 1.2 * stretching_friction(1.0)(x));
        assert!(largest(&tip) < 0.2, "{}", largest(&tip));
        let last = tip.iter().rev().take(40).map(|(_, t)| t.abs()).fold(0.0, f64::max);
        assert!(last < 0.05, "{last} of 0.3 N");
    }

    #[test]
    fn a_caught_tip_keeps_two_thirds_of_its_pull_over_a_millimetre_with_a_model() {
        let pulled = |x: f64| stretching_friction(1.0)(x) - if x > 0.0099 { 0.5 } else { 0.0 };
        let tip = tip_n(pulled, stretching_friction(1.0));
        let at = |x: f64| tip.iter().find(|t| (t.0 - x).abs() < 1e-5).map_or(f64::NAN, |t| t.1);
        assert!((-0.5..-0.47).contains(&at(0.01)), "{}", at(0.01));
        // exp(-1/2.5) of it, less a tenth by the slope.
        assert!((-0.5 * 0.67..-0.5 * 0.6).contains(&at(0.011)), "{}", at(0.011));
    }

    #[test]
    fn during_insertion_model_friction_is_limited_to_the_force() {
        let mut model = ModelFriction::default();
        let into = |z: f64, f: f64| ShaftSample { advancing: true, retracting: false, ..retracting(z, f) };
        for (force_n, model_n, friction_n) in
            [(3.0, 1.0, 1.0), (0.5, 1.0, 0.5), (-0.2, 1.0, 0.0), (3.0, -1.0, 0.0)]
        {
            let found = model.update(&into(0.02, force_n), force_n, model_n);
            assert_eq!(found, (friction_n, 0.25 * friction_n));
        }
        // The whole hold force is friction until the needle passes the turn again.
        model.update(&ShaftSample { retracting: false, ..retracting(0.02, 2.0) }, 2.0, 1.4);
        assert_eq!(model.update(&retracting(0.02, 2.0), 2.0, 1.4).0, 2.0);
        assert_eq!(model.update(&into(0.019, 2.0), 2.0, 1.4).0, 2.0);
        assert_eq!(model.update(&into(0.02, 2.0), 2.0, 1.4).0, 1.4);
        // Without tracking the model is used as it is.
        let plain = ShaftSample { track_retraction: false, ..retracting(0.02, 2.0) };
        assert_eq!(model.update(&plain, 2.0, -0.7), (-0.7, 1.0));
    }
}
