//! One-step force prediction: a Kalman filter for the force at the next sample if nothing ruptures.
//!
//! Unknowns: level `L`, rate with time `R` (relaxation), slope with travel `S` (stiffness), slope with speed `B` (friction)
//! and its change with travel `C`. Between samples
//!
//! ```text
//! L += R dt + S dz + B dv,   S += C dv,   B += C dz
//! ```
//!
//! which is exact for the base law (`S = K + b v`, `B = D + b x`, `C = b`). `R` and `S` are random walks whose process noise
//! gives a memory of [`MEMORY_S`] and [`MEMORY_M`] at any noise level and sampling rate. A direction that the motion has not
//! excited keeps its wide prior: at constant speed nothing is learned about `B`, so that a change of speed widens the
//! prediction by all that friction could do, and raises no alarm.

use super::gaussian::{Gaussian, Innovation, MAX_VARIANCE_RATIO};
use super::noise_estimator::NoiseEstimator;

/// Travel over which the loading curve counts as straight, in m: between the travel of a puncture (tenths of a
/// millimetre) and the thickness of a layer (several millimetres).
pub(crate) const MEMORY_M: f64 = 1e-3;
/// Time over which relaxation counts as linear, in s: longer than a puncture (0.1 s), shorter than relaxation in soft tissue
/// (seconds).
pub(crate) const MEMORY_S: f64 = 0.5;

const L: usize = 0;
const R: usize = 1;
const S: usize = 2;
const B: usize = 3;
const C: usize = 4;

#[derive(Clone, Copy, Debug)]
pub(crate) struct ForcePredictor {
    pub(crate) state: Gaussian<5>,
    last_n: f64,
    /// There is no previous sample to whiten the next one with.
    unpaired: bool,
}

/// Motion between two samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionStep {
    pub(crate) dt_s: f64,
    pub(crate) dz_m: f64,
    pub(crate) dv_mps: f64,
    /// Correlation of the sensor noise over the step.
    pub(crate) rho: f64,
    /// The speed has jumped at an unknown time within the step.
    pub(crate) sudden: bool,
    /// Low-passed speed, positive.
    pub(crate) speed_mps: f64,
}

impl ForcePredictor {
    /// In air: constant level.
    pub(crate) fn new(level_n: f64) -> Self {
        Self {
            state: Gaussian::new([level_n, 0.0, 0.0, 0.0, 0.0], [1.0, 1e-12, 1e-12, 1e-12, 1e-12]),
            last_n: level_n,
            unpaired: true,
        }
    }

    /// After contact or a rupture: slopes unknown on the scale of `force_n` per memory. Friction keeps its estimate, with at
    /// most the variance that the whole force allows; with `forget_friction` it is unknown as well.
    pub(crate) fn restart(
        &mut self,
        measured_n: f64,
        force_n: f64,
        noise: &NoiseEstimator,
        speed_mps: f64,
        forget_friction: bool,
    ) {
        let unit = 1.0 / noise.variance;
        let scale = (force_n * force_n * unit).min(MAX_VARIANCE_RATIO);
        let v2 = speed_mps * speed_mps;
        let slope = scale / (MEMORY_M * MEMORY_M);
        self.reset_level(measured_n, noise);
        self.state.reset_component(R, 0.0, slope * v2);
        self.state.reset_component(S, 0.0, slope);
        self.state.reset_component(C, 0.0, slope / v2);
        if forget_friction {
            self.state.reset_component(B, 0.0, scale / v2);
        } else {
            let (mean, variance) = (self.state.x[B], self.state.p[B][B]);
            self.state.reset_component(B, mean, variance.min(scale / v2));
        }
    }

    /// Time update to the next sample.
    #[inline(always)]
    pub(crate) fn advance(&mut self, step: &MotionStep, noise: &NoiseEstimator) {
        let MotionStep { dt_s, dz_m, dv_mps, .. } = *step;
        let g = &mut self.state;
        g.add_multiple(L, R, dt_s);
        if dz_m != 0.0 {
            g.add_multiple(L, S, dz_m);
        }
        if dv_mps != 0.0 {
            g.add_multiple(L, B, dv_mps);
            g.add_multiple(S, C, dv_mps);
        }
        if dz_m != 0.0 {
            g.add_multiple(B, C, dz_m);
        }
        let long_run = noise.long_run_factor();
        let time = dt_s / (MEMORY_S * MEMORY_S);
        let travel = dz_m / (MEMORY_M * MEMORY_M);
        g.p[R][R] += long_run * time * time;
        g.p[S][S] += long_run * travel * travel;
    }

    /// Innovation of a measured force, whitened with the previous sample.
    #[inline(always)]
    pub(crate) fn innovation(
        &self,
        force_n: f64,
        step: &MotionStep,
        noise: &NoiseEstimator,
    ) -> Innovation<5> {
        if self.unpaired {
            let r = 1.0 / (1.0 - noise.rho * noise.rho);
            return self.state.innovation([L], [1.0], force_n, r);
        }
        let rho = step.rho;
        if rho == 0.0 {
            return self.state.innovation([L], [1.0], force_n, 1.0);
        }
        let h = [1.0 - rho, rho * step.dt_s, rho * step.dz_m, rho * step.dv_mps];
        self.state.innovation([L, R, S, B], h, force_n - rho * self.last_n, 1.0)
    }

    #[inline(always)]
    pub(crate) fn update(&mut self, innovation: &Innovation<5>, force_n: f64) {
        self.state.update(innovation);
        self.last_n = force_n;
        self.unpaired = false;
    }

    /// Resets the level to a measured force and keeps the slopes.
    pub(crate) fn reset_level(&mut self, measured_n: f64, noise: &NoiseEstimator) {
        self.state.reset_component(L, measured_n, 1.0 / (1.0 - noise.rho * noise.rho));
        self.last_n = measured_n;
        self.unpaired = true;
    }

    pub(crate) fn skip_sample(&mut self) {
        self.unpaired = true;
    }

    /// Shifts the level because all later forces are larger by `by_n`.
    pub(super) fn shift_level(&mut self, by_n: f64) {
        self.state.x[L] += by_n;
        self.unpaired = true;
    }

    /// Rate of the force in N/s at this speed and acceleration, without the part that a known friction (N s/m) contributes
    /// through the acceleration, and its variance in units of the noise variance. Under constant acceleration the terms are
    /// not separable, but their sum is.
    pub(crate) fn rate(&self, speed_mps: f64, accel_mps2: f64, friction_ns_per_m: f64) -> (f64, f64) {
        let g = &self.state;
        let (v, a) = (speed_mps, accel_mps2);
        let rate = g.x[R] + v * g.x[S] + a * (g.x[B] - friction_ns_per_m);
        let constant_speed = g.p[R][R] + v * (2.0 * g.cov(R, S) + v * g.p[S][S]);
        (rate, constant_speed + a * (2.0 * (g.cov(R, B) + v * g.cov(S, B)) + a * g.p[B][B]))
    }

    /// Variance of the level and its covariance with [`ForcePredictor::rate`] at constant speed, in units of the noise
    /// variance.
    pub(crate) fn level_covariance(&self, speed_mps: f64) -> (f64, f64) {
        let g = &self.state;
        (g.p[L][L], g.cov(L, R) + speed_mps * g.cov(L, S))
    }

    /// Predicted force in N.
    pub(crate) fn level_n(&self) -> f64 {
        self.state.x[L]
    }
}

#[cfg(test)]
mod tests;
