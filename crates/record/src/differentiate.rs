//! Velocity from position on irregular time stamps.
//!
//! The velocity at a sample is the slope of the least-squares line through all samples within `+-h` (half-width) of its time
//! stamp. For evenly spaced samples this is the Savitzky-Golay derivative of order 1; on irregular time stamps it
//! is unbiased for constant velocity.
//!
//! With `x = 2 pi f h`, a sinusoidal motion of frequency `f` is multiplied by `3 (sin x - x cos x) / x^3`, without
//! phase lag:
//!
//! | `h` | -1 % at | -3 dB at | velocity noise per position noise, 100 Hz | 200 Hz | 1 kHz |
//! |---|---|---|---|---|---|
//! | 20 ms | 2.5 Hz | 14.4 Hz | 31.6 /s | 25.8 /s | 13.2 /s |
//! | **50 ms** (default) | 1.0 Hz | 5.8 Hz | 9.5 /s | 7.2 /s | 3.4 /s |
//! | 100 ms | 0.5 Hz | 2.9 Hz | 3.6 /s | 2.6 /s | 1.2 /s |
//!
//! (`the_gain_of_sinusoids_is_as_documented`, `the_noise_gain_is_as_documented`.)
//! For `n` samples at interval `T` within the window the noise gain is `1/sqrt(sum tau^2)`, about
//! `sqrt(3 T / (2 h^3))`. 10 um of encoder noise at 200 Hz give 0.07 mm/s: 3 % of an insertion at 2.3 mm/s.
//!
//! Limits. In the first and last `h` of a recording (and next to gaps) the window is one-sided and the slope is that of its
//! middle, with an error of up to `h/2` times the acceleration. Changes of speed are smeared over `+-h`. A window with fewer
//! than three samples is extended by one neighbour on each side, across gaps if necessary.

use std::collections::VecDeque;

/// Default half-width of the window (s).
///
/// Insertions are slow (sinusoids of 0.0167 Hz, constant speeds, ripples of about 1 Hz), so that a bandwidth of 5.8 Hz is
/// enough, while velocity noise directly increases the error of friction estimates.
pub const DEFAULT_HALF_WIDTH_S: f64 = 0.05;

/// Tolerance of the window for rounded time stamps, as a share of the half-width.
const EDGE_TOLERANCE: f64 = 1e-6;

/// The slope of `position_m` over `time_s` at each sample (m/s), over windows of `+-half_width_s`; see the
/// [module](self) for bandwidth and noise.
///
/// `time_s` must strictly increase and be as long as `position_m` (the shorter length counts). Fewer than two samples give
/// zeros. The time is proportional to the number of samples and independent of the width.
pub fn differentiate(time_s: &[f64], position_m: &[f64], half_width_s: f64) -> Vec<f64> {
    let mut velocity_mps = Vec::with_capacity(time_s.len().min(position_m.len()));
    let mut slopes = SlopeFilter::new(half_width_s);
    for (time_s, position_m) in time_s.iter().zip(position_m) {
        slopes.push(*time_s, *position_m, |v| velocity_mps.push(v));
    }
    slopes.finish(|v| velocity_mps.push(v));
    velocity_mps
}

/// [`differentiate`] sample by sample, with one window in memory. The slope at a sample is emitted as soon as a sample after
/// its window was added.
#[derive(Debug, Clone)]
pub(crate) struct SlopeFilter {
    reach_s: f64,
    /// Samples from the first of the window, or the one before its centre, to the latest.
    buffer: VecDeque<(f64, f64)>,
    /// Index of the first buffered sample.
    from: usize,
    /// The window, and the sample whose slope is next.
    first: usize,
    end: usize,
    centre: usize,
    sums: Sums,
    steps_since_anchor: usize,
}

impl SlopeFilter {
    pub(crate) fn new(half_width_s: f64) -> Self {
        Self {
            reach_s: half_width_s * (1.0 + EDGE_TOLERANCE),
            buffer: VecDeque::new(),
            from: 0,
            first: 0,
            end: 0,
            centre: 0,
            sums: Sums::anchored_at(0.0, 0.0),
            steps_since_anchor: 0,
        }
    }

    /// Adds a sample; `emit` receives the slopes whose window is complete.
    #[inline]
    pub(crate) fn push(&mut self, time_s: f64, position_m: f64, mut emit: impl FnMut(f64)) {
        if self.end == 0 {
            self.sums = Sums::anchored_at(time_s, position_m);
        }
        self.buffer.push_back((time_s, position_m));
        while self.end > self.centre && time_s - self.at(self.centre).0 > self.reach_s {
            emit(self.slope());
        }
        self.sums.add(time_s, position_m);
        self.end += 1;
    }

    /// Emits the remaining slopes.
    pub(crate) fn finish(mut self, mut emit: impl FnMut(f64)) {
        if self.end == 1 {
            return emit(0.0);
        }
        while self.centre < self.end {
            emit(self.slope());
        }
    }

    fn at(&self, sample: usize) -> (f64, f64) {
        self.buffer[sample - self.from]
    }

    /// The slope at the centre, whose window is complete; advances the centre.
    #[inline]
    fn slope(&mut self) -> f64 {
        let now_s = self.at(self.centre).0;
        while self.first < self.centre && now_s - self.at(self.first).0 > self.reach_s {
            let (time_s, position_m) = self.at(self.first);
            self.sums.remove(time_s, position_m);
            self.first += 1;
        }
        // Running sums lose accuracy as the window moves away from their anchor: recompute them every half window.
        self.steps_since_anchor += 1;
        if 2 * self.steps_since_anchor >= self.end - self.first {
            self.sums = self.sums_over(self.first, self.end);
            self.steps_since_anchor = 0;
        }
        let slope = if self.end - self.first >= 3 {
            self.sums.slope()
        } else {
            let newest = self.from + self.buffer.len();
            self.sums_over(self.centre.saturating_sub(1), (self.centre + 2).min(newest)).slope()
        };
        self.centre += 1;
        // The sample before the next centre is kept for extended windows.
        while self.from < self.first.min(self.centre - 1) {
            self.buffer.pop_front();
            self.from += 1;
        }
        slope
    }

    fn sums_over(&self, first: usize, end: usize) -> Sums {
        let (anchor_s, anchor_m) = self.at(self.centre);
        let mut sums = Sums::anchored_at(anchor_s, anchor_m);
        for (time_s, position_m) in self.buffer.range(first - self.from..end - self.from) {
            sums.add(*time_s, *position_m);
        }
        sums
    }
}

/// Moments of the samples in a window, relative to an anchor inside or near it.
#[derive(Debug, Clone, Copy)]
struct Sums {
    anchor_s: f64,
    anchor_m: f64,
    n: f64,
    t: f64,
    tt: f64,
    z: f64,
    tz: f64,
}

impl Sums {
    fn anchored_at(anchor_s: f64, anchor_m: f64) -> Self {
        Self { anchor_s, anchor_m, n: 0.0, t: 0.0, tt: 0.0, z: 0.0, tz: 0.0 }
    }

    fn add(&mut self, time_s: f64, position_m: f64) {
        let (t, z) = (time_s - self.anchor_s, position_m - self.anchor_m);
        self.n += 1.0;
        self.t += t;
        self.tt += t * t;
        self.z += z;
        self.tz += t * z;
    }

    fn remove(&mut self, time_s: f64, position_m: f64) {
        let (t, z) = (time_s - self.anchor_s, position_m - self.anchor_m);
        self.n -= 1.0;
        self.t -= t;
        self.tt -= t * t;
        self.z -= z;
        self.tz -= t * z;
    }

    fn slope(&self) -> f64 {
        (self.n * self.tz - self.t * self.z) / (self.n * self.tt - self.t * self.t)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// Deterministic numbers in -0.5..0.5 (a multiplicative congruential generator).
    fn scatter(count: usize) -> Vec<f64> {
        let mut state: u64 = 0x9E37_79B9_7F4A_7C15;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..count).map(|_| next()).collect()
    }

    fn times(count: usize, interval_s: f64) -> Vec<f64> {
        (0..count).map(|i| i as f64 * interval_s).collect()
    }

    /// Root mean square of the derivative of `sin(2 pi f t)` over that of the exact one, edges left out.
    fn gain(frequency_hz: f64, half_width_s: f64) -> f64 {
        let time_s = times(40_000, 0.001);
        let position_m: Vec<f64> = time_s.iter().map(|t| (TAU * frequency_hz * t).sin()).collect();
        let velocity = differentiate(&time_s, &position_m, half_width_s);
        let square = |values: &[f64]| values[500..39_500].iter().map(|v| v * v).sum::<f64>();
        let exact: Vec<f64> =
            time_s.iter().map(|t| TAU * frequency_hz * (TAU * frequency_hz * t).cos()).collect();
        (square(&velocity) / square(&exact)).sqrt()
    }

    #[test]
    fn constant_velocity_is_exact_at_irregular_samples() {
        let jitter = scatter(5000);
        let time_s: Vec<f64> =
            jitter.iter().enumerate().map(|(i, j)| 1e4 + 0.005 * (i as f64 + 0.9 * j)).collect();
        let position_m: Vec<f64> = time_s.iter().map(|t| 0.0023 * (t - 1e4) - 0.005).collect();
        for speed in differentiate(&time_s, &position_m, DEFAULT_HALF_WIDTH_S) {
            assert!((speed - 0.0023).abs() < 1e-11, "{speed}");
        }
    }

    #[test]
    fn the_gain_of_sinusoids_is_as_documented() {
        for (half_width_s, one_percent_hz, half_power_hz) in
            [(0.02, 2.5, 14.4), (0.05, 1.0, 5.8), (0.1, 0.5, 2.9)]
        {
            assert!(
                (gain(one_percent_hz, half_width_s) - 0.99).abs() < 2e-3,
                "{}",
                gain(one_percent_hz, half_width_s)
            );
            assert!(
                (gain(half_power_hz, half_width_s) - 0.5_f64.sqrt()).abs() < 0.03,
                "{}",
                gain(half_power_hz, half_width_s)
            );
        }
    }

    #[test]
    fn the_noise_gain_is_as_documented() {
        let position_m = scatter(200_000);
        let sd = |values: &[f64]| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        for (half_width_s, gains) in
            [(0.02, [31.6, 25.8, 13.2]), (0.05, [9.5, 7.2, 3.4]), (0.1, [3.6, 2.6, 1.2])]
        {
            for (interval_s, documented) in [0.01, 0.005, 0.001].into_iter().zip(gains) {
                let velocity = differentiate(&times(200_000, interval_s), &position_m, half_width_s);
                let found = sd(&velocity[200..199_800]) / sd(&position_m);
                assert!((found / documented - 1.0).abs() < 0.05, "{half_width_s} {interval_s}: {found} /s");
            }
        }
    }

    #[test]
    fn running_sums_equal_a_direct_fit_of_each_window() {
        let jitter = scatter(3000);
        let mut time_s: Vec<f64> =
            jitter.iter().enumerate().map(|(i, j)| 0.002 * (i as f64 + 0.9 * j)).collect();
        time_s.iter_mut().skip(1500).for_each(|t| *t += 0.7);
        let position_m: Vec<f64> =
            time_s.iter().zip(&jitter).map(|(t, j)| 0.05 * (3.0 * t).sin() + 1e-4 * j).collect();
        let fast = differentiate(&time_s, &position_m, 0.05);
        for centre in 0..time_s.len() {
            let first = time_s.partition_point(|&t| time_s[centre] - t > 0.05 * (1.0 + EDGE_TOLERANCE));
            let end = time_s.partition_point(|&t| t - time_s[centre] <= 0.05 * (1.0 + EDGE_TOLERANCE));
            let mut direct = Sums::anchored_at(time_s[centre], position_m[centre]);
            (first..end).for_each(|k| direct.add(time_s[k], position_m[k]));
            let direct = direct.slope();
            assert!((fast[centre] - direct).abs() < 1e-11, "{centre}: {} {direct}", fast[centre]);
        }
    }

    #[test]
    fn sparse_windows_are_extended_to_their_neighbours() {
        let time_s = times(10, 1.0);
        let position_m: Vec<f64> = time_s.iter().map(|t| 0.001 * t).collect();
        assert!(differentiate(&time_s, &position_m, 0.05).iter().all(|v| (v - 0.001).abs() < 1e-15));
        assert_eq!(differentiate(&[0.0, 2.0], &[0.0, 1.0], 0.05), vec![0.5, 0.5]);
        assert_eq!(differentiate(&[0.0], &[1.0], 0.05), vec![0.0]);
    }
}
