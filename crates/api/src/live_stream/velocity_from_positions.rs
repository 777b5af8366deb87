//! Velocity as the slope of the latest positions.

use std::collections::VecDeque;

/// Window in s: twenty samples at 1 kHz; the velocity lags by half of it.
const WINDOW_S: f64 = 0.02;
/// Limits on the number of samples in the window.
const MIN_SAMPLES: usize = 3;
const MAX_SAMPLES: usize = 512;

/// Least-squares line through the latest positions.
#[derive(Clone, Debug, Default)]
pub(crate) struct VelocityEstimator {
    points: VecDeque<(f64, f64)>,
}

impl VelocityEstimator {
    /// Velocity in m/s at a new position (m); zero from fewer than two positions. The position counts from [`Self::add`] on.
    pub(crate) fn at(&self, time_s: f64, position_m: f64) -> f64 {
        if self.points.back().is_none_or(|(before, _)| time_s <= *before) {
            return 0.0;
        }
        let skipped = self.surplus(time_s, self.points.len() + 1);
        let points = || self.points.iter().copied().skip(skipped).chain([(time_s, position_m)]);
        let n = (self.points.len() - skipped + 1) as f64;
        let (t0, z0) = points().fold((0.0, 0.0), |(t, z), p| (t + p.0 / n, z + p.1 / n));
        let (tt, tz) = points()
            .fold((0.0, 0.0), |(tt, tz), (t, z)| (tt + (t - t0) * (t - t0), tz + (t - t0) * (z - z0)));
        if tt > 0.0 { tz / tt } else { 0.0 }
    }

    /// Takes a position that belongs to the motion.
    pub(crate) fn add(&mut self, time_s: f64, position_m: f64) {
        if self.points.back().is_some_and(|(before, _)| time_s <= *before) {
            self.points.clear();
        }
        self.points.push_back((time_s, position_m));
        self.points.drain(..self.surplus(time_s, self.points.len()));
    }

    /// Number of points that leave the window when it has `count` points and ends at `time_s`.
    fn surplus(&self, time_s: f64, count: usize) -> usize {
        let old = self.points.iter().take_while(|(t, _)| time_s - t > WINDOW_S).count();
        old.max(count.saturating_sub(MAX_SAMPLES)).min(count.saturating_sub(MIN_SAMPLES))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_motion_has_its_velocity_from_the_second_sample_on() {
        let mut velocity = VelocityEstimator::default();
        assert_eq!(velocity.at(0.0, 0.001), 0.0);
        velocity.add(0.0, 0.001);
        for k in 1..100 {
            let (time_s, position_m) = (f64::from(k) * 1e-3, 0.001 + 0.0023e-3 * f64::from(k));
            let v = velocity.at(time_s, position_m);
            assert!((v - 0.0023).abs() < 1e-9, "{k}: {v}");
            // A wrong time stamp that is not added has no effect.
            velocity.at(1e9, position_m);
            velocity.add(time_s, position_m);
            assert!(velocity.points.len() <= 21, "{}", velocity.points.len());
        }
    }

    #[test]
    fn a_clock_that_jumps_back_restarts_the_window() {
        let mut velocity = VelocityEstimator::default();
        velocity.add(10.0, 0.0);
        assert_eq!(velocity.at(0.0, 5.0), 0.0);
        velocity.add(0.0, 5.0);
        assert!((velocity.at(0.001, 5.001) - 1.0).abs() < 1e-9);
    }
}
