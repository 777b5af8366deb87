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

use super::force_predictor::MEMORY_M;
use super::gaussian::{Gaussian, Innovation, MAX_VARIANCE_RATIO, at_least};
use super::noise_estimator::NoiseEstimator;
use crate::friction_compensation::MAX_LAYERS;

pub(crate) const D: usize = 0;
pub(crate) const K: usize = 1;
pub(crate) const B: usize = 2;
pub(crate) const K_PREV: usize = 3;
pub(crate) const B_PREV: usize = 4;
const BIAS: usize = 5;
const N: usize = 6;

/// Belief about the layers, and where the active one starts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerEstimator {
    pub(crate) belief: Gaussian<N>,
    pub(crate) start_m: f64,
    /// Ruptures so far.
    pub(crate) passed_count: usize,
    /// Thickness of the layer before.
    pub(crate) previous_thickness_m: f64,
    /// The tip is in a gap, or behind the last layer: what grows with travel is friction.
    pub(super) tip_free: bool,
    /// See [`super::slack`]: the densities when the active layer began, friction as that of the layer before, and none.
    pub(super) initial_log_densities: [f64; 2],
    /// It is beyond doubt that a layer has begun.
    pub(super) layer_confirmed: bool,
    /// Where the layer before gave way, in m, and how well that is known.
    pub(super) rupture_m: f64,
    rupture_sd_m: f64,
    /// Travel of the gap behind the layer before, in which its friction went on to grow, and how well it is known.
    pub(super) gap_m: f64,
    gap_sd_m: f64,
    /// How well the begin of the active layer is known, and that of the layer before was, in m.
    start_sd_m: f64,
    pub(super) previous_start_sd_m: f64,
    /// Slope that the active layer was thought to have at its begin, in N/m.
    slope_scale: f64,
    /// Drive at contact.
    contact_drive: f64,
    /// Depth, drive and force of the sample before.
    last: Option<[f64; 3]>,
}

/// Start, end and friction per metre of the layers behind, as they were known when the next one gave way.
pub(crate) type PassedLayers = [[f64; 3]; MAX_LAYERS];

impl LayerEstimator {
    /// At contact at `start_m` with the force `force_n` acting already, known to `sd_n`; stiffness and friction are
    /// unknown on the scale of `slope` N/m.
    pub(crate) fn at_contact(
        start_m: f64,
        force_n: f64,
        sd_n: f64,
        slope: f64,
        drive: f64,
        noise: &NoiseEstimator,
    ) -> Self {
        let unit = 1.0 / noise.variance;
        let sd_n = sd_n.min(libm::sqrt(MAX_VARIANCE_RATIO / unit));
        let slope = slope.min(libm::sqrt(MAX_VARIANCE_RATIO / unit) / MEMORY_M);
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
            passed_count: 0,
            previous_thickness_m: 0.0,
            tip_free: false,
            initial_log_densities: [0.0; 2],
            layer_confirmed: false,
            rupture_m: start_m,
            rupture_sd_m: 0.0,
            gap_m: 0.0,
            gap_sd_m: 0.0,
            start_sd_m: 0.0,
            previous_start_sd_m: 0.0,
            slope_scale: slope,
            contact_drive: drive,
            last: None,
        }
    }

    /// The tip feels nothing, or nobody knows: it may be in a gap, or in the air still.
    #[inline(always)]
    pub(super) fn may_be_free(&self) -> bool {
        !self.layer_confirmed
    }

    #[inline(always)]
    fn regressor(&self, x: f64, drive: f64) -> [f64; N] {
        let (a, q) = if self.passed_count > 0 { (drive, 0.0) } else { (1.0, drive) };
        [a, x, x * drive, q, 0.0, 1.0]
    }

    /// Friction per drive, what the tip feels of it included.
    pub(crate) fn friction(&self, position_m: f64) -> f64 {
        let behind = self.belief.x[if self.passed_count > 0 { D } else { K_PREV }];
        behind + self.belief.x[B] * (position_m - self.start_m)
    }

    /// The force that the law says.
    #[inline(always)]
    pub(crate) fn predict(&self, position_m: f64, drive: f64) -> f64 {
        let w = self.regressor(position_m - self.start_m, drive);
        w.iter().zip(&self.belief.x).map(|(w, x)| w * x).sum()
    }

    /// Takes a sample; returns the innovation in N and its variance in units of the noise's.
    #[inline(always)]
    pub(crate) fn update(&mut self, position_m: f64, drive: f64, force_n: f64, rho: f64) -> (f64, f64) {
        let innovation = self.innovation(position_m, drive, force_n, rho);
        self.apply(&innovation, position_m, drive, force_n)
    }

    /// What a sample says before it is taken.
    #[inline(always)]
    pub(crate) fn innovation(&self, position_m: f64, drive: f64, force_n: f64, rho: f64) -> Innovation<6> {
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
        if self.passed_count > 0 {
            self.belief.innovation([D, K, B, BIAS], [w[D], w[K], w[B], w[BIAS]], y, r)
        } else {
            self.belief.innovation([D, K, B, K_PREV, BIAS], [w[D], w[K], w[B], w[K_PREV], w[BIAS]], y, r)
        }
    }

    /// Takes the sample of an [`Layers::innovation`].
    #[inline(always)]
    pub(crate) fn apply(
        &mut self,
        innovation: &Innovation<6>,
        position_m: f64,
        drive: f64,
        force_n: f64,
    ) -> (f64, f64) {
        self.belief.update(innovation);
        self.last = Some([position_m - self.start_m, drive, force_n]);
        (innovation.e, innovation.s)
    }

    pub(crate) fn skip_sample(&mut self) {
        self.last = None;
    }

    /// Slope of the force with travel in N/m.
    pub(crate) fn slope(&self, drive: f64) -> f64 {
        self.belief.x[K] + self.belief.x[B] * drive
    }

    /// The same, and its standard deviation.
    pub(super) fn slope_and_sd(&self, drive: f64, noise: &NoiseEstimator) -> (f64, f64) {
        let g = &self.belief;
        let variance = g.p[K][K] + drive * (2.0 * g.cov(B, K) + drive * g.p[B][B]);
        (self.slope(drive), libm::sqrt(at_least(0.0, variance) * noise.variance))
    }

    /// A rupture at `position_m`, known to `sd_m`.
    pub(crate) fn rupture(
        &mut self,
        position_m: f64,
        sd_m: f64,
        drive: f64,
        noise: &NoiseEstimator,
        behind: &mut PassedLayers,
    ) {
        let unit = 1.0 / noise.variance;
        let mut d = (position_m - self.start_m).max(1e-6);
        let first = self.passed_count == 0;
        let mut delta = 0.0;
        if first {
            // How far the tip was inside when contact was noticed: initial force over slope. Then p = K delta.
            let [p, k, b, q, ..] = self.belief.x;
            let (force, slope) = (p + q * self.contact_drive, k + b * self.contact_drive);
            if force > 0.0 && slope > 0.0 {
                delta = (force / slope).min(d);
                let g = &self.belief.p;
                let u0 = self.contact_drive;
                let variance = (g[D][D] + 2.0 * u0 * g[K_PREV][D] + u0 * u0 * g[K_PREV][K_PREV]).max(1e-6);
                let constraint = self.belief.innovation([D, K], [1.0, -delta], 0.0, variance);
                self.belief.update(&constraint);
            }
        }
        let before = if self.tip_free { self.slope_scale } else { self.slope(drive).abs().max(1.0) };
        if self.tip_free {
            self.reopen_split(drive, unit);
        }
        let before = before.min(libm::sqrt(MAX_VARIANCE_RATIO / unit) / MEMORY_M);
        let known = self.belief.x[B_PREV].max(0.0);
        let b = self.belief.x[B].clamp(-before / drive, before / drive);
        let stiff = self.stiffness_rms(before, unit);
        // The belief moves on by a linear map; the new layer's stiffness and friction are unknown.
        let mut map = [[0.0; N]; N];
        map[D][if first { K_PREV } else { D }] = 1.0;
        map[D][B] = d;
        map[K_PREV][K] = 1.0;
        map[B_PREV][B] = 1.0;
        map[BIAS][BIAS] = 1.0;
        self.belief = self.belief.transformed(&map);
        if self.start_sd_m > 0.0 {
            // What looked like an error of the zero was the begin of the layer that is gone.
            self.belief.reset_component(BIAS, noise.bias_n(), noise.bias_variance() * unit);
        }
        self.start_layer(before, sd_m, (stiff, b), drive, unit);
        (self.previous_start_sd_m, self.start_sd_m, self.gap_m) = (self.start_sd_m, 0.0, 0.0);
        self.gap_sd_m = 0.0;
        d += delta;
        // The layer before this one will not be known better.
        if let Some(before) = self.passed_count.checked_sub(1).and_then(|i| behind.get_mut(i)) {
            before[2] = known;
        }
        if let Some(slot) = behind.get_mut(self.passed_count) {
            *slot = [position_m - d, position_m, 0.0];
        }
        self.start_m = position_m;
        (self.rupture_m, self.rupture_sd_m) = (position_m, sd_m);
        self.previous_thickness_m = d;
        self.passed_count += 1;
        self.last = None;
        self.initial_log_densities =
            [self.log_density_of_free(true, noise), self.log_density_of_free(false, noise)];
    }

    /// What has lost force was a layer, which looked like friction that grows on: any part of the slope may have been elastic.
    pub(super) fn reopen_split(&mut self, drive: f64, unit: f64) {
        let widest = libm::sqrt(MAX_VARIANCE_RATIO / unit) / MEMORY_M;
        let half = (0.5 * self.slope(drive)).clamp(-widest, widest);
        let g = &mut self.belief;
        (g.x[K], g.x[B]) = (g.x[K] + half, g.x[B] - half / drive);
        let variance = half * half * unit;
        g.p[K][K] += variance;
        g.p[B][B] += variance / (drive * drive);
        g.p[B][K] -= variance / drive;
        self.tip_free = false;
    }

    /// Root mean square of what the active layer's stiffness may be in N/m, of which it has shown the slope `most` with friction.
    fn stiffness_rms(&self, most: f64, unit: f64) -> f64 {
        let g = &self.belief;
        libm::sqrt(g.x[K] * g.x[K] + g.p[K][K] / unit).min(most)
    }

    /// A layer of unknown stiffness and friction begins at a place that is known to `sd_m`: on either side of it friction per
    /// drive grows by `friction` more or less.
    fn start_layer(&mut self, scale: f64, sd_m: f64, (stiff, friction): (f64, f64), drive: f64, unit: f64) {
        let wide = (3.0 * scale).min(libm::sqrt(MAX_VARIANCE_RATIO / unit) / MEMORY_M);
        let g = &mut self.belief;
        g.reset_component(K, 0.5 * scale, wide * wide * unit);
        g.reset_component(B, 0.5 * scale / drive, wide * wide / (drive * drive) * unit);
        // Where exactly it gave way is not known better than the samples lie: that much friction more or less, and
        // that much force of the new layer, which looks like an error of the zero.
        let place = sd_m * sd_m * unit;
        g.p[D][D] += friction * friction * place;
        g.p[BIAS][BIAS] += stiff * stiff * place;
        (self.tip_free, self.layer_confirmed, self.slope_scale) = (false, false, scale);
    }

    /// The force has bent at `position_m` while the tip was free: upwards where a layer begins, downwards where the layer before has
    /// ended and friction stops to grow.
    pub(super) fn start_after_bend(
        &mut self,
        position_m: f64,
        sd_m: f64,
        up: bool,
        drive: f64,
        noise: &NoiseEstimator,
        behind: &mut PassedLayers,
    ) {
        let unit = 1.0 / noise.variance;
        let travel = (position_m - self.start_m).max(0.0);
        let b = self.belief.x[B];
        let mut map = [[0.0; N]; N];
        for (i, row) in map.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        map[D][B] = travel;
        self.belief = self.belief.transformed(&map);
        // The layer before goes on to here as far as its friction did.
        if let Some(slot) = self.passed_count.checked_sub(1).and_then(|i| behind.get_mut(i))
            && b > 0.5 * self.belief.x[B_PREV]
        {
            slot[1] = position_m;
            self.gap_m += travel;
            self.gap_sd_m = sd_m;
        }
        if up {
            self.start_sd_m = sd_m;
            self.start_layer(self.slope_scale, sd_m, (self.slope_scale, b), drive, unit);
        } else {
            let g = &mut self.belief;
            g.reset_component(B, 0.0, b * b * unit);
            g.p[D][D] += b * b * sd_m * sd_m * unit;
        }
        self.start_m = position_m;
        self.last = None;
    }

    /// Friction along the shaft that the tip does not feel, per drive, with the tip at `position_m`; and its variance in squared
    /// units (N s/m for a viscous drive).
    #[inline(always)]
    pub(crate) fn shaft_friction(&self, position_m: f64, noise: &NoiseEstimator) -> (f64, f64) {
        if self.passed_count == 0 {
            return (0.0, 0.0);
        }
        let g = &self.belief;
        let (mut behind, mut variance) = (g.x[D], g.p[D][D]);
        if self.tip_free {
            let x = at_least(0.0, position_m - self.start_m);
            behind += g.x[B] * x;
            variance += x * (2.0 * g.cov(B, D) + x * g.p[B][B]);
        } else if self.start_sd_m > 0.0 {
            // A layer that begins `delta` later than it is taken to leaves `f0 - K delta` of the zero and `D - b delta` of the friction behind.
            let (k, sd_k) = (g.x[K], libm::sqrt(g.p[K][K] * noise.variance));
            if k > 2.0 * sd_k {
                let later_m = (noise.bias_n() - g.x[BIAS]) / k;
                let bound_m = 2.0 * self.start_sd_m;
                let by = g.x[B] / k;
                behind += g.x[B] * later_m.clamp(-bound_m, bound_m);
                variance += by * (by * g.p[BIAS][BIAS] - 2.0 * g.cov(BIAS, D));
            }
        }
        (behind, variance * noise.variance)
    }

    /// Friction per drive behind the layer before as it gave way, and its variance in squared units.
    pub(crate) fn friction_at_rupture(&self, noise: &NoiseEstimator) -> (f64, f64) {
        let (g, gap) = (&self.belief, self.gap_m);
        let place = g.x[B_PREV] * self.gap_sd_m;
        // The active layer's friction over what its begin may be off by is told from `D` by nothing.
        let begun = g.x[B] * self.rupture_sd_m;
        let known = g.p[D][D] - gap * (2.0 * g.cov(B_PREV, D) - gap * g.p[B_PREV][B_PREV]);
        let variance = known + (place * place + begun * begun) / noise.variance;
        (g.x[D] - gap * g.x[B_PREV], variance * noise.variance)
    }

    /// How friction grows with travel while the shaft enters the layer before, in N/m.
    pub(crate) fn friction_growth(&self, drive: f64) -> f64 {
        (self.belief.x[B_PREV] * drive).abs()
    }

    /// Variances of `Kp` and `bp` in squared units.
    pub(crate) fn previous_variance(&self, noise: &NoiseEstimator) -> [f64; 2] {
        [self.belief.p[K_PREV][K_PREV] * noise.variance, self.belief.p[B_PREV][B_PREV] * noise.variance]
    }

    /// Friction per drive that the passed layers exert with the tip at `z_m` on the way back, each with its friction spread
    /// evenly over its thickness.
    pub(crate) fn friction_during_retraction(
        &self,
        behind: &PassedLayers,
        z_m: f64,
        deepest_m: f64,
        noise: &NoiseEstimator,
    ) -> f64 {
        let last = self.passed_count.min(MAX_LAYERS);
        let (mut whole, mut inside) = (0.0, 0.0);
        for (i, [start, end, b]) in behind.iter().take(last).enumerate() {
            let b = if i + 1 == self.passed_count { self.belief.x[B_PREV].max(0.0) } else { *b };
            whole += b * (end - start);
            inside += b * (z_m - start).clamp(0.0, end - start);
        }
        // The sum is known better than its parts.
        let all = self.shaft_friction(deepest_m, noise).0.max(0.0);
        let share = if whole > 0.0 { inside / whole } else { 1.0 };
        all * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVES: [f64; 3] = [0.002, 0.003, 0.0015];

    /// Noise of 1 mN with a zero that is known to be none.
    fn noise() -> NoiseEstimator {
        let mut noise = NoiseEstimator::new(1e-3);
        (0..2000).for_each(|_| noise.update_in_air(0.0));
        noise
    }

    /// Stiffness, friction per metre, end.
    type Layer = (f64, f64, f64);
    const FIRST: Layer = (60.0, 9000.0, 0.02);
    const SECOND: Layer = (120.0, 5000.0, 0.045);
    const FIRST_BEHIND: f64 = 9000.0 * 0.02;
    const BOTH_BEHIND: f64 = FIRST_BEHIND + 5000.0 * 0.025;

    /// Over a layer from `start_m` to its end by 50 um, at speeds that change, with the friction `behind` of those before.
    fn travel(layers: &mut LayerEstimator, start_m: f64, (k, b, end_m): Layer, behind: f64) {
        let steps = ((end_m - start_m) / 5e-5) as usize;
        for n in 1..steps {
            let (x, u) = (5e-5 * n as f64, DRIVES[n / 40 % 3]);
            layers.update(start_m + x, u, k * x + b * x * u + behind * u, 0.0);
        }
    }

    /// At the end of the second layer, before it gives way.
    fn two() -> (LayerEstimator, PassedLayers, NoiseEstimator) {
        let (noise, mut behind) = (noise(), PassedLayers::default());
        let mut layers = LayerEstimator::at_contact(0.0, 0.0, 0.0, 2000.0, 0.002, &noise);
        travel(&mut layers, 0.0, FIRST, 0.0);
        layers.rupture(FIRST.2, 0.0, 0.002, &noise, &mut behind);
        travel(&mut layers, FIRST.2, SECOND, FIRST_BEHIND);
        (layers, behind, noise)
    }

    fn near(found: f64, expected: f64, share: f64) {
        assert!((found - expected).abs() <= share * expected.abs(), "{found} for {expected}");
    }

    #[test]
    fn stiffness_and_friction_of_this_layer_and_the_one_before_come_back_from_the_law() {
        let (layers, _, noise) = two();
        near(layers.belief.x[K], SECOND.0, 0.01);
        near(layers.belief.x[B], SECOND.1, 0.01);
        near(layers.belief.x[K_PREV], FIRST.0, 0.01);
        near(layers.belief.x[B_PREV], FIRST.1, 0.01);
        near(layers.shaft_friction(0.04, &noise).0, FIRST_BEHIND, 0.01);
        near(layers.friction_at_rupture(&noise).0, FIRST_BEHIND, 0.01);
        near(layers.previous_thickness_m, FIRST.2, 1e-9);
        near(layers.slope(0.002), SECOND.0 + SECOND.1 * 0.002, 0.01);
        near(layers.friction(0.03), FIRST_BEHIND + SECOND.1 * 0.01, 0.01);
        near(layers.friction_growth(0.002), FIRST.1 * 0.002, 0.01);
        for (z, u) in [(0.025, 0.001), (0.04, 0.004)] {
            let x = z - FIRST.2;
            let force_n = SECOND.0 * x + SECOND.1 * x * u + FIRST_BEHIND * u;
            near(layers.predict(z, u), force_n, 0.005);
        }
    }

    #[test]
    fn a_tip_that_was_inside_when_contact_was_noticed_has_its_layer_begin_before() {
        // 0.5 mm: 30 mN and some friction act already, known to 20 mN.
        let (noise, mut behind, inside_m) = (noise(), PassedLayers::default(), 5e-4);
        let force_n = FIRST.0 * inside_m + FIRST.1 * inside_m * DRIVES[0];
        let mut layers = LayerEstimator::at_contact(0.0, force_n, 0.02, 2000.0, DRIVES[0], &noise);
        for n in 1..400 {
            let (z, u) = (5e-5 * f64::from(n), DRIVES[n as usize / 40 % 3]);
            let x = z + inside_m;
            layers.update(z, u, FIRST.0 * x + FIRST.1 * x * u, 0.0);
        }
        layers.rupture(0.02, 0.0, 0.002, &noise, &mut behind);
        near(layers.previous_thickness_m, 0.0205, 0.005);
        near(layers.shaft_friction(0.02, &noise).0, FIRST.1 * 0.0205, 0.01);
        near(layers.belief.x[K_PREV], FIRST.0, 0.01);
        near(behind[0][0], -inside_m, 0.2);
        assert_eq!(behind[0][1], 0.02);
    }

    #[test]
    fn on_the_way_back_each_layer_leaves_the_shaft_as_the_tip_leaves_it() {
        let (mut layers, mut behind, noise) = two();
        layers.rupture(SECOND.2, 0.0, 0.002, &noise, &mut behind);
        for (z, expected) in [
            (0.06, BOTH_BEHIND),
            (0.045, BOTH_BEHIND),
            (0.035, FIRST_BEHIND + 5000.0 * 0.015),
            (0.02, FIRST_BEHIND),
            (0.005, 9000.0 * 0.005),
        ] {
            near(layers.friction_during_retraction(&behind, z, 0.06, &noise), expected, 0.02);
        }
        assert_eq!(layers.friction_during_retraction(&behind, -0.01, 0.06, &noise), 0.0);
    }

    #[test]
    fn what_is_not_known_of_the_place_of_a_rupture_is_not_known_of_the_friction_behind() {
        // Friction grows by b a metre: 0.4 mm more or less are 3.6 N s/m.
        let sd = |place_m: f64| {
            let (noise, mut behind) = (noise(), PassedLayers::default());
            let mut layers = LayerEstimator::at_contact(0.0, 0.0, 0.0, 2000.0, 0.002, &noise);
            travel(&mut layers, 0.0, FIRST, 0.0);
            layers.rupture(FIRST.2, place_m, 0.002, &noise, &mut behind);
            layers.shaft_friction(FIRST.2, &noise).1.sqrt()
        };
        let (sharp, blurred) = (sd(0.0), sd(4e-4));
        near((blurred * blurred - sharp * sharp).sqrt(), FIRST.1 * 4e-4, 0.01);
    }

    #[test]
    fn in_a_gap_friction_grows_on_and_the_layer_before_reaches_to_its_end() {
        let (mut layers, mut behind, noise) = two();
        layers.rupture(SECOND.2, 0.0, 0.002, &noise, &mut behind);
        // The shaft enters the second layer for 8 mm more, the tip feels nothing.
        layers.tip_free = true;
        let gap = (0.0, SECOND.1, SECOND.2 + 0.008);
        travel(&mut layers, SECOND.2, gap, BOTH_BEHIND);
        near(layers.shaft_friction(SECOND.2 + 0.004, &noise).0, BOTH_BEHIND + SECOND.1 * 0.004, 0.01);
        layers.start_after_bend(SECOND.2 + 0.008, 1e-4, true, 0.002, &noise, &mut behind);
        assert!(!layers.tip_free);
        near(layers.gap_m, 0.008, 1e-9);
        near(layers.shaft_friction(0.06, &noise).0, BOTH_BEHIND + SECOND.1 * 0.008, 0.01);
        near(layers.friction_at_rupture(&noise).0, BOTH_BEHIND, 0.01);
        // What it gave way at is known as well as the sum of what is known now and of what the gap has added.
        let g = &layers.belief;
        let h = [(D, 1.0), (B_PREV, -0.008)];
        let spread: f64 = h.iter().flat_map(|a| h.iter().map(|b| a.1 * g.cov(a.0, b.0) * b.1)).sum::<f64>()
            * noise.variance;
        let place = g.x[B_PREV] * 1e-4;
        near(layers.friction_at_rupture(&noise).1, spread + place * place, 1e-6);
        near(behind[1][1], SECOND.2 + 0.008, 1e-9);
        let back = layers.friction_during_retraction(&behind, SECOND.2 + 0.004, 0.06, &noise);
        near(back, BOTH_BEHIND + SECOND.1 * 0.004, 0.01);
    }

    /// Friction is in the doubt about `D` already; counted as force of the next layer as well, it made intervals of fast insertions hold
    /// 99 % instead of 95.
    #[test]
    fn where_a_layer_gave_way_leaves_open_what_stiffness_does_over_that_travel_and_not_what_friction_does() {
        let (mut layers, mut behind, noise) = two();
        let before = layers.belief.p[BIAS][BIAS];
        // At 0.3 m/s friction would be 1500 of the slope's 1620 N/m.
        layers.rupture(SECOND.2, 1e-5, 0.3, &noise, &mut behind);
        let open_n = ((layers.belief.p[BIAS][BIAS] - before) * noise.variance).sqrt();
        near(open_n, SECOND.0 * 1e-5, 0.01);
    }

    #[test]
    fn friction_where_a_layer_gave_way_is_known_no_better_than_what_the_next_adds_over_the_same_doubt() {
        let known = |sd_m: f64| {
            let (mut layers, mut behind, noise) = two();
            layers.rupture(SECOND.2, sd_m, 0.002, &noise, &mut behind);
            layers.belief.p[D][D] = 0.0;
            (layers.belief.p[B_PREV][D], layers.belief.x[B]) = (0.0, 7000.0);
            layers.friction_at_rupture(&noise).1.sqrt()
        };
        near(known(3e-5), 7000.0 * 3e-5, 1e-9);
        assert_eq!(known(0.0), 0.0);
    }

    #[test]
    fn a_layer_that_begins_later_than_it_is_taken_to_tells_so_by_the_zero() {
        let (mut layers, mut behind, noise) = two();
        layers.rupture(SECOND.2, 0.0, 0.002, &noise, &mut behind);
        layers.tip_free = true;
        travel(&mut layers, SECOND.2, (0.0, SECOND.1, SECOND.2 + 0.008), BOTH_BEHIND);
        // Taken to begin a millimetre before the face.
        let (face_m, k, b) = (SECOND.2 + 0.008, 100.0, 20_000.0);
        layers.start_after_bend(face_m - 1e-3, 8e-4, true, 0.002, &noise, &mut behind);
        let at_face = BOTH_BEHIND + SECOND.1 * 0.008;
        for n in 1..400 {
            let (x, u) = (5e-5 * n as f64, DRIVES[n / 40 % 3]);
            layers.update(face_m + x, u, k * x + b * x * u + at_face * u, 0.0);
        }
        near(layers.shaft_friction(0.07, &noise).0, at_face, 2e-3);
        // b times a millimetre, 20 N s/m, is what the estimator has in place of it.
        near(layers.belief.x[D], at_face - b * 1e-3, 0.01);
        let g = &layers.belief;
        let by = g.x[B] / g.x[K];
        let spread = g.p[D][D] + by * by * g.p[BIAS][BIAS] - 2.0 * by * g.cov(BIAS, D);
        near(layers.shaft_friction(0.07, &noise).1, spread * noise.variance, 1e-9);
        // No farther than twice what the begin is known to, and only where stiffness is known to half of itself.
        let mut far = layers;
        far.belief.x[BIAS] -= 1.0;
        near(far.shaft_friction(0.07, &noise).0, far.belief.x[D] + far.belief.x[B] * 1.6e-3, 1e-9);
        let mut vague = layers;
        vague.belief.p[K][K] = 1.1 * 0.25 * vague.belief.x[K] * vague.belief.x[K] / noise.variance;
        near(vague.shaft_friction(0.07, &noise).0, vague.belief.x[D], 1e-12);
        near(vague.shaft_friction(0.07, &noise).1, vague.belief.p[D][D] * noise.variance, 1e-12);
    }

    #[test]
    fn coloured_noise_weighs_as_if_it_were_whitened() {
        // Samples alternating about the law by what AR(1) noise makes of one impulse: f_k - rho f_(k-1) is the law's again.
        let (noise, rho) = (noise(), 0.8);
        let mut layers = LayerEstimator::at_contact(0.0, 0.0, 0.0, 2000.0, 0.002, &noise);
        let mut colour_n = 0.05;
        for n in 1..400 {
            let (x, u) = (5e-5 * f64::from(n), DRIVES[n as usize / 40 % 3]);
            let (e, _) = layers.update(x, u, FIRST.0 * x + FIRST.1 * x * u + colour_n, rho);
            if n > 200 {
                assert!(e.abs() < 2e-3, "{e} N at {x} m");
            }
            colour_n *= rho;
        }
        near(layers.slope(0.002), FIRST.0 + FIRST.1 * 0.002, 0.05);
    }

    use crate::stylet::gaussian::Gaussian;

    type Matrix = [[f64; N]; N];

    /// A layer from 31 mm on, behind `passed` others, and what is known of it: unknowns that hang together, in units of the noise.
    fn knowing(passed: usize) -> (LayerEstimator, NoiseEstimator) {
        let noise = NoiseEstimator::known(0.0, 1.6e-3, 0.07, 400.0);
        let mut layers = LayerEstimator::at_contact(0.013, 0.7, 0.3, 1700.0, 0.0023, &noise);
        let map = core::array::from_fn(|i| {
            core::array::from_fn(|j| if i == j { 1.0 } else { 0.1 * (i as f64 - 0.7 * j as f64) })
        });
        layers.belief = Gaussian::new([0.0; N], [1.3, 4.0, 0.25, 2.0, 0.5, 0.7]).transformed(&map);
        layers.belief.x = [130.0, 57.0, 8300.0, 44.0, 7100.0, 0.06];
        (layers.start_m, layers.previous_thickness_m, layers.passed_count) = (0.031, 0.018, passed);
        (layers.gap_m, layers.gap_sd_m, layers.previous_start_sd_m) = (0.0037, 3e-4, 5e-4);
        (layers.slope_scale, layers.layer_confirmed) = (90.0, true);
        (layers, noise)
    }

    fn full(g: &Gaussian<N>) -> Matrix {
        core::array::from_fn(|i| core::array::from_fn(|j| g.cov(i, j)))
    }

    /// `h' P h`.
    fn spread(p: &Matrix, h: &[f64; N]) -> f64 {
        (0..N * N).map(|n| h[n / N] * p[n / N][n % N] * h[n % N]).sum()
    }

    fn assert_belief(found: &Gaussian<N>, x: &[f64; N], p: &Matrix) {
        for i in 0..N {
            near(found.x[i], x[i], 1e-9);
            for j in 0..N {
                let scale = (p[i][i] * p[j][j]).sqrt();
                let off = (found.cov(i, j) - p[i][j]).abs();
                assert!(off <= 1e-9 * scale, "{i} {j}: {} for {}", found.cov(i, j), p[i][j]);
            }
        }
    }

    /// `map x` and `map P map'`.
    fn carried(map: &Matrix, x: &[f64; N], p: &Matrix) -> ([f64; N], Matrix) {
        let mean = map.map(|row| (0..N).map(|k| row[k] * x[k]).sum());
        let of =
            |i: usize, j: usize| (0..N * N).map(|n| map[i][n / N] * p[n / N][n % N] * map[j][n % N]).sum();
        (mean, core::array::from_fn(|i| core::array::from_fn(|j| of(i, j))))
    }

    #[test]
    fn at_contact_the_force_is_half_elastic_and_slopes_are_as_uncertain_as_they_may_be_large() {
        let noise = NoiseEstimator::known(0.0, 1.6e-3, 0.07, 400.0);
        let layers = LayerEstimator::at_contact(0.013, 0.7, 0.3, 1700.0, 0.0023, &noise);
        let g = &layers.belief;
        assert_eq!(g.x, [0.35, 850.0, 0.5 * (1700.0 / 0.0023), 0.35 / 0.0023, 0.0, 0.07]);
        let sds = [0.3, 1700.0, 1700.0 / 0.0023, 0.3 / 0.0023, 0.04, 0.002];
        for (i, sd) in sds.into_iter().enumerate() {
            near((g.p[i][i] * noise.variance).sqrt(), sd, 1e-12);
        }
        assert_eq!((layers.start_m, layers.contact_drive, layers.slope_scale), (0.013, 0.0023, 1700.0));
        // Not wider than what can be told apart from a noise of 1 uN: 10 mN, and that much over the memory of 1 mm.
        let noise = NoiseEstimator::known(0.0, 1e-12, 0.0, 400.0);
        let layers = LayerEstimator::at_contact(0.0, 0.7, 0.3, 1700.0, 0.0023, &noise);
        for (i, sd) in [(D, 0.01), (K, 10.0), (B, 10.0 / 0.0023), (K_PREV, 0.01 / 0.0023)] {
            near((layers.belief.p[i][i] * noise.variance).sqrt(), sd, 1e-12);
        }
        near(layers.belief.x[K], 5.0, 1e-12);
    }

    #[test]
    fn a_sample_teaches_what_the_law_of_its_place_leaves_of_it_whitened_by_the_one_before() {
        for (passed, rho) in [(0, 0.0), (0, 0.6), (2, 0.0), (2, 0.6)] {
            let (mut layers, _) = knowing(passed);
            let h = |z: f64, u: f64| {
                let x = z - 0.031;
                if passed == 0 { [1.0, x, x * u, u, 0.0, 1.0] } else { [u, x, x * u, 0.0, 0.0, 1.0] }
            };
            let samples = [(0.0347, 0.7, 3.1), (0.0391, 1.9, 2.7), (0.0402, 0.3, 9.9)];
            let mut before: Option<(f64, f64, f64)> = None;
            for (n, (z, u, force_n)) in samples.into_iter().enumerate() {
                let (mut h_now, mut y, mut r) = (h(z, u), force_n, 1.0);
                let says: f64 = (0..N).map(|i| h_now[i] * layers.belief.x[i]).sum();
                near(layers.predict(z, u), says, 1e-12);
                if rho > 0.0 && n == 1 {
                    let (z, u, force_n) = before.expect("a sample before");
                    let h_before = h(z, u);
                    (0..N).for_each(|i| h_now[i] -= rho * h_before[i]);
                    y -= rho * force_n;
                } else {
                    // The noise of a sample alone.
                    r = 1.0 / (1.0 - rho * rho);
                }
                let (g, p) = (layers.belief, full(&layers.belief));
                let e = y - (0..N).map(|i| h_now[i] * g.x[i]).sum::<f64>();
                let s = r + spread(&p, &h_now);
                let gain: [f64; N] =
                    core::array::from_fn(|i| (0..N).map(|j| p[i][j] * h_now[j]).sum::<f64>() / s);
                let (found_e, found_s) = layers.update(z, u, force_n, rho);
                near(found_e, e, 1e-9);
                near(found_s, s, 1e-9);
                let x = core::array::from_fn(|i| g.x[i] + gain[i] * e);
                let left =
                    core::array::from_fn(|i| core::array::from_fn(|j| p[i][j] - gain[i] * gain[j] * s));
                assert_belief(&layers.belief, &x, &left);
                before = Some((z, u, force_n));
                if n == 1 {
                    // What is passed over whitens nothing.
                    layers.skip_sample();
                }
            }
        }
    }

    #[test]
    fn slope_and_friction_are_what_the_belief_makes_of_drive_and_place() {
        let (layers, noise) = knowing(2);
        near(layers.slope(0.3), 57.0 + 0.3 * 8300.0, 1e-12);
        near(layers.friction(0.0345), 130.0 + 8300.0 * 0.0035, 1e-12);
        near(layers.friction_growth(0.3), 7100.0 * 0.3, 1e-12);
        near(knowing(0).0.friction(0.0345), 44.0 + 8300.0 * 0.0035, 1e-12);
        let p = full(&layers.belief);
        near(layers.previous_variance(&noise)[0], p[K_PREV][K_PREV] * 1.6e-3, 1e-12);
        near(layers.previous_variance(&noise)[1], p[B_PREV][B_PREV] * 1.6e-3, 1e-12);
        let (mut falling, _) = knowing(2);
        falling.belief.x[B_PREV] = -7100.0;
        near(falling.friction_growth(0.3), 7100.0 * 0.3, 1e-12);
    }

    #[test]
    fn friction_behind_is_that_of_the_layers_passed_and_grows_with_travel_where_the_tip_is_free() {
        let (mut layers, noise) = knowing(2);
        let p = full(&layers.belief);
        let (found, variance) = layers.shaft_friction(0.0345, &noise);
        near(found, 130.0, 1e-12);
        near(variance, p[D][D] * 1.6e-3, 1e-12);
        layers.tip_free = true;
        let (found, variance) = layers.shaft_friction(0.0345, &noise);
        near(found, 130.0 + 8300.0 * 0.0035, 1e-12);
        near(variance, spread(&p, &[1.0, 0.0, 0.0035, 0.0, 0.0, 0.0]) * 1.6e-3, 1e-12);
        // Before where it begins there is none of it; and none at all in the first layer.
        near(layers.shaft_friction(0.02, &noise).0, 130.0, 1e-12);
        assert_eq!(knowing(0).0.shaft_friction(0.0345, &noise), (0.0, 0.0));
        // When the layer before gave way there was as much less as the gap of 3.7 mm has added.
        let (gave_way, variance) = layers.friction_at_rupture(&noise);
        near(gave_way, 130.0 - 0.0037 * 7100.0, 1e-12);
        let place = 7100.0 * 3e-4;
        near(variance, spread(&p, &[1.0, 0.0, 0.0, 0.0, -0.0037, 0.0]) * 1.6e-3 + place * place, 1e-9);
    }

    #[test]
    fn each_layer_has_its_share_of_the_friction_on_the_way_back() {
        let (mut layers, noise) = knowing(2);
        let mut behind = PassedLayers::default();
        behind[0] = [0.001, 0.021, 9000.0];
        behind[1] = [0.021, 0.031, 1.0];
        behind[2] = [0.031, 0.041, 5000.0];
        // 180 N s/m, and 71 N s/m of the one before as it is known now: of what is known of the sum.
        for (z, inside) in
            [(0.05, 251.0), (0.031, 251.0), (0.027, 180.0 + 42.6), (0.011, 90.0), (0.0005, 0.0)]
        {
            near(layers.friction_during_retraction(&behind, z, 0.04, &noise), 130.0 * inside / 251.0, 1e-9);
        }
        // A free tip has gone on in friction to its deepest point.
        layers.tip_free = true;
        near(
            layers.friction_during_retraction(&behind, 0.011, 0.0345, &noise),
            (130.0 + 29.05) * 90.0 / 251.0,
            1e-9,
        );
        // No layer pulls; without friction of its own each is as good as another.
        layers.tip_free = false;
        layers.belief.x[B_PREV] = -3.0;
        near(layers.friction_during_retraction(&behind, 0.027, 0.04, &noise), 130.0, 1e-12);
        near(layers.friction_during_retraction(&behind, 0.011, 0.04, &noise), 65.0, 1e-9);
        behind[0][2] = 0.0;
        near(layers.friction_during_retraction(&behind, 0.011, 0.04, &noise), 130.0, 1e-12);
        layers.belief.x[D] = -4.0;
        assert_eq!(layers.friction_during_retraction(&behind, 0.011, 0.04, &noise), 0.0);
        // Those beyond the last one kept are part of the sum alone.
        let (layers, _) = knowing(MAX_LAYERS + 1);
        let behind: PassedLayers =
            core::array::from_fn(|i| [0.001 * i as f64, 0.001 * (i as f64 + 1.0), 40.0]);
        near(
            layers.friction_during_retraction(&behind, 0.004, 0.04, &noise),
            130.0 * 4.0 / MAX_LAYERS as f64,
            1e-9,
        );
    }

    /// What a stiffness may be of which the slope is known to have the size `most`.
    fn stiff(g: &Gaussian<N>, noise: &NoiseEstimator, most: f64) -> f64 {
        (g.x[K].powi(2) + g.p[K][K] * noise.variance).sqrt().min(most)
    }

    /// What is known just after a rupture at 43.1 mm, to 0.6 mm, of a layer whose slope had the size `before`, whose stiffness may have had
    /// the size `stiff`, and whose friction was `b`.
    fn after_a_rupture(
        map: &Matrix,
        (g, noise): (&Gaussian<N>, &NoiseEstimator),
        [before, stiff]: [f64; 2],
        b: f64,
    ) -> ([f64; N], Matrix) {
        let (mut x, mut p) = carried(map, &g.x, &full(g));
        (x[K], x[B]) = (0.5 * before, 0.5 * before / 0.3);
        (p[K], p[B]) = ([0.0; N], [0.0; N]);
        p.iter_mut().for_each(|row| (row[K], row[B]) = (0.0, 0.0));
        let wide = (3.0 * before).min((1e8 * noise.variance).sqrt() / MEMORY_M);
        p[K][K] = wide * wide / noise.variance;
        p[B][B] = wide * wide / (0.3 * 0.3) / noise.variance;
        p[D][D] += (b * 6e-4).powi(2) / noise.variance;
        p[BIAS][BIAS] += (stiff * 6e-4).powi(2) / noise.variance;
        (x, p)
    }

    #[test]
    fn at_a_rupture_the_friction_of_the_layer_is_behind_and_the_next_may_be_three_times_as_stiff() {
        // K, b, and what is believed of the slope and of the friction: no more of it than the slope allows.
        for (k, b, before, believed) in [
            (57.0, 83.0, 81.9, 83.0),
            (-30.0, 70.0, 9.0, 30.0),
            (57.0, -240.0, 15.0, -50.0),
            (-24.2, 80.0, 1.0, 1.0 / 0.3),
        ] {
            let (mut layers, noise) = knowing(2);
            (layers.belief.x[K], layers.belief.x[B]) = (k, b);
            let (g, mut behind) = (layers.belief, PassedLayers::default());
            behind[1] = [0.013, 0.031, 5.0];
            let mut map = Matrix::default();
            (map[D][D], map[D][B]) = (1.0, 0.0121);
            (map[K_PREV][K], map[B_PREV][B], map[BIAS][BIAS]) = (1.0, 1.0, 1.0);
            let (x, p) = after_a_rupture(&map, (&g, &noise), [before, stiff(&g, &noise, before)], believed);
            layers.rupture(0.0431, 6e-4, 0.3, &noise, &mut behind);
            assert_belief(&layers.belief, &x, &p);
            assert_eq!(behind[1], [0.013, 0.031, 7100.0], "as it is known when the next one gives way");
            near(behind[2][0], 0.031, 1e-12);
            assert_eq!((behind[2][1], behind[2][2], behind[3]), (0.0431, 0.0, [0.0; 3]));
            near(layers.previous_thickness_m, 0.0121, 1e-9);
            near(layers.slope_scale, before, 1e-9);
            assert_eq!((layers.passed_count, layers.start_m, layers.layer_confirmed), (3, 0.0431, false));
            assert_eq!((layers.gap_m, layers.gap_sd_m, layers.previous_start_sd_m), (0.0, 0.0, 0.0));
            let densities = [true, false].map(|follows| layers.log_density_of_free(follows, &noise));
            assert_eq!(layers.initial_log_densities, densities);
        }
    }

    #[test]
    fn a_layer_that_began_behind_a_gap_takes_its_doubt_about_its_begin_with_it() {
        let (mut layers, noise) = knowing(2);
        (layers.start_sd_m, layers.tip_free) = (8e-4, true);
        (layers.belief.x[K], layers.belief.x[B]) = (0.0, 83.0);
        let (mut g, mut behind) = (layers.belief, PassedLayers::default());
        behind[1] = [0.013, 0.031, 5.0];
        let mut map = Matrix::default();
        (map[D][D], map[D][B], map[K_PREV][K], map[B_PREV][B]) = (1.0, 1e-6, 1.0, 1.0);
        // A tip that has lost force was not free: any part of the slope of 24.9 N/m may have been elastic.
        (g.x[K], g.x[B]) = (12.45, 41.5);
        let variance = 12.45 * 12.45 / noise.variance;
        g.p[K][K] += variance;
        g.p[B][B] += variance / (0.3 * 0.3);
        g.p[B][K] -= variance / 0.3;
        // A free tip's slope says nothing of layers: the scale stays. What looked like an error of the zero is gone.
        let (mut x, mut p) = after_a_rupture(&map, (&g, &noise), [90.0, stiff(&g, &noise, 90.0)], 41.5);
        x[BIAS] = 0.07;
        p[BIAS][BIAS] += 1.0 / 400.0;
        // Nor does a layer end before it has begun.
        layers.rupture(0.03, 6e-4, 0.3, &noise, &mut behind);
        assert_belief(&layers.belief, &x, &p);
        assert_eq!((layers.previous_start_sd_m, layers.start_sd_m, layers.tip_free), (8e-4, 0.0, false));
        near(layers.previous_thickness_m, 1e-6, 1e-9);
    }

    #[test]
    fn no_more_of_a_slope_is_in_doubt_than_what_can_be_told_from_the_noise() {
        for (friction, half) in [(400.0, 60.0), (1e9, 1000.0), (-1e9, -1000.0)] {
            let (mut layers, _) = knowing(2);
            layers.belief = Gaussian::new([130.0, 0.0, friction, 44.0, 7100.0, 0.06], [1.0; N]);
            layers.reopen_split(0.3, 1e8);
            near(layers.belief.x[K], half, 1e-9);
            near(layers.belief.p[K][K], 1.0 + half * half * 1e8, 1e-9);
        }
    }

    #[test]
    fn no_layer_is_expected_to_be_stiffer_than_what_can_be_told_from_the_noise() {
        let (mut layers, _) = knowing(2);
        let noise = NoiseEstimator::known(0.0, 1e-12, 0.07, 400.0);
        layers.rupture(0.0431, 0.0, 0.3, &noise, &mut PassedLayers::default());
        near(layers.slope_scale, 10.0, 1e-9);
        near((layers.belief.p[K][K] * noise.variance).sqrt(), 10.0, 1e-9);
        near((layers.belief.p[B][B] * noise.variance).sqrt(), 10.0 / 0.3, 1e-9);
    }

    #[test]
    fn the_first_layer_began_as_far_before_contact_as_force_over_slope_says() {
        // Force and slope at contact with the drive that there was, in N and N/m; and how far the tip was inside, in m.
        for (p_n, q, k, b, inside_m) in [
            (0.13, 0.9, 57.0, 83.0, Some((0.13 + 0.9 * 0.0023) / (57.0 + 83.0 * 0.0023))),
            // No more than the tip has travelled since.
            (1.9, 0.9, 57.0, 83.0, Some(0.0121)),
            (-0.13, 0.9, 57.0, 83.0, None),
            (-0.0023 * 0.9, 0.9, 57.0, 83.0, None),
            (0.13, 0.9, -57.0, 83.0, None),
            (-0.13, 0.9, -57.0, 83.0, None),
            (0.13, 0.9, -0.0023 * 83.0, 83.0, None),
        ] {
            let (mut layers, noise) = knowing(0);
            let x = &mut layers.belief.x;
            (x[D], x[K_PREV], x[K], x[B]) = (p_n, q, k, b);
            let (mut g, mut behind) = (layers.belief, PassedLayers::default());
            let delta = inside_m.unwrap_or(0.0);
            if inside_m.is_some() {
                // Then p = K delta, as well as the force was known.
                let r = spread(&full(&g), &[1.0, 0.0, 0.0, 0.0023, 0.0, 0.0]);
                let p_is_k_delta = g.innovation([D, K], [1.0, -delta], 0.0, r);
                g.update(&p_is_k_delta);
            }
            let mut map = Matrix::default();
            (map[D][K_PREV], map[D][B], map[K_PREV][K], map[B_PREV][B], map[BIAS][BIAS]) =
                (1.0, 0.0121, 1.0, 1.0, 1.0);
            let before = (g.x[K] + g.x[B] * 0.3).abs().max(1.0);
            let (x, p) = after_a_rupture(
                &map,
                (&g, &noise),
                [before, stiff(&g, &noise, before)],
                g.x[B].clamp(-before / 0.3, before / 0.3),
            );
            layers.rupture(0.0431, 6e-4, 0.3, &noise, &mut behind);
            assert_belief(&layers.belief, &x, &p);
            near(layers.previous_thickness_m, 0.0121 + delta, 1e-9);
            near(behind[0][0], 0.031 - delta, 1e-9);
            assert_eq!((behind[0][1], layers.passed_count), (0.0431, 1));
        }
        // A force that is known all but exactly makes no constraint that is.
        let (mut layers, noise) = knowing(0);
        layers.belief = Gaussian::new([0.13, 57.0, 83.0, 0.9, 0.0, 0.0], [1e-9, 1e-9, 0.1, 1e-9, 0.1, 0.1]);
        let inside_m = (0.13 + 0.9 * 0.0023) / (57.0 + 83.0 * 0.0023);
        layers.rupture(0.0431, 6e-4, 0.3, &noise, &mut PassedLayers::default());
        let kept =
            57.0 + 1e-9 * inside_m * (0.13 - 57.0 * inside_m) / (1e-6 + 1e-9 + 1e-9 * inside_m * inside_m);
        assert!((layers.belief.x[K_PREV] - kept).abs() < 1e-13, "{} for {kept}", layers.belief.x[K_PREV]);
    }

    #[test]
    fn where_the_force_bends_upwards_a_layer_begins_and_where_downwards_friction_stops_to_grow() {
        for (up, b, grows) in
            [(true, 83.0, true), (false, 83.0, true), (true, 30.0, false), (false, 30.0, false)]
        {
            let (mut layers, noise) = knowing(2);
            (layers.tip_free, layers.gap_sd_m) = (true, 3e-4);
            (layers.belief.x[B], layers.belief.x[B_PREV]) = (b, 61.0);
            let (g, mut behind) = (layers.belief, PassedLayers::default());
            behind[1] = [0.013, 0.031, 61.0];
            let mut map: Matrix =
                core::array::from_fn(|i| core::array::from_fn(|j| f64::from(u8::from(i == j))));
            map[D][B] = 0.0121;
            layers.start_after_bend(0.0431, 6e-4, up, 0.3, &noise, &mut behind);
            let (x, p) = if up {
                after_a_rupture(&map, (&g, &noise), [90.0; 2], b)
            } else {
                let (mut x, mut p) = carried(&map, &g.x, &full(&g));
                x[B] = 0.0;
                (0..N).for_each(|i| (p[i][B], p[B][i]) = (0.0, 0.0));
                p[B][B] = b * b / noise.variance;
                p[D][D] += (b * 6e-4).powi(2) / noise.variance;
                (x, p)
            };
            assert_belief(&layers.belief, &x, &p);
            assert_eq!((layers.tip_free, layers.start_m), (!up, 0.0431));
            assert_eq!(layers.start_sd_m, if up { 6e-4 } else { 0.0 });
            // As far as more than half of its friction per metre went on, the layer before went on.
            let gap = layers.gap_m - 0.0037;
            if grows {
                near(gap, 0.0121, 1e-9);
                assert_eq!((behind[1], layers.gap_sd_m), ([0.013, 0.0431, 61.0], 6e-4));
            } else {
                assert_eq!((gap, behind[1], layers.gap_sd_m), (0.0, [0.013, 0.031, 61.0], 3e-4));
            }
        }
        // What bends before the place where it began has not gone on.
        let (mut layers, noise) = knowing(2);
        let before = layers.belief.x[D];
        layers.start_after_bend(0.03, 6e-4, false, 0.3, &noise, &mut PassedLayers::default());
        assert_eq!((layers.gap_m, layers.belief.x[D]), (0.0037, before));
    }
}
