//! Power spectrum of evenly sampled signals with missing samples, and detection of tones.

use crate::linear_algebra::SymmetricMatrix;
use crate::order_statistics::median;
use core::f64::consts::TAU;
use rustfft::FftPlannerScalar;
use rustfft::num_complex::Complex;

/// Zero-padding factor for detection of tones to a fraction of the frequency resolution.
pub const PADDING: usize = 4;
/// Power of a tone over the median of its surroundings, averaged over signals.
const MIN_TONE_RATIO: f64 = 14.0;
/// Bins (before padding) on each side that are the surroundings.
const SURROUNDING_BINS: usize = 60;
/// Most tones.
const MAX_TONES: usize = 3;
/// Lowest frequency of a tone in Hz.
const MIN_TONE_HZ: f64 = 0.3;

/// A signal sampled every `step_s`, possibly with missing samples.
#[derive(Clone, Debug)]
pub struct SampledSignal<'a> {
    /// Time stamps in s.
    pub time_s: &'a [f64],
    /// Values.
    pub values: Vec<f64>,
    /// Sampling step in s.
    pub step_s: f64,
}

/// Power spectral density, mean of several signals.
#[derive(Clone, Debug)]
pub struct PowerSpectrum {
    /// Width of a bin in Hz.
    pub bin_hz: f64,
    /// One-sided density per Hz, bin by bin from zero on.
    pub density: Vec<f64>,
    padding: usize,
}

impl PowerSpectrum {
    /// Hann-tapered periodogram, averaged over the signals that have the rate of the first one. Values are clipped at six
    /// times their median size.
    #[must_use]
    pub fn estimate(columns: &[SampledSignal], padding: usize) -> Self {
        let samples = |c: &SampledSignal| {
            let span_s = c.time_s.last().zip(c.time_s.first()).map_or(0.0, |(b, a)| b - a);
            // Long gaps are shortened to limit memory.
            ((span_s / c.step_s) as usize + 1).min(2 * c.time_s.len() + 1)
        };
        let longest = columns.iter().map(samples).max().unwrap_or(0);
        let size = (longest * padding).next_power_of_two();
        let mut density = vec![0.0; size / 2];
        let mut planner = FftPlannerScalar::new();
        let fft = planner.plan_fft_forward(size);
        let step_s = columns.first().map_or(1.0, |c| c.step_s);
        let mut count = 0.0;
        for c in columns {
            if c.values.is_empty() || (c.step_s / step_s - 1.0).abs() > 0.01 {
                continue;
            }
            let mut sizes: Vec<f64> = c.values.iter().map(|x| x.abs()).collect();
            let limit = 6.0 * median(&mut sizes).max(1e-9);
            // On a regular grid, with zeros for missing samples.
            let first = c.time_s.first().copied().unwrap_or(0.0);
            let place = |k: usize| ((c.time_s[k] - first) / c.step_s).round() as usize;
            let n = c.values.len() as f64;
            let long = (place(c.values.len() - 1) + 1).min(size) as f64;
            let mut buffer = vec![Complex::new(0.0, 0.0); size];
            for (k, x) in c.values.iter().enumerate() {
                if let Some(slot) = buffer.get_mut(place(k)) {
                    let taper = 0.5 - 0.5 * libm::cos(TAU * (place(k) as f64 + 0.5) / long);
                    *slot = Complex::new(taper * x.clamp(-limit, limit), 0.0);
                }
            }
            fft.process(&mut buffer);
            // One-sided; the Hann taper keeps three eighths of the power.
            let scale = 2.0 * step_s / (0.375 * n);
            density.iter_mut().zip(&buffer).for_each(|(p, c)| *p += c.norm_sqr() * scale);
            count += 1.0;
        }
        density.iter_mut().for_each(|p| *p /= f64::max(count, 1.0));
        Self { bin_hz: 1.0 / (size as f64 * step_s), density, padding }
    }

    /// For plots: frequencies in Hz and amplitude spectral density, averaged to some hundred points.
    #[must_use]
    pub fn for_plot(&self) -> (Vec<f64>, Vec<f64>) {
        const POINTS: usize = 400;
        let wide = (self.density.len() / POINTS).max(1);
        self.density
            .chunks(wide)
            .enumerate()
            .map(|(k, c)| {
                let hz = (k as f64 + 0.5) * wide as f64 * self.bin_hz;
                (hz, (c.iter().sum::<f64>() / c.len() as f64).sqrt())
            })
            .unzip()
    }

    /// Frequencies (Hz) of its tones, strongest first.
    #[must_use]
    pub fn detect_tones(&self) -> Vec<f64> {
        let (bin_hz, power) = (self.bin_hz, &self.density);
        let around = SURROUNDING_BINS * self.padding;
        let first = ((MIN_TONE_HZ / bin_hz) as usize).max(1);
        let mut found: Vec<(f64, f64)> = Vec::new();
        let last = power.len().saturating_sub(1);
        let mut floor = 0.0;
        for k in first..last {
            if (k - first).is_multiple_of(around / 4) {
                let (lo, hi) = (k.saturating_sub(around), (k + around).min(last));
                floor = median(&mut power[lo..hi].to_vec());
            }
            if power[k] > MIN_TONE_RATIO * floor && power[k] > power[k - 1] && power[k] >= power[k + 1] {
                // Maximum of a parabola through three bins.
                let (a, b, c) = (power[k - 1], power[k], power[k + 1]);
                let shift = 0.5 * (a - c) / (a - 2.0 * b + c);
                found.push((power[k] / floor.max(1e-300), (k as f64 + shift) * bin_hz));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Neighbours of a strong tone are its side lobes.
        let mut out: Vec<f64> = Vec::new();
        for (_, hz) in found {
            if out.iter().all(|o| (o - hz).abs() > 8.0 * self.padding as f64 * bin_hz)
                && out.len() < MAX_TONES
            {
                out.push(hz);
            }
        }
        out
    }
}

/// Subtracts the best-fitting sinusoid of frequency `hz` from `x` at the time stamps `t` (s), fitted to the samples `used`.
pub fn subtract_sinusoid(x: &mut [f64], t: impl Fn(usize) -> f64, used: impl Fn(usize) -> bool, hz: f64) {
    let wave: Vec<(f64, f64)> = (0..x.len()).map(|k| libm::sincos(TAU * hz * t(k))).collect();
    let (mut h, mut g) = (SymmetricMatrix::zeros(2), [0.0; 2]);
    for (k, (s, c)) in wave.iter().enumerate().filter(|(k, _)| used(*k)) {
        h.add(0, 0, s * s);
        h.add(1, 0, s * c);
        h.add(1, 1, c * c);
        g[0] += s * x[k];
        g[1] += c * x[k];
    }
    let of = h.cholesky().solve(&g);
    x.iter_mut().zip(&wave).for_each(|(x, (s, c))| *x -= of[0] * s + of[1] * c);
}

#[cfg(test)]
mod tests;
