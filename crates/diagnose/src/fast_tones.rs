//! Detects, fits and removes tones above the band of the block means, at the sampling rate.
//!
//! A mean over 20 ms removes 50 Hz and its multiples exactly and attenuates all tones above half the block rate, so tests on block means
//! take them for noise. The frequency of mains drifts, so amplitude and phase are fitted in windows of one second. The frequency and, if
//! the phase is stable, the amplitude are estimated from whole recordings, with the Cramér-Rao bounds of a sinusoid in noise (Rife and
//! Boorstyn 1974).

use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty};
use core::f64::consts::{PI, TAU};
use stylet_record::Recording;
use stylet_stats::golden_section;
use stylet_stats::order_statistics::median_of;
use stylet_stats::parallel::*;
use stylet_stats::spectrum::{PADDING, PowerSpectrum, SampledSignal};

/// Length (s) of the windows in which amplitude and phase are assumed constant.
const WINDOW_S: f64 = 1.0;
/// Largest number of tones that are removed.
const MAX_TONES: usize = 6;
/// Ratio of a spectral peak to the median around it from which it is tested as a tone.
const MIN_POWER_RATIO: f64 = 8.0;
/// Half width of the range of that median, in frequency resolutions.
const SURROUNDING_RESOLUTIONS: usize = 60;
/// Smallest amplitude, in standard deviations of the samples within their blocks; smaller tones are negligible.
const MIN_AMPLITUDE_SD: f64 = 0.15;
/// Share of a tone's power that is coherent over whole recordings from which its phase counts as stable.
const MIN_COHERENCE: f64 = 0.9;
/// Largest deviation of a recording's phase from the common phase, in standard deviations.
const PHASE_AGREEMENT_SD: f64 = 4.0;

/// Deviation, in median absolute deviations, from which a sample belongs to a rupture or a velocity jump; the peak of a tone is at 1.4.
const MAX_DEVIATION: f64 = 8.0;

/// A value with its standard deviation.
pub(crate) type WithSd = (f64, f64);

/// A tone that was removed.
#[derive(Clone, Debug)]
pub(crate) struct FastTone {
    /// Frequency in Hz.
    pub frequency_hz: WithSd,
    /// Amplitude in N of a sinusoid with the same mean square.
    pub amplitude_n: WithSd,
    /// Phase at time zero in rad. If recordings differ: that of the first one, with infinite standard deviation.
    pub phase_rad: WithSd,
    /// Gain of its removal in nats, after the penalty of its parameters.
    pub gain_nats: f64,
}

/// High-frequency part of the samples of one recording.
struct Samples<'a> {
    time_s: &'a [f64],
    step_s: f64,
    /// Deviation from the moving average; 0 for excluded samples.
    fast_n: Vec<f64>,
    used: Vec<bool>,
    /// Number of samples of the moving average.
    length: usize,
}

/// Removes tones above half the rate of blocks of `block_s` (s) from the forces; samples marked in `exclude` are not used.
pub(crate) fn remove_fast_tones(
    recordings: &mut [Recording],
    exclude: &[Vec<bool>],
    block_s: f64,
) -> Vec<FastTone> {
    let step_s = recordings.iter().map(median_step_s).next().unwrap_or(block_s);
    let per_block = ((block_s / step_s).round() as usize).max(1);
    if per_block < 2 {
        return Vec::new();
    }
    let lowest_hz = 0.5 / (per_block as f64 * step_s);
    let mut tones: Vec<FastTone> = Vec::new();
    while tones.len() < MAX_TONES {
        let samples: Vec<Samples> = recordings
            .par_iter()
            .zip(exclude)
            .map(|(r, x)| Samples::new(r, x, 2 * per_block + 1))
            .into_iter()
            .filter(|s| (s.step_s / step_s - 1.0).abs() < 0.01)
            .collect();
        let Some((tone, waves)) = strongest_tone(&samples, lowest_hz) else { break };
        let mut waves = waves.into_iter();
        for r in recordings.iter_mut().filter(|r| (median_step_s(r) / step_s - 1.0).abs() < 0.01) {
            if let Some(wave) = waves.next() {
                r.force_n.iter_mut().zip(wave).for_each(|(f, w)| *f -= w);
            }
        }
        tones.push(tone);
    }
    tones
}

fn median_step_s(r: &Recording) -> f64 {
    median_of(r.time_s.windows(2).map(|w| w[1] - w[0])).max(1e-9)
}

/// Fit of a sinusoid in a range of samples.
struct Sinusoid {
    /// Coefficient of the sine (N).
    sine: f64,
    /// Coefficient of the cosine (N).
    cosine: f64,
    /// Explained sum of squares (N²): about half the squared amplitude per sample. Close to half the sampling rate, one column is nearly zero,
    /// and its coefficient says nothing about the power.
    explained: f64,
    /// Number of samples used.
    count: f64,
}

impl<'a> Samples<'a> {
    fn new(r: &'a Recording, exclude: &[bool], length: usize) -> Self {
        let n = r.len();
        let used: Vec<bool> = (0..n).map(|k| !exclude.get(k).copied().unwrap_or(false)).collect();
        let mut sums = Vec::with_capacity(n + 1);
        sums.push(0.0);
        r.force_n.iter().for_each(|f| sums.push(sums.last().copied().unwrap_or(0.0) + f));
        let fast_n = (0..n)
            .map(|k| {
                // The window is symmetric, so that a slope cancels.
                let half = (length / 2).min(k).min(n - 1 - k);
                let (lo, hi) = (k - half, k + half + 1);
                if used[k] { r.force_n[k] - (sums[hi] - sums[lo]) / (hi - lo) as f64 } else { 0.0 }
            })
            .collect();
        let mut samples = Self { time_s: &r.time_s, step_s: median_step_s(r), fast_n, used, length };
        samples.exclude_steps();
        samples
    }

    /// Excludes samples around ruptures and velocity jumps.
    fn exclude_steps(&mut self) {
        let limit_n = MAX_DEVIATION * median_of(self.fast_n.iter().map(|x| x.abs()));
        let steps: Vec<usize> = (0..self.fast_n.len()).filter(|k| self.fast_n[*k].abs() > limit_n).collect();
        for k in steps {
            let (lo, hi) =
                (k.saturating_sub(self.length / 2), (k + self.length / 2 + 1).min(self.fast_n.len()));
            self.used[lo..hi].fill(false);
            self.fast_n[lo..hi].fill(0.0);
        }
    }

    /// Share of a tone's amplitude that remains after subtraction of the moving average.
    fn response(&self, hz: f64) -> f64 {
        let half = PI * hz * self.step_s;
        let n = self.length as f64;
        let below = libm::sin(half);
        let kept = if below.abs() < 1e-9 { 1.0 } else { libm::sin(n * half) / (n * below) };
        1.0 - kept
    }

    /// Least-squares fit of a sinusoid over a range of samples, corrected for the subtracted moving average.
    fn sinusoid(&self, hz: f64, range: std::ops::Range<usize>) -> Sinusoid {
        let (mut ss, mut sc, mut cc, mut s, mut c, mut n) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for k in range.filter(|k| self.used[*k]) {
            let (a, b) = libm::sincos(TAU * hz * self.time_s[k]);
            (ss, sc, cc) = (ss + a * a, sc + a * b, cc + b * b);
            (s, c, n) = (s + a * self.fast_n[k], c + b * self.fast_n[k], n + 1.0);
        }
        // Ridge, because at half the sampling rate only one of both columns is determined.
        let ridge = 1e-3 * n;
        let det = (ss + ridge) * (cc + ridge) - sc * sc;
        if det <= 0.0 {
            return Sinusoid { sine: 0.0, cosine: 0.0, explained: 0.0, count: n };
        }
        let response = self.response(hz);
        let share = (1.0 + 2.0 * ridge / f64::max(n, 1.0)) / response;
        let sine = share * ((cc + ridge) * s - sc * c) / det;
        let cosine = share * ((ss + ridge) * c - sc * s) / det;
        Sinusoid { sine, cosine, explained: (sine * s + cosine * c) / response, count: n }
    }

    /// Ranges of samples of about one second.
    fn windows(&self) -> Vec<std::ops::Range<usize>> {
        let n = self.fast_n.len();
        let count = ((n as f64 * self.step_s / WINDOW_S).round() as usize).max(1);
        (0..count).map(|w| w * n / count..(w + 1) * n / count).collect()
    }

    fn duration_s(&self) -> f64 {
        self.time_s.last().zip(self.time_s.first()).map_or(0.0, |(b, a)| b - a)
    }

    fn mid_s(&self) -> f64 {
        self.time_s.last().zip(self.time_s.first()).map_or(0.0, |(b, a)| 0.5 * (a + b))
    }
}

/// Sum of squares (N²) that one frequency explains in all recordings, each with its own phase.
fn power(samples: &[Samples], hz: f64) -> f64 {
    samples.par_iter().map(|s| s.sinusoid(hz, 0..s.fast_n.len()).explained).into_iter().sum()
}

/// The strongest significant tone from `lowest_hz` on, and its force (N) in every recording.
fn strongest_tone(samples: &[Samples], lowest_hz: f64) -> Option<(FastTone, Vec<Vec<f64>>)> {
    let columns: Vec<SampledSignal> = samples
        .iter()
        .map(|s| SampledSignal { time_s: s.time_s, values: s.fast_n.clone(), step_s: s.step_s })
        .collect();
    let spectrum = PowerSpectrum::estimate(&columns, PADDING);
    let (peak, floor) = spectral_peak(&spectrum, lowest_hz)?;
    let first = samples.first()?;
    let hz = refined(samples, peak as f64 * spectrum.bin_hz, spectrum.bin_hz, 0.5 / first.step_s);
    // The one-sided density of white noise is twice variance times step. The median of a mean of exponential variables is below its mean
    // (Wilson and Hilferty 1931).
    let to_mean = (1.0 - 1.0 / (9.0 * samples.len() as f64)).powi(3);
    let variance = floor / to_mean / (2.0 * first.step_s) / first.response(hz).powi(2);
    let bins = spectrum.density.len() as f64 / PADDING as f64;
    let (tone, waves) = fitted(samples, hz, variance.max(f64::MIN_POSITIVE));
    let within = stylet_stats::MAD_TO_SD * median_of(first.fast_n.iter().map(|x| x.abs()));
    let noise_sd = within.min(variance.sqrt());
    let needed = MIN_GAIN_NATS + libm::log(bins.max(1.0));
    (tone.gain_nats > needed && tone.amplitude_n.0 > MIN_AMPLITUDE_SD * noise_sd).then_some((tone, waves))
}

/// Bin with the largest ratio of power to the median around it, and this median; `None` if no ratio is large enough.
fn spectral_peak(spectrum: &PowerSpectrum, lowest_hz: f64) -> Option<(usize, f64)> {
    let power = &spectrum.density;
    let first = (lowest_hz / spectrum.bin_hz).ceil() as usize;
    let around = SURROUNDING_RESOLUTIONS * PADDING;
    let mut best: Option<(usize, f64)> = None;
    let mut floor = 0.0;
    for k in first..power.len() {
        if (k - first).is_multiple_of(around / 4) {
            let (lo, hi) = (k.saturating_sub(around).max(first.min(k)), (k + around).min(power.len()));
            floor = median_of(power[lo..hi].iter().copied());
        }
        let ratio = power[k] / floor.max(f64::MIN_POSITIVE);
        if ratio > MIN_POWER_RATIO && best.is_none_or(|(b, f)| ratio > power[b] / f) {
            best = Some((k, floor));
        }
    }
    best
}

/// Frequency (Hz) of the largest power within a bin of a peak, by golden section.
fn refined(samples: &[Samples], hz: f64, bin_hz: f64, highest_hz: f64) -> f64 {
    /// Steps of the golden section, which locate the maximum to 1e-5 of a bin.
    const ITERATIONS: usize = 24;
    golden_section(|hz| -power(samples, hz), (hz - bin_hz, (hz + bin_hz).min(highest_hz)), ITERATIONS)
}

/// Fits a tone of one frequency in noise of `variance` (N²) per sample; returns it and its force in every recording.
fn fitted(samples: &[Samples], hz: f64, variance: f64) -> (FastTone, Vec<Vec<f64>>) {
    let mut waves = Vec::with_capacity(samples.len());
    let (mut window_power, mut stable_power, mut all, mut windows) = (0.0, 0.0, 0.0, 0.0);
    let (mut information, mut frequency_information, mut mid) = (0.0, 0.0, 0.0);
    let mut steps: Vec<f64> = Vec::new();
    let mut phases: Vec<WithSd> = Vec::new();
    for s in samples {
        let mut wave = vec![0.0; s.fast_n.len()];
        let mut before: Option<[f64; 2]> = None;
        for range in s.windows() {
            let Sinusoid { sine: a, cosine: b, explained, .. } = s.sinusoid(hz, range.clone());
            window_power += explained;
            windows += 1.0;
            if let Some([p, q]) = before.replace([a, b]) {
                let turned = libm::atan2(b * p - a * q, a * p + b * q);
                steps.push(turned / (TAU * WINDOW_S));
            }
            for k in range {
                let (sine, cosine) = libm::sincos(TAU * hz * s.time_s[k]);
                wave[k] = a * sine + b * cosine;
            }
        }
        waves.push(wave);
        let Sinusoid { sine, cosine, explained, count: n } = s.sinusoid(hz, 0..s.fast_n.len());
        (stable_power, all) = (stable_power + explained, all + n);
        (information, mid) = (information + n, mid + n * s.mid_s());
        frequency_information += n * s.duration_s().powi(2);
        phases.push((libm::atan2(cosine, sine), (variance / explained.max(f64::MIN_POSITIVE)).sqrt()));
    }
    let recordings = samples.len() as f64;
    let (window_nats, stable_nats) = (0.5 * window_power / variance, 0.5 * stable_power / variance);
    let count = all.max(2.0) as usize;
    let penalty = |of: f64| bic_penalty((2.0 * of) as usize + 1, count);
    let gain_nats = (window_nats - penalty(windows)).max(stable_nats - penalty(recordings));
    // Two coefficients fitted to noise gain one nat.
    let is_stable = stable_nats - recordings > MIN_COHERENCE * (window_nats - windows);
    let nats = if is_stable { stable_nats - recordings } else { window_nats - windows };
    let amplitude = (4.0 * variance * nats.max(0.0) / f64::max(all, 1.0)).sqrt();
    let amplitude_sd = (2.0 * variance / information.max(1.0)).sqrt();
    let bound =
        (6.0 * variance / (PI * PI * amplitude * amplitude * frequency_information).max(1e-300)).sqrt();
    let frequency_sd = if is_stable {
        bound
    } else {
        /// Number of neighbouring windows that count as one, because the frequency drifts slowly.
        const DEPENDENT_WINDOWS: f64 = 10.0;
        let scatter = stylet_stats::sd(&steps);
        bound.max(scatter * (DEPENDENT_WINDOWS / steps.len().max(1) as f64).sqrt())
    };
    let relative =
        libm::hypot(amplitude_sd / amplitude.max(1e-300), TAU * mid / information.max(1.0) * frequency_sd);
    let phase_rad = common_phase(&phases)
        .filter(|_| is_stable)
        .map_or_else(|| (phases.first().map_or(0.0, |p| p.0), f64::INFINITY), |phase| (phase, relative));
    let tone = FastTone {
        frequency_hz: (hz, frequency_sd),
        amplitude_n: (amplitude, amplitude_sd),
        phase_rad,
        gain_nats,
    };
    (tone, waves)
}

/// Common phase of the recordings; `None` if they disagree.
fn common_phase(phases: &[WithSd]) -> Option<f64> {
    let (mut s, mut c) = (0.0, 0.0);
    for (phase, sd) in phases {
        let weight = 1.0 / (sd * sd).max(1e-12);
        let (a, b) = libm::sincos(*phase);
        (s, c) = (s + weight * a, c + weight * b);
    }
    let mean = libm::atan2(s, c);
    let off = |phase: f64| libm::remainder(phase - mean, TAU).abs();
    phases.iter().all(|(phase, sd)| off(*phase) < PHASE_AGREEMENT_SD * sd.max(0.02)).then_some(mean)
}

#[cfg(test)]
mod tests;
