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
    flags: u64,
}

impl Seen {
    const USED: u64 = 1;
    const QUIET: u64 = 2;
    const DERIVATIVE_ON: u64 = 4;
    const EDGE: u64 = 8;

    /// False when the sample is to be passed over; the rest is then empty.
    #[inline(always)]
    pub(crate) fn used(self) -> bool {
        self.flags & Self::USED != 0
    }

    /// A change of force may be a rupture.
    #[inline(always)]
    pub(crate) fn quiet(self) -> bool {
        self.flags & Self::QUIET != 0
    }

    /// The force derivative's switch.
    #[inline(always)]
    pub(crate) fn derivative_on(self) -> bool {
        self.flags & Self::DERIVATIVE_ON != 0
    }

    /// Its trailing edge, where it tells a rupture.
    #[inline(always)]
    pub(crate) fn edge(self) -> bool {
        self.flags & Self::EDGE != 0
    }
}

/// Looks at the samples before the estimator does.
#[derive(Clone, Debug)]
pub(crate) struct Front {
    /// Of the motion's low-pass and scatter, and of the derivative's two low-passes.
    coefficients: Coefficients<4>,
    derivative: ForceDerivative,
    guard: MotionGuard,
    derivative_on: bool,
    /// Time of the last sample that was used in s; minus infinity before the first.
    last_s: f64,
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
            last_s: f64::NEG_INFINITY,
        }
    }

    /// The force derivative in N/s after the last sample.
    pub(crate) fn derivative_n_per_s(&self) -> f64 {
        self.derivative.value_n_per_s()
    }

    /// Looks at a sample and writes down what it sees.
    #[inline(always)]
    pub(crate) fn look(&mut self, config: &EnhanceConfig, sample: Sample, seen: &mut Seen) {
        let dt_s = sample.time_s - self.last_s;
        // Also false for times that are not finite, and before the first sample.
        if !(dt_s > 0.0 && dt_s < f64::MAX && sample.is_in_range()) {
            return self.look_aside(config, sample, seen);
        }
        self.last_s = sample.time_s;
        let [motion, scatter, force, derivative] = *self.coefficients.at(dt_s);
        self.guard.update(&config.guard, config.drop.standstill_mps, dt_s, [motion, scatter], sample);
        let rate = self.derivative.update(dt_s, [force, derivative], sample.force_n);
        let edge = self.switch(config, rate);
        seen.dt_s = dt_s;
        seen.flags = Seen::USED
            | if self.guard.is_quiet() { Seen::QUIET } else { 0 }
            | if self.derivative_on { Seen::DERIVATIVE_ON } else { 0 };
        if edge && config.derivative.trailing_edge && !self.guard.is_slowing(&config.guard) {
            seen.flags |= Seen::EDGE;
        }
    }

    /// The first sample, and those that cannot be used.
    #[cold]
    #[inline(never)]
    fn look_aside(&mut self, config: &EnhanceConfig, sample: Sample, seen: &mut Seen) {
        *seen = Seen::default();
        if self.last_s > f64::NEG_INFINITY || !sample.is_usable() {
            return;
        }
        self.last_s = sample.time_s;
        self.guard.begin(&config.guard, config.drop.standstill_mps, sample);
        self.derivative.begin(sample.force_n);
        self.switch(config, 0.0);
        seen.flags = Seen::USED
            | if self.guard.is_quiet() { Seen::QUIET } else { 0 }
            | if self.derivative_on { Seen::DERIVATIVE_ON } else { 0 };
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
