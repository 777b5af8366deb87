//! The spectrum of columns that were sampled evenly, with samples missing, and its lines.

use crate::linear_algebra::SymmetricMatrix;
use crate::order_statistics::median;
use core::f64::consts::TAU;
use rustfft::FftPlannerScalar;
use rustfft::num_complex::Complex;

/// Zero padding: frequencies are told to a part of the resolution.
pub const PADDING: usize = 4;
/// A line stands out of its surroundings by this factor in power, averaged over columns.
const STANDS_OUT: f64 = 14.0;
/// Bins (before padding) on each side that make the surroundings.
const AROUND: usize = 60;
/// Most lines.
const LINES: usize = 3;
/// Lowest line in Hz.
const LEAST_HZ: f64 = 0.3;

/// A column that was sampled every `step_s`, with samples missing.
#[derive(Clone, Debug)]
pub struct SampledSignal<'a> {
    /// Instants in s.
    pub time_s: &'a [f64],
    /// What was sampled.
    pub values: Vec<f64>,
    /// Sampling step in s.
    pub step_s: f64,
}

/// Power over frequency, mean of several columns.
#[derive(Clone, Debug)]
pub struct PowerSpectrum {
    /// Width of a bin in Hz.
    pub bin_hz: f64,
    /// One-sided density per Hz, bin by bin from zero on.
    pub density: Vec<f64>,
    padding: usize,
}

impl PowerSpectrum {
    /// The power of columns of the first one's rate; what lies beyond six times the median of the sizes is cut off there.
    #[must_use]
    pub fn estimate(columns: &[SampledSignal], padding: usize) -> Self {
        let samples = |c: &SampledSignal| {
            let span_s = c.time_s.last().zip(c.time_s.first()).map_or(0.0, |(b, a)| b - a);
            // Long gaps are cut short: no line is worth so much memory.
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
            // On a regular grid: a sample that is missing tells nothing.
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
            // One-sided; the taper keeps three eighths of the power.
            let scale = 2.0 * step_s / (0.375 * n);
            density.iter_mut().zip(&buffer).for_each(|(p, c)| *p += c.norm_sqr() * scale);
            count += 1.0;
        }
        density.iter_mut().for_each(|p| *p /= f64::max(count, 1.0));
        Self { bin_hz: 1.0 / (size as f64 * step_s), density, padding }
    }

    /// For drawing: frequencies in Hz, and amplitudes per root of a Hz, smoothed to some hundred points.
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

    /// Frequencies (Hz) of its lines, strongest first.
    #[must_use]
    pub fn detect_tones(&self) -> Vec<f64> {
        let (bin_hz, power) = (self.bin_hz, &self.density);
        let around = AROUND * self.padding;
        let first = ((LEAST_HZ / bin_hz) as usize).max(1);
        let mut found: Vec<(f64, f64)> = Vec::new();
        let last = power.len().saturating_sub(1);
        let mut floor = 0.0;
        for k in first..last {
            if (k - first).is_multiple_of(around / 4) {
                let (lo, hi) = (k.saturating_sub(around), (k + around).min(last));
                floor = median(&mut power[lo..hi].to_vec());
            }
            if power[k] > STANDS_OUT * floor && power[k] > power[k - 1] && power[k] >= power[k + 1] {
                // The top of a parabola through the three.
                let (a, b, c) = (power[k - 1], power[k], power[k + 1]);
                let shift = 0.5 * (a - c) / (a - 2.0 * b + c);
                found.push((power[k] / floor.max(1e-300), (k as f64 + shift) * bin_hz));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Neighbours of a strong line are its own flanks.
        let mut out: Vec<f64> = Vec::new();
        for (_, hz) in found {
            if out.iter().all(|o| (o - hz).abs() > 8.0 * self.padding as f64 * bin_hz) && out.len() < LINES {
                out.push(hz);
            }
        }
        out
    }
}

/// Takes the sinusoid of this frequency (Hz) that fits best away from numbers `x` at instants `t` (s), of which those `used` tell it.
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
mod tests {
    use super::*;

    const HZ: f64 = 100.0;

    /// Columns of 100 Hz from the seventh second on.
    fn in_air(
        of: &[&dyn Fn(f64) -> f64],
        seconds: f64,
        keep: impl Fn(usize) -> bool,
    ) -> Vec<SampledSignal<'static>> {
        let kept: Vec<f64> =
            (0..(seconds * HZ) as usize).filter(|k| keep(*k)).map(|k| 7.0 + k as f64 / HZ).collect();
        let t: &'static [f64] = kept.leak();
        of.iter()
            .map(|f| SampledSignal { time_s: t, values: t.iter().map(|t| f(*t)).collect(), step_s: 1.0 / HZ })
            .collect()
    }

    fn wave(a: f64, hz: f64, phase: f64) -> impl Fn(f64) -> f64 {
        move |t| a * (std::f64::consts::TAU * hz * t + phase).sin()
    }

    fn noise(t: f64) -> f64 {
        nth(0, t)
    }

    /// Noise of one of several recordings: evenly within 0.01 of nothing (SplitMix64).
    fn nth(r: u64, t: f64) -> f64 {
        let seed = (t * 1e4).round() as u64 + 10_000_000 * r;
        let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        0.02 * (((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
    }

    /// Four recordings with noise of their own and the same beside it; their lines.
    fn of_four(f: &dyn Fn(f64) -> f64) -> Vec<f64> {
        let [a, b, c, d] = [0, 1, 2, 3].map(|r| move |t: f64| nth(r, t) + f(t));
        let data = in_air(&[&a, &b, &c, &d], 20.0, |_| true);
        PowerSpectrum::estimate(&data, PADDING).detect_tones()
    }

    /// Parseval: the one-sided density over all frequencies is the mean square, for a tone and for noise, also where the mean is over
    /// recordings of different power.
    #[test]
    fn the_power_of_a_residual_adds_up_to_its_mean_square() {
        let (tone, hiss, quiet) = (wave(0.3, 11.3, 0.4), |t: f64| 20.0 * noise(t), |_: f64| 0.0);
        let square = |f: &dyn Fn(f64) -> f64| {
            (0..2000).map(|k| f(7.0 + f64::from(k) / HZ).powi(2)).sum::<f64>() / 2000.0
        };
        let total = |forces: &[&dyn Fn(f64) -> f64], padding: usize| {
            let data = in_air(forces, 20.0, |_| true);
            let PowerSpectrum { bin_hz, density: p, .. } = PowerSpectrum::estimate(&data, padding);
            assert_eq!(p.len(), 1024 * padding);
            assert!((bin_hz * (2048 * padding) as f64 / HZ - 1.0).abs() < 1e-9);
            p.iter().sum::<f64>() * bin_hz
        };
        for padding in [1, 4] {
            assert!((total(&[&tone], padding) / square(&tone) - 1.0).abs() < 0.01);
            assert!((total(&[&hiss], padding) / square(&hiss) - 1.0).abs() < 0.15);
            assert!((total(&[&tone, &quiet], padding) / square(&tone) - 0.5).abs() < 0.01);
        }
        // A tone of which every fifth sample is missing has less, and a recording of another rate does not count.
        let data = in_air(&[&tone], 20.0, |k| k % 5 != 0);
        let PowerSpectrum { bin_hz, density: p, .. } = PowerSpectrum::estimate(&data, 1);
        let peak = (0..p.len()).max_by(|a, b| p[*a].total_cmp(&p[*b])).expect("a peak");
        assert!((peak as f64 * bin_hz - 11.3).abs() < bin_hz, "{}", peak as f64 * bin_hz);
    }

    /// A spectrum has room for the time from the first sample to the last, but no more than for twice the samples and one.
    #[test]
    fn long_gaps_take_no_more_room_than_the_samples() {
        let tone = wave(0.3, 11.3, 0.4);
        let bins = |seconds: f64, keep: &dyn Fn(usize) -> bool| {
            let data = in_air(&[&tone], seconds, keep);
            PowerSpectrum::estimate(&data, 1).density.len()
        };
        assert_eq!((bins(10.23, &|_| true), bins(10.26, &|_| true)), (512, 1024));
        // 512 samples beside a gap of a minute: 1025 places; 511 have 1023.
        assert_eq!(bins(70.0, &|k| !(256..7000 - 256).contains(&k)), 1024);
        assert_eq!(bins(70.0, &|k| !(256..7000 - 255).contains(&k)), 512);
    }

    #[test]
    fn a_recording_of_another_rate_has_no_part_in_the_spectrum() {
        let (tone, other) = (wave(0.3, 11.3, 0.4), wave(0.9, 31.0, 0.4));
        let data = in_air(&[&tone, &other], 20.0, |_| true);
        let alone_data = in_air(&[&tone], 20.0, |_| true);
        let one = PowerSpectrum::estimate(&alone_data, 1).density;
        for (by, counts) in [(1.009, true), (1.011, false)] {
            let mut columns = data.clone();
            columns[1].step_s *= by;
            let p = PowerSpectrum::estimate(&columns, 1).density;
            let same = p.iter().zip(&one).all(|(p, one)| (p - one).abs() <= 1e-9 * one);
            assert_eq!(!same, counts, "{by}");
        }
    }

    #[test]
    fn outlying_samples_are_cut_at_six_times_the_median() {
        let spike = |t: f64| if (t - 12.0).abs() < 0.004 { 900.0 } else { wave(0.3, 11.3, 0.4)(t) };
        let data = in_air(&[&spike], 20.0, |_| true);
        let PowerSpectrum { bin_hz, density: p, .. } = PowerSpectrum::estimate(&data, 1);
        let total = p.iter().sum::<f64>() * bin_hz;
        // One of 2000 samples of at most 6 * 0.22 adds little to a mean square of 0.045.
        assert!(total > 0.044 && total < 0.05, "{total}");
    }

    #[test]
    fn the_spectrum_that_is_drawn_is_the_root_of_means_over_bins() {
        let tone = wave(0.3, 11.3, 0.4);
        let data = in_air(&[&tone], 20.0, |_| true);
        let PowerSpectrum { bin_hz, density: p, .. } = PowerSpectrum::estimate(&data, 1);
        let (hz, amplitude) = PowerSpectrum::estimate(&data, 1).for_plot();
        // 1024 bins, two by two.
        assert_eq!(hz.len(), 512);
        for k in [0, 1, 57, 115, 116, 511] {
            assert!((hz[k] - (2.0 * k as f64 + 1.0) * bin_hz).abs() < 1e-9, "{k}: {}", hz[k]);
            assert!((amplitude[k] - (0.5 * (p[2 * k] + p[2 * k + 1])).sqrt()).abs() < 1e-12);
        }
        // A short one is drawn bin by bin.
        let data = in_air(&[&tone], 4.0, |_| true);
        assert_eq!(PowerSpectrum::estimate(&data, 1).for_plot().0.len(), 256);
    }

    #[test]
    fn lines_stand_where_the_tones_are_strongest_first() {
        let found = of_four(&|t| wave(0.02, 7.77, 0.3)(t) + wave(0.05, 23.41, 1.0)(t));
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0] - 23.41).abs() < 0.003 && (found[1] - 7.77).abs() < 0.003, "{found:?}");
        // Three at most.
        let found = of_four(&|t| {
            [3.1, 9.2, 17.3, 31.7, 44.0].map(|hz| wave(0.05 + 1e-3 * hz, hz, 0.2)(t)).iter().sum()
        });
        assert_eq!(found.iter().map(|hz| (10.0 * hz).round() / 10.0).collect::<Vec<_>>(), [44.0, 31.7, 17.3]);
        // Within eight bins before padding (0.39 Hz) a weaker one is the strong one's flank.
        for (apart, count) in [(0.36, 1), (0.44, 2)] {
            let found = of_four(&move |t| wave(0.05, 20.0, 0.2)(t) + wave(0.03, 20.0 + apart, 0.2)(t));
            assert_eq!(found.len(), count, "{apart}: {found:?}");
        }
        // Noise has none, nor has what is slower than the slowest line.
        assert!(of_four(&|_| 0.0).is_empty());
        let found = of_four(&wave(0.05, 0.5 * LEAST_HZ, 0.2));
        assert!(found.is_empty(), "{found:?}");
    }

    #[test]
    fn what_is_left_of_a_column_stands_at_right_angles_to_the_wave_taken_away() {
        let t = |k: usize| 0.013 * k as f64;
        let used = |k: usize| !(40..90).contains(&k);
        let whole: Vec<f64> = (0..300).map(|k| wave(0.3, 5.1, 0.4)(t(k)) + noise(t(k))).collect();
        let mut x = whole.clone();
        subtract_sinusoid(&mut x, t, used, 5.1);
        assert!(x.iter().all(|x| x.abs() < 0.013));
        for phase in [0.0, 0.5 * std::f64::consts::PI] {
            let dot: f64 =
                (0..300).filter(|k| used(*k)).map(|k| x[k] * (TAU * 5.1 * t(k) + phase).sin()).sum();
            assert!(dot.abs() < 1e-9, "{dot}");
        }
    }
}
