//! Estimates the baseline of the force sensor in air (offset, drift, noise, tone, drive friction) from a recording in air, or from an
//! insertion before and after contact.

use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use stylet_identify::insertion_phases::noise_n;
use stylet_record::Recording;
use stylet_stats::least_squares::NormalEquations;
use stylet_stats::linear_algebra::dot;
use stylet_stats::{mean, median_of, rms};

/// Share of the distance to the assumed surface that counts as air: the surface may be nearer than assumed.
const AIR_SHARE: f64 = 0.5;
/// Smallest number of samples in air for a line or a tone.
const MIN_AIR_SAMPLES: usize = 20;
/// Ratio of the RMS residual about a line to the noise above which a force is not measured in air.
const MAX_NOISE_RATIO: f64 = 2.0;
/// Speed (m/s) above which the drive moves.
const MIN_DRIVE_SPEED_MPS: f64 = 2e-4;

/// Straight line through a force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearTrend {
    /// Force (N) at the first sample.
    pub start_n: f64,
    /// Slope (N/s).
    pub rate_n_per_s: f64,
    /// RMS residual (N).
    pub sd_n: f64,
}

/// Least-squares line through forces `f` (N) at times `t` (s).
pub fn fit_trend(t: &[f64], f: &[f64]) -> LinearTrend {
    let (middle, level) = (mean(t), mean(f));
    let about = |x: &[f64], mean: f64| x.iter().map(|x| x - mean).collect::<Vec<_>>();
    let (t, f) = (about(t, middle), about(f, level));
    let rate = dot(&t, &f) / dot(&t, &t).max(1e-12);
    let rest: Vec<f64> = t.iter().zip(&f).map(|(t, f)| f - rate * t).collect();
    LinearTrend { start_n: level + rate * t[0], rate_n_per_s: rate, sd_n: rms(&rest) }
}

/// Coefficients and residuals of a linear least-squares fit.
pub fn least_squares<const N: usize>(rows: &[[f64; N]], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut sums = NormalEquations::<N>::new(N);
    for (row, y) in rows.iter().zip(y) {
        sums.add(row, *y);
    }
    let x = sums.solve();
    let of = |row: &[f64; N]| row.iter().zip(&x).map(|(r, x)| r * x).sum::<f64>();
    let rest = rows.iter().zip(y).map(|(row, y)| y - of(row)).collect();
    (x, rest)
}

/// Analysis of a recording in air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AirAnalysis {
    /// Offset, drift and noise.
    pub trend: LinearTrend,
    /// Lag-one autocorrelation of the noise.
    pub ar1: f64,
    /// Amplitude (N) and frequency (Hz) of the strongest sinusoid.
    pub tone: Option<(f64, f64)>,
    /// Half the force difference (N) between forward and backward motion.
    pub drive_friction_n: Option<f64>,
}

impl AirAnalysis {
    /// Analyses a recording in air.
    pub fn new(air: &Recording) -> Self {
        let (t, f) = (&air.time_s, &air.force_n);
        let moves_in = |sign: f64| {
            air.velocity_mps.iter().filter(|v| **v * sign > MIN_DRIVE_SPEED_MPS).count() > MIN_AIR_SAMPLES
        };
        let moves = moves_in(1.0) && moves_in(-1.0);
        let drive = |i: usize| match air.velocity_mps[i] {
            v if !moves || v.abs() <= MIN_DRIVE_SPEED_MPS => 0.0,
            v => v.signum(),
        };
        // Drift and drive friction are fitted jointly, because forward motion precedes backward motion.
        let middle = mean(t);
        let rows: Vec<[f64; 3]> = (0..t.len()).map(|i| [1.0, t[i] - middle, drive(i)]).collect();
        let (x, rest) = least_squares(&rows, f);
        let lagged: f64 = rest.windows(2).map(|p| p[0] * p[1]).sum();
        Self {
            trend: LinearTrend {
                start_n: x[0] + x[1] * (t[0] - middle),
                rate_n_per_s: x[1],
                sd_n: rms(&rest),
            },
            ar1: lagged / rest.iter().map(|x| x * x).sum::<f64>().max(1e-300),
            tone: strongest_tone(t, &rest),
            drive_friction_n: moves.then_some(x[2]),
        }
    }
}

/// Position (m) up to which a recording is in air.
fn air_limit_m(r: &Recording, surface_m: f64) -> f64 {
    let from = r.position_m[0];
    from + AIR_SHARE * (surface_m - from)
}

/// Line through the force of some samples; `None` if the force is not straight.
fn straight_trend(r: &Recording, samples: std::ops::Range<usize>) -> Option<LinearTrend> {
    if samples.len() < MIN_AIR_SAMPLES {
        return None;
    }
    let (t, f) = (&r.time_s[samples.clone()], &r.force_n[samples]);
    let at = fit_trend(t, f);
    (at.sd_n <= MAX_NOISE_RATIO * noise_n(f).max(1e-9)).then_some(at)
}

/// Samples of an insertion before contact.
fn samples_before_contact(r: &Recording, surface_m: f64) -> Option<std::ops::Range<usize>> {
    let end = r.position_m.iter().position(|z| *z > air_limit_m(r, surface_m))?;
    (surface_m > r.position_m[0]).then_some(0..end)
}

/// Lines through the force before contact, of the recordings in which it is straight; a force of tissue is not.
pub fn pre_contact_trends(recordings: &[&SegmentedRecording], surface_m: f64) -> Vec<LinearTrend> {
    recordings
        .iter()
        .filter_map(|run| straight_trend(&run.recording, samples_before_contact(&run.recording, surface_m)?))
        .collect()
}

/// Drift (N/s) between the air before and after an insertion; `None` if either force is not straight.
pub fn air_drift_n_per_s(run: &SegmentedRecording, surface_m: f64) -> Option<f64> {
    let r = &run.recording;
    let there = samples_before_contact(r, surface_m)?;
    let back = r.position_m.iter().rposition(|z| *z > air_limit_m(r, surface_m))? + 1;
    // The first half after the insertion is skipped, because a slow sensor is still decaying.
    let settled = back + (r.len() - back) / 2;
    let (before, after) = (straight_trend(r, there.clone())?, straight_trend(r, settled..r.len())?);
    let level = |l: LinearTrend, from: usize, to: usize| {
        l.start_n + l.rate_n_per_s * 0.5 * (r.time_s[to - 1] - r.time_s[from])
    };
    let middle = |from: usize, to: usize| 0.5 * (r.time_s[to - 1] + r.time_s[from]);
    let change = level(after, settled, r.len()) - level(before, 0, there.end);
    Some(change / (middle(settled, r.len()) - middle(0, there.end)))
}

/// Median over the recordings; zero if its median absolute deviation exceeds half of it.
pub fn consensus(values: &[f64]) -> f64 {
    let middle = median_of(values.iter().copied());
    let apart = median_of(values.iter().map(|x| (x - middle).abs()));
    if apart < 0.5 * middle.abs() { middle } else { 0.0 }
}

/// Amplitude (N) and frequency (Hz) of the strongest sinusoid up to half the sampling rate, at the actual time stamps.
fn strongest_tone(t: &[f64], e: &[f64]) -> Option<(f64, f64)> {
    let duration = t[t.len() - 1] - t[0];
    if duration <= 0.0 || t.len() < MIN_AIR_SAMPLES {
        return None;
    }
    let most = 0.5 * t.len() as f64 / duration;
    let step = 0.5 / duration;
    let mut best = (0.0, 0.0);
    let mut k = 2.0;
    while k * step < most {
        let omega = std::f64::consts::TAU * k * step;
        let (mut c, mut s) = (0.0, 0.0);
        for (at, e) in t.iter().zip(e) {
            let (sin, cos) = libm::sincos(omega * (at - t[0]));
            c += e * cos;
            s += e * sin;
        }
        let amplitude = 2.0 * libm::sqrt(c * c + s * s) / t.len() as f64;
        if amplitude > best.0 {
            best = (amplitude, k * step);
        }
        k += 1.0;
    }
    Some(best)
}

#[cfg(test)]
mod tests;
