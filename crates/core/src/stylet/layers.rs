//! The estimator: everything that the samples since contact say about the layer being traversed, the layer before it, and
//! the friction behind, as one Gaussian belief.
//!
//! Unknowns `[a, K, b, Kp, bp, f0]`. In a layer that starts at depth `s`, with `x = z - s` and the drive `u` of friction,
//!
//! ```text
//! f = f0 + D u + K x + b x u          a = D, the friction behind
//! f = f0 + p + q u + K x + b x u      first layer: p, q = K, b times what was inside already when contact was noticed
//! ```
//!
//! `f0` is what the sensor shows without load, known from the air as well as the noise allows.
//!
//! (`q` takes the place of `Kp` there.) At a rupture after a travel `d` the friction behind becomes `D + b d` (`q + b d` in the first layer): the belief moves on by this linear map, and the ruptured layer's
//! `K, b` stay in it as `Kp, bp`. So every sample *after* the rupture still says something about the split of the layer
//! *before* it (the force that is left is friction), and every sample before about `D` after: the joint least-squares solution without
//! buffer or replay.

use super::gaussian::{Gaussian, WIDEST};
use super::local::MEMORY_M;
use super::noise::Noise;
use crate::compensation::MAX_LAYERS;

pub(crate) const A: usize = 0;
pub(crate) const K: usize = 1;
pub(crate) const F: usize = 2;
pub(crate) const KP: usize = 3;
pub(crate) const FP: usize = 4;
const ZERO: usize = 5;
const N: usize = 6;

/// Belief about the layers, and where the active one starts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layers {
    pub(crate) belief: Gaussian<N>,
    pub(crate) start_m: f64,
    /// Ruptures so far.
    pub(crate) passed: usize,
    /// Thickness of the layer before.
    pub(crate) previous_m: f64,
    /// Drive at contact.
    drive0: f64,
    /// Depth, drive and force of the sample before.
    last: Option<[f64; 3]>,
}

/// Start, end and friction per metre of the layers behind, as they were known when the next one gave way.
pub(crate) type Behind = [[f64; 3]; MAX_LAYERS];

impl Layers {
    /// At contact at `start_m` with the force `force_n` acting already, known to `sd_n`; stiffness and friction are
    /// unknown on the scale of `slope` N/m.
    pub(crate) fn contact(
        start_m: f64,
        force_n: f64,
        sd_n: f64,
        slope: f64,
        drive: f64,
        noise: &Noise,
    ) -> Self {
        let unit = 1.0 / noise.variance;
        let sd_n = sd_n.min(libm::sqrt(WIDEST / unit));
        let slope = slope.min(libm::sqrt(WIDEST / unit) / MEMORY_M);
        let friction = slope / drive;
        let half = 0.5 * force_n;
        let variance = [
            sd_n * sd_n * unit,
            slope * slope * unit,
            friction * friction * unit,
            sd_n * sd_n / (drive * drive) * unit,
            1.0,
            noise.bias_variance() * unit,
        ];
        let mean = [half, 0.5 * slope, 0.5 * friction, half / drive, 0.0, noise.bias_n()];
        Self {
            belief: Gaussian::new(mean, variance),
            start_m,
            passed: 0,
            previous_m: 0.0,
            drive0: drive,
            last: None,
        }
    }

    #[inline(always)]
    fn regressor(&self, x: f64, drive: f64) -> [f64; N] {
        let (a, q) = if self.passed > 0 { (drive, 0.0) } else { (1.0, drive) };
        [a, x, x * drive, q, 0.0, 1.0]
    }

    /// Takes a sample; returns the innovation in N and its variance in units of the noise's.
    #[inline(always)]
    pub(crate) fn take(&mut self, position_m: f64, drive: f64, force_n: f64, rho: f64) -> (f64, f64) {
        let x = position_m - self.start_m;
        let (mut w, mut y, mut r) = (self.regressor(x, drive), force_n, 1.0);
        if rho != 0.0 {
            if let Some([x, drive, force_n]) = self.last {
                for (w, before) in w.iter_mut().zip(self.regressor(x, drive)) {
                    *w -= rho * before;
                }
                y -= rho * force_n;
            } else {
                r = 1.0 / (1.0 - rho * rho);
            }
        }
        let innovation = if self.passed > 0 {
            self.belief.innovation([A, K, F, ZERO], [w[A], w[K], w[F], w[ZERO]], y, r)
        } else {
            self.belief.innovation([A, K, F, KP, ZERO], [w[A], w[K], w[F], w[KP], w[ZERO]], y, r)
        };
        self.belief.take(&innovation);
        self.last = Some([x, drive, force_n]);
        (innovation.e, innovation.s)
    }

    pub(crate) fn pass(&mut self) {
        self.last = None;
    }

    /// Slope of the force with travel in N/m.
    pub(crate) fn slope(&self, drive: f64) -> f64 {
        self.belief.x[K] + self.belief.x[F] * drive
    }

    /// A rupture at `position_m`, known to `sd_m`.
    pub(crate) fn rupture(
        &mut self,
        position_m: f64,
        sd_m: f64,
        drive: f64,
        noise: &Noise,
        behind: &mut Behind,
    ) {
        let unit = 1.0 / noise.variance;
        let mut d = (position_m - self.start_m).max(1e-6);
        let first = self.passed == 0;
        let mut delta = 0.0;
        if first {
            // How far the tip was inside when contact was noticed: initial force over slope. Then p = K delta.
            let [p, k, b, q, ..] = self.belief.x;
            let (force, slope) = (p + q * self.drive0, k + b * self.drive0);
            if force > 0.0 && slope > 0.0 {
                delta = (force / slope).min(d);
                let g = &self.belief.p;
                let u0 = self.drive0;
                let variance = (g[A][A] + 2.0 * u0 * g[KP][A] + u0 * u0 * g[KP][KP]).max(1e-6);
                let constraint = self.belief.innovation([A, K], [1.0, -delta], 0.0, variance);
                self.belief.take(&constraint);
            }
        }
        let before = self.slope(drive).abs().max(1.0);
        let before = before.min(libm::sqrt(WIDEST / unit) / MEMORY_M);
        let known = self.belief.x[FP].max(0.0);
        let b = self.belief.x[F].clamp(-before / drive, before / drive);
        // The belief moves on by a linear map; the new layer's stiffness and friction are unknown.
        let mut map = [[0.0; N]; N];
        map[A][if first { KP } else { A }] = 1.0;
        map[A][F] = d;
        map[KP][K] = 1.0;
        map[FP][F] = 1.0;
        map[ZERO][ZERO] = 1.0;
        self.belief = self.belief.mapped(&map);
        let wide = (3.0 * before).min(libm::sqrt(WIDEST / unit) / MEMORY_M);
        let g = &mut self.belief;
        g.renew(K, 0.5 * before, wide * wide * unit);
        g.renew(F, 0.5 * before / drive, wide * wide / (drive * drive) * unit);
        // Where exactly it gave way is not known better than the samples lie: that much friction more or less, and
        // that much force of the new layer, which looks like an error of the zero.
        let place = sd_m * sd_m * unit;
        g.p[A][A] += b * b * place;
        g.p[ZERO][ZERO] += before * before * place;
        d += delta;
        // The layer before this one will not be known better.
        if let Some(before) = self.passed.checked_sub(1).and_then(|i| behind.get_mut(i)) {
            before[2] = known;
        }
        if let Some(slot) = behind.get_mut(self.passed) {
            *slot = [position_m - d, position_m, 0.0];
        }
        self.start_m = position_m;
        self.previous_m = d;
        self.passed += 1;
        self.last = None;
    }

    /// Friction behind the tip per drive, and its variance in squared units (N s/m for a viscous drive).
    #[inline(always)]
    pub(crate) fn behind(&self, noise: &Noise) -> (f64, f64) {
        if self.passed == 0 {
            return (0.0, 0.0);
        }
        (self.belief.x[A], self.belief.p[A][A] * noise.variance)
    }

    /// Variances of `Kp` and `bp` in squared units.
    pub(crate) fn previous_variance(&self, noise: &Noise) -> [f64; 2] {
        [self.belief.p[KP][KP] * noise.variance, self.belief.p[FP][FP] * noise.variance]
    }

    /// Friction per drive that the passed layers exert with the tip at `z_m` on the way back, each with its friction spread
    /// evenly over its thickness.
    pub(crate) fn around_shaft(&self, behind: &Behind, z_m: f64) -> f64 {
        let last = self.passed.min(MAX_LAYERS);
        let (mut whole, mut inside) = (0.0, 0.0);
        for (i, [start, end, b]) in behind.iter().take(last).enumerate() {
            let b = if i + 1 == self.passed { self.belief.x[FP].max(0.0) } else { *b };
            whole += b * (end - start);
            inside += b * (z_m - start).clamp(0.0, end - start);
        }
        // The sum is known better than its parts.
        let all = self.belief.x[A].max(0.0);
        let share = if whole > 0.0 { inside / whole } else { 1.0 };
        all * share
    }
}
