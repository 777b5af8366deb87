//! What a sample says by itself, whatever the estimator makes of it: whether it can be used, how the
//! needle moves, and how fast the force changes.

use crate::config::{DerivativeSense, EnhanceConfig};
use crate::filter::{Coefficients, ForceDerivative};
use crate::guard::{MotionGuard, SCATTER_S};
use crate::sample::Sample;

/// What was seen in a sample.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// Time since the sample before in s; zero at the first.
    pub(crate) dt_s: f64,
    /// False when the sample is to be passed over; the rest is then empty.
    pub(crate) used: bool,
    /// A change of force may be a rupture.
    pub(crate) quiet: bool,
    /// The force derivative's switch.
    pub(crate) derivative_on: bool,
    /// Its trailing edge, where it tells a rupture.
    pub(crate) edge: bool,
}

/// Looks at the samples before the estimator does.
#[derive(Clone, Debug)]
pub(crate) struct Front {
    /// Of the motion's low-pass and scatter, and of the derivative's two low-passes.
    coefficients: Coefficients<4>,
    derivative: ForceDerivative,
    guard: MotionGuard,
    derivative_on: bool,
    last_s: f64,
    started: bool,
}

impl Front {
    pub(crate) fn new(config: &EnhanceConfig) -> Self {
        Self {
            coefficients: Coefficients::new([
                config.guard.acceleration_time_constant_s,
                SCATTER_S,
                config.derivative.force_time_constant_s,
                config.derivative.derivative_time_constant_s,
            ]),
            derivative: ForceDerivative::default(),
            guard: MotionGuard::default(),
            derivative_on: false,
            last_s: 0.0,
            started: false,
        }
    }

    /// The force derivative in N/s after the last sample.
    pub(crate) fn derivative_n_per_s(&self) -> f64 {
        self.derivative.value_n_per_s()
    }

    #[inline(always)]
    pub(crate) fn look(&mut self, config: &EnhanceConfig, sample: Sample) -> Seen {
        let dt_s = sample.time_s - self.last_s;
        if !sample.is_usable() || (self.started && dt_s <= 0.0) {
            return Seen::default();
        }
        let dt_s = if self.started { dt_s } else { 0.0 };
        self.last_s = sample.time_s;
        self.started = true;
        let [motion, scatter, force, derivative] = *self.coefficients.at(dt_s);
        self.guard.update(&config.guard, config.drop.standstill_mps, dt_s, [motion, scatter], sample);
        let rate = self.derivative.update(dt_s, [force, derivative], sample.force_n);
        let edge = self.switch(config, rate);
        Seen {
            dt_s,
            used: true,
            quiet: self.guard.is_quiet(),
            derivative_on: self.derivative_on,
            edge: edge && config.derivative.trailing_edge && !self.guard.is_slowing(&config.guard),
        }
    }

    /// Moves the derivative's switch; true on its trailing edge.
    #[inline(always)]
    fn switch(&mut self, config: &EnhanceConfig, rate_n_per_s: f64) -> bool {
        let config = &config.derivative;
        if !config.enabled {
            return false;
        }
        let rate = match config.sense {
            DerivativeSense::Rise => rate_n_per_s,
            DerivativeSense::Drop => -rate_n_per_s,
        };
        let was_on = self.derivative_on;
        self.derivative_on = if was_on { rate >= config.off_n_per_s } else { rate > config.on_n_per_s };
        was_on && !self.derivative_on
    }
}
