//! Velocity as the slope of the latest positions.

use std::collections::VecDeque;

/// Window in s: twenty samples at 1 kHz; the velocity lags by half of it.
const WINDOW_S: f64 = 0.02;
/// Limits on the number of samples in the window.
const MIN_SAMPLES: usize = 3;
const MAX_SAMPLES: usize = 512;

/// Least-squares line through the latest positions.
#[derive(Clone, Debug, Default)]
pub(super) struct VelocityEstimator {
    points: VecDeque<(f64, f64)>,
}

impl VelocityEstimator {
    /// Takes a position (m) and returns the velocity in m/s; zero from fewer than two positions.
    pub(super) fn update(&mut self, time_s: f64, position_m: f64) -> f64 {
        if self.points.back().is_some_and(|(before, _)| time_s <= *before) {
            self.points.clear();
        }
        self.points.push_back((time_s, position_m));
        while self.points.len() > MIN_SAMPLES
            && (self.points.len() > MAX_SAMPLES
                || self.points.front().is_some_and(|(t, _)| time_s - t > WINDOW_S))
        {
            self.points.pop_front();
        }
        let n = self.points.len() as f64;
        let (t0, z0) = self.points.iter().fold((0.0, 0.0), |(t, z), p| (t + p.0 / n, z + p.1 / n));
        let (tt, tz) = self
            .points
            .iter()
            .fold((0.0, 0.0), |(tt, tz), (t, z)| (tt + (t - t0) * (t - t0), tz + (t - t0) * (z - z0)));
        if tt > 0.0 { tz / tt } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_motion_has_its_velocity_from_the_second_sample_on() {
        let mut velocity = VelocityEstimator::default();
        assert_eq!(velocity.update(0.0, 0.001), 0.0);
        for k in 1..100 {
            let v = velocity.update(f64::from(k) * 1e-3, 0.001 + 0.0023e-3 * f64::from(k));
            assert!((v - 0.0023).abs() < 1e-9, "{k}: {v}");
        }
    }

    #[test]
    fn a_clock_that_jumps_back_restarts_the_window() {
        let mut velocity = VelocityEstimator::default();
        velocity.update(10.0, 0.0);
        assert_eq!(velocity.update(0.0, 5.0), 0.0);
    }
}
