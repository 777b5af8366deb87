//! What is not a rupture \[D\]: reversal, hold, a sudden change of the commanded speed, and travel
//! over ground where the needle has already been.

use crate::config::GuardConfig;
use crate::filter::Coefficient;
use crate::sample::Sample;

/// Watches the motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionGuard {
    low_pass: Coefficient,
    velocity_mps: f64,
    acceleration_mps2: f64,
    rest_s: f64,
    deepest_m: f64,
    started: bool,
}

impl MotionGuard {
    pub(crate) fn new(config: &GuardConfig) -> Self {
        Self {
            low_pass: Coefficient::new(config.acceleration_time_constant_s),
            velocity_mps: 0.0,
            acceleration_mps2: 0.0,
            rest_s: 0.0,
            deepest_m: f64::NEG_INFINITY,
            started: false,
        }
    }

    #[inline]
    pub(crate) fn update(&mut self, config: &GuardConfig, standstill_mps: f64, dt_s: f64, sample: &Sample) {
        let v = sample.velocity_mps;
        if self.started && dt_s > 0.0 {
            let a = (v - self.velocity_mps) / dt_s;
            self.acceleration_mps2 += self.low_pass.at(dt_s) * (a - self.acceleration_mps2);
        }
        self.started = true;
        self.velocity_mps = v;
        self.rest_s -= dt_s;
        let new_ground = sample.position_m >= self.deepest_m;
        if new_ground {
            self.deepest_m = sample.position_m;
        }
        if v < standstill_mps || !new_ground || self.acceleration_mps2.abs() > config.sudden_mps2 {
            self.rest_s = config.rest_s;
        }
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
