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
