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

use super::gaussian::{Gaussian, Innovation, WIDEST, at_least};
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
    /// The tip is in a gap, or behind the last layer: what grows with travel is friction.
    pub(super) free: bool,
    /// See [`super::slack`]: the densities when the active layer began, friction as that of the layer before, and none.
    pub(super) free_before: [f64; 2],
    /// It is beyond doubt that a layer has begun.
    pub(super) settled: bool,
    /// Where the layer before gave way, in m, and how well that is known.
    pub(super) gave_way_m: f64,
    gave_way_sd_m: f64,
    /// Travel of the gap behind the layer before, in which its friction went on to grow, and how well it is known.
    pub(super) gap_m: f64,
    gap_sd_m: f64,
    /// How well the begin of the active layer is known, and that of the layer before was, in m.
    start_sd_m: f64,
    pub(super) previous_sd_m: f64,
    /// Slope that the active layer was thought to have at its begin, in N/m.
    scale: f64,
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
            free: false,
            free_before: [0.0; 2],
            settled: false,
            gave_way_m: start_m,
            gave_way_sd_m: 0.0,
            gap_m: 0.0,
            gap_sd_m: 0.0,
            start_sd_m: 0.0,
            previous_sd_m: 0.0,
            scale: slope,
            drive0: drive,
            last: None,
        }
    }

    /// The tip feels nothing, or nobody knows: it may be in a gap, or in the air still.
    #[inline(always)]
    pub(super) fn may_be_free(&self) -> bool {
        !self.settled
    }

    #[inline(always)]
    fn regressor(&self, x: f64, drive: f64) -> [f64; N] {
        let (a, q) = if self.passed > 0 { (drive, 0.0) } else { (1.0, drive) };
        [a, x, x * drive, q, 0.0, 1.0]
    }

    /// Friction per drive, what the tip feels of it included.
    pub(crate) fn friction(&self, position_m: f64) -> f64 {
        let behind = self.belief.x[if self.passed > 0 { A } else { KP }];
        behind + self.belief.x[F] * (position_m - self.start_m)
    }

    /// The force that the law says.
    #[inline(always)]
    pub(crate) fn says(&self, position_m: f64, drive: f64) -> f64 {
        let w = self.regressor(position_m - self.start_m, drive);
        w.iter().zip(&self.belief.x).map(|(w, x)| w * x).sum()
    }

    /// Takes a sample; returns the innovation in N and its variance in units of the noise's.
    #[inline(always)]
    pub(crate) fn take(&mut self, position_m: f64, drive: f64, force_n: f64, rho: f64) -> (f64, f64) {
        let innovation = self.innovation(position_m, drive, force_n, rho);
        self.learn(&innovation, position_m, drive, force_n)
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
        if self.passed > 0 {
            self.belief.innovation([A, K, F, ZERO], [w[A], w[K], w[F], w[ZERO]], y, r)
        } else {
            self.belief.innovation([A, K, F, KP, ZERO], [w[A], w[K], w[F], w[KP], w[ZERO]], y, r)
        }
    }

    /// Takes the sample of an [`Layers::innovation`].
    #[inline(always)]
    pub(crate) fn learn(
        &mut self,
        innovation: &Innovation<6>,
        position_m: f64,
        drive: f64,
        force_n: f64,
    ) -> (f64, f64) {
        self.belief.take(innovation);
        self.last = Some([position_m - self.start_m, drive, force_n]);
        (innovation.e, innovation.s)
    }

    pub(crate) fn pass(&mut self) {
        self.last = None;
    }

    /// Slope of the force with travel in N/m.
    pub(crate) fn slope(&self, drive: f64) -> f64 {
        self.belief.x[K] + self.belief.x[F] * drive
    }

    /// The same, and its standard deviation.
    pub(super) fn slope_and_sd(&self, drive: f64, noise: &Noise) -> (f64, f64) {
        let g = &self.belief;
        let variance = g.p[K][K] + drive * (2.0 * g.cov(F, K) + drive * g.p[F][F]);
        (self.slope(drive), libm::sqrt(at_least(0.0, variance) * noise.variance))
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
        let before = if self.free { self.scale } else { self.slope(drive).abs().max(1.0) };
        if self.free {
            self.was_not_free(drive, unit);
        }
        let before = before.min(libm::sqrt(WIDEST / unit) / MEMORY_M);
        let known = self.belief.x[FP].max(0.0);
        let b = self.belief.x[F].clamp(-before / drive, before / drive);
        let stiff = self.stiffest(before, unit);
        // The belief moves on by a linear map; the new layer's stiffness and friction are unknown.
        let mut map = [[0.0; N]; N];
        map[A][if first { KP } else { A }] = 1.0;
        map[A][F] = d;
        map[KP][K] = 1.0;
        map[FP][F] = 1.0;
        map[ZERO][ZERO] = 1.0;
        self.belief = self.belief.mapped(&map);
        if self.start_sd_m > 0.0 {
            // What looked like an error of the zero was the begin of the layer that is gone.
            self.belief.renew(ZERO, noise.bias_n(), noise.bias_variance() * unit);
        }
        self.begin(before, sd_m, (stiff, b), drive, unit);
        (self.previous_sd_m, self.start_sd_m, self.gap_m) = (self.start_sd_m, 0.0, 0.0);
        self.gap_sd_m = 0.0;
        d += delta;
        // The layer before this one will not be known better.
        if let Some(before) = self.passed.checked_sub(1).and_then(|i| behind.get_mut(i)) {
            before[2] = known;
        }
        if let Some(slot) = behind.get_mut(self.passed) {
            *slot = [position_m - d, position_m, 0.0];
        }
        self.start_m = position_m;
        (self.gave_way_m, self.gave_way_sd_m) = (position_m, sd_m);
        self.previous_m = d;
        self.passed += 1;
        self.last = None;
        self.free_before = [self.log_density_of_free(true, noise), self.log_density_of_free(false, noise)];
    }

    /// What has lost force was a layer, which looked like friction that grows on: any part of the slope may have been elastic.
    pub(super) fn was_not_free(&mut self, drive: f64, unit: f64) {
        let widest = libm::sqrt(WIDEST / unit) / MEMORY_M;
        let half = (0.5 * self.slope(drive)).clamp(-widest, widest);
        let g = &mut self.belief;
        (g.x[K], g.x[F]) = (g.x[K] + half, g.x[F] - half / drive);
        let variance = half * half * unit;
        g.p[K][K] += variance;
        g.p[F][F] += variance / (drive * drive);
        g.p[F][K] -= variance / drive;
        self.free = false;
    }

    /// Root mean square of what the active layer's stiffness may be in N/m, of which it has shown the slope `most` with friction.
    fn stiffest(&self, most: f64, unit: f64) -> f64 {
        let g = &self.belief;
        libm::sqrt(g.x[K] * g.x[K] + g.p[K][K] / unit).min(most)
    }

    /// A layer of unknown stiffness and friction begins at a place that is known to `sd_m`: on either side of it friction per
    /// drive grows by `friction` more or less.
    fn begin(&mut self, scale: f64, sd_m: f64, (stiff, friction): (f64, f64), drive: f64, unit: f64) {
        let wide = (3.0 * scale).min(libm::sqrt(WIDEST / unit) / MEMORY_M);
        let g = &mut self.belief;
        g.renew(K, 0.5 * scale, wide * wide * unit);
        g.renew(F, 0.5 * scale / drive, wide * wide / (drive * drive) * unit);
        // Where exactly it gave way is not known better than the samples lie: that much friction more or less, and
        // that much force of the new layer, which looks like an error of the zero.
        let place = sd_m * sd_m * unit;
        g.p[A][A] += friction * friction * place;
        g.p[ZERO][ZERO] += stiff * stiff * place;
        (self.free, self.settled, self.scale) = (false, false, scale);
    }

    /// The force has bent at `position_m` while the tip was free: upwards where a layer begins, downwards where the layer before has
    /// ended and friction stops to grow.
    pub(super) fn bend(
        &mut self,
        position_m: f64,
        sd_m: f64,
        up: bool,
        drive: f64,
        noise: &Noise,
        behind: &mut Behind,
    ) {
        let unit = 1.0 / noise.variance;
        let travel = (position_m - self.start_m).max(0.0);
        let b = self.belief.x[F];
        let mut map = [[0.0; N]; N];
        for (i, row) in map.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        map[A][F] = travel;
        self.belief = self.belief.mapped(&map);
        // The layer before goes on to here as far as its friction did.
        if let Some(slot) = self.passed.checked_sub(1).and_then(|i| behind.get_mut(i))
            && b > 0.5 * self.belief.x[FP]
        {
            slot[1] = position_m;
            self.gap_m += travel;
            self.gap_sd_m = sd_m;
        }
        if up {
            self.start_sd_m = sd_m;
            self.begin(self.scale, sd_m, (self.scale, b), drive, unit);
        } else {
            let g = &mut self.belief;
            g.renew(F, 0.0, b * b * unit);
            g.p[A][A] += b * b * sd_m * sd_m * unit;
        }
        self.start_m = position_m;
        self.last = None;
    }

    /// Friction along the shaft that the tip does not feel, per drive, with the tip at `position_m`; and its variance in squared
    /// units (N s/m for a viscous drive).
    #[inline(always)]
    pub(crate) fn behind(&self, position_m: f64, noise: &Noise) -> (f64, f64) {
        if self.passed == 0 {
            return (0.0, 0.0);
        }
        let g = &self.belief;
        let (mut behind, mut variance) = (g.x[A], g.p[A][A]);
        if self.free {
            let x = at_least(0.0, position_m - self.start_m);
            behind += g.x[F] * x;
            variance += x * (2.0 * g.cov(F, A) + x * g.p[F][F]);
        } else if self.start_sd_m > 0.0 {
            // A layer that begins `delta` later than it is taken to leaves `f0 - K delta` of the zero and `D - b delta` of the friction behind.
            let (k, sd_k) = (g.x[K], libm::sqrt(g.p[K][K] * noise.variance));
            if k > 2.0 * sd_k {
                let later_m = (noise.bias_n() - g.x[ZERO]) / k;
                let bound_m = 2.0 * self.start_sd_m;
                let by = g.x[F] / k;
                behind += g.x[F] * later_m.clamp(-bound_m, bound_m);
                variance += by * (by * g.p[ZERO][ZERO] - 2.0 * g.cov(ZERO, A));
            }
        }
        (behind, variance * noise.variance)
    }

    /// Friction per drive behind the layer before as it gave way, and its variance in squared units.
    pub(crate) fn when_it_gave_way(&self, noise: &Noise) -> (f64, f64) {
        let (g, gap) = (&self.belief, self.gap_m);
        let place = g.x[FP] * self.gap_sd_m;
        // The active layer's friction over what its begin may be off by is told from `D` by nothing.
        let begun = g.x[F] * self.gave_way_sd_m;
        let known = g.p[A][A] - gap * (2.0 * g.cov(FP, A) - gap * g.p[FP][FP]);
        let variance = known + (place * place + begun * begun) / noise.variance;
        (g.x[A] - gap * g.x[FP], variance * noise.variance)
    }

    /// How friction grows with travel while the shaft enters the layer before, in N/m.
    pub(crate) fn growth(&self, drive: f64) -> f64 {
        (self.belief.x[FP] * drive).abs()
    }

    /// Variances of `Kp` and `bp` in squared units.
    pub(crate) fn previous_variance(&self, noise: &Noise) -> [f64; 2] {
        [self.belief.p[KP][KP] * noise.variance, self.belief.p[FP][FP] * noise.variance]
    }

    /// Friction per drive that the passed layers exert with the tip at `z_m` on the way back, each with its friction spread
    /// evenly over its thickness.
    pub(crate) fn around_shaft(&self, behind: &Behind, z_m: f64, deepest_m: f64, noise: &Noise) -> f64 {
        let last = self.passed.min(MAX_LAYERS);
        let (mut whole, mut inside) = (0.0, 0.0);
        for (i, [start, end, b]) in behind.iter().take(last).enumerate() {
            let b = if i + 1 == self.passed { self.belief.x[FP].max(0.0) } else { *b };
            whole += b * (end - start);
            inside += b * (z_m - start).clamp(0.0, end - start);
        }
        // The sum is known better than its parts.
        let all = self.behind(deepest_m, noise).0.max(0.0);
        let share = if whole > 0.0 { inside / whole } else { 1.0 };
        all * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVES: [f64; 3] = [0.002, 0.003, 0.0015];

    /// Noise of 1 mN with a zero that is known to be none.
    fn noise() -> Noise {
        let mut noise = Noise::new(1e-3);
        (0..2000).for_each(|_| noise.in_air(0.0));
        noise
    }

    /// Stiffness, friction per metre, end.
    type Layer = (f64, f64, f64);
    const FIRST: Layer = (60.0, 9000.0, 0.02);
    const SECOND: Layer = (120.0, 5000.0, 0.045);
    const FIRST_BEHIND: f64 = 9000.0 * 0.02;
    const BOTH_BEHIND: f64 = FIRST_BEHIND + 5000.0 * 0.025;

    /// Over a layer from `start_m` to its end by 50 um, at speeds that change, with the friction `behind` of those before.
    fn travel(layers: &mut Layers, start_m: f64, (k, b, end_m): Layer, behind: f64) {
        let steps = ((end_m - start_m) / 5e-5) as usize;
        for n in 1..steps {
            let (x, u) = (5e-5 * n as f64, DRIVES[n / 40 % 3]);
            layers.take(start_m + x, u, k * x + b * x * u + behind * u, 0.0);
        }
    }

    /// At the end of the second layer, before it gives way.
    fn two() -> (Layers, Behind, Noise) {
        let (noise, mut behind) = (noise(), Behind::default());
        let mut layers = Layers::contact(0.0, 0.0, 0.0, 2000.0, 0.002, &noise);
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
        near(layers.belief.x[F], SECOND.1, 0.01);
        near(layers.belief.x[KP], FIRST.0, 0.01);
        near(layers.belief.x[FP], FIRST.1, 0.01);
        near(layers.behind(0.04, &noise).0, FIRST_BEHIND, 0.01);
        near(layers.when_it_gave_way(&noise).0, FIRST_BEHIND, 0.01);
        near(layers.previous_m, FIRST.2, 1e-9);
        near(layers.slope(0.002), SECOND.0 + SECOND.1 * 0.002, 0.01);
        near(layers.friction(0.03), FIRST_BEHIND + SECOND.1 * 0.01, 0.01);
        near(layers.growth(0.002), FIRST.1 * 0.002, 0.01);
        for (z, u) in [(0.025, 0.001), (0.04, 0.004)] {
            let x = z - FIRST.2;
            let force_n = SECOND.0 * x + SECOND.1 * x * u + FIRST_BEHIND * u;
            near(layers.says(z, u), force_n, 0.005);
        }
    }

    #[test]
    fn a_tip_that_was_inside_when_contact_was_noticed_has_its_layer_begin_before() {
        // 0.5 mm: 30 mN and some friction act already, known to 20 mN.
        let (noise, mut behind, inside_m) = (noise(), Behind::default(), 5e-4);
        let force_n = FIRST.0 * inside_m + FIRST.1 * inside_m * DRIVES[0];
        let mut layers = Layers::contact(0.0, force_n, 0.02, 2000.0, DRIVES[0], &noise);
        for n in 1..400 {
            let (z, u) = (5e-5 * f64::from(n), DRIVES[n as usize / 40 % 3]);
            let x = z + inside_m;
            layers.take(z, u, FIRST.0 * x + FIRST.1 * x * u, 0.0);
        }
        layers.rupture(0.02, 0.0, 0.002, &noise, &mut behind);
        near(layers.previous_m, 0.0205, 0.005);
        near(layers.behind(0.02, &noise).0, FIRST.1 * 0.0205, 0.01);
        near(layers.belief.x[KP], FIRST.0, 0.01);
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
            near(layers.around_shaft(&behind, z, 0.06, &noise), expected, 0.02);
        }
        assert_eq!(layers.around_shaft(&behind, -0.01, 0.06, &noise), 0.0);
    }

    #[test]
    fn what_is_not_known_of_the_place_of_a_rupture_is_not_known_of_the_friction_behind() {
        // Friction grows by b a metre: 0.4 mm more or less are 3.6 N s/m.
        let sd = |place_m: f64| {
            let (noise, mut behind) = (noise(), Behind::default());
            let mut layers = Layers::contact(0.0, 0.0, 0.0, 2000.0, 0.002, &noise);
            travel(&mut layers, 0.0, FIRST, 0.0);
            layers.rupture(FIRST.2, place_m, 0.002, &noise, &mut behind);
            layers.behind(FIRST.2, &noise).1.sqrt()
        };
        let (sharp, blurred) = (sd(0.0), sd(4e-4));
        near((blurred * blurred - sharp * sharp).sqrt(), FIRST.1 * 4e-4, 0.01);
    }

    #[test]
    fn in_a_gap_friction_grows_on_and_the_layer_before_reaches_to_its_end() {
        let (mut layers, mut behind, noise) = two();
        layers.rupture(SECOND.2, 0.0, 0.002, &noise, &mut behind);
        // The shaft enters the second layer for 8 mm more, the tip feels nothing.
        layers.free = true;
        let gap = (0.0, SECOND.1, SECOND.2 + 0.008);
        travel(&mut layers, SECOND.2, gap, BOTH_BEHIND);
        near(layers.behind(SECOND.2 + 0.004, &noise).0, BOTH_BEHIND + SECOND.1 * 0.004, 0.01);
        layers.bend(SECOND.2 + 0.008, 1e-4, true, 0.002, &noise, &mut behind);
        assert!(!layers.free);
        near(layers.gap_m, 0.008, 1e-9);
        near(layers.behind(0.06, &noise).0, BOTH_BEHIND + SECOND.1 * 0.008, 0.01);
        near(layers.when_it_gave_way(&noise).0, BOTH_BEHIND, 0.01);
        // What it gave way at is known as well as the sum of what is known now and of what the gap has added.
        let g = &layers.belief;
        let h = [(A, 1.0), (FP, -0.008)];
        let spread: f64 = h.iter().flat_map(|a| h.iter().map(|b| a.1 * g.cov(a.0, b.0) * b.1)).sum::<f64>()
            * noise.variance;
        let place = g.x[FP] * 1e-4;
        near(layers.when_it_gave_way(&noise).1, spread + place * place, 1e-6);
        near(behind[1][1], SECOND.2 + 0.008, 1e-9);
        let back = layers.around_shaft(&behind, SECOND.2 + 0.004, 0.06, &noise);
        near(back, BOTH_BEHIND + SECOND.1 * 0.004, 0.01);
    }

    /// Friction is in the doubt about `D` already; counted as force of the next layer as well, it made intervals of fast insertions hold
    /// 99 % instead of 95.
    #[test]
    fn where_a_layer_gave_way_leaves_open_what_stiffness_does_over_that_travel_and_not_what_friction_does() {
        let (mut layers, mut behind, noise) = two();
        let before = layers.belief.p[ZERO][ZERO];
        // At 0.3 m/s friction would be 1500 of the slope's 1620 N/m.
        layers.rupture(SECOND.2, 1e-5, 0.3, &noise, &mut behind);
        let open_n = ((layers.belief.p[ZERO][ZERO] - before) * noise.variance).sqrt();
        near(open_n, SECOND.0 * 1e-5, 0.01);
    }

    #[test]
    fn friction_where_a_layer_gave_way_is_known_no_better_than_what_the_next_adds_over_the_same_doubt() {
        let known = |sd_m: f64| {
            let (mut layers, mut behind, noise) = two();
            layers.rupture(SECOND.2, sd_m, 0.002, &noise, &mut behind);
            layers.belief.p[A][A] = 0.0;
            (layers.belief.p[FP][A], layers.belief.x[F]) = (0.0, 7000.0);
            layers.when_it_gave_way(&noise).1.sqrt()
        };
        near(known(3e-5), 7000.0 * 3e-5, 1e-9);
        assert_eq!(known(0.0), 0.0);
    }

    #[test]
    fn a_layer_that_begins_later_than_it_is_taken_to_tells_so_by_the_zero() {
        let (mut layers, mut behind, noise) = two();
        layers.rupture(SECOND.2, 0.0, 0.002, &noise, &mut behind);
        layers.free = true;
        travel(&mut layers, SECOND.2, (0.0, SECOND.1, SECOND.2 + 0.008), BOTH_BEHIND);
        // Taken to begin a millimetre before the face.
        let (face_m, k, b) = (SECOND.2 + 0.008, 100.0, 20_000.0);
        layers.bend(face_m - 1e-3, 8e-4, true, 0.002, &noise, &mut behind);
        let at_face = BOTH_BEHIND + SECOND.1 * 0.008;
        for n in 1..400 {
            let (x, u) = (5e-5 * n as f64, DRIVES[n / 40 % 3]);
            layers.take(face_m + x, u, k * x + b * x * u + at_face * u, 0.0);
        }
        near(layers.behind(0.07, &noise).0, at_face, 2e-3);
        // b times a millimetre, 20 N s/m, is what the estimator has in place of it.
        near(layers.belief.x[A], at_face - b * 1e-3, 0.01);
        let g = &layers.belief;
        let by = g.x[F] / g.x[K];
        let spread = g.p[A][A] + by * by * g.p[ZERO][ZERO] - 2.0 * by * g.cov(ZERO, A);
        near(layers.behind(0.07, &noise).1, spread * noise.variance, 1e-9);
        // No farther than twice what the begin is known to, and only where stiffness is known to half of itself.
        let mut far = layers;
        far.belief.x[ZERO] -= 1.0;
        near(far.behind(0.07, &noise).0, far.belief.x[A] + far.belief.x[F] * 1.6e-3, 1e-9);
        let mut vague = layers;
        vague.belief.p[K][K] = 1.1 * 0.25 * vague.belief.x[K] * vague.belief.x[K] / noise.variance;
        near(vague.behind(0.07, &noise).0, vague.belief.x[A], 1e-12);
        near(vague.behind(0.07, &noise).1, vague.belief.p[A][A] * noise.variance, 1e-12);
    }

    #[test]
    fn coloured_noise_weighs_as_if_it_were_whitened() {
        // Samples alternating about the law by what AR(1) noise makes of one impulse: f_k - rho f_(k-1) is the law's again.
        let (noise, rho) = (noise(), 0.8);
        let mut layers = Layers::contact(0.0, 0.0, 0.0, 2000.0, 0.002, &noise);
        let mut colour_n = 0.05;
        for n in 1..400 {
            let (x, u) = (5e-5 * f64::from(n), DRIVES[n as usize / 40 % 3]);
            let (e, _) = layers.take(x, u, FIRST.0 * x + FIRST.1 * x * u + colour_n, rho);
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
    fn knowing(passed: usize) -> (Layers, Noise) {
        let noise = Noise::known(0.0, 1.6e-3, 0.07, 400.0);
        let mut layers = Layers::contact(0.013, 0.7, 0.3, 1700.0, 0.0023, &noise);
        let map = core::array::from_fn(|i| {
            core::array::from_fn(|j| if i == j { 1.0 } else { 0.1 * (i as f64 - 0.7 * j as f64) })
        });
        layers.belief = Gaussian::new([0.0; N], [1.3, 4.0, 0.25, 2.0, 0.5, 0.7]).mapped(&map);
        layers.belief.x = [130.0, 57.0, 8300.0, 44.0, 7100.0, 0.06];
        (layers.start_m, layers.previous_m, layers.passed) = (0.031, 0.018, passed);
        (layers.gap_m, layers.gap_sd_m, layers.previous_sd_m) = (0.0037, 3e-4, 5e-4);
        (layers.scale, layers.settled) = (90.0, true);
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
        let noise = Noise::known(0.0, 1.6e-3, 0.07, 400.0);
        let layers = Layers::contact(0.013, 0.7, 0.3, 1700.0, 0.0023, &noise);
        let g = &layers.belief;
        assert_eq!(g.x, [0.35, 850.0, 0.5 * (1700.0 / 0.0023), 0.35 / 0.0023, 0.0, 0.07]);
        let sds = [0.3, 1700.0, 1700.0 / 0.0023, 0.3 / 0.0023, 0.04, 0.002];
        for (i, sd) in sds.into_iter().enumerate() {
            near((g.p[i][i] * noise.variance).sqrt(), sd, 1e-12);
        }
        assert_eq!((layers.start_m, layers.drive0, layers.scale), (0.013, 0.0023, 1700.0));
        // Not wider than what can be told apart from a noise of 1 uN: 10 mN, and that much over the memory of 1 mm.
        let noise = Noise::known(0.0, 1e-12, 0.0, 400.0);
        let layers = Layers::contact(0.0, 0.7, 0.3, 1700.0, 0.0023, &noise);
        for (i, sd) in [(A, 0.01), (K, 10.0), (F, 10.0 / 0.0023), (KP, 0.01 / 0.0023)] {
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
                near(layers.says(z, u), says, 1e-12);
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
                let (found_e, found_s) = layers.take(z, u, force_n, rho);
                near(found_e, e, 1e-9);
                near(found_s, s, 1e-9);
                let x = core::array::from_fn(|i| g.x[i] + gain[i] * e);
                let left =
                    core::array::from_fn(|i| core::array::from_fn(|j| p[i][j] - gain[i] * gain[j] * s));
                assert_belief(&layers.belief, &x, &left);
                before = Some((z, u, force_n));
                if n == 1 {
                    // What is passed over whitens nothing.
                    layers.pass();
                }
            }
        }
    }

    #[test]
    fn slope_and_friction_are_what_the_belief_makes_of_drive_and_place() {
        let (layers, noise) = knowing(2);
        near(layers.slope(0.3), 57.0 + 0.3 * 8300.0, 1e-12);
        near(layers.friction(0.0345), 130.0 + 8300.0 * 0.0035, 1e-12);
        near(layers.growth(0.3), 7100.0 * 0.3, 1e-12);
        near(knowing(0).0.friction(0.0345), 44.0 + 8300.0 * 0.0035, 1e-12);
        let p = full(&layers.belief);
        near(layers.previous_variance(&noise)[0], p[KP][KP] * 1.6e-3, 1e-12);
        near(layers.previous_variance(&noise)[1], p[FP][FP] * 1.6e-3, 1e-12);
        let (mut falling, _) = knowing(2);
        falling.belief.x[FP] = -7100.0;
        near(falling.growth(0.3), 7100.0 * 0.3, 1e-12);
    }

    #[test]
    fn friction_behind_is_that_of_the_layers_passed_and_grows_with_travel_where_the_tip_is_free() {
        let (mut layers, noise) = knowing(2);
        let p = full(&layers.belief);
        let (found, variance) = layers.behind(0.0345, &noise);
        near(found, 130.0, 1e-12);
        near(variance, p[A][A] * 1.6e-3, 1e-12);
        layers.free = true;
        let (found, variance) = layers.behind(0.0345, &noise);
        near(found, 130.0 + 8300.0 * 0.0035, 1e-12);
        near(variance, spread(&p, &[1.0, 0.0, 0.0035, 0.0, 0.0, 0.0]) * 1.6e-3, 1e-12);
        // Before where it begins there is none of it; and none at all in the first layer.
        near(layers.behind(0.02, &noise).0, 130.0, 1e-12);
        assert_eq!(knowing(0).0.behind(0.0345, &noise), (0.0, 0.0));
        // When the layer before gave way there was as much less as the gap of 3.7 mm has added.
        let (gave_way, variance) = layers.when_it_gave_way(&noise);
        near(gave_way, 130.0 - 0.0037 * 7100.0, 1e-12);
        let place = 7100.0 * 3e-4;
        near(variance, spread(&p, &[1.0, 0.0, 0.0, 0.0, -0.0037, 0.0]) * 1.6e-3 + place * place, 1e-9);
    }

    #[test]
    fn each_layer_has_its_share_of_the_friction_on_the_way_back() {
        let (mut layers, noise) = knowing(2);
        let mut behind = Behind::default();
        behind[0] = [0.001, 0.021, 9000.0];
        behind[1] = [0.021, 0.031, 1.0];
        behind[2] = [0.031, 0.041, 5000.0];
        // 180 N s/m, and 71 N s/m of the one before as it is known now: of what is known of the sum.
        for (z, inside) in
            [(0.05, 251.0), (0.031, 251.0), (0.027, 180.0 + 42.6), (0.011, 90.0), (0.0005, 0.0)]
        {
            near(layers.around_shaft(&behind, z, 0.04, &noise), 130.0 * inside / 251.0, 1e-9);
        }
        // A free tip has gone on in friction to its deepest point.
        layers.free = true;
        near(layers.around_shaft(&behind, 0.011, 0.0345, &noise), (130.0 + 29.05) * 90.0 / 251.0, 1e-9);
        // No layer pulls; without friction of its own each is as good as another.
        layers.free = false;
        layers.belief.x[FP] = -3.0;
        near(layers.around_shaft(&behind, 0.027, 0.04, &noise), 130.0, 1e-12);
        near(layers.around_shaft(&behind, 0.011, 0.04, &noise), 65.0, 1e-9);
        behind[0][2] = 0.0;
        near(layers.around_shaft(&behind, 0.011, 0.04, &noise), 130.0, 1e-12);
        layers.belief.x[A] = -4.0;
        assert_eq!(layers.around_shaft(&behind, 0.011, 0.04, &noise), 0.0);
        // Those beyond the last one kept are part of the sum alone.
        let (layers, _) = knowing(MAX_LAYERS + 1);
        let behind: Behind = core::array::from_fn(|i| [0.001 * i as f64, 0.001 * (i as f64 + 1.0), 40.0]);
        near(layers.around_shaft(&behind, 0.004, 0.04, &noise), 130.0 * 4.0 / MAX_LAYERS as f64, 1e-9);
    }

    /// What a stiffness may be of which the slope is known to have the size `most`.
    fn stiff(g: &Gaussian<N>, noise: &Noise, most: f64) -> f64 {
        (g.x[K].powi(2) + g.p[K][K] * noise.variance).sqrt().min(most)
    }

    /// What is known just after a rupture at 43.1 mm, to 0.6 mm, of a layer whose slope had the size `before`, whose stiffness may have had
    /// the size `stiff`, and whose friction was `b`.
    fn after_a_rupture(
        map: &Matrix,
        (g, noise): (&Gaussian<N>, &Noise),
        [before, stiff]: [f64; 2],
        b: f64,
    ) -> ([f64; N], Matrix) {
        let (mut x, mut p) = carried(map, &g.x, &full(g));
        (x[K], x[F]) = (0.5 * before, 0.5 * before / 0.3);
        (p[K], p[F]) = ([0.0; N], [0.0; N]);
        p.iter_mut().for_each(|row| (row[K], row[F]) = (0.0, 0.0));
        let wide = (3.0 * before).min((1e8 * noise.variance).sqrt() / MEMORY_M);
        p[K][K] = wide * wide / noise.variance;
        p[F][F] = wide * wide / (0.3 * 0.3) / noise.variance;
        p[A][A] += (b * 6e-4).powi(2) / noise.variance;
        p[ZERO][ZERO] += (stiff * 6e-4).powi(2) / noise.variance;
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
            (layers.belief.x[K], layers.belief.x[F]) = (k, b);
            let (g, mut behind) = (layers.belief, Behind::default());
            behind[1] = [0.013, 0.031, 5.0];
            let mut map = Matrix::default();
            (map[A][A], map[A][F]) = (1.0, 0.0121);
            (map[KP][K], map[FP][F], map[ZERO][ZERO]) = (1.0, 1.0, 1.0);
            let (x, p) = after_a_rupture(&map, (&g, &noise), [before, stiff(&g, &noise, before)], believed);
            layers.rupture(0.0431, 6e-4, 0.3, &noise, &mut behind);
            assert_belief(&layers.belief, &x, &p);
            assert_eq!(behind[1], [0.013, 0.031, 7100.0], "as it is known when the next one gives way");
            near(behind[2][0], 0.031, 1e-12);
            assert_eq!((behind[2][1], behind[2][2], behind[3]), (0.0431, 0.0, [0.0; 3]));
            near(layers.previous_m, 0.0121, 1e-9);
            near(layers.scale, before, 1e-9);
            assert_eq!((layers.passed, layers.start_m, layers.settled), (3, 0.0431, false));
            assert_eq!((layers.gap_m, layers.gap_sd_m, layers.previous_sd_m), (0.0, 0.0, 0.0));
            let densities = [true, false].map(|follows| layers.log_density_of_free(follows, &noise));
            assert_eq!(layers.free_before, densities);
        }
    }

    #[test]
    fn a_layer_that_began_behind_a_gap_takes_its_doubt_about_its_begin_with_it() {
        let (mut layers, noise) = knowing(2);
        (layers.start_sd_m, layers.free) = (8e-4, true);
        (layers.belief.x[K], layers.belief.x[F]) = (0.0, 83.0);
        let (mut g, mut behind) = (layers.belief, Behind::default());
        behind[1] = [0.013, 0.031, 5.0];
        let mut map = Matrix::default();
        (map[A][A], map[A][F], map[KP][K], map[FP][F]) = (1.0, 1e-6, 1.0, 1.0);
        // A tip that has lost force was not free: any part of the slope of 24.9 N/m may have been elastic.
        (g.x[K], g.x[F]) = (12.45, 41.5);
        let variance = 12.45 * 12.45 / noise.variance;
        g.p[K][K] += variance;
        g.p[F][F] += variance / (0.3 * 0.3);
        g.p[F][K] -= variance / 0.3;
        // A free tip's slope says nothing of layers: the scale stays. What looked like an error of the zero is gone.
        let (mut x, mut p) = after_a_rupture(&map, (&g, &noise), [90.0, stiff(&g, &noise, 90.0)], 41.5);
        x[ZERO] = 0.07;
        p[ZERO][ZERO] += 1.0 / 400.0;
        // Nor does a layer end before it has begun.
        layers.rupture(0.03, 6e-4, 0.3, &noise, &mut behind);
        assert_belief(&layers.belief, &x, &p);
        assert_eq!((layers.previous_sd_m, layers.start_sd_m, layers.free), (8e-4, 0.0, false));
        near(layers.previous_m, 1e-6, 1e-9);
    }

    #[test]
    fn no_more_of_a_slope_is_in_doubt_than_what_can_be_told_from_the_noise() {
        for (friction, half) in [(400.0, 60.0), (1e9, 1000.0), (-1e9, -1000.0)] {
            let (mut layers, _) = knowing(2);
            layers.belief = Gaussian::new([130.0, 0.0, friction, 44.0, 7100.0, 0.06], [1.0; N]);
            layers.was_not_free(0.3, 1e8);
            near(layers.belief.x[K], half, 1e-9);
            near(layers.belief.p[K][K], 1.0 + half * half * 1e8, 1e-9);
        }
    }

    #[test]
    fn no_layer_is_expected_to_be_stiffer_than_what_can_be_told_from_the_noise() {
        let (mut layers, _) = knowing(2);
        let noise = Noise::known(0.0, 1e-12, 0.07, 400.0);
        layers.rupture(0.0431, 0.0, 0.3, &noise, &mut Behind::default());
        near(layers.scale, 10.0, 1e-9);
        near((layers.belief.p[K][K] * noise.variance).sqrt(), 10.0, 1e-9);
        near((layers.belief.p[F][F] * noise.variance).sqrt(), 10.0 / 0.3, 1e-9);
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
            (x[A], x[KP], x[K], x[F]) = (p_n, q, k, b);
            let (mut g, mut behind) = (layers.belief, Behind::default());
            let delta = inside_m.unwrap_or(0.0);
            if inside_m.is_some() {
                // Then p = K delta, as well as the force was known.
                let r = spread(&full(&g), &[1.0, 0.0, 0.0, 0.0023, 0.0, 0.0]);
                let p_is_k_delta = g.innovation([A, K], [1.0, -delta], 0.0, r);
                g.take(&p_is_k_delta);
            }
            let mut map = Matrix::default();
            (map[A][KP], map[A][F], map[KP][K], map[FP][F], map[ZERO][ZERO]) = (1.0, 0.0121, 1.0, 1.0, 1.0);
            let before = (g.x[K] + g.x[F] * 0.3).abs().max(1.0);
            let (x, p) = after_a_rupture(
                &map,
                (&g, &noise),
                [before, stiff(&g, &noise, before)],
                g.x[F].clamp(-before / 0.3, before / 0.3),
            );
            layers.rupture(0.0431, 6e-4, 0.3, &noise, &mut behind);
            assert_belief(&layers.belief, &x, &p);
            near(layers.previous_m, 0.0121 + delta, 1e-9);
            near(behind[0][0], 0.031 - delta, 1e-9);
            assert_eq!((behind[0][1], layers.passed), (0.0431, 1));
        }
        // A force that is known all but exactly makes no constraint that is.
        let (mut layers, noise) = knowing(0);
        layers.belief = Gaussian::new([0.13, 57.0, 83.0, 0.9, 0.0, 0.0], [1e-9, 1e-9, 0.1, 1e-9, 0.1, 0.1]);
        let inside_m = (0.13 + 0.9 * 0.0023) / (57.0 + 83.0 * 0.0023);
        layers.rupture(0.0431, 6e-4, 0.3, &noise, &mut Behind::default());
        let kept =
            57.0 + 1e-9 * inside_m * (0.13 - 57.0 * inside_m) / (1e-6 + 1e-9 + 1e-9 * inside_m * inside_m);
        assert!((layers.belief.x[KP] - kept).abs() < 1e-13, "{} for {kept}", layers.belief.x[KP]);
    }

    #[test]
    fn where_the_force_bends_upwards_a_layer_begins_and_where_downwards_friction_stops_to_grow() {
        for (up, b, grows) in
            [(true, 83.0, true), (false, 83.0, true), (true, 30.0, false), (false, 30.0, false)]
        {
            let (mut layers, noise) = knowing(2);
            (layers.free, layers.gap_sd_m) = (true, 3e-4);
            (layers.belief.x[F], layers.belief.x[FP]) = (b, 61.0);
            let (g, mut behind) = (layers.belief, Behind::default());
            behind[1] = [0.013, 0.031, 61.0];
            let mut map: Matrix =
                core::array::from_fn(|i| core::array::from_fn(|j| f64::from(u8::from(i == j))));
            map[A][F] = 0.0121;
            layers.bend(0.0431, 6e-4, up, 0.3, &noise, &mut behind);
            let (x, p) = if up {
                after_a_rupture(&map, (&g, &noise), [90.0; 2], b)
            } else {
                let (mut x, mut p) = carried(&map, &g.x, &full(&g));
                x[F] = 0.0;
                (0..N).for_each(|i| (p[i][F], p[F][i]) = (0.0, 0.0));
                p[F][F] = b * b / noise.variance;
                p[A][A] += (b * 6e-4).powi(2) / noise.variance;
                (x, p)
            };
            assert_belief(&layers.belief, &x, &p);
            assert_eq!((layers.free, layers.start_m), (!up, 0.0431));
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
        let before = layers.belief.x[A];
        layers.bend(0.03, 6e-4, false, 0.3, &noise, &mut Behind::default());
        assert_eq!((layers.gap_m, layers.belief.x[A]), (0.0037, before));
    }
}
