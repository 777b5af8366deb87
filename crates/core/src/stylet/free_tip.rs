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
//! the force, found by the same sums as a drop: upwards a face, where a layer begins; downwards the far face, where friction stops to grow. As long as the
//! odds are open, upwards alone: a layer's law is straight, and what goes down may be its drop.

use super::cusum::CusumBank;
use super::gaussian::at_least;
use super::layer_estimator::{B, B_PREV, K, LayerEstimator, PassedLayers};
use super::noise_estimator::NoiseEstimator;

/// Odds at which the tip is taken to be free.
const ODDS: f64 = 20.0;
/// Shift that the sum is made for which tells where a bend began, in standard deviations of an innovation.
const SLOW_SHIFT: f64 = 0.5;
/// No more is said of odds than this, in nats.
const MOST_NATS: f64 = 500.0;
/// How many times the logarithm of those odds it takes to be sure of the contrary: weaker layers look free for a while.
const SETTLED: f64 = 4.0;
/// Variance that is left of what is taken to be so, as a share.
const TIGHT: f64 = 1e-9;
/// Samples between two looks at the odds.
const EVERY: u32 = 8;
/// Multiplications and additions of a look at the odds, of the sums, and of a bend (a linear map of six unknowns).
const WORK_LOOK: u32 = 60;
pub(super) const OPERATIONS_PER_BEND_TEST: u32 = 42;
pub(super) const OPERATIONS_PER_BEND: u32 = 2 * 216 + 2 * 126;

/// Whether the tip is free, and what would end that.
#[derive(Clone, Copy, Debug)]
pub(super) struct FreeTipDetector {
    up: Side,
    down: Side,
}

/// One direction in which the force may bend.
#[derive(Clone, Copy, Debug)]
struct Side {
    alarm: CusumBank,
    /// A sum for a smaller shift: a bend shows little by little, and this one leaves zero nearer to where it began.
    slow: f64,
    /// The estimator as it was when the slow sum left zero, and the position then.
    before: LayerEstimator,
    before_m: f64,
}

impl Side {
    fn rest(&mut self) {
        self.alarm.reset();
        self.slow = 0.0;
    }

    /// Takes an innovation whose negative values count; `true` when the force has bent.
    #[inline(always)]
    fn take(&mut self, z: f64, layers: &LayerEstimator, last_m: f64) -> bool {
        let next = at_least(0.0, self.slow + SLOW_SHIFT * (-z - 0.5 * SLOW_SHIFT));
        if self.slow == 0.0 && next > 0.0 {
            (self.before, self.before_m) = (*layers, last_m);
        }
        self.slow = next;
        self.alarm.update(z).alarm
    }
}

impl FreeTipDetector {
    pub(super) fn new(false_alarms_per_hour: f64, step_s: f64, layers: &LayerEstimator) -> Self {
        let alarm = CusumBank::new(false_alarms_per_hour, step_s);
        let side = Side { alarm, slow: 0.0, before: *layers, before_m: layers.start_m };
        Self { up: side, down: side }
    }

    pub(super) fn reset(&mut self) {
        self.up.rest();
        self.down.rest();
    }

    /// Nothing says that the force is about to bend upwards.
    pub(super) fn is_straight(&self) -> bool {
        self.up.slow == 0.0
    }

    /// Whether the force has risen above a straight line, by samples like this one with the standardised innovation `z`.
    pub(super) fn bends_up(&mut self, z: f64, before: &LayerEstimator, last_m: f64) -> bool {
        let bent = self.up.take(-z, before, last_m);
        if bent {
            self.reset();
        }
        bent
    }

    /// After a sample at `position_m` that the estimator took with the standardised innovation `z` (`before`, while the tip may be free, is the estimator
    /// without it, `last_m` the position of the sample before). Returns the work done, and whether the force has bent.
    #[inline(always)]
    pub(super) fn update(
        &mut self,
        layers: &mut LayerEstimator,
        (before, last_m): (Option<LayerEstimator>, f64),
        (position_m, z, drive): (f64, f64, f64),
        count: u32,
        noise: &NoiseEstimator,
        behind: &mut PassedLayers,
    ) -> (u32, bool) {
        let Some(before) = &before else { return (0, false) };
        let mut work = OPERATIONS_PER_BEND_TEST;
        if !layers.tip_free && count.is_multiple_of(EVERY) {
            work += WORK_LOOK;
            if layers.test_free_tip(ODDS, self.is_straight(), noise) {
                self.reset();
                return (work, false);
            }
        }
        let bent_up = self.up.take(-z, before, last_m);
        // As long as there may be a layer, what goes down may be its drop.
        let bent_down = layers.tip_free && self.down.take(z, before, last_m);
        if !bent_up && !bent_down {
            return (work, false);
        }
        let side = if bent_up { &self.up } else { &self.down };
        let (span_m, at_m) = ((position_m - side.before_m).max(0.0), side.before_m);
        *layers = side.before;
        if span_m == 0.0 {
            // No layer begins where the needle stands: what it feels there it has felt before.
            if layers.tip_free {
                layers.reopen_split(drive, 1.0 / noise.variance);
            }
            self.reset();
            return (work, true);
        }
        if !layers.tip_free {
            // The law of a layer is straight: there was none, whatever friction did.
            layers.set_zero_stiffness();
        }
        layers.start_after_bend(at_m, span_m / libm::sqrt(12.0), bent_up, drive, noise, behind);
        self.reset();
        (work + OPERATIONS_PER_BEND, true)
    }
}

impl LayerEstimator {
    /// Takes the tip to be free where that is `odds` times as probable as a layer that began at the rupture.
    fn test_free_tip(&mut self, odds: f64, straight: bool, noise: &NoiseEstimator) -> bool {
        let [before_follows, before_ends] = self.initial_log_densities;
        let follows = self.log_density_of_free(true, noise) - before_follows;
        let ends = self.log_density_of_free(false, noise) - before_ends;
        // A layer has begun, and it is not looked at again, when it is that much more probable than a free tip.
        self.layer_confirmed =
            straight && self.belief.x[K] > 0.0 && follows.max(ends) < -SETTLED * libm::log(odds);
        // As probable as that against both others together: that a layer has begun, and the other way to be free.
        let others = libm::log(odds * (1.0 + odds * libm::exp(follows.min(ends).min(MOST_NATS))));
        if follows.max(ends) < others || !(follows + ends).is_finite() {
            return false;
        }
        self.tip_free = true;
        let tight = |p: f64| TIGHT * p;
        self.set_zero_stiffness();
        if follows > ends {
            let same = self.belief.innovation([B, B_PREV], [1.0, -1.0], 0.0, tight(self.belief.p[B][B]));
            self.belief.update(&same);
        } else {
            let ended = self.belief.innovation([B], [1.0], 0.0, tight(self.belief.p[B][B]));
            self.belief.update(&ended);
        }
        true
    }

    /// The tip has felt nothing in this layer.
    fn set_zero_stiffness(&mut self) {
        let none = self.belief.innovation([K], [1.0], 0.0, TIGHT * self.belief.p[K][K]);
        self.belief.update(&none);
    }

    /// Logarithm of the belief's density (up to a constant) at `K = 0` and `b = bp` or `b = 0`.
    pub(super) fn log_density_of_free(&self, follows: bool, noise: &NoiseEstimator) -> f64 {
        let g = &self.belief;
        let (mut b, mut vb, mut cov) = (g.x[B], g.p[B][B], g.cov(B, K));
        if follows {
            b -= g.x[B_PREV];
            vb += g.p[B_PREV][B_PREV] - 2.0 * g.cov(B_PREV, B);
            cov -= g.cov(B_PREV, K);
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

    fn noise() -> NoiseEstimator {
        let mut noise = NoiseEstimator::new(1e-3);
        (0..2000).for_each(|_| noise.update_in_air(0.0));
        noise
    }

    const SPEEDS: [f64; 3] = [0.002, 0.003, 0.0015];

    /// A layer of 60 N/m and 9000 N s/m² that gives way at 20 mm; then 4 mm in which the force grows by `stiffness` and `friction`.
    fn behind_a_rupture(stiffness: f64, friction: f64) -> (LayerEstimator, NoiseEstimator) {
        let (noise, mut behind) = (noise(), PassedLayers::default());
        let mut layers = LayerEstimator::at_contact(0.0, 0.0, 0.0, 2000.0, 0.002, &noise);
        for n in 1..400_usize {
            let (x, u) = (5e-5 * n as f64, SPEEDS[n / 40 % 3]);
            layers.update(x, u, 60.0 * x + 9000.0 * x * u, 0.0);
        }
        layers.rupture(0.02, 0.0, 0.002, &noise, &mut behind);
        for n in 1..80_usize {
            let (x, u) = (5e-5 * n as f64, SPEEDS[n / 20 % 3]);
            layers.update(0.02 + x, u, stiffness * x + (180.0 + friction * x) * u, 0.0);
        }
        (layers, noise)
    }

    /// Density of a normal vector of two by its definition, from the belief about `(K, b - bp)` or `(K, b)`.
    fn log_density(layers: &LayerEstimator, follows: bool, noise: &NoiseEstimator) -> f64 {
        let g = &layers.belief;
        let map = [[(K, 1.0), (K, 0.0)], [(B, 1.0), (B_PREV, if follows { -1.0 } else { 0.0 })]];
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
        assert!(gap.test_free_tip(ODDS, true, &noise) && gap.tip_free && !gap.layer_confirmed);
        assert!(gap.belief.x[K].abs() < 1e-3, "{}", gap.belief.x[K]);
        assert!((gap.belief.x[B] / 9000.0 - 1.0).abs() < 0.02, "{}", gap.belief.x[B]);
        let (mut end, noise) = behind_a_rupture(0.0, 0.0);
        assert!(end.test_free_tip(ODDS, true, &noise) && end.tip_free);
        assert!(end.belief.x[B].abs() < 10.0, "{}", end.belief.x[B]);
    }

    #[test]
    fn a_layer_that_has_begun_is_no_gap_and_is_not_looked_at_again() {
        for (stiffness, friction) in [(60.0, 9000.0), (0.0, 20_000.0), (30.0, 0.0)] {
            let (mut layers, noise) = behind_a_rupture(stiffness, friction);
            assert!(!layers.test_free_tip(ODDS, true, &noise) && !layers.tip_free, "{stiffness} N/m");
            assert!(layers.layer_confirmed, "{stiffness} N/m");
        }
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} for {expected}");
    }

    /// Behind a rupture, with the tip free or a layer begun as surely as these log-densities over those at the rupture say.
    fn with_evidence(follows: f64, ends: f64) -> (LayerEstimator, NoiseEstimator) {
        let (mut layers, noise) = behind_a_rupture(0.0, 9000.0);
        let now = [true, false].map(|follows| layers.log_density_of_free(follows, &noise));
        layers.initial_log_densities = [now[0] - follows, now[1] - ends];
        (layers, noise)
    }

    #[test]
    fn a_tip_is_free_at_twenty_to_one_against_a_layer_and_four_hundred_against_the_other_way_to_be_free() {
        let log = |x: f64| x.ln();
        for (follows, ends, free, settled) in [
            (log(20.2), -30.0, true, false),
            (log(19.8), -30.0, false, false),
            (-30.0, log(20.2), true, false),
            (-30.0, log(19.8), false, false),
            // Twenty times as probable as a layer and four hundred times as the other way at three to one: 1220.
            (log(1230.0), log(3.0), true, false),
            (log(1210.0), log(3.0), false, false),
            (log(3.0), log(1230.0), true, false),
            // Twenty to the fourth to one that it is not, both ways.
            (-4.01 * log(20.0), -30.0, false, true),
            (-30.0, -4.01 * log(20.0), false, true),
            (-3.99 * log(20.0), -30.0, false, false),
            (-30.0, -3.99 * log(20.0), false, false),
            // No more is made of odds than numbers can hold.
            (900.0, 800.0, true, false),
            (f64::INFINITY, 0.0, false, false),
            (f64::NEG_INFINITY, 10.0, false, false),
        ] {
            let (mut layers, noise) = with_evidence(follows, ends);
            let was = layers.belief;
            assert_eq!(layers.test_free_tip(ODDS, true, &noise), free, "{follows} {ends}");
            assert_eq!((layers.tip_free, layers.layer_confirmed), (free, settled), "{follows} {ends}");
            // What is believed then: no stiffness, and the friction of the layer before or none.
            let mut expected = was;
            let variance = |g: &crate::stylet::gaussian::Gaussian<6>, i: usize| 1e-9 * g.p[i][i];
            if free {
                let none = expected.innovation([K], [1.0], 0.0, variance(&expected, K));
                expected.update(&none);
                let h = if follows > ends { -1.0 } else { 0.0 };
                let friction = expected.innovation([B, B_PREV], [1.0, h], 0.0, variance(&expected, B));
                expected.update(&friction);
            }
            for i in 0..6 {
                let scale = was.p[i][i].sqrt();
                assert!((layers.belief.x[i] - expected.x[i]).abs() <= 1e-12 * expected.x[i].abs().max(scale));
                assert!((layers.belief.p[i][i] - expected.p[i][i]).abs() <= 1e-9 * expected.p[i][i], "{i}");
            }
        }
    }

    #[test]
    fn where_a_bend_begins_is_told_by_a_sum_for_half_a_standard_deviation() {
        let (layers, _) = behind_a_rupture(0.0, 9000.0);
        let mut other = layers;
        other.start_m = 0.077;
        let FreeTipDetector { mut up, .. } = FreeTipDetector::new(0.05, 0.005, &layers);
        // It leaves zero where an innovation is lower than a quarter.
        assert!(!up.take(-0.2, &other, 0.03) && up.slow == 0.0 && up.before_m == 0.02);
        assert!(!up.take(-0.7, &other, 0.031));
        near(up.slow, 0.5 * (0.7 - 0.25));
        assert_eq!((up.before_m, up.before.start_m), (0.031, 0.077));
        up.take(-1.3, &layers, 0.032);
        near(up.slow, 0.5 * (0.7 + 1.3 - 0.5));
        assert_eq!((up.before_m, up.before.start_m), (0.031, 0.077));
        up.take(3.0, &layers, 0.033);
        assert_eq!(up.slow, 0.0);
        up.take(-0.7, &layers, 0.034);
        assert_eq!(up.before_m, 0.034);
        assert!(up.take(-9.0, &layers, 0.035));
        up.rest();
        assert_eq!((up.slow, up.alarm.relative_level()), (0.0, 0.0));
    }

    #[test]
    fn evidence_is_looked_at_every_eighth_sample_until_it_is_settled_or_the_tip_is_free() {
        let (noise, mut behind) = (noise(), PassedLayers::default());
        let mut follow = |layers: &mut LayerEstimator, slack: &mut FreeTipDetector, count: u32| {
            let before = layers.may_be_free().then_some(*layers);
            slack.update(layers, (before, 0.024), (0.02405, 0.0, 0.002), count, &noise, &mut behind)
        };
        let (mut layers, _) = behind_a_rupture(60.0, 9000.0);
        let mut slack = FreeTipDetector::new(0.05, 0.005, &layers);
        assert_eq!([7, 9, 12].map(|count| follow(&mut layers, &mut slack, count)), [(42, false); 3]);
        assert!(!layers.layer_confirmed);
        // A force that may be bending upwards settles nothing.
        slack.up.take(-3.0, &layers, 0.0);
        assert_eq!(follow(&mut layers, &mut slack, 16), (102, false));
        assert!(!layers.layer_confirmed);
        slack.reset();
        assert_eq!(follow(&mut layers, &mut slack, 16), (102, false));
        assert!(layers.layer_confirmed && !layers.tip_free);
        assert_eq!(follow(&mut layers, &mut slack, 24), (0, false));
        let (mut layers, _) = behind_a_rupture(0.0, 9000.0);
        for side in [&mut slack.up, &mut slack.down] {
            side.take(-3.0, &layers, 0.0);
        }
        assert_eq!(follow(&mut layers, &mut slack, 8), (102, false));
        assert!(layers.tip_free && slack.up.slow == 0.0 && slack.down.slow == 0.0, "the sums begin then");
    }

    #[test]
    fn a_layer_without_stiffness_is_not_settled() {
        for stiffness in [60.0, -60.0] {
            let (mut layers, noise) = behind_a_rupture(stiffness, 9000.0);
            assert!(!layers.test_free_tip(ODDS, true, &noise) && !layers.tip_free);
            assert_eq!(layers.layer_confirmed, stiffness > 0.0);
        }
    }

    #[test]
    fn a_gap_that_was_not_known_for_one_ends_where_the_force_bends_upwards() {
        let (noise, mut behind) = (noise(), PassedLayers::default());
        // As long as nobody knows, what goes down may be the drop of a layer.
        let (undecided, _) = behind_a_rupture(0.0, 9000.0);
        for (z, bent) in [(9.0, true), (-9.0, false)] {
            let (mut layers, mut slack) = (undecided, FreeTipDetector::new(0.05, 0.005, &undecided));
            let mut follow = |layers: &mut LayerEstimator, last_m: f64, z: f64| {
                let next = (last_m + 1e-4, z, 0.0021);
                slack.update(layers, (Some(undecided), last_m), next, 3, &noise, &mut behind).1
            };
            assert!(!follow(&mut layers, 0.0241, 0.2 * z));
            assert_eq!(follow(&mut layers, 0.0242, z), bent);
            if bent {
                let mut expected = undecided;
                expected.set_zero_stiffness();
                expected.start_after_bend(
                    0.0241,
                    2e-4 / 12.0_f64.sqrt(),
                    true,
                    0.0021,
                    &noise,
                    &mut PassedLayers::default(),
                );
                near(layers.start_m, 0.0241);
                for i in 0..6 {
                    near(layers.belief.x[i], expected.belief.x[i]);
                    near(layers.belief.p[i][i], expected.belief.p[i][i]);
                }
            } else {
                near(layers.start_m, undecided.start_m);
            }
        }
    }

    #[test]
    fn no_layer_begins_where_the_needle_stands() {
        let (noise, mut behind) = (noise(), PassedLayers::default());
        for free in [true, false] {
            let (mut layers, _) = behind_a_rupture(0.0, 9000.0);
            assert!(!free || layers.test_free_tip(ODDS, true, &noise));
            let before = layers;
            let mut slack = FreeTipDetector::new(0.05, 0.005, &layers);
            let mut follow = |layers: &mut LayerEstimator, z: f64| {
                slack.update(layers, (Some(before), 0.024), (0.024, z, 0.002), 3, &noise, &mut behind).1
            };
            assert!(!follow(&mut layers, 2.0) && follow(&mut layers, 9.0));
            assert_eq!((layers.tip_free, layers.start_m), (false, before.start_m));
            // What friction was thought to do by itself, 18 N/m, may have been elastic for any part.
            let part = if free { 9.0 } else { 0.0 };
            assert!((layers.belief.x[K] - before.belief.x[K] - part).abs() < 0.2, "{}", layers.belief.x[K]);
            let slope = |layers: &LayerEstimator| layers.slope(0.002);
            near(slope(&layers), slope(&before));
        }
    }

    #[test]
    fn a_free_tip_is_ended_by_a_force_above_and_its_friction_by_one_below() {
        for up in [true, false] {
            let (mut layers, noise) = behind_a_rupture(0.0, 9000.0);
            let mut behind = PassedLayers::default();
            assert!(layers.test_free_tip(ODDS, true, &noise));
            let before = layers;
            let mut slack = FreeTipDetector::new(0.05, 0.005, &layers);
            let mut follow = |layers: &mut LayerEstimator, last_m: f64, z: f64| {
                slack.update(
                    layers,
                    (Some(before), last_m),
                    (last_m + 1e-4, z, 0.0021),
                    3,
                    &noise,
                    &mut behind,
                )
            };
            // A sample that says nothing, then two that do; the sums leave zero before the first of them.
            let sign = if up { 1.0 } else { -1.0 };
            assert_eq!(follow(&mut layers, 0.024, 0.0), (42, false));
            assert_eq!(follow(&mut layers, 0.0241, 2.0 * sign), (42, false));
            layers.belief.x[K] = 77.0;
            assert_eq!(follow(&mut layers, 0.0242, 9.0 * sign), (42 + 2 * 216 + 2 * 126, true));
            let (mut expected, mut expected_behind) = (before, PassedLayers::default());
            let place_m = (0.0243 - 0.0241) / 12.0_f64.sqrt();
            expected.start_after_bend(0.0241, place_m, up, 0.0021, &noise, &mut expected_behind);
            assert_eq!((layers.tip_free, layers.start_m), (!up, 0.0241));
            for i in 0..6 {
                near(layers.belief.x[i], expected.belief.x[i]);
                near(layers.belief.p[i][i], expected.belief.p[i][i]);
            }
            assert_eq!((slack.up.slow, slack.down.slow), (0.0, 0.0));
        }
    }

    #[test]
    fn what_hangs_together_wholly_still_has_a_density() {
        let (mut layers, noise) = behind_a_rupture(0.0, 9000.0);
        layers.belief = crate::stylet::gaussian::Gaussian::new([0.0; 6], [1.0, 4.0, 9.0, 1.0, 1.0, 1.0]);
        layers.belief.p[B][K] = 6.0;
        // A trillionth of what it would be of unknowns on their own.
        near(layers.log_density_of_free(false, &noise), -0.5 * 36e-12_f64.ln());
        layers.belief.p[B][K] = -3.0;
        (layers.belief.x[K], layers.belief.x[B]) = (0.7, 1.1);
        let square = (0.49 * 9.0 + 2.0 * 0.7 * 1.1 * 3.0 + 1.21 * 4.0) / 27.0;
        near(layers.log_density_of_free(false, &noise), -0.5 * (27.0_f64.ln() + square / noise.variance));
    }
}
