//! Per-sample preprocessing, independent of the estimator: validity, motion guard, switch of the force derivative.

use super::low_pass::{ForceDerivative, LowPassCoefficients};
use super::motion_guard::{MotionGuard, SCATTER_TIME_CONSTANT_S};
use crate::config::{DerivativeSense, EnhanceConfig};
use crate::sample::Sample;

/// Result of preprocessing a sample.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SampleFlags {
    /// Time since the previous sample in s; zero at the first.
    pub(crate) dt_s: f64,
    flags: u64,
}

impl SampleFlags {
    const USED: u64 = 1;
    const DETECTION_ENABLED: u64 = 2;
    const DERIVATIVE_ON: u64 = 4;
    const TRAILING_EDGE: u64 = 8;

    /// False when the sample is ignored; the other flags are then unset.
    #[inline(always)]
    pub(crate) fn used(self) -> bool {
        self.flags & Self::USED != 0
    }

    /// A change of force may be a rupture.
    #[inline(always)]
    pub(crate) fn detection_enabled(self) -> bool {
        self.flags & Self::DETECTION_ENABLED != 0
    }

    /// State of the derivative switch.
    #[inline(always)]
    pub(crate) fn derivative_on(self) -> bool {
        self.flags & Self::DERIVATIVE_ON != 0
    }

    /// A trailing edge of the derivative switch that counts as a rupture.
    #[inline(always)]
    pub(crate) fn trailing_edge(self) -> bool {
        self.flags & Self::TRAILING_EDGE != 0
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Preprocessor {
    /// Gains of the motion low-pass, the acceleration scatter, and the two low-passes of the derivative.
    coefficients: LowPassCoefficients<4>,
    derivative: ForceDerivative,
    guard: MotionGuard,
    derivative_on: bool,
    /// Time of the last used sample in s; minus infinity before the first.
    last_s: f64,
}

impl Preprocessor {
    pub(crate) fn new(config: &EnhanceConfig) -> Self {
        Self {
            coefficients: LowPassCoefficients::new([
                config.guard.acceleration_time_constant_s,
                SCATTER_TIME_CONSTANT_S,
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

    /// Takes a sample and sets its flags.
    #[inline(always)]
    pub(crate) fn process(&mut self, config: &EnhanceConfig, sample: Sample, out: &mut SampleFlags) {
        let dt_s = sample.time_s - self.last_s;
        // Also false for times that are not finite, and before the first sample.
        if !(dt_s > 0.0 && dt_s < f64::MAX && sample.is_in_range()) {
            return self.process_first_or_invalid(config, sample, out);
        }
        self.last_s = sample.time_s;
        let [motion, scatter, force, derivative] = *self.coefficients.at_interval(dt_s);
        self.guard.update(&config.guard, config.drop.standstill_mps, dt_s, [motion, scatter], sample);
        let rate = self.derivative.update(dt_s, [force, derivative], sample.force_n);
        let edge = self.update_switch(config, rate);
        out.dt_s = dt_s;
        out.flags = self.flags();
        if edge && config.derivative.trailing_edge && !self.guard.is_slowing(&config.guard) {
            out.flags |= SampleFlags::TRAILING_EDGE;
        }
    }

    #[cold]
    #[inline(never)]
    fn process_first_or_invalid(&mut self, config: &EnhanceConfig, sample: Sample, out: &mut SampleFlags) {
        *out = SampleFlags::default();
        if self.last_s > f64::NEG_INFINITY || !sample.is_usable() {
            return;
        }
        self.last_s = sample.time_s;
        self.guard.start(&config.guard, config.drop.standstill_mps, sample);
        self.derivative.begin(sample.force_n);
        self.update_switch(config, 0.0);
        out.flags = self.flags();
    }

    #[inline(always)]
    fn flags(&self) -> u64 {
        SampleFlags::USED
            | if self.guard.allows_detection() { SampleFlags::DETECTION_ENABLED } else { 0 }
            | if self.derivative_on { SampleFlags::DERIVATIVE_ON } else { 0 }
    }

    /// Updates the derivative switch; true on its trailing edge.
    #[inline(always)]
    fn update_switch(&mut self, config: &EnhanceConfig, rate_n_per_s: f64) -> bool {
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

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    /// Flags for these forces at 200 Hz during a steady advance.
    fn flags_of(config: &EnhanceConfig, forces_n: &[f64]) -> Vec<(bool, bool, bool, bool)> {
        let mut preprocessor = Preprocessor::new(config);
        let mut flags = SampleFlags::default();
        forces_n
            .iter()
            .enumerate()
            .map(|(k, force_n)| {
                let time_s = 0.005 * k as f64;
                let sample =
                    Sample { time_s, position_m: 0.002 * time_s, velocity_mps: 0.002, force_n: *force_n };
                preprocessor.process(config, sample, &mut flags);
                (flags.used(), flags.detection_enabled(), flags.derivative_on(), flags.trailing_edge())
            })
            .collect()
    }

    #[test]
    fn the_derivative_switches_on_above_one_threshold_and_off_below_the_other() {
        let mut config = EnhanceConfig::paper();
        // A rise of 0.5 N/s for two seconds, then a fall.
        let forces_n: Vec<f64> = (0..800)
            .map(|k| 0.0025 * f64::from(k).min(400.0) - 0.01 * (f64::from(k) - 400.0).max(0.0))
            .collect();
        let rise = flags_of(&config, &forces_n);
        let on = rise.iter().position(|s| s.2).expect("a rise");
        let off = on + rise[on..].iter().position(|s| !s.2).expect("a fall");
        assert!(rise.iter().all(|s| s.0 && s.1), "all of it can be used, and the motion is even");
        assert!((10..200).contains(&on) && (401..500).contains(&off), "{on} {off}");
        // The trailing edge lasts one sample, where enabled.
        let edges = |flags: &[(bool, bool, bool, bool)]| {
            flags.iter().enumerate().filter(|(_, s)| s.3).map(|(k, _)| k).collect::<Vec<_>>()
        };
        assert_eq!(edges(&rise), [off]);
        config.derivative.trailing_edge = false;
        let without = flags_of(&config, &forces_n);
        assert_eq!((edges(&without), without[on].2), (Vec::new(), true));
        // The switch for falling forces is that of the negative force.
        config.derivative.sense = DerivativeSense::Drop;
        let over: Vec<f64> = forces_n.iter().map(|f| -f).collect();
        assert_eq!(flags_of(&config, &over), without);
        config.derivative.enabled = false;
        assert!(flags_of(&config, &over).iter().all(|s| !s.2 && !s.3));
    }

    #[test]
    fn unusable_samples_do_not_change_the_state() {
        let config = EnhanceConfig::paper();
        let look = |preprocessor: &mut Preprocessor, time_s: f64, force_n: f64| {
            let mut flags = SampleFlags::default();
            let sample = Sample { time_s, position_m: 0.01, velocity_mps: 0.002, force_n };
            preprocessor.process(&config, sample, &mut flags);
            (flags.used(), flags.dt_s)
        };
        let mut preprocessor = Preprocessor::new(&config);
        for (time_s, force_n) in [(f64::NAN, 1.0), (f64::INFINITY, 1.0), (0.3, f64::NAN), (0.3, 1e6)] {
            assert_eq!(look(&mut preprocessor, time_s, force_n), (false, 0.0));
        }
        assert_eq!(look(&mut preprocessor, 0.3, 1.0), (true, 0.0), "the first has none before it");
        for (time_s, force_n) in
            [(0.3, 1.0), (0.2, 1.0), (0.4, f64::NAN), (f64::INFINITY, 1.0), (f64::NAN, 1.0)]
        {
            assert_eq!(look(&mut preprocessor, time_s, force_n), (false, 0.0), "{time_s} s, {force_n} N");
        }
        let (used, dt_s) = look(&mut preprocessor, 0.45, 1.0);
        assert!(used && (dt_s - 0.15).abs() < 1e-12);
        assert_eq!(preprocessor.derivative_n_per_s(), 0.0, "a force that stays");
    }
}
