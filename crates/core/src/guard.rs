//! What is not a rupture \[D\]: reversal, hold, a sudden change of the commanded speed, and travel
//! over ground where the needle has already been.
//!
//! Position and velocity may be noisy: velocity is smoothed before it is judged, a change of speed is
//! sudden only when it stands out of the acceleration's own scatter, and ground counts as old only
//! when the tip is clearly above its deepest point.

use crate::config::GuardConfig;
use crate::sample::Sample;

/// Time over which the scatter of the acceleration is learnt, in s.
pub(crate) const SCATTER_S: f64 = 2.0;
/// How far the acceleration must stand out of its scatter to be a sudden change.
const SCATTERS: f64 = 6.0;

/// Watches the motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionGuard {
    raw_mps: f64,
    velocity_mps: f64,
    acceleration_mps2: f64,
    scatter_mps2_squared: f64,
    rest_s: f64,
    deepest_m: f64,
    /// Filtered speed and speed are the same, and there never was any acceleration.
    even: bool,
}

impl Default for MotionGuard {
    fn default() -> Self {
        Self {
            raw_mps: 0.0,
            velocity_mps: 0.0,
            acceleration_mps2: 0.0,
            scatter_mps2_squared: 0.0,
            rest_s: 0.0,
            deepest_m: f64::NEG_INFINITY,
            even: false,
        }
    }
}

impl MotionGuard {
    /// The first sample.
    pub(crate) fn begin(&mut self, config: &GuardConfig, standstill_mps: f64, sample: Sample) {
        self.velocity_mps = sample.velocity_mps;
        self.settle(config, standstill_mps, false, sample);
    }

    /// Takes a sample, `dt_s` after the one before, with the coefficients of the motion's low-pass and of
    /// the scatter's.
    #[inline]
    pub(crate) fn update(
        &mut self,
        config: &GuardConfig,
        standstill_mps: f64,
        dt_s: f64,
        [low_pass, scatter]: [f64; 2],
        sample: Sample,
    ) {
        self.rest_s -= dt_s;
        // A needle that goes on as evenly as it did leaves all filters where they are.
        let even = self.even && sample.velocity_mps == self.raw_mps;
        let sudden = !even && self.filter(config, dt_s, low_pass, scatter, sample.velocity_mps);
        self.settle(config, standstill_mps, sudden, sample);
    }

    /// Smooths the motion; true where the speed changes suddenly.
    #[inline]
    fn filter(&mut self, config: &GuardConfig, dt_s: f64, low_pass: f64, scatter: f64, v: f64) -> bool {
        let a = (v - self.raw_mps) / dt_s;
        self.velocity_mps += low_pass * (v - self.velocity_mps);
        self.acceleration_mps2 += low_pass * (a - self.acceleration_mps2);
        let size = self.acceleration_mps2 * self.acceleration_mps2;
        let scattered = SCATTERS * SCATTERS * self.scatter_mps2_squared;
        let least = config.sudden_mps2 * config.sudden_mps2;
        let limit = if scattered > least { scattered } else { least };
        let sudden = size > limit;
        // One jump teaches little: it counts at most as what was just bearable.
        let bearable = if sudden { limit } else { size };
        self.scatter_mps2_squared += scatter * (bearable - self.scatter_mps2_squared);
        self.even =
            self.velocity_mps == v && self.acceleration_mps2 == 0.0 && self.scatter_mps2_squared == 0.0;
        sudden
    }

    /// Whether detection rests after this sample.
    #[inline]
    fn settle(&mut self, config: &GuardConfig, standstill_mps: f64, sudden: bool, sample: Sample) {
        self.raw_mps = sample.velocity_mps;
        if sample.position_m > self.deepest_m {
            self.deepest_m = sample.position_m;
        }
        if sudden || self.velocity_mps < standstill_mps || self.is_old_ground(config, sample.position_m) {
            self.rest_s = config.rest_s;
        }
    }

    /// True where the tip is clearly above its deepest point.
    #[inline]
    pub(crate) fn is_old_ground(&self, config: &GuardConfig, position_m: f64) -> bool {
        position_m < self.deepest_m - config.old_ground_m
    }

    /// True while a change of force may be a rupture.
    #[inline]
    pub(crate) fn is_quiet(&self) -> bool {
        self.rest_s <= 0.0
    }

    /// True while the needle slows down so fast that friction alone makes the force fall.
    #[inline]
    pub(crate) fn is_slowing(&self, config: &GuardConfig) -> bool {
        self.acceleration_mps2 < -config.slowing_per_s * self.velocity_mps.abs()
    }
}
