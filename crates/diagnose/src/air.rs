//! The noise before the needle touches the tissue: no model of the tissue can disturb it.

use crate::noise::{Noise, median};
use crate::track::Track;

/// Distance in m from the surface at which the needle is certainly in air.
const CLEAR_M: f64 = 1.5e-3;
/// The same when there are few samples.
const NEAR_M: f64 = 0.3e-3;

/// The noise in air beyond `dead_n`; `None` when there are too few samples there.
#[must_use]
pub fn noise(tracks: &[Track], surface_m: f64, least_n: f64, dead_n: f64) -> Option<Noise> {
    for clear in [CLEAR_M, NEAR_M] {
        let runs: Vec<(Track, Vec<f64>)> = tracks.iter().filter_map(|t| run(t, surface_m - clear)).collect();
        let runs: Vec<(Track, Vec<f64>)> = runs
            .into_iter()
            .map(|(t, mut e)| {
                crate::fit::dead_zone(dead_n, &mut e);
                (t, e)
            })
            .collect();
        let parts: Vec<(&Track, &[f64])> = runs.iter().map(|(t, e)| (t, e.as_slice())).collect();
        let samples: usize = parts.iter().map(|p| p.1.len()).sum();
        if samples >= 200 {
            return Noise::estimate(&parts, |_, _| true, least_n);
        }
    }
    None
}

/// The run in air before the first contact, less its mean, its trend and up to two spectral lines.
fn run(track: &Track, below_m: f64) -> Option<(Track, Vec<f64>)> {
    let n = track.z.iter().position(|z| *z > below_m).unwrap_or(track.len());
    if n < 40 {
        return None;
    }
    let part = Track {
        t: track.t[..n].to_vec(),
        used: track.used[..n].to_vec(),
        restart: track.restart[..n].to_vec(),
        sample_hz: track.sample_hz,
        ..Track::default()
    };
    let mut e = track.f[..n].to_vec();
    detrend(&part.t, &mut e);
    for _ in 0..2 {
        let Some(frequency) = spectral_line(&e, track.sample_hz) else { break };
        remove_line(&part.t, &mut e, frequency);
    }
    Some((part, e))
}

fn detrend(t: &[f64], e: &mut [f64]) {
    let n = e.len() as f64;
    let (tm, em) = (t.iter().sum::<f64>() / n, e.iter().sum::<f64>() / n);
    let (mut sxy, mut sxx) = (0.0, 1e-300);
    for (t, e) in t.iter().zip(e.iter()) {
        sxy += (t - tm) * (e - em);
        sxx += (t - tm) * (t - tm);
    }
    let slope = sxy / sxx;
    for (t, e) in t.iter().zip(e.iter_mut()) {
        *e -= em + slope * (t - tm);
    }
}

/// Power at a frequency, by Goertzel's recursion.
#[must_use]
pub fn power(e: &[f64], cycles_per_sample: f64) -> f64 {
    let c = 2.0 * libm::cos(core::f64::consts::TAU * cycles_per_sample);
    let (mut s1, mut s2) = (0.0, 0.0);
    for x in e {
        let s = x + c * s1 - s2;
        s2 = s1;
        s1 = s;
    }
    (s1 * s1 + s2 * s2 - c * s1 * s2) / e.len() as f64
}

/// A frequency (Hz) that stands out of its neighbours by far.
fn spectral_line(e: &[f64], sample_hz: f64) -> Option<f64> {
    let n = e.len();
    let bins = n / 2;
    let powers: Vec<f64> = (0..bins).map(|k| power(e, k as f64 / n as f64)).collect();
    let mut best = (0.0, 0);
    for k in 2..bins {
        let mut around: Vec<f64> = (k.saturating_sub(14)..(k + 15).min(bins))
            .filter(|j| j.abs_diff(k) > 2)
            .map(|j| powers[j])
            .collect();
        let ratio = powers[k] / median(&mut around).max(1e-300);
        if ratio > best.0 {
            best = (ratio, k);
        }
    }
    // Noise: the ratio exceeds 25 once in 2^25 bins at a flat spectrum.
    (best.0 > 25.0).then(|| best.1 as f64 / n as f64 * sample_hz)
}

/// Subtracts the sinusoid of about this frequency, by least squares over a few nearby frequencies.
fn remove_line(t: &[f64], e: &mut [f64], frequency_hz: f64) {
    let span = t.last().zip(t.first()).map_or(1.0, |(b, a)| (b - a).max(1e-9));
    let mut best = (f64::INFINITY, 0.0, 0.0, 0.0);
    for k in -10..=10 {
        let f = frequency_hz + f64::from(k) * 0.1 / span;
        let (a, b, left) = sinusoid(t, e, f);
        if left < best.0 {
            best = (left, f, a, b);
        }
    }
    let (_, f, a, b) = best;
    for (t, e) in t.iter().zip(e.iter_mut()) {
        let (sin, cos) = libm::sincos(core::f64::consts::TAU * f * t);
        *e -= a * sin + b * cos;
    }
}

/// Least-squares `a sin + b cos` at a frequency, and the sum of squares left.
#[must_use]
pub fn sinusoid(t: &[f64], e: &[f64], frequency_hz: f64) -> (f64, f64, f64) {
    let (mut ss, mut sc, mut cc, mut es, mut ec, mut ee) = (1e-300, 0.0, 1e-300, 0.0, 0.0, 0.0);
    for (t, e) in t.iter().zip(e) {
        let (s, c) = libm::sincos(core::f64::consts::TAU * frequency_hz * t);
        ss += s * s;
        sc += s * c;
        cc += c * c;
        es += e * s;
        ec += e * c;
        ee += e * e;
    }
    let det = (ss * cc - sc * sc).max(1e-300);
    let (a, b) = ((es * cc - ec * sc) / det, (ec * ss - es * sc) / det);
    (a, b, ee - a * es - b * ec)
}
