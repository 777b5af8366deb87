//! Shaft friction of the layers from the state of the layer estimator.

use super::layer_estimator::{B, B_PREV, BIAS, D, K, K_PREV, LayerEstimator, PassedLayers};
use super::noise_estimator::NoiseEstimator;
use crate::bounds::{at_least, at_most};
use crate::sample::MAX_LAYERS;

impl LayerEstimator {
    /// Shaft friction per drive that does not act at the tip, with the tip at `position_m`, and its variance (N s/m and its
    /// square for a viscous drive).
    #[inline(always)]
    pub(crate) fn shaft_friction(&self, position_m: f64, noise: &NoiseEstimator) -> (f64, f64) {
        if self.passed_count == 0 {
            return (0.0, 0.0);
        }
        let g = &self.state;
        let (mut friction, mut variance) = (g.x[D], g.p[D][D]);
        if self.tip_free {
            let x = at_least(0.0, position_m - self.start_m);
            friction += g.x[B] * x;
            variance += x * (2.0 * g.cov(B, D) + x * g.p[B][B]);
        } else if self.start_sd_m > 0.0 {
            // A layer that begins `e` later than estimated changes the bias to `f0 - K e` and the friction to `D - b e`.
            let (k, sd_k) = (g.x[K], libm::sqrt(g.p[K][K] * noise.variance));
            if k > 2.0 * sd_k {
                let later_m = (noise.bias_n() - g.x[BIAS]) / k;
                let bound_m = 2.0 * self.start_sd_m;
                let per_bias = g.x[B] / k;
                friction += g.x[B] * at_least(-bound_m, at_most(bound_m, later_m));
                variance += per_bias * (per_bias * g.p[BIAS][BIAS] - 2.0 * g.cov(BIAS, D));
            }
        }
        (friction, variance * noise.variance)
    }

    /// Friction per drive of the passed layers at the last rupture, and its variance.
    pub(crate) fn friction_at_rupture(&self, noise: &NoiseEstimator) -> (f64, f64) {
        let (g, gap) = (&self.state, self.gap_m);
        let place = g.x[B_PREV] * self.gap_sd_m;
        // Friction of the active layer over its uncertain start is not separable from `D`.
        let start = g.x[B] * self.rupture_sd_m;
        let estimated = g.p[D][D] - gap * (2.0 * g.cov(B_PREV, D) - gap * g.p[B_PREV][B_PREV]);
        let variance = estimated + (place * place + start * start) / noise.variance;
        (g.x[D] - gap * g.x[B_PREV], variance * noise.variance)
    }

    /// Total friction per unit of drive, including the active layer, and its standard deviation.
    pub(super) fn friction_and_sd(&self, position_m: f64, noise: &NoiseEstimator) -> (f64, f64) {
        let (g, x) = (&self.state, at_least(0.0, position_m - self.start_m));
        let passed = if self.passed_count > 0 { D } else { K_PREV };
        let variance = g.p[passed][passed] + x * (2.0 * g.cov(B, passed) + x * g.p[B][B]);
        (self.friction(position_m), libm::sqrt(at_least(0.0, variance) * noise.variance))
    }

    /// Growth of friction with travel while the shaft enters the previous layer, in N/m.
    pub(crate) fn friction_growth(&self, drive: f64) -> f64 {
        (self.state.x[B_PREV] * drive).abs()
    }

    /// Variances of `K'` and `b'`.
    pub(crate) fn previous_variance(&self, noise: &NoiseEstimator) -> [f64; 2] {
        [self.state.p[K_PREV][K_PREV] * noise.variance, self.state.p[B_PREV][B_PREV] * noise.variance]
    }

    /// Friction per drive during retraction with the tip at `z_m`, each passed layer's friction spread evenly over its
    /// thickness.
    pub(crate) fn friction_during_retraction(
        &self,
        passed_layers: &PassedLayers,
        z_m: f64,
        deepest_m: f64,
        noise: &NoiseEstimator,
    ) -> f64 {
        let count = self.passed_count.min(MAX_LAYERS);
        let (mut whole, mut inside) = (0.0, 0.0);
        for (i, [start, end, b]) in passed_layers.iter().take(count).enumerate() {
            let b = if i + 1 == self.passed_count { self.state.x[B_PREV].max(0.0) } else { *b };
            // A rupture may be located just before the estimated start of its layer.
            let length_m = at_least(0.0, end - start);
            whole += b * length_m;
            inside += b * at_least(0.0, at_most(length_m, z_m - start));
        }
        // The sum is known better than its parts.
        let total = self.shaft_friction(deepest_m, noise).0.max(0.0);
        let share = if whole > 0.0 { inside / whole } else { 1.0 };
        total * share
    }
}
