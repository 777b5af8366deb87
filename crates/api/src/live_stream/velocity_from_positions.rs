//! Velocity as the slope of the latest positions.
//!
//! The slope of a straight line through the window is the velocity at its middle, which lags a 10 Hz hand tremor by a tenth of a
//! period. A parabola gives the velocity at the end of the window with four times the noise; it is used where its curvature is
//! significant.

use std::collections::VecDeque;

/// Window in s: twenty intervals at 1 kHz, four at 200 Hz, and 0.5 ms of tolerance for jitter of the time stamps.
const WINDOW_S: f64 = 0.0205;
/// Limits on the number of samples in the window.
const MIN_SAMPLES: usize = 3;
const MAX_SAMPLES: usize = 512;
/// Least number of samples for a parabola: two more than it has coefficients.
const MIN_FOR_PARABOLA: usize = 5;
/// Standard deviations by which the curvature must differ from zero.
const CURVED_SDS: f64 = 4.0;
/// Number of windows over which the noise of the positions is averaged.
const NOISE_WINDOWS: f64 = 50.0;

/// Least-squares line or parabola through the latest positions.
#[derive(Clone, Debug, Default)]
pub(crate) struct VelocityEstimator {
    points: VecDeque<(f64, f64)>,
    /// Mean square of the positions about their parabolas, in m², and the number of windows in it.
    noise_m2: f64,
    windows: f64,
}

/// Polynomials through the points of a window, in terms of the time from their middle.
struct WindowFit {
    /// Slope of the line in m/s, which is the parabola's in the middle.
    slope: f64,
    /// Half the parabola's second derivative in m/s², and the sum of squares of its basis function.
    curvature: f64,
    curvature_weight: f64,
    /// Slope of that basis function at the last point, in s.
    end_slope: f64,
    /// Mean square of the points about the parabola in m²; zero of fewer than four points.
    residual_m2: f64,
    count: usize,
}

impl WindowFit {
    fn new(points: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let (mut count, mut t0, mut z0, mut last) = (0, 0.0, 0.0, 0.0);
        for (t, z) in points.clone() {
            count += 1;
            t0 += (t - t0) / f64::from(count);
            z0 += (z - z0) / f64::from(count);
            last = t;
        }
        let n = f64::from(count);
        let centred = points.map(|(t, z)| (t - t0, z - z0));
        let [tt, ttt, tz] =
            centred.clone().fold([0.0; 3], |[tt, ttt, tz], (t, z)| [tt + t * t, ttt + t * t * t, tz + t * z]);
        let slope = if tt > 0.0 { tz / tt } else { 0.0 };
        // t² without its parts along 1 and t.
        let skew = if tt > 0.0 { ttt / tt } else { 0.0 };
        let basis = |t: f64| t * t - skew * t - tt / n;
        let [qq, qz] =
            centred.clone().fold([0.0; 2], |[qq, qz], (t, z)| [qq + basis(t) * basis(t), qz + basis(t) * z]);
        let curvature = if qq > 0.0 { qz / qq } else { 0.0 };
        let rest: f64 = centred
            .map(|(t, z)| {
                let off = z - slope * t - curvature * basis(t);
                off * off
            })
            .sum();
        Self {
            slope,
            curvature,
            curvature_weight: qq,
            end_slope: 2.0 * (last - t0) - skew,
            residual_m2: if count > 3 { rest / (n - 3.0) } else { 0.0 },
            count: count as usize,
        }
    }
}

impl VelocityEstimator {
    /// Velocity in m/s at a new position (m); zero from fewer than two positions. The position is not added to the window; see
    /// [`Self::add`].
    pub(crate) fn at(&self, time_s: f64, position_m: f64) -> f64 {
        if self.points.back().is_none_or(|(before, _)| time_s <= *before) {
            return 0.0;
        }
        let skipped = self.surplus(time_s, self.points.len() + 1);
        let fit = WindowFit::new(self.points.iter().copied().skip(skipped).chain([(time_s, position_m)]));
        let size_m2 = fit.curvature * fit.curvature * fit.curvature_weight;
        let curved = fit.count >= MIN_FOR_PARABOLA
            && size_m2 > CURVED_SDS * CURVED_SDS * self.noise_m2.max(fit.residual_m2);
        if curved { fit.slope + fit.curvature * fit.end_slope } else { fit.slope }
    }

    /// Adds a position to the window.
    pub(crate) fn add(&mut self, time_s: f64, position_m: f64) {
        if self.points.back().is_some_and(|(before, _)| time_s <= *before) {
            self.points.clear();
        }
        self.points.push_back((time_s, position_m));
        self.points.drain(..self.surplus(time_s, self.points.len()));
        if self.points.len() >= MIN_FOR_PARABOLA {
            let fit = WindowFit::new(self.points.iter().copied());
            self.windows = (self.windows + 1.0).min(NOISE_WINDOWS);
            self.noise_m2 += (fit.residual_m2 - self.noise_m2) / self.windows;
        }
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

    /// Largest error of the velocity over a second at 200 Hz, for positions that are rounded to a micrometre.
    fn largest_error(position: impl Fn(f64) -> f64, speed: impl Fn(f64) -> f64) -> f64 {
        let mut velocity = VelocityEstimator::default();
        let mut largest: f64 = 0.0;
        for k in 0..200 {
            let t = f64::from(k) * 5e-3;
            let z = (position(t) * 1e6).round() * 1e-6;
            if k > 20 {
                largest = largest.max((velocity.at(t, z) - speed(t)).abs());
            }
            velocity.add(t, z);
        }
        largest
    }

    #[test]
    fn a_trembling_hand_is_followed_without_delay_and_a_steady_one_without_noise() {
        // 0.1 mm at 10 Hz: 6.3 mm/s, of which a line would be late by 3.7 mm/s.
        let w = core::f64::consts::TAU * 10.0;
        let trembling =
            largest_error(|t| 0.01 * t + 1e-4 * (w * t).sin(), |t| 0.01 + 1e-4 * w * (w * t).cos());
        assert!(trembling < 1.5e-3, "{trembling}");
        let steady = largest_error(|t| 0.0023 * t, |_| 0.0023);
        assert!(steady < 0.1e-3, "{steady}");
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
