//! A layer that gives way before its far face leaves a gap: until the next face (or behind the last one for ever) the tip
//! feels nothing, and what the force still shows is friction.
//!
//! After a rupture the estimator takes it that the next layer begins at once. Both ways of its being wrong are nested in that law:
//!
//! ```text
//! K = 0, b = bp     the tip is free, the shaft is still entering the layer that gave way
//! K = 0, b = 0      the tip is free, behind the far face
//! ```
//!
//! so the evidence for each is the density of the belief at that point over what it was when the layer began (Dickey 1971, Ann. Math.
//! Statist. 42, 204): no second filter. Once one of them is [`ODDS`] times as probable, it is what the estimator believes. The end of the gap is a bend of
//! the force, found by the same sums as a drop: upwards a face, where a layer begins; downwards the far face, where friction stops to grow.

use super::alarm::Alarm;
use super::gaussian::at_least;
use super::layers::{Behind, F, FP, K, Layers};
use super::noise::Noise;

/// Odds at which the tip is taken to be free.
const ODDS: f64 = 20.0;
/// Shift that the sum is made for which tells where a bend began, in standard deviations of an innovation.
const SLOW_SHIFT: f64 = 0.5;
/// No more is said of odds than this, in nats.
const MOST_NATS: f64 = 500.0;
/// How many times the logarithm of those odds it takes to be sure of the contrary: weaker layers look free for a while.
const SETTLED: f64 = 4.0;
/// Samples between two looks at the odds.
const EVERY: u32 = 8;
/// Multiplications and additions of a look at the odds, of the sums, and of a bend (a linear map of six unknowns).
const WORK_LOOK: u32 = 60;
const WORK_SUMS: u32 = 42;
pub(super) const WORK_BEND: u32 = 2 * 216 + 2 * 126;

/// Whether the tip is free, and what would end that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slack {
    up: Side,
    down: Side,
}

/// One direction in which the force may bend.
#[derive(Clone, Copy, Debug)]
struct Side {
    alarm: Alarm,
    /// A sum for a smaller shift: a bend shows little by little, and this one leaves zero nearer to where it began.
    slow: f64,
    /// The estimator as it was when the slow sum left zero, and the position then.
    before: Layers,
    before_m: f64,
}

impl Side {
    fn rest(&mut self) {
        self.alarm.rest();
        self.slow = 0.0;
    }

    /// Takes an innovation whose negative values count; `true` when the force has bent.
    #[inline(always)]
    fn take(&mut self, z: f64, layers: &Layers, last_m: f64) -> bool {
        let next = at_least(0.0, self.slow + SLOW_SHIFT * (-z - 0.5 * SLOW_SHIFT));
        if self.slow == 0.0 && next > 0.0 {
            (self.before, self.before_m) = (*layers, last_m);
        }
        self.slow = next;
        self.alarm.take(z).alarm
    }
}

impl Slack {
    pub(super) fn new(false_alarms_per_hour: f64, step_s: f64, layers: &Layers) -> Self {
        let alarm = Alarm::new(false_alarms_per_hour, step_s);
        let side = Side { alarm, slow: 0.0, before: *layers, before_m: layers.start_m };
        Self { up: side, down: side }
    }

    pub(super) fn rest(&mut self) {
        self.up.rest();
        self.down.rest();
    }

    /// After a sample at `position_m` that the estimator took with the standardised innovation `z` (`before`, while the tip is free, is the estimator
    /// without it, `last_m` the position of the sample before). Returns the work done, and whether the force has bent.
    #[inline(always)]
    pub(super) fn follow(
        &mut self,
        layers: &mut Layers,
        (before, last_m): (Option<Layers>, f64),
        (position_m, z, drive): (f64, f64, f64),
        count: u32,
        noise: &Noise,
        behind: &mut Behind,
    ) -> (u32, bool) {
        if layers.passed == 0 {
            return (0, false);
        }
        let Some(before) = &before else {
            if layers.settled || !count.is_multiple_of(EVERY) {
                return (0, false);
            }
            if layers.consider_free(ODDS, noise) {
                self.rest();
            }
            return (WORK_LOOK, false);
        };
        let bent_up = self.up.take(-z, before, last_m);
        let bent_down = self.down.take(z, before, last_m);
        if !bent_up && !bent_down {
            return (WORK_SUMS, false);
        }
        let side = if bent_up { &self.up } else { &self.down };
        let (span_m, at_m) = ((position_m - side.before_m).max(0.0), side.before_m);
        *layers = side.before;
        layers.bend(at_m, span_m / libm::sqrt(12.0), bent_up, drive, noise, behind);
        self.rest();
        (WORK_SUMS + WORK_BEND, true)
    }
}

impl Layers {
    /// Takes the tip to be free where that is `odds` times as probable as a layer that began at the rupture.
    fn consider_free(&mut self, odds: f64, noise: &Noise) -> bool {
        let [before_follows, before_ends] = self.free_before;
        let follows = self.log_density_of_free(true, noise) - before_follows;
        let ends = self.log_density_of_free(false, noise) - before_ends;
        // A layer has begun, and it is not looked at again, when it is that much more probable than a free tip.
        self.settled = follows.max(ends) < -SETTLED * libm::log(odds);
        // As probable as that against both others together: that a layer has begun, and the other way to be free.
        let others = libm::log(odds * (1.0 + odds * libm::exp(follows.min(ends).min(MOST_NATS))));
        if follows.max(ends) < others || !(follows + ends).is_finite() {
            return false;
        }
        self.free = true;
        let tight = |p: f64| 1e-9 * p;
        let none = self.belief.innovation([K], [1.0], 0.0, tight(self.belief.p[K][K]));
        self.belief.take(&none);
        if follows > ends {
            let same = self.belief.innovation([F, FP], [1.0, -1.0], 0.0, tight(self.belief.p[F][F]));
            self.belief.take(&same);
        } else {
            let ended = self.belief.innovation([F], [1.0], 0.0, tight(self.belief.p[F][F]));
            self.belief.take(&ended);
        }
        true
    }

    /// Logarithm of the belief's density (up to a constant) at `K = 0` and `b = bp` or `b = 0`.
    pub(super) fn log_density_of_free(&self, follows: bool, noise: &Noise) -> f64 {
        let g = &self.belief;
        let (mut b, mut vb, mut cov) = (g.x[F], g.p[F][F], g.cov(F, K));
        if follows {
            b -= g.x[FP];
            vb += g.p[FP][FP] - 2.0 * g.cov(FP, F);
            cov -= g.cov(FP, K);
        }
        let (k, vk) = (g.x[K], g.p[K][K]);
        let determinant = (vk * vb - cov * cov).max(1e-12 * vk * vb);
        let square = (k * k * vb - 2.0 * k * b * cov + b * b * vk) / determinant;
        -0.5 * (libm::log(determinant) + square / noise.variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise() -> Noise {
        let mut noise = Noise::new(1e-3);
        (0..2000).for_each(|_| noise.in_air(0.0));
        noise
    }

    const SPEEDS: [f64; 3] = [0.002, 0.003, 0.0015];

    /// A layer of 60 N/m and 9000 N s/m² that gives way at 20 mm; then 4 mm in which the force grows by `stiffness` and `friction`.
    fn behind_a_rupture(stiffness: f64, friction: f64) -> (Layers, Noise) {
        let (noise, mut behind) = (noise(), Behind::default());
        let mut layers = Layers::contact(0.0, 0.0, 0.0, 2000.0, 0.002, &noise);
        for n in 1..400_usize {
            let (x, u) = (5e-5 * n as f64, SPEEDS[n / 40 % 3]);
            layers.take(x, u, 60.0 * x + 9000.0 * x * u, 0.0);
        }
        layers.rupture(0.02, 0.0, 0.002, &noise, &mut behind);
        for n in 1..80_usize {
            let (x, u) = (5e-5 * n as f64, SPEEDS[n / 20 % 3]);
            layers.take(0.02 + x, u, stiffness * x + (180.0 + friction * x) * u, 0.0);
        }
        (layers, noise)
    }

    /// Density of a normal vector of two by its definition, from the belief about `(K, b - bp)` or `(K, b)`.
    fn log_density(layers: &Layers, follows: bool, noise: &Noise) -> f64 {
        let g = &layers.belief;
        let map = [[(K, 1.0), (K, 0.0)], [(F, 1.0), (FP, if follows { -1.0 } else { 0.0 })]];
        let mean = map.map(|row| row.iter().map(|(i, w)| w * g.x[*i]).sum::<f64>());
        let cov = |a: usize, b: usize| -> f64 {
            map[a].iter().flat_map(|x| map[b].iter().map(move |y| x.1 * g.cov(x.0, y.0) * y.1)).sum::<f64>()
                * noise.variance
        };
        let (c00, c01, c11) = (cov(0, 0), cov(0, 1), cov(1, 1));
        let determinant = c00 * c11 - c01 * c01;
        let distance2 =
            (c11 * mean[0] * mean[0] - 2.0 * c01 * mean[0] * mean[1] + c00 * mean[1] * mean[1]) / determinant;
        -0.5 * (determinant.ln() + distance2)
    }

    #[test]
    fn the_evidence_for_a_free_tip_is_a_ratio_of_densities() {
        for (stiffness, friction) in [(0.0, 9000.0), (0.0, 0.0), (30.0, 4000.0)] {
            let (layers, noise) = behind_a_rupture(stiffness, friction);
            let (other, _) = behind_a_rupture(10.0, 8000.0);
            for follows in [true, false] {
                // Up to a constant, which a difference does not show.
                let found =
                    layers.log_density_of_free(follows, &noise) - other.log_density_of_free(follows, &noise);
                let expected = log_density(&layers, follows, &noise) - log_density(&other, follows, &noise);
                assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "{found} for {expected}");
            }
        }
    }

    #[test]
    fn a_tip_is_free_where_nothing_is_felt_and_friction_grows_on_or_stays() {
        let (mut gap, noise) = behind_a_rupture(0.0, 9000.0);
        assert!(gap.consider_free(ODDS, &noise) && gap.free && !gap.settled);
        assert!(gap.belief.x[K].abs() < 1e-3, "{}", gap.belief.x[K]);
        assert!((gap.belief.x[F] / 9000.0 - 1.0).abs() < 0.02, "{}", gap.belief.x[F]);
        let (mut end, noise) = behind_a_rupture(0.0, 0.0);
        assert!(end.consider_free(ODDS, &noise) && end.free);
        assert!(end.belief.x[F].abs() < 10.0, "{}", end.belief.x[F]);
    }

    #[test]
    fn a_layer_that_has_begun_is_no_gap_and_is_not_looked_at_again() {
        for (stiffness, friction) in [(60.0, 9000.0), (0.0, 20_000.0), (30.0, 0.0)] {
            let (mut layers, noise) = behind_a_rupture(stiffness, friction);
            assert!(!layers.consider_free(ODDS, &noise) && !layers.free, "{stiffness} N/m");
            assert!(layers.settled, "{stiffness} N/m");
        }
    }
}
