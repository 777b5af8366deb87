//! A sensor that touches nothing: what it shows in air, in a recording of its own or before an insertion reaches the tissue.

use crate::set::first::Insertion;
use stylet_identify::linear::Symmetric;
use stylet_identify::phases::noise_n;
use stylet_record::Recording;
use stylet_stats::{mean, median_of, rms};

/// Share of the way to the believed surface that counts as air: the surface may be nearer than believed.
const AIR_SHARE: f64 = 0.5;
/// Fewest samples of it.
const AIR_SAMPLES: usize = 20;
/// Force that scatters about its line by more than so many standard deviations of its noise is no air.
const AIR_NOISES: f64 = 2.0;
/// Speed (m/s) from which the drive moves.
const MOVES_MPS: f64 = 2e-4;

/// A straight line through a force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Force (N) at the first instant.
    pub first_n: f64,
    /// Slope (N/s).
    pub rate_n_per_s: f64,
    /// Standard deviation about it (N).
    pub sd_n: f64,
}

/// The line of least squares.
#[must_use]
pub fn line(t: &[f64], f: &[f64]) -> Line {
    let (middle, level) = (mean(t), mean(f));
    let (tt, tf) = t.iter().zip(f).fold((0.0, 0.0), |(tt, tf), (t, f)| {
        (tt + (t - middle) * (t - middle), tf + (t - middle) * (f - level))
    });
    let rate = tf / tt.max(1e-12);
    let rest: Vec<f64> = t.iter().zip(f).map(|(t, f)| f - level - rate * (t - middle)).collect();
    Line { first_n: level + rate * (t[0] - middle), rate_n_per_s: rate, sd_n: rms(&rest) }
}

/// Coefficients of the combination of columns that leaves least squares, and what it leaves.
pub fn regress<const N: usize>(rows: &[[f64; N]], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut a = Symmetric::zeros(N);
    let mut b = [0.0; N];
    for (row, y) in rows.iter().zip(y) {
        for i in 0..N {
            b[i] += row[i] * y;
            for j in i..N {
                a.add(i, j, row[i] * row[j]);
            }
        }
    }
    let x = a.factor().solve(&b);
    let of = |row: &[f64; N]| row.iter().zip(&x).map(|(r, x)| r * x).sum::<f64>();
    let rest = rows.iter().zip(y).map(|(row, y)| y - of(row)).collect();
    (x, rest)
}

/// What a recording in air shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Its line.
    pub line: Line,
    /// Correlation of neighbouring noise samples.
    pub ar1: f64,
    /// Amplitude (N) and frequency (Hz) of the strongest line of its spectrum.
    pub tone: Option<(f64, f64)>,
    /// Half the difference (N) between moving in and moving out.
    pub drive_n: Option<f64>,
}

impl Air {
    /// Looks at a recording in air.
    #[must_use]
    pub fn of(air: &Recording) -> Self {
        let (t, f) = (&air.time_s, &air.force_n);
        let way =
            |sign: f64| air.velocity_mps.iter().filter(|v| **v * sign > MOVES_MPS).count() > AIR_SAMPLES;
        let moves = way(1.0) && way(-1.0);
        let drive = |i: usize| match air.velocity_mps[i] {
            v if !moves || v.abs() <= MOVES_MPS => 0.0,
            v => v.signum(),
        };
        // Offset, drift and drive at once: the way in comes before the way out, as the early part of a drift before the late one.
        let middle = mean(t);
        let rows: Vec<[f64; 3]> = (0..t.len()).map(|i| [1.0, t[i] - middle, drive(i)]).collect();
        let (x, rest) = regress(&rows, f);
        let lagged: f64 = rest.windows(2).map(|p| p[0] * p[1]).sum();
        Self {
            line: Line { first_n: x[0] + x[1] * (t[0] - middle), rate_n_per_s: x[1], sd_n: rms(&rest) },
            ar1: lagged / rest.iter().map(|x| x * x).sum::<f64>().max(1e-300),
            tone: tone(t, &rest),
            drive_n: moves.then_some(x[2]),
        }
    }
}

/// Depth (m) up to which a recording counts as air.
fn in_air_m(r: &Recording, surface_m: f64) -> f64 {
    let from = r.position_m[0];
    from + AIR_SHARE * (surface_m - from)
}

/// The line of some samples' force, where it is straight.
fn straight(r: &Recording, samples: std::ops::Range<usize>) -> Option<Line> {
    if samples.len() < AIR_SAMPLES {
        return None;
    }
    let (t, f) = (&r.time_s[samples.clone()], &r.force_n[samples]);
    let at = line(t, f);
    (at.sd_n <= AIR_NOISES * noise_n(f).max(1e-9)).then_some(at)
}

/// The samples of an insertion before it reaches the tissue.
fn way_there(r: &Recording, surface_m: f64) -> Option<std::ops::Range<usize>> {
    let end = r.position_m.iter().position(|z| *z > in_air_m(r, surface_m))?;
    (surface_m > r.position_m[0]).then_some(0..end)
}

/// The line of the force before each insertion reaches the tissue, where that can be told from the tissue's own: it is straight.
#[must_use]
pub fn before_contact(runs: &[&Insertion], surface_m: f64) -> Vec<Line> {
    runs.iter().filter_map(|run| straight(&run.recording, way_there(&run.recording, surface_m)?)).collect()
}

/// Change of the force in air (N/s) from before an insertion to after it, where the needle comes back into the air.
#[must_use]
pub fn between(run: &Insertion, surface_m: f64) -> Option<f64> {
    let r = &run.recording;
    let there = way_there(r, surface_m)?;
    let back = r.position_m.iter().rposition(|z| *z > in_air_m(r, surface_m))? + 1;
    // What a slow sensor still has of the tissue fades first.
    let late = back + (r.len() - back) / 2;
    let (before, after) = (straight(r, there.clone())?, straight(r, late..r.len())?);
    let level = |l: Line, from: usize, to: usize| {
        l.first_n + l.rate_n_per_s * 0.5 * (r.time_s[to - 1] - r.time_s[from])
    };
    let middle = |from: usize, to: usize| 0.5 * (r.time_s[to - 1] + r.time_s[from]);
    let change = level(after, late, r.len()) - level(before, 0, there.end);
    Some(change / (middle(late, r.len()) - middle(0, there.end)))
}

/// The middle of a number that the insertions have in common: nothing when they do not agree on it.
#[must_use]
pub fn common(values: &[f64]) -> f64 {
    let middle = median_of(values.iter().copied());
    let apart = median_of(values.iter().map(|x| (x - middle).abs()));
    if apart < 0.5 * middle.abs() { middle } else { 0.0 }
}

/// The strongest sinusoid (amplitude, frequency) up to half the sampling rate, on the time stamps as they are.
fn tone(t: &[f64], e: &[f64]) -> Option<(f64, f64)> {
    let duration = t[t.len() - 1] - t[0];
    if duration <= 0.0 || t.len() < AIR_SAMPLES {
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
