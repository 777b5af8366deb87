//! Motions during which a change of force does not count as a rupture \[D\]: reversal, hold, a sudden change of the commanded
//! speed, and travel over tissue that the needle has already passed.
//!
//! Position and velocity may be noisy: the velocity is smoothed, a change of speed is sudden only when it exceeds the scatter
//! of the acceleration, and the needle revisits tissue only when the tip is clearly above its deepest point.

use crate::config::GuardConfig;
use crate::sample::Sample;

/// Time constant of the acceleration scatter, in s.
pub(crate) const SCATTER_TIME_CONSTANT_S: f64 = 2.0;
/// Acceleration of a sudden change, in units of its scatter.
const SUDDEN_SCATTERS: f64 = 6.0;

#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionGuard {
    raw_mps: f64,
    velocity_mps: f64,
    acceleration_mps2: f64,
    scatter_mps2_squared: f64,
    hold_off_s: f64,
    deepest_m: f64,
    /// Filtered and raw velocity are equal, and there has been no acceleration.
    steady: bool,
}

impl Default for MotionGuard {
    fn default() -> Self {
        Self {
            raw_mps: 0.0,
            velocity_mps: 0.0,
            acceleration_mps2: 0.0,
            scatter_mps2_squared: 0.0,
            hold_off_s: 0.0,
            deepest_m: f64::NEG_INFINITY,
            steady: false,
        }
    }
}

impl MotionGuard {
    /// The first sample.
    pub(crate) fn start(&mut self, config: &GuardConfig, standstill_mps: f64, sample: Sample) {
        self.velocity_mps = sample.velocity_mps;
        self.update_hold_off(config, standstill_mps, false, sample);
    }

    /// Takes a sample, `dt_s` after the previous one, with the gains of the motion low-pass and of the scatter.
    #[inline]
    pub(crate) fn update(
        &mut self,
        config: &GuardConfig,
        standstill_mps: f64,
        dt_s: f64,
        [low_pass, scatter]: [f64; 2],
        sample: Sample,
    ) {
        self.hold_off_s -= dt_s;
        // Constant velocity leaves all filters as they are.
        let steady = self.steady && sample.velocity_mps == self.raw_mps;
        let sudden = !steady && self.filter(config, dt_s, low_pass, scatter, sample.velocity_mps);
        self.update_hold_off(config, standstill_mps, sudden, sample);
    }

    /// Smooths the motion; true where the speed changes suddenly.
    #[inline]
    fn filter(&mut self, config: &GuardConfig, dt_s: f64, low_pass: f64, scatter: f64, v: f64) -> bool {
        let a = (v - self.raw_mps) / dt_s;
        self.velocity_mps += low_pass * (v - self.velocity_mps);
        self.acceleration_mps2 += low_pass * (a - self.acceleration_mps2);
        let size = self.acceleration_mps2 * self.acceleration_mps2;
        let scattered = SUDDEN_SCATTERS * SUDDEN_SCATTERS * self.scatter_mps2_squared;
        let least = config.sudden_mps2 * config.sudden_mps2;
        let limit = if scattered > least { scattered } else { least };
        let sudden = size > limit;
        // A jump enters the scatter clipped to the limit.
        let clipped = if sudden { limit } else { size };
        self.scatter_mps2_squared += scatter * (clipped - self.scatter_mps2_squared);
        self.steady =
            self.velocity_mps == v && self.acceleration_mps2 == 0.0 && self.scatter_mps2_squared == 0.0;
        sudden
    }

    #[inline]
    fn update_hold_off(&mut self, config: &GuardConfig, standstill_mps: f64, sudden: bool, sample: Sample) {
        self.raw_mps = sample.velocity_mps;
        if sample.position_m > self.deepest_m {
            self.deepest_m = sample.position_m;
        }
        if sudden || self.velocity_mps < standstill_mps || self.is_revisiting(config, sample.position_m) {
            self.hold_off_s = config.rest_s;
        }
    }

    /// The tip is clearly above its deepest point.
    #[inline]
    pub(crate) fn is_revisiting(&self, config: &GuardConfig, position_m: f64) -> bool {
        position_m < self.deepest_m - config.revisit_margin_m
    }

    /// A change of force may be a rupture.
    #[inline]
    pub(crate) fn allows_detection(&self) -> bool {
        self.hold_off_s <= 0.0
    }

    /// The needle slows down so fast that friction alone makes the force fall.
    #[inline]
    pub(crate) fn is_slowing(&self, config: &GuardConfig) -> bool {
        self.acceleration_mps2 < -config.slowing_per_s * self.velocity_mps.abs()
    }
}

#[cfg(test)]
mod tests;
