//! Detection of the first contact \[D\]: bias and noise are learned in air, contact is declared when the low-passed force
//! exceeds the noise for several samples, and its position is extrapolated back along the loading line to zero force.

use super::line_fit::LineFit;
use super::low_pass::LowPassCoefficients;
use crate::bounds::{at_least, at_most};
use crate::config::ContactConfig;
use crate::sample::Sample;

/// Memory of bias and noise in air, in s.
const FORGETTING_TIME_S: f64 = 5.0;
/// Samples before bias and noise count as learned.
const MIN_AIR_SAMPLES: f64 = 10.0;
/// Standard deviations of the noise at which the loading line begins.
const LINE_START_SDS: f64 = 2.0;
/// Largest distance of the surface before the declaration, in m.
const MAX_EXTRAPOLATION_M: f64 = 0.005;

#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactDetector {
    /// Gains of the low-pass on the force and of the forgetting of bias and noise.
    coefficients: LowPassCoefficients<2>,
    elapsed_s: f64,
    force_n: f64,
    // Welford's running mean and variance of the force in air.
    count: f64,
    mean_n: f64,
    m2: f64,
    samples_above: usize,
    line: LineFit,
    first: u64,
    declared_m: Option<f64>,
}

/// Result after a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ContactStatus {
    InAir,
    /// Contact declared; the surface position is a preliminary estimate, `first` the index of the loading line's first sample.
    Provisional {
        surface_m: f64,
        first: u64,
    },
    /// The surface position is final.
    Settled {
        surface_m: f64,
        first: u64,
    },
}

impl ContactDetector {
    pub(crate) fn new(config: &ContactConfig) -> Self {
        Self {
            coefficients: LowPassCoefficients::new([config.time_constant_s, FORGETTING_TIME_S]),
            elapsed_s: 0.0,
            force_n: 0.0,
            count: 0.0,
            mean_n: 0.0,
            m2: 0.0,
            samples_above: 0,
            line: LineFit::default(),
            first: 0,
            declared_m: None,
        }
    }

    fn noise_n(&self, config: &ContactConfig) -> f64 {
        if self.count < 2.0 {
            return f64::INFINITY;
        }
        libm::sqrt(self.m2 / (self.count - 1.0)).max(config.min_noise_n)
    }

    /// Processes the sample with this index.
    pub(crate) fn update(
        &mut self,
        config: &ContactConfig,
        dt_s: f64,
        sample: Sample,
        index: u64,
    ) -> ContactStatus {
        self.elapsed_s += dt_s;
        let [low_pass, forget] = *self.coefficients.at_interval(dt_s);
        if self.count == 0.0 && self.declared_m.is_none() {
            self.force_n = sample.force_n;
        }
        self.force_n += low_pass * (sample.force_n - self.force_n);
        let noise = self.noise_n(config);
        let rise = self.force_n - self.mean_n;
        let learning = self.elapsed_s < config.learn_s || self.count < MIN_AIR_SAMPLES;
        if let Some(declared_m) = self.declared_m {
            self.line.add(sample.position_m, sample.force_n);
            let surface_m = self.surface_m(config, declared_m);
            let first = self.first;
            return if (sample.position_m - declared_m).abs() >= config.extrapolate_over_m {
                ContactStatus::Settled { surface_m, first }
            } else {
                ContactStatus::Provisional { surface_m, first }
            };
        }
        if !learning && rise > LINE_START_SDS * noise {
            if self.line.count == 0.0 {
                self.first = index;
            }
            self.line.add(sample.position_m, sample.force_n);
        } else {
            self.line = LineFit::default();
            self.learn(forget, learning, sample.force_n);
        }
        let above = !learning && rise > config.noise_sds * noise;
        self.samples_above = if above { self.samples_above + 1 } else { 0 };
        if self.samples_above < config.samples.max(1) {
            return ContactStatus::InAir;
        }
        self.declared_m = Some(sample.position_m);
        ContactStatus::Provisional { surface_m: self.surface_m(config, sample.position_m), first: self.first }
    }

    /// Bias and noise: by Welford's recursion at first, then with slow forgetting, which follows a drift in air but not a
    /// loading line.
    fn learn(&mut self, gain: f64, learning: bool, force_n: f64) {
        if learning {
            self.count += 1.0;
            let delta = force_n - self.mean_n;
            self.mean_n += delta / self.count;
            self.m2 += delta * (force_n - self.mean_n);
            return;
        }
        let delta = force_n - self.mean_n;
        self.mean_n += gain * delta;
        self.m2 += gain * ((self.count - 1.0) * delta * delta - self.m2);
    }

    /// Where the loading line reaches the bias, at most 5 mm before the declaration; the declaration itself without
    /// extrapolation.
    fn surface_m(&self, config: &ContactConfig, declared_m: f64) -> f64 {
        if config.extrapolate_over_m <= 0.0 {
            return declared_m;
        }
        match self.line.x_at(self.mean_n) {
            Some(at) if self.line.slope() > 0.0 => {
                at_most(declared_m, at_least(declared_m - MAX_EXTRAPOLATION_M, at))
            }
            _ => declared_m,
        }
    }
}

#[cfg(test)]
mod tests;
