//! The local predictor: what the force will be at the next sample if nothing gives way.
//!
//! Unknowns: level `L`, change with time `r` (relaxation), with travel `s` (stiffness), with speed `B` (friction), and of that with
//! travel `c`. Between samples
//!
//! ```text
//! L += r dt + s dz + B dv,   s += c dv,   B += c dz
//! ```
//!
//! which is exact for the base law (`s = K + b v`, `B = D + b x`, `c = b`). `r` and `s` wander so that the memory is
//! [`MEMORY_S`] and [`MEMORY_M`] at any noise and sampling rate. What the motion has not yet shown keeps its wide prior
//! variance: while the speed stays the same nothing is learned of `B`, so that a change of speed widens the prediction by what friction
//! may do, and cannot alarm.

use super::gaussian::{Gaussian, Innovation, WIDEST};
use super::noise::Noise;

/// Travel over which the loading curve counts as straight, in m: between the travel of a puncture (tenths of a
/// millimetre) and the thickness of a layer (several).
pub(crate) const MEMORY_M: f64 = 1e-3;
/// Time over which relaxation counts as even, in s: longer than a puncture (0.1 s), shorter than relaxation in soft tissue (seconds).
pub(crate) const MEMORY_S: f64 = 0.5;

const L: usize = 0;
const R: usize = 1;
const S: usize = 2;
const B: usize = 3;
const C: usize = 4;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Local {
    pub(crate) state: Gaussian<5>,
    last_n: f64,
    fresh: bool,
}

/// What the predictor needs to know of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    pub(crate) dt_s: f64,
    pub(crate) dz_m: f64,
    pub(crate) dv_mps: f64,
    /// Correlation of the noise over it.
    pub(crate) rho: f64,
    /// The speed has changed within it, nobody knows when.
    pub(crate) sudden: bool,
    /// Typical speed of the last travel, positive.
    pub(crate) speed_mps: f64,
}

impl Local {
    /// In the air: the level is the bias, nothing changes with anything.
    pub(crate) fn new(level_n: f64) -> Self {
        Self {
            state: Gaussian::new([level_n, 0.0, 0.0, 0.0, 0.0], [1.0, 1e-12, 1e-12, 1e-12, 1e-12]),
            last_n: level_n,
            fresh: true,
        }
    }

    /// After contact or a rupture: slopes unknown on the scale of `force_n` per memory; friction as it was, but no better known
    /// than to the whole force when `all` is set.
    pub(crate) fn renew(&mut self, measured_n: f64, force_n: f64, noise: &Noise, speed_mps: f64, all: bool) {
        let unit = 1.0 / noise.variance;
        let scale = (force_n * force_n * unit).min(WIDEST);
        let v2 = speed_mps * speed_mps;
        let slope = scale / (MEMORY_M * MEMORY_M);
        self.state.renew(L, measured_n, 1.0 / (1.0 - noise.rho * noise.rho));
        self.state.renew(R, 0.0, slope * v2);
        self.state.renew(S, 0.0, slope);
        self.state.renew(C, 0.0, slope / v2);
        if all {
            self.state.renew(B, 0.0, scale / v2);
        } else {
            let (mean, known) = (self.state.x[B], self.state.p[B][B]);
            self.state.renew(B, mean, known.min(scale / v2));
        }
        self.last_n = measured_n;
        self.fresh = true;
    }

    /// Moves on to the next sample.
    #[inline(always)]
    pub(crate) fn advance(&mut self, step: &Step, noise: &Noise) {
        let Step { dt_s, dz_m, dv_mps, .. } = *step;
        let g = &mut self.state;
        g.shear(L, R, dt_s);
        if dz_m != 0.0 {
            g.shear(L, S, dz_m);
        }
        if dv_mps != 0.0 {
            g.shear(L, B, dv_mps);
            g.shear(S, C, dv_mps);
        }
        if dz_m != 0.0 {
            g.shear(B, C, dz_m);
        }
        let slow = noise.slow();
        let time = dt_s / (MEMORY_S * MEMORY_S);
        let travel = dz_m / (MEMORY_M * MEMORY_M);
        g.p[R][R] += slow * time * time;
        g.p[S][S] += slow * travel * travel;
    }

    /// Innovation of a measured force.
    #[inline(always)]
    pub(crate) fn innovation(&self, force_n: f64, step: &Step, noise: &Noise) -> Innovation<5> {
        if self.fresh {
            // Nothing before it to be whitened with.
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
    pub(crate) fn take(&mut self, innovation: &Innovation<5>, force_n: f64) {
        self.state.take(innovation);
        self.last_n = force_n;
        self.fresh = false;
    }

    /// The level begins anew at a measured force; what the slopes are stays.
    pub(crate) fn level(&mut self, measured_n: f64, noise: &Noise) {
        self.state.renew(L, measured_n, 1.0 / (1.0 - noise.rho * noise.rho));
        self.last_n = measured_n;
        self.fresh = true;
    }

    /// Passes a sample over.
    pub(crate) fn pass(&mut self) {
        self.fresh = true;
    }

    /// Change of the force with time at a speed and an acceleration, in N/s, less what a friction `known_ns_per_m` makes of the
    /// acceleration; and its variance in units of the noise's. While speed changes evenly the parts are not told from each other, but
    /// their sum is.
    pub(crate) fn rate(&self, speed_mps: f64, accel_mps2: f64, known_ns_per_m: f64) -> (f64, f64) {
        let g = &self.state;
        let (v, a) = (speed_mps, accel_mps2);
        let rate = g.x[R] + v * g.x[S] + a * (g.x[B] - known_ns_per_m);
        let alone = g.p[R][R] + v * (2.0 * g.cov(R, S) + v * g.p[S][S]);
        (rate, alone + a * (2.0 * (g.cov(R, B) + v * g.cov(S, B)) + a * g.p[B][B]))
    }

    /// Predicted force in N.
    pub(crate) fn level_n(&self) -> f64 {
        self.state.x[L]
    }
}
