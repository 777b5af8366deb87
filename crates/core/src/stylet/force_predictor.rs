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

use super::gaussian::{Gaussian, Innovation, MAX_VARIANCE_RATIO};
use super::noise_estimator::NoiseEstimator;

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
pub(crate) struct ForcePredictor {
    pub(crate) belief: Gaussian<5>,
    last_n: f64,
    fresh: bool,
}

/// What the predictor needs to know of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionStep {
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

impl ForcePredictor {
    /// In the air: the level is the bias, nothing changes with anything.
    pub(crate) fn new(level_n: f64) -> Self {
        Self {
            belief: Gaussian::new([level_n, 0.0, 0.0, 0.0, 0.0], [1.0, 1e-12, 1e-12, 1e-12, 1e-12]),
            last_n: level_n,
            fresh: true,
        }
    }

    /// After contact or a rupture: slopes unknown on the scale of `force_n` per memory; friction as it was, but no better known
    /// than to the whole force when `all` is set.
    pub(crate) fn restart(
        &mut self,
        measured_n: f64,
        force_n: f64,
        noise: &NoiseEstimator,
        speed_mps: f64,
        all: bool,
    ) {
        let unit = 1.0 / noise.variance;
        let scale = (force_n * force_n * unit).min(MAX_VARIANCE_RATIO);
        let v2 = speed_mps * speed_mps;
        let slope = scale / (MEMORY_M * MEMORY_M);
        self.belief.reset_component(L, measured_n, 1.0 / (1.0 - noise.rho * noise.rho));
        self.belief.reset_component(R, 0.0, slope * v2);
        self.belief.reset_component(S, 0.0, slope);
        self.belief.reset_component(C, 0.0, slope / v2);
        if all {
            self.belief.reset_component(B, 0.0, scale / v2);
        } else {
            let (mean, known) = (self.belief.x[B], self.belief.p[B][B]);
            self.belief.reset_component(B, mean, known.min(scale / v2));
        }
        self.last_n = measured_n;
        self.fresh = true;
    }

    /// Moves on to the next sample.
    #[inline(always)]
    pub(crate) fn advance(&mut self, step: &MotionStep, noise: &NoiseEstimator) {
        let MotionStep { dt_s, dz_m, dv_mps, .. } = *step;
        let g = &mut self.belief;
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
        let slow = noise.long_run_factor();
        let time = dt_s / (MEMORY_S * MEMORY_S);
        let travel = dz_m / (MEMORY_M * MEMORY_M);
        g.p[R][R] += slow * time * time;
        g.p[S][S] += slow * travel * travel;
    }

    /// Innovation of a measured force.
    #[inline(always)]
    pub(crate) fn innovation(
        &self,
        force_n: f64,
        step: &MotionStep,
        noise: &NoiseEstimator,
    ) -> Innovation<5> {
        if self.fresh {
            // Nothing before it to be whitened with.
            let r = 1.0 / (1.0 - noise.rho * noise.rho);
            return self.belief.innovation([L], [1.0], force_n, r);
        }
        let rho = step.rho;
        if rho == 0.0 {
            return self.belief.innovation([L], [1.0], force_n, 1.0);
        }
        let h = [1.0 - rho, rho * step.dt_s, rho * step.dz_m, rho * step.dv_mps];
        self.belief.innovation([L, R, S, B], h, force_n - rho * self.last_n, 1.0)
    }

    #[inline(always)]
    pub(crate) fn update(&mut self, innovation: &Innovation<5>, force_n: f64) {
        self.belief.update(innovation);
        self.last_n = force_n;
        self.fresh = false;
    }

    /// The level begins anew at a measured force; what the slopes are stays.
    pub(crate) fn reset_level(&mut self, measured_n: f64, noise: &NoiseEstimator) {
        self.belief.reset_component(L, measured_n, 1.0 / (1.0 - noise.rho * noise.rho));
        self.last_n = measured_n;
        self.fresh = true;
    }

    /// Passes a sample over.
    pub(crate) fn skip_sample(&mut self) {
        self.fresh = true;
    }

    /// Change of the force with time at a speed and an acceleration, in N/s, less what a friction `known_ns_per_m` makes of the
    /// acceleration; and its variance in units of the noise's. While speed changes evenly the parts are not told from each other, but
    /// their sum is.
    pub(crate) fn rate(&self, speed_mps: f64, accel_mps2: f64, known_ns_per_m: f64) -> (f64, f64) {
        let g = &self.belief;
        let (v, a) = (speed_mps, accel_mps2);
        let rate = g.x[R] + v * g.x[S] + a * (g.x[B] - known_ns_per_m);
        let alone = g.p[R][R] + v * (2.0 * g.cov(R, S) + v * g.p[S][S]);
        (rate, alone + a * (2.0 * (g.cov(R, B) + v * g.cov(S, B)) + a * g.p[B][B]))
    }

    /// Variance of the level in units of the noise's, and its covariance with [`Local::rate`] at an even speed.
    pub(crate) fn level_covariance(&self, speed_mps: f64) -> (f64, f64) {
        let g = &self.belief;
        (g.p[L][L], g.cov(L, R) + speed_mps * g.cov(L, S))
    }

    /// Predicted force in N.
    pub(crate) fn level_n(&self) -> f64 {
        self.belief.x[L]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STIFFNESS: f64 = 40.0;
    const FRICTION: f64 = 9000.0;
    const BEHIND: f64 = 150.0;

    /// `K x + b x v + D v`, and a relaxation by 0.2 N/s.
    fn law_n(t: f64, x: f64, v: f64) -> f64 {
        STIFFNESS * x + FRICTION * x * v + BEHIND * v - 0.2 * t
    }

    /// What is to be known of that law at a depth and a speed, with some doubt that hangs together.
    fn knowing(x: f64, v: f64) -> ForcePredictor {
        let mut local = ForcePredictor::new(0.0);
        let mean = [law_n(0.0, x, v), -0.2, STIFFNESS + FRICTION * v, BEHIND + FRICTION * x, FRICTION];
        let map = core::array::from_fn(|i| {
            core::array::from_fn(|j| if i == j { 1.0 } else { 0.1 * (i as f64 - 0.5 * j as f64) })
        });
        local.belief = Gaussian::new([0.0; 5], [1.0, 4.0, 0.25, 2.0, 0.5]).transformed(&map);
        local.belief.x = mean;
        local
    }

    fn noise(rho: f64) -> NoiseEstimator {
        NoiseEstimator::known(rho, 1e-4, 0.0, 1e6)
    }

    fn step(dt_s: f64, dz_m: f64, dv_mps: f64, rho: f64) -> MotionStep {
        MotionStep { dt_s, dz_m, dv_mps, rho, sudden: false, speed_mps: 0.002 }
    }

    #[test]
    fn the_prediction_is_exact_where_the_law_of_layers_holds() {
        for (dz, dv) in [(1e-5, 0.0), (0.0, 1e-4), (1e-5, 1e-5), (2e-5, -1e-4), (-1e-5, 1e-4)] {
            let (mut local, mut x, mut v) = (knowing(0.01, 0.002), 0.01, 0.002);
            for k in 1..=20 {
                local.advance(&step(0.005, dz, dv, 0.0), &noise(0.0));
                (x, v) = (x + dz, v + dv);
                // What a step leaves out is b dz dv, of the second order.
                let off = local.level_n() - law_n(0.005 * f64::from(k), x, v);
                assert!(off.abs() <= 1.001 * f64::from(k) * FRICTION * (dz * dv).abs() + 1e-9, "{off} N");
            }
            assert!((local.belief.x[S] - (STIFFNESS + FRICTION * v)).abs() < 1e-9);
            assert!((local.belief.x[B] - (BEHIND + FRICTION * x)).abs() < 1e-9);
        }
    }

    #[test]
    fn coloured_noise_is_whitened_by_the_sample_before() {
        for rho in [0.0, 0.4, 0.9] {
            let noise = noise(rho);
            let (mut local, x, v) = (knowing(0.01, 0.002), 0.01, 0.002);
            // Known exactly, so that the innovation is what the noise has new, and its variance that of it.
            for (row, p) in local.belief.p.iter_mut().enumerate() {
                p[..=row].fill(0.0);
            }
            let colour_n = 0.03;
            local.last_n = law_n(0.0, x, v) + colour_n;
            local.fresh = false;
            let step = step(0.005, 1e-5, 2e-5, rho);
            local.advance(&step, &noise);
            let new_n = 0.007;
            let expected = local.level_n() + rho * colour_n + new_n;
            let innovation = local.innovation(expected, &step, &noise);
            // But for b dz dv, of the second order.
            let left_out = 2.01 * rho * FRICTION * step.dz_m * step.dv_mps + 1e-12;
            assert!((innovation.e - new_n).abs() < left_out, "rho {rho}: {}", innovation.e);
            // What the slopes may have changed by within a step is next to nothing.
            assert!((innovation.s - 1.0).abs() < 0.05, "rho {rho}: {}", innovation.s);
            // Without a sample before it, all of the noise is new.
            local.skip_sample();
            let alone = local.innovation(expected, &step, &noise);
            assert!((alone.e - (rho * colour_n + new_n)).abs() < 1e-12);
            assert!((alone.s * (1.0 - rho * rho) - 1.0).abs() < 0.05, "rho {rho}: {}", alone.s);
        }
    }

    #[test]
    fn the_rate_of_the_force_is_the_sum_of_its_parts_and_as_uncertain_as_they_are_together() {
        let local = knowing(0.01, 0.002);
        let (v, a, known) = (0.7, -0.4, 30.0);
        let (rate, variance) = local.rate(v, a, known);
        let x = &local.belief.x;
        assert!((rate - (x[R] + v * x[S] + a * (x[B] - known))).abs() < 1e-9);
        // h' P h, the known friction being no unknown.
        let h = [0.0, 1.0, v, a, 0.0];
        let expected: f64 = (0..25).map(|n| h[n / 5] * local.belief.cov(n / 5, n % 5) * h[n % 5]).sum();
        assert!((variance - expected).abs() < 1e-9 * expected, "{variance} {expected}");
    }

    #[test]
    fn slopes_begin_anew_on_the_scale_of_a_force_per_memory_and_friction_is_kept_as_far_as_it_is_known() {
        let (noise, speed, force_n) = (noise(0.6), 0.002, 0.5);
        let sd_n =
            |local: &ForcePredictor, i: usize, by: f64| (local.belief.p[i][i] * noise.variance).sqrt() * by;
        for all in [false, true] {
            let mut local = knowing(0.01, 0.002);
            let was = (local.belief.x[B], local.belief.p[B][B]);
            local.restart(1.7, force_n, &noise, speed, all);
            assert_eq!(local.level_n(), 1.7);
            // The level is known as well as one sample knows it.
            assert!((sd_n(&local, L, 1.0) / (noise.variance / (1.0 - 0.36)).sqrt() - 1.0).abs() < 1e-9);
            // Over the memory's travel, or at the usual speed in the time that it takes, the whole force.
            assert!((sd_n(&local, S, MEMORY_M) / force_n - 1.0).abs() < 1e-9);
            assert!((sd_n(&local, R, MEMORY_M / speed) / force_n - 1.0).abs() < 1e-9);
            assert!((sd_n(&local, C, MEMORY_M * speed) / force_n - 1.0).abs() < 1e-9);
            assert_eq!([local.belief.x[R], local.belief.x[S], local.belief.x[C]], [0.0; 3]);
            if all {
                assert!((sd_n(&local, B, speed) / force_n - 1.0).abs() < 1e-9);
                assert_eq!(local.belief.x[B], 0.0);
            } else {
                assert_eq!(
                    (local.belief.x[B], local.belief.p[B][B]),
                    was,
                    "friction is better known than that"
                );
            }
        }
        // What is known worse than to the whole force is no better known than before, and no worse than to the force.
        let mut local = knowing(0.01, 0.002);
        local.belief.p[B][B] = 1e14;
        local.restart(1.7, force_n, &noise, speed, false);
        assert!((sd_n(&local, B, speed) / force_n - 1.0).abs() < 1e-9);
    }

    fn full(local: &ForcePredictor) -> [[f64; 5]; 5] {
        core::array::from_fn(|i| core::array::from_fn(|j| local.belief.cov(i, j)))
    }

    fn near(found: f64, expected: f64, scale: f64) {
        assert!((found - expected).abs() <= 1e-12 * scale, "{found} for {expected}");
    }

    #[test]
    fn a_step_is_a_linear_map_and_slopes_wander_as_their_memories_say() {
        let noise = noise(0.6);
        for (dz, dv) in [(0.3, 0.7), (0.3, 0.0), (0.0, 0.7), (0.0, 0.0)] {
            let (mut local, dt) = (knowing(0.01, 0.002), 0.2);
            local.belief.x = [1.3, -0.7, 2.9, 5.3, -3.1];
            let (x, p) = (local.belief.x, full(&local));
            local.advance(&step(dt, dz, dv, 0.6), &noise);
            let map = [
                [1.0, dt, dz, dv, 0.0],
                [0.0, 1.0, 0.0, 0.0, 0.0],
                [0.0, 0.0, 1.0, 0.0, dv],
                [0.0, 0.0, 0.0, 1.0, dz],
                [0.0, 0.0, 0.0, 0.0, 1.0],
            ];
            // Slow noise of correlation 0.6 weighs 1/0.16; half a second and a millimetre are the memories.
            let wander = [0.0, (dt / 0.25).powi(2) / 0.16, (dz / 1e-6).powi(2) / 0.16, 0.0, 0.0];
            for i in 0..5 {
                near(local.belief.x[i], (0..5).map(|k| map[i][k] * x[k]).sum(), 10.0);
                for j in 0..5 {
                    let mut expected: f64 =
                        (0..25).map(|n| map[i][n / 5] * p[n / 5][n % 5] * map[j][n % 5]).sum();
                    if i == j {
                        expected += wander[i];
                    }
                    near(local.belief.cov(i, j), expected, expected.abs().max(1.0));
                }
            }
        }
    }

    #[test]
    fn an_innovation_is_what_is_new_of_a_force_against_the_sample_before() {
        let (mut local, noise) = (knowing(0.01, 0.002), noise(0.6));
        local.belief.x = [1.3, -0.7, 2.9, 5.3, -3.1];
        (local.last_n, local.fresh) = (1.1, false);
        let (x, p) = (local.belief.x, full(&local));
        for (rho, h) in [(0.5, [0.5, 0.1, 0.15, 0.35, 0.0]), (0.0, [1.0, 0.0, 0.0, 0.0, 0.0])] {
            let found = local.innovation(2.3, &step(0.2, 0.3, 0.7, rho), &noise);
            near(found.e, 2.3 - rho * 1.1 - (0..5).map(|i| h[i] * x[i]).sum::<f64>(), 1.0);
            near(found.s, 1.0 + (0..25).map(|n| h[n / 5] * p[n / 5][n % 5] * h[n % 5]).sum::<f64>(), 10.0);
            let mut taken = local;
            taken.update(&found, 2.3);
            let mut expected = local.belief;
            expected.update(&found);
            assert_eq!((taken.belief.x, taken.belief.p), (expected.x, expected.p));
            assert_eq!((taken.last_n, taken.fresh), (2.3, false));
            // Where there is none before it, all of the noise is in it, whatever the step.
            taken = local;
            taken.skip_sample();
            let alone = taken.innovation(2.3, &step(0.2, 0.3, 0.7, rho), &noise);
            near(alone.e, 1.0, 1.0);
            near(alone.s, p[0][0] + 1.0 / 0.64, 10.0);
        }
    }

    #[test]
    fn a_level_that_begins_anew_leaves_the_slopes_and_no_scale_is_wider_than_the_noise_can_tell() {
        let mut local = knowing(0.01, 0.002);
        let (x, p) = (local.belief.x, full(&local));
        local.fresh = false;
        local.reset_level(1.7, &noise(0.6));
        assert_eq!((local.level_n(), local.last_n, local.fresh), (1.7, 1.7, true));
        assert_eq!(local.belief.x[1..], x[1..]);
        near(local.belief.p[0][0], 1.0 / 0.64, 1.0);
        for (i, row) in p.iter().enumerate().skip(1) {
            assert_eq!(local.belief.cov(0, i), 0.0);
            (1..5).for_each(|j| assert_eq!(local.belief.cov(i, j), row[j]));
        }
        // Noise of 1 uN: slopes on the scale of 10 mN a millimetre, whatever the force.
        let noise = NoiseEstimator::known(0.0, 1e-12, 0.0, 1e6);
        local.restart(1.7, 0.5, &noise, 0.002, true);
        near((local.belief.p[S][S] * 1e-12).sqrt(), 10.0, 10.0);
        assert_eq!((local.last_n, local.fresh), (1.7, true));
        // In the air nothing changes with anything.
        let air = ForcePredictor::new(0.3);
        assert_eq!((air.belief.x, air.last_n, air.fresh), ([0.3, 0.0, 0.0, 0.0, 0.0], 0.3, true));
        assert_eq!(core::array::from_fn(|i| air.belief.p[i][i]), [1.0, 1e-12, 1e-12, 1e-12, 1e-12]);
    }
}
