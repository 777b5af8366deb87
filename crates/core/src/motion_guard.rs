//! What is not a rupture \[D\]: reversal, hold, a sudden change of the commanded speed, and travel
//! over ground where the needle has already been.
//!
//! Position and velocity may be noisy: velocity is smoothed before it is judged, a change of speed is
//! sudden only when it stands out of the acceleration's own scatter, and ground counts as old only
//! when the tip is clearly above its deepest point.

use crate::config::GuardConfig;
use crate::sample::Sample;

/// Time over which the scatter of the acceleration is learnt, in s.
pub(crate) const SCATTER_S: f64 = 2.0;
/// How far the acceleration must stand out of its scatter to be a sudden change.
const SCATTERS: f64 = 6.0;

/// Watches the motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionGuard {
    raw_mps: f64,
    velocity_mps: f64,
    acceleration_mps2: f64,
    scatter_mps2_squared: f64,
    rest_s: f64,
    deepest_m: f64,
    /// Filtered speed and speed are the same, and there never was any acceleration.
    even: bool,
}

impl Default for MotionGuard {
    fn default() -> Self {
        Self {
            raw_mps: 0.0,
            velocity_mps: 0.0,
            acceleration_mps2: 0.0,
            scatter_mps2_squared: 0.0,
            rest_s: 0.0,
            deepest_m: f64::NEG_INFINITY,
            even: false,
        }
    }
}

impl MotionGuard {
    /// The first sample.
    pub(crate) fn start(&mut self, config: &GuardConfig, standstill_mps: f64, sample: Sample) {
        self.velocity_mps = sample.velocity_mps;
        self.settle(config, standstill_mps, false, sample);
    }

    /// Takes a sample, `dt_s` after the one before, with the coefficients of the motion's low-pass and of
    /// the scatter's.
    #[inline]
    pub(crate) fn update(
        &mut self,
        config: &GuardConfig,
        standstill_mps: f64,
        dt_s: f64,
        [low_pass, scatter]: [f64; 2],
        sample: Sample,
    ) {
        self.rest_s -= dt_s;
        // A needle that goes on as evenly as it did leaves all filters where they are.
        let even = self.even && sample.velocity_mps == self.raw_mps;
        let sudden = !even && self.filter(config, dt_s, low_pass, scatter, sample.velocity_mps);
        self.settle(config, standstill_mps, sudden, sample);
    }

    /// Smooths the motion; true where the speed changes suddenly.
    #[inline]
    fn filter(&mut self, config: &GuardConfig, dt_s: f64, low_pass: f64, scatter: f64, v: f64) -> bool {
        let a = (v - self.raw_mps) / dt_s;
        self.velocity_mps += low_pass * (v - self.velocity_mps);
        self.acceleration_mps2 += low_pass * (a - self.acceleration_mps2);
        let size = self.acceleration_mps2 * self.acceleration_mps2;
        let scattered = SCATTERS * SCATTERS * self.scatter_mps2_squared;
        let least = config.sudden_mps2 * config.sudden_mps2;
        let limit = if scattered > least { scattered } else { least };
        let sudden = size > limit;
        // One jump teaches little: it counts at most as what was just bearable.
        let bearable = if sudden { limit } else { size };
        self.scatter_mps2_squared += scatter * (bearable - self.scatter_mps2_squared);
        self.even =
            self.velocity_mps == v && self.acceleration_mps2 == 0.0 && self.scatter_mps2_squared == 0.0;
        sudden
    }

    /// Whether detection rests after this sample.
    #[inline]
    fn settle(&mut self, config: &GuardConfig, standstill_mps: f64, sudden: bool, sample: Sample) {
        self.raw_mps = sample.velocity_mps;
        if sample.position_m > self.deepest_m {
            self.deepest_m = sample.position_m;
        }
        if sudden || self.velocity_mps < standstill_mps || self.is_revisiting(config, sample.position_m) {
            self.rest_s = config.rest_s;
        }
    }

    /// True where the tip is clearly above its deepest point.
    #[inline]
    pub(crate) fn is_revisiting(&self, config: &GuardConfig, position_m: f64) -> bool {
        position_m < self.deepest_m - config.revisit_margin_m
    }

    /// True while a change of force may be a rupture.
    #[inline]
    pub(crate) fn allows_detection(&self) -> bool {
        self.rest_s <= 0.0
    }

    /// True while the needle slows down so fast that friction alone makes the force fall.
    #[inline]
    pub(crate) fn is_slowing(&self, config: &GuardConfig) -> bool {
        self.acceleration_mps2 < -config.slowing_per_s * self.velocity_mps.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STANDSTILL_MPS: f64 = 5e-5;
    const DT_S: f64 = 0.005;

    /// Whether detection rests after each of the samples, from rest at zero with a speed that is there at once.
    fn quiet(count: usize, mut v: impl FnMut(usize) -> f64) -> alloc::vec::Vec<bool> {
        let (config, mut guard, mut z) = (GuardConfig::default(), MotionGuard::default(), 0.0);
        let share = |tau_s: f64| 1.0 - (-DT_S / tau_s).exp();
        let shares = [share(config.acceleration_time_constant_s), share(SCATTER_S)];
        (0..count)
            .map(|k| {
                let velocity_mps = v(k);
                z += velocity_mps * DT_S;
                let sample = Sample { velocity_mps, position_m: z, ..Sample::default() };
                if k == 0 {
                    guard.start(&config, STANDSTILL_MPS, sample);
                } else {
                    guard.update(&config, STANDSTILL_MPS, DT_S, shares, sample);
                }
                guard.allows_detection()
            })
            .collect()
    }

    /// Numbers of the first and last sample at rest, and how many there were.
    fn rests(quiet: &[bool]) -> Option<(usize, usize, usize)> {
        let at = |i: Option<usize>| i.map(|i| i + 1);
        let first = at(quiet.iter().position(|q| !q))?;
        let last = at(quiet.iter().rposition(|q| !q))?;
        Some((first - 1, last - 1, quiet.iter().filter(|q| !**q).count()))
    }

    #[test]
    fn an_even_advance_never_rests_and_a_hold_rests_as_long_as_it_lasts_and_a_quarter_of_a_second() {
        assert_eq!(rests(&quiet(2000, |_| 0.0023)), None);
        let (first, last, count) =
            rests(&quiet(2000, |k| if (500..900).contains(&k) { 0.0 } else { 0.0023 })).expect("a hold");
        // 0.25 s are 50 samples; the filter of 10 ms is two samples late.
        assert!((500..=504).contains(&first) && (945..=965).contains(&last), "{first} to {last}");
        assert_eq!(count, last + 1 - first);
    }

    #[test]
    fn a_sudden_change_of_speed_rests_and_a_gentle_one_does_not() {
        let (first, last, _) =
            rests(&quiet(2000, |k| if k < 700 { 0.0023 } else { 0.0046 })).expect("a sudden change");
        // Over the filters' 10 ms the change is 0.2 m/s² and fades within some of them.
        assert!((700..=701).contains(&first) && (748..=770).contains(&last), "{first} to {last}");
        // 0.02 m/s² are less than the 0.05 that are sudden.
        let gentle = |k: usize| 0.0023 + 0.02 * DT_S * (k as f64 - 700.0).clamp(0.0, 100.0);
        assert_eq!(rests(&quiet(2000, gentle)), None);
        // And 0.09 are more.
        let strong = |k: usize| 0.0023 + 0.09 * DT_S * (k as f64 - 700.0).clamp(0.0, 20.0);
        assert!(rests(&quiet(2000, strong)).is_some());
    }

    #[test]
    fn noise_on_the_speed_is_no_sudden_change_once_its_scatter_is_known() {
        let noisy = |k: usize| 0.0023 + 2e-4 * ((k * 7919 % 1009) as f64 / 504.0 - 1.0);
        let found = quiet(4000, noisy);
        assert!(found[2000..].iter().all(|q| *q));
        // A jump that stands out of that scatter is one.
        let found = quiet(4000, |k| noisy(k) + if k >= 3000 { 0.004 } else { 0.0 });
        let (first, ..) = rests(&found[2000..]).expect("a sudden change");
        assert!((1000..=1001).contains(&first), "{first}");
    }

    #[test]
    fn going_over_old_ground_rests_until_the_tip_is_a_tenth_of_a_millimetre_from_its_deepest_point() {
        let (config, mut guard) = (GuardConfig::default(), MotionGuard::default());
        let sample = |position_m: f64| Sample { position_m, ..Sample::default() };
        guard.start(&config, STANDSTILL_MPS, sample(0.01));
        guard.start(&config, STANDSTILL_MPS, sample(0.008));
        assert!(guard.is_revisiting(&config, 0.0098) && !guard.is_revisiting(&config, 0.00995));
    }

    #[test]
    fn slowing_down_is_by_a_tenth_of_the_speed_a_second() {
        // A speed that falls exponentially with a time constant of 20 s slows down by 5 % a second, one of 5 s by 20 %.
        for (tau_s, slowing) in [(20.0, false), (5.0, true)] {
            let (config, mut guard) = (GuardConfig::default(), MotionGuard::default());
            for k in 0..400 {
                let v = 0.01 * (-DT_S * f64::from(k) / tau_s).exp();
                let sample = Sample { velocity_mps: v, position_m: 1e-5 * f64::from(k), ..Sample::default() };
                if k == 0 {
                    guard.start(&config, STANDSTILL_MPS, sample);
                } else {
                    guard.update(&config, STANDSTILL_MPS, DT_S, [0.4, 0.0025], sample);
                }
            }
            assert_eq!(guard.is_slowing(&config), slowing, "{tau_s} s");
        }
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{found} for {expected}");
    }

    /// In motion at 2 mm/s, with an acceleration whose scatter is this in m/s².
    fn moving(scatter_mps2: f64) -> MotionGuard {
        MotionGuard {
            raw_mps: 0.002,
            velocity_mps: 0.0021,
            acceleration_mps2: 0.03,
            scatter_mps2_squared: scatter_mps2 * scatter_mps2,
            deepest_m: 0.01,
            ..MotionGuard::default()
        }
    }

    #[test]
    fn speed_and_acceleration_are_low_passed_and_sudden_is_what_stands_out_of_scatter_and_limit() {
        let config = GuardConfig::default();
        // Scatter, speed, and whether it is sudden: above six times the scatter, and above 0.05 m/s².
        for (scatter, v, sudden) in [
            (0.02, 0.0023, false),
            (0.0, 0.0023, false),
            (0.0, 0.00241, true),
            (0.0, 0.00239, false),
            (0.0, -0.0005, true),
            (0.02, 0.0032, false),
            (0.02, 0.0033, true),
            (0.007, 0.00241, true),
            (0.009, 0.00241, false),
        ] {
            let mut guard = moving(scatter);
            // (v - 2 mm/s)/5 ms has two fifths of the acceleration.
            let acceleration = 0.6 * 0.03 + 0.4 * (v - 0.002) / 0.005;
            let limit = f64::max(36.0 * scatter * scatter, 0.0025);
            let size = acceleration * acceleration;
            assert_eq!(guard.filter(&config, 0.005, 0.4, 0.1, v), sudden, "{scatter} m/s², {v} m/s");
            near(guard.velocity_mps, 0.6 * 0.0021 + 0.4 * v);
            near(guard.acceleration_mps2, acceleration);
            near(guard.scatter_mps2_squared, 0.9 * scatter * scatter + 0.1 * size.min(limit));
            assert!(!guard.even);
        }
    }

    #[test]
    fn a_motion_is_even_once_all_filters_have_come_to_rest_and_goes_on_so_until_the_speed_changes() {
        let config = GuardConfig::default();
        let sample = |velocity_mps: f64| Sample { velocity_mps, position_m: 0.01, ..Sample::default() };
        let even = MotionGuard {
            raw_mps: 0.002,
            velocity_mps: 0.002,
            acceleration_mps2: 0.0,
            scatter_mps2_squared: 0.0,
            ..MotionGuard::default()
        };
        for (guard, v, expected) in [
            (even, 0.002, true),
            (MotionGuard { velocity_mps: 0.0021, ..even }, 0.002, false),
            (MotionGuard { acceleration_mps2: 1e-9, ..even }, 0.002, false),
            (MotionGuard { scatter_mps2_squared: 1e-9, ..even }, 0.002, false),
            (even, 0.0021, false),
        ] {
            let mut filtered = guard;
            filtered.filter(&config, DT_S, 0.4, 0.1, v);
            assert_eq!(filtered.even, expected);
        }
        // What is even is not filtered again; what has changed is.
        let mut guard = MotionGuard { acceleration_mps2: 0.01, even: true, ..even };
        guard.update(&config, STANDSTILL_MPS, DT_S, [0.4, 0.1], sample(0.002));
        assert_eq!(guard.acceleration_mps2, 0.01);
        guard.update(&config, STANDSTILL_MPS, DT_S, [0.4, 0.1], sample(0.0021));
        near(guard.acceleration_mps2, 0.006 + 0.4 * 0.02);
        assert_eq!(guard.raw_mps, 0.0021);
        guard.even = false;
        guard.update(&config, STANDSTILL_MPS, DT_S, [0.4, 0.1], sample(0.0021));
        near(guard.acceleration_mps2, 0.6 * 0.014);
    }

    #[test]
    fn detection_rests_for_its_time_after_what_may_not_be_a_rupture() {
        let config = GuardConfig::default();
        for (sudden, v, position_m, rests) in [
            (false, 0.002, 0.011, false),
            (true, 0.002, 0.011, true),
            (false, 4e-5, 0.011, true),
            (false, 5e-5, 0.011, false),
            (false, -0.002, 0.011, true),
            (false, 0.002, 0.00989, true),
            (false, 0.002, 0.00991, false),
        ] {
            let mut guard = MotionGuard { velocity_mps: v, deepest_m: 0.01, ..MotionGuard::default() };
            let sample = Sample { position_m, velocity_mps: 0.003, ..Sample::default() };
            guard.settle(&config, STANDSTILL_MPS, sudden, sample);
            assert_eq!(guard.allows_detection(), !rests, "{sudden} {v} m/s {position_m} m");
            assert_eq!((guard.raw_mps, guard.deepest_m), (0.003, position_m.max(0.01)));
            assert_eq!(guard.rest_s, if rests { 0.25 } else { 0.0 });
        }
        let mut guard = MotionGuard { rest_s: 0.011, even: true, ..moving(0.0) };
        let sample = Sample { position_m: 0.01, velocity_mps: 0.002, ..Sample::default() };
        for quiet in [false, false, true] {
            guard.update(&config, STANDSTILL_MPS, DT_S, [0.4, 0.1], sample);
            assert_eq!(guard.allows_detection(), quiet);
        }
    }

    #[test]
    fn a_needle_slows_down_where_its_speed_falls_by_more_than_a_tenth_a_second() {
        let config = GuardConfig::default();
        for (v, a, slowing) in [
            (0.002, -1.9e-4, false),
            (0.002, -2.1e-4, true),
            (-0.002, -1.9e-4, false),
            (-0.002, -2.1e-4, true),
            (0.002, 2.1e-4, false),
            (0.0, 0.0, false),
        ] {
            let guard = MotionGuard { velocity_mps: v, acceleration_mps2: a, ..MotionGuard::default() };
            assert_eq!(guard.is_slowing(&config), slowing, "{v} m/s, {a} m/s²");
        }
    }
}
