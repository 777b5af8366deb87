//! Lines of the residual's spectrum, at the recordings' own rate.

use rustfft::FftPlannerScalar;
use rustfft::num_complex::Complex;
use stylet_identify::blocks::Blocks;
use stylet_identify::fit::Fit;
use stylet_identify::linear::Symmetric;
use stylet_identify::noise::From;
use stylet_identify::objective::Data;
use stylet_stats::order::median;

/// Zero padding: frequencies are told to a part of the resolution.
const PADDING: usize = 4;
/// A line stands out of its surroundings by this factor in power, averaged over recordings.
const STANDS_OUT: f64 = 14.0;
/// Bins (before padding) on each side that make the surroundings.
const AROUND: usize = 60;
/// Most lines.
const LINES: usize = 3;
/// Lowest line in Hz.
const LEAST_HZ: f64 = 0.3;

/// Power of the residual of a fit at the recordings' own rate, in N²/Hz: the width of a bin in Hz, and the bins.
fn power(fit: &Fit, data: &Data, padding: usize) -> (f64, Vec<f64>) {
    let samples = |b: &Blocks| {
        let span_s = b.raw_t.last().zip(b.raw_t.first()).map_or(0.0, |(b, a)| b - a);
        // Long gaps are cut short: no line is worth so much memory.
        ((span_s / b.step_s) as usize + 1).min(2 * b.raw_t.len() + 1)
    };
    let longest = data.blocks.iter().map(samples).max().unwrap_or(0);
    let size = (longest * padding).next_power_of_two();
    let mut power = vec![0.0; size / 2];
    let mut planner = FftPlannerScalar::new();
    let fft = planner.plan_fft_forward(size);
    let step_s = data.blocks.first().map_or(1.0, |b| b.step_s);
    let mut count = 0.0;
    for (r, b) in data.blocks.iter().enumerate() {
        if (b.step_s / step_s - 1.0).abs() > 0.01 {
            continue;
        }
        let mut e = b.raw_residual(&fit.residuals.e[r]);
        let mut sizes: Vec<f64> = e.iter().map(|e| e.abs()).collect();
        let limit = 6.0 * median(&mut sizes).max(1e-9);
        e.iter_mut().for_each(|e| *e = e.clamp(-limit, limit));
        // On a regular grid: a sample that is missing tells nothing.
        let first = b.raw_t.first().copied().unwrap_or(0.0);
        let place = |k: usize| ((b.raw_t[k] - first) / b.step_s).round() as usize;
        let n = e.len() as f64;
        let long = (place(e.len() - 1) + 1).min(size) as f64;
        let mut buffer = vec![Complex::new(0.0, 0.0); size];
        for (k, e) in e.iter().enumerate() {
            if let Some(slot) = buffer.get_mut(place(k)) {
                let taper = 0.5 - 0.5 * libm::cos(core::f64::consts::TAU * (place(k) as f64 + 0.5) / long);
                *slot = Complex::new(taper * e, 0.0);
            }
        }
        fft.process(&mut buffer);
        // One-sided; the taper keeps three eighths of the power.
        let scale = 2.0 * step_s / (0.375 * n);
        power.iter_mut().zip(&buffer).for_each(|(p, c)| *p += c.norm_sqr() * scale);
        count += 1.0;
    }
    power.iter_mut().for_each(|p| *p /= f64::max(count, 1.0));
    (1.0 / (size as f64 * step_s), power)
}

/// Spectrum of the residual of a fit for drawing: frequencies in Hz, and amplitudes in N/sqrt(Hz), smoothed.
#[must_use]
pub fn spectrum(fit: &Fit, data: &Data) -> (Vec<f64>, Vec<f64>) {
    const POINTS: usize = 400;
    let (bin_hz, power) = power(fit, data, 1);
    let wide = (power.len() / POINTS).max(1);
    power
        .chunks(wide)
        .enumerate()
        .map(|(k, c)| {
            let hz = (k as f64 + 0.5) * wide as f64 * bin_hz;
            (hz, (c.iter().sum::<f64>() / c.len() as f64).sqrt())
        })
        .unzip()
}

/// Residuals (N) of a fit less the lines at these frequencies (Hz), each with an amplitude and a phase of every
/// recording's own.
#[must_use]
pub fn without(fit: &Fit, data: &Data, lines: &[f64]) -> Vec<Vec<f64>> {
    let mut e = fit.residuals.e.clone();
    for (b, e) in data.blocks.iter().zip(&mut e) {
        for hz in lines {
            let wave: Vec<(f64, f64)> = (0..b.len())
                .map(|k| libm::sincos(core::f64::consts::TAU * hz * 0.5 * (b.from_s[k] + b.to_s[k])))
                .collect();
            let (mut h, mut g) = (Symmetric::zeros(2), [0.0; 2]);
            for (k, (s, c)) in wave.iter().enumerate().filter(|(k, _)| b.used[*k]) {
                h.add(0, 0, s * s);
                h.add(1, 0, s * c);
                h.add(1, 1, c * c);
                g[0] += s * e[k];
                g[1] += c * e[k];
            }
            let x = h.factor().solve(&g);
            e.iter_mut().zip(&wave).for_each(|(e, (s, c))| *e -= x[0] * s + x[1] * c);
        }
    }
    e
}

/// The data judged by the noise that a fit leaves beside the lines at these frequencies (Hz): a line is no noise, though an
/// autoregression would take it for its own colour.
#[must_use]
pub fn judged_beside(fit: &Fit, data: &Data, lines: &[f64]) -> Data {
    data.judged_by(&without(fit, data, lines), From::Calm)
}

/// Frequencies (Hz) at which the residual of a fit has lines, strongest first.
#[must_use]
pub fn lines(fit: &Fit, data: &Data) -> Vec<f64> {
    if data.blocks.iter().all(|b| b.raw_f.len() < 64) {
        return Vec::new();
    }
    let (bin_hz, power) = power(fit, data, PADDING);
    let around = AROUND * PADDING;
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
        if out.iter().all(|o| (o - hz).abs() > 8.0 * PADDING as f64 * bin_hz) && out.len() < LINES {
            out.push(hz);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{LEAST_HZ, judged_beside, lines, power, spectrum, without};
    use crate::made::believed;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};
    use std::sync::Arc;
    use stylet_identify::blocks::{BLOCK_S, Blocks};
    use stylet_identify::fit::Fit;
    use stylet_identify::model::Model;
    use stylet_identify::noise::Noise;
    use stylet_identify::objective::{Data, residuals};
    use stylet_record::Recording;

    const HZ: f64 = 100.0;

    /// Recordings in air: the law has no force there, so that the force is what is left.
    fn in_air(forces: &[&dyn Fn(f64) -> f64], seconds: f64, keep: impl Fn(usize) -> bool) -> (Fit, Data) {
        let blocks: Vec<Blocks> = forces
            .iter()
            .map(|f| {
                let kept: Vec<usize> = (0..(seconds * HZ) as usize).filter(|k| keep(*k)).collect();
                let t: Vec<f64> = kept.iter().map(|k| 7.0 + *k as f64 / HZ).collect();
                let z = t.iter().map(|t| -0.1 + 1e-4 * t).collect();
                let f = t.iter().map(|t| f(*t)).collect();
                Blocks::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
            })
            .collect();
        let belief = believed(&[[0.02, 100.0, 1000.0]]);
        let model = Model::base(belief, blocks.len());
        let data = Data::new(Arc::new(blocks), Noise::white(0.02), 0.0);
        let residuals = residuals(&model, &data).expect("a replay");
        (Fit { model, residuals }, data)
    }

    fn wave(a: f64, hz: f64, phase: f64) -> impl Fn(f64) -> f64 {
        move |t| a * (std::f64::consts::TAU * hz * t + phase).sin()
    }

    fn noise(t: f64) -> f64 {
        nth(0, t)
    }

    /// Noise of one of several recordings.
    fn nth(r: u64, t: f64) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64((t * 1e4).round() as u64 + 10_000_000 * r);
        0.02 * (rng.random::<f64>() - 0.5)
    }

    /// Four recordings with noise of their own and the same beside it; their lines.
    fn of_four(f: &dyn Fn(f64) -> f64) -> Vec<f64> {
        let [a, b, c, d] = [0, 1, 2, 3].map(|r| move |t: f64| nth(r, t) + f(t));
        let (fit, data) = in_air(&[&a, &b, &c, &d], 20.0, |_| true);
        lines(&fit, &data)
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
            let (fit, data) = in_air(forces, 20.0, |_| true);
            let (bin_hz, p) = power(&fit, &data, padding);
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
        let (fit, data) = in_air(&[&tone], 20.0, |k| k % 5 != 0);
        let (bin_hz, p) = power(&fit, &data, 1);
        let peak = (0..p.len()).max_by(|a, b| p[*a].total_cmp(&p[*b])).expect("a peak");
        assert!((peak as f64 * bin_hz - 11.3).abs() < bin_hz, "{}", peak as f64 * bin_hz);
    }

    /// A spectrum has room for the time from the first sample to the last, but no more than for twice the samples and one.
    #[test]
    fn long_gaps_take_no_more_room_than_the_samples() {
        let tone = wave(0.3, 11.3, 0.4);
        let bins = |seconds: f64, keep: &dyn Fn(usize) -> bool| {
            let (fit, data) = in_air(&[&tone], seconds, keep);
            power(&fit, &data, 1).1.len()
        };
        assert_eq!((bins(10.23, &|_| true), bins(10.26, &|_| true)), (512, 1024));
        // 512 samples beside a gap of a minute: 1025 places; 511 have 1023.
        assert_eq!(bins(70.0, &|k| !(256..7000 - 256).contains(&k)), 1024);
        assert_eq!(bins(70.0, &|k| !(256..7000 - 255).contains(&k)), 512);
    }

    #[test]
    fn a_recording_of_another_rate_has_no_part_in_the_spectrum() {
        let (tone, other) = (wave(0.3, 11.3, 0.4), wave(0.9, 31.0, 0.4));
        let (fit, data) = in_air(&[&tone, &other], 20.0, |_| true);
        let (alone, alone_data) = in_air(&[&tone], 20.0, |_| true);
        let one = power(&alone, &alone_data, 1).1;
        for (by, counts) in [(1.009, true), (1.011, false)] {
            let mut blocks = data.blocks.to_vec();
            blocks[1].step_s *= by;
            let p = power(&fit, &data.on(blocks), 1).1;
            let same = p.iter().zip(&one).all(|(p, one)| (p - one).abs() <= 1e-9 * one);
            assert_eq!(!same, counts, "{by}");
        }
    }

    #[test]
    fn outlying_samples_are_cut_at_six_times_the_median() {
        let spike = |t: f64| if (t - 12.0).abs() < 0.004 { 900.0 } else { wave(0.3, 11.3, 0.4)(t) };
        let (fit, data) = in_air(&[&spike], 20.0, |_| true);
        let (bin_hz, p) = power(&fit, &data, 1);
        let total = p.iter().sum::<f64>() * bin_hz;
        // One of 2000 samples of at most 6 * 0.22 adds little to a mean square of 0.045.
        assert!(total > 0.044 && total < 0.05, "{total}");
    }

    #[test]
    fn the_spectrum_that_is_drawn_is_the_root_of_means_over_bins() {
        let tone = wave(0.3, 11.3, 0.4);
        let (fit, data) = in_air(&[&tone], 20.0, |_| true);
        let (bin_hz, p) = power(&fit, &data, 1);
        let (hz, amplitude) = spectrum(&fit, &data);
        // 1024 bins, two by two.
        assert_eq!(hz.len(), 512);
        for k in [0, 1, 57, 115, 116, 511] {
            assert!((hz[k] - (2.0 * k as f64 + 1.0) * bin_hz).abs() < 1e-9, "{k}: {}", hz[k]);
            assert!((amplitude[k] - (0.5 * (p[2 * k] + p[2 * k + 1])).sqrt()).abs() < 1e-12);
        }
        // A short one is drawn bin by bin.
        let (fit, data) = in_air(&[&tone], 4.0, |_| true);
        assert_eq!(spectrum(&fit, &data).0.len(), 256);
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
        // Noise has none, nor has what is slower than the slowest line, nor a recording of a few samples.
        assert!(of_four(&|_| 0.0).is_empty());
        let found = of_four(&wave(0.05, 0.5 * LEAST_HZ, 0.2));
        assert!(found.is_empty(), "{found:?}");
        let tone = |t: f64| noise(t) + wave(0.2, 20.0, 0.2)(t);
        for (samples, any) in [(63, false), (64, true)] {
            let (fit, data) = in_air(&[&tone], 5.0, move |k| k < samples);
            assert_eq!(!lines(&fit, &data).is_empty(), any, "{samples}");
        }
    }

    #[test]
    fn a_residual_without_its_lines_has_their_best_sinusoids_taken_away_recording_by_recording() {
        let (one, two) = (wave(0.3, 5.1, 0.4), |t: f64| wave(0.7, 5.1, 2.0)(t) + wave(0.2, 12.6, 0.1)(t));
        let (fit, data) = in_air(&[&one, &two], 20.0, |_| true);
        let left = without(&fit, &data, &[5.1, 12.6]);
        let most = |e: &[f64]| e.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        // Blocks of two samples see a tone as it is.
        assert!(most(&left[0]) < 2e-3 && most(&left[1]) < 2e-3, "{} {}", most(&left[0]), most(&left[1]));
        let left = without(&fit, &data, &[5.1]);
        assert!((most(&left[1]) - 0.19).abs() < 0.02, "{}", most(&left[1]));
        assert_eq!(without(&fit, &data, &[]), fit.residuals.e);
        // What is left stands at right angles to the line, over the blocks compared.
        let mut blocks = data.blocks.to_vec();
        blocks[1].used[100..300].fill(false);
        let some = data.on(blocks);
        let left = without(&fit, &some, &[7.3]);
        let b = &some.blocks[1];
        for phase in [0.0, 0.5 * std::f64::consts::PI] {
            let dot: f64 = (0..b.len())
                .filter(|k| b.used[*k])
                .map(|k| {
                    left[1][k] * (std::f64::consts::TAU * 7.3 * 0.5 * (b.from_s[k] + b.to_s[k]) + phase).sin()
                })
                .sum();
            assert!(dot.abs() < 1e-8, "{dot}");
        }
        let judged = judged_beside(&fit, &data, &[5.1, 12.6]);
        assert!(judged.noise.sd_n() < 2e-3, "{}", judged.noise.sd_n());
    }
}
