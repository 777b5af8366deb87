//! Fits parametric segments of commanded motion: a rest, a line, a parabola or cubic, a line with one or two sinusoids.
//!
//! A local window narrow enough for a ripple of 1 Hz leaves 0.1 mm/s of encoder noise in the velocity, which friction turns into the
//! largest force error. A parametric segment estimates a few parameters from all samples of an interval, and its velocity is a hundred
//! times more accurate. Intervals whose residuals are not white under any form are smoothed by local windows (`smooth_positions`).

use core::f64::consts::TAU;
use stylet_stats::golden_section;
use stylet_stats::least_squares::NormalEquations;

/// Highest frequency (Hz) that is searched; faster motion is left to local windows.
const HIGHEST_HZ: f64 = 3.0;
/// Length in s of the means used in the frequency search.
const SEARCH_MEAN_S: f64 = 0.1;
/// Smallest number of means in the frequency search.
const MIN_SEARCH_MEANS: f64 = 24.0;
/// Largest number of means in the frequency search, which bounds its cost.
const MAX_SEARCH_MEANS: f64 = 400.0;
/// Intervals shorter than this (s) are searched over all frequencies even if hints are given.
const SHORT_SEGMENT_S: f64 = 6.0;
/// Cells per mean in the whiteness test: the variance of means shows low-frequency misfit.
const WHITENESS_CELLS: usize = 8;
/// Largest number of coefficients: a line and two sinusoids.
const MAX_COEFFICIENTS: usize = 6;
/// Smallest number of cells of a segment.
pub(super) const MIN_CELLS: usize = 12;

/// A segment with its coefficients.
#[derive(Clone, Debug)]
pub(super) struct MotionSegment {
    middle: f64,
    half: f64,
    /// Coefficients of `1, s, s², s³` with `s = (t - middle) / half`.
    poly: [f64; 4],
    /// Angular frequency (1/s) and coefficients of cosine and sine of `w (t - middle)`.
    sinusoids: Vec<[f64; 3]>,
    /// Standard deviation of the residual per cell in m.
    pub sd_m: f64,
    /// Bayesian information criterion in nats: negative log likelihood plus `ln n` per parameter.
    pub cost: f64,
    /// Whether the residuals pass the whiteness test.
    pub white: bool,
}

impl MotionSegment {
    /// Position in m and velocity in m/s at a time.
    pub fn at(&self, t: f64) -> (f64, f64) {
        let s = (t - self.middle) / self.half;
        let [a, b, c, d] = self.poly;
        let mut z = a + s * (b + s * (c + s * d));
        let mut v = (b + s * (2.0 * c + 3.0 * s * d)) / self.half;
        for [w, x, y] in &self.sinusoids {
            let (sin, cos) = libm::sincos(w * (t - self.middle));
            z += x * cos + y * sin;
            v += w * (y * cos - x * sin);
        }
        (z, v)
    }

    /// Whether the segment is a rest.
    pub fn is_at_rest(&self) -> bool {
        self.sinusoids.is_empty() && self.poly[1..].iter().all(|c| *c == 0.0)
    }

    /// Whether the velocity is constant.
    pub fn is_constant_velocity(&self) -> bool {
        self.sinusoids.is_empty() && self.poly[2..].iter().all(|c| *c == 0.0)
    }

    /// Whether the amplitudes of all sinusoids exceed `amplitude_m`.
    fn sinusoids_exceed(&self, amplitude_m: f64) -> bool {
        self.sinusoids.iter().all(|[_, x, y]| libm::hypot(*x, *y) > amplitude_m)
    }

    /// Angular frequencies in 1/s.
    pub fn frequencies(&self) -> impl Iterator<Item = f64> + '_ {
        self.sinusoids.iter().map(|w| w[0])
    }

    /// Segment with the lowest cost for cells with midpoints `t` (s, `cell_s` apart) and mean positions `z` (m). With angular frequencies
    /// in `hints` (1/s), a long interval is tried at these frequencies only. Quantisation of a constant velocity beats with the sampling
    /// and looks like a sinusoid: sinusoids with amplitudes below `rounded_m` are discarded, and a line with such residuals counts as
    /// white.
    pub fn fit_best(t: &[f64], z: &[f64], cell_s: f64, hints: &[f64], rounded_m: f64) -> Option<Self> {
        let n = t.len();
        if n < MIN_CELLS {
            return None;
        }
        let frame = SegmentFit::new(t, z, cell_s)?;
        let mut best = frame.fit(0, &[])?;
        for degree in 1..=3 {
            best = cheaper(best, frame.fit(degree, &[]));
        }
        // A short union of intervals can resemble a cubic although it is a sinusoid.
        let union = !hints.is_empty();
        if !best.white || union {
            let narrow = 0.3 / (2.0 * frame.half);
            for w in hints {
                best = cheaper(
                    best,
                    frame.refine_frequency(&[], w / TAU, narrow).filter(|c| c.sinusoids_exceed(rounded_m)),
                );
            }
            let wanted = if union { 2.0 * frame.half < SHORT_SEGMENT_S } else { !best.white };
            if wanted && let Some(one) = frame.add_sinusoid(&[]) {
                if one.sinusoids_exceed(rounded_m) {
                    let two = if one.white { None } else { frame.add_sinusoid(&[one.sinusoids[0][0]]) };
                    best = cheaper(cheaper(best, Some(one)), two.filter(|c| c.sinusoids_exceed(rounded_m)));
                } else if one.white && best.sinusoids.is_empty() {
                    best.white = true;
                }
            }
        }
        Some(best)
    }

    /// The cheaper of a rest and a line.
    pub fn fit_constant_velocity(t: &[f64], z: &[f64], cell_s: f64) -> Option<Self> {
        let frame = SegmentFit::new(t, z, cell_s)?;
        Some(cheaper(frame.fit(0, &[])?, frame.fit(1, &[])))
    }
}

/// The segment with the lower cost.
pub(super) fn cheaper(a: MotionSegment, b: Option<MotionSegment>) -> MotionSegment {
    match b {
        Some(b) if b.cost < a.cost => b,
        _ => a,
    }
}

/// Least-squares problem of one interval.
struct SegmentFit<'a> {
    middle: f64,
    half: f64,
    cell_s: f64,
    t: &'a [f64],
    z: &'a [f64],
}

impl<'a> SegmentFit<'a> {
    fn new(t: &'a [f64], z: &'a [f64], cell_s: f64) -> Option<Self> {
        let (first, last) = (*t.first()?, *t.last()?);
        Some(Self { middle: 0.5 * (first + last), half: (0.5 * (last - first)).max(1e-9), cell_s, t, z })
    }

    /// Least squares of a polynomial and sinusoids with given frequencies.
    fn fit(&self, degree: usize, sinusoids: &[f64]) -> Option<MotionSegment> {
        let rows = |row: &mut [f64; MAX_COEFFICIENTS], t: f64| {
            self.design_row(row, t, degree, sinusoids, self.cell_s)
        };
        let count = degree + 1 + 2 * sinusoids.len();
        let (x, squares) = least_squares(self.t, self.z, count, &rows)?;
        let n = self.t.len() as f64;
        let free = n - (count + sinusoids.len()) as f64;
        if free < 4.0 {
            return None;
        }
        let variance = (squares / free).max(1e-20);
        let mut poly = [0.0; 4];
        poly[..=degree].copy_from_slice(&x[..=degree]);
        let sinusoids: Vec<[f64; 3]> = sinusoids
            .iter()
            .enumerate()
            .map(|(k, w)| {
                let at = degree + 1 + 2 * k;
                [*w, x[at], x[at + 1]]
            })
            .collect();
        let parameters = (count + sinusoids.len()) as f64;
        let mut segment = MotionSegment {
            middle: self.middle,
            half: self.half,
            poly,
            sinusoids,
            sd_m: variance.sqrt(),
            cost: 0.5 * n * libm::log(variance) + parameters * libm::log(n),
            white: false,
        };
        segment.white = self.is_white(&segment);
        Some(segment)
    }

    /// Row of the design matrix: the regressors averaged over a cell.
    fn design_row(
        &self,
        row: &mut [f64; MAX_COEFFICIENTS],
        t: f64,
        degree: usize,
        sinusoids: &[f64],
        cell_s: f64,
    ) {
        let s = (t - self.middle) / self.half;
        let mut power = 1.0;
        for slot in row.iter_mut().take(degree + 1) {
            *slot = power;
            power *= s;
        }
        for (k, w) in sinusoids.iter().enumerate() {
            let half = 0.5 * w * cell_s;
            let mean = if half > 1e-6 { libm::sin(half) / half } else { 1.0 };
            let (sin, cos) = libm::sincos(w * (t - self.middle));
            row[degree + 1 + 2 * k] = mean * cos;
            row[degree + 2 + 2 * k] = mean * sin;
        }
    }

    /// Best line with sinusoids of the frequencies `others` and one more, by a search over frequencies.
    fn add_sinusoid(&self, others: &[f64]) -> Option<MotionSegment> {
        let group_s =
            SEARCH_MEAN_S.min(2.0 * self.half / MIN_SEARCH_MEANS).max(2.0 * self.half / MAX_SEARCH_MEANS);
        let together = ((group_s / self.cell_s).round() as usize).max(1);
        let mean = |x: &[f64]| -> Vec<f64> {
            x.chunks(together).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect()
        };
        let (t, z) = (mean(self.t), mean(self.z));
        if t.len() < MAX_COEFFICIENTS + 2 {
            return None;
        }
        let cell_s = self.cell_s * together as f64;
        let step_hz = 0.2 / (2.0 * self.half);
        let highest = HIGHEST_HZ.min(0.4 / cell_s);
        let steps = (highest / step_hz) as usize;
        let known = |hz: f64| others.iter().any(|w| (w / TAU - hz).abs() < 2.0 * step_hz);
        let coarse = (1..=steps)
            .map(|k| step_hz * (k + 1) as f64)
            .filter(|hz| !known(*hz))
            .map(|hz| (hz, self.sum_of_squares(others, hz, &t, &z, cell_s)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?
            .0;
        self.refine_frequency(others, coarse, step_hz)
    }

    /// As [`add_sinusoid`](Self::add_sinusoid), within `within_hz` of `hz`, by golden section over all cells.
    fn refine_frequency(&self, others: &[f64], hz: f64, within_hz: f64) -> Option<MotionSegment> {
        let all = |hz: f64| self.sum_of_squares(others, hz, self.t, self.z, self.cell_s);
        let best_hz = golden_section(all, ((hz - within_hz).max(1e-4), hz + within_hz), 24);
        let mut sinusoids = others.to_vec();
        sinusoids.push(TAU * best_hz);
        self.fit(1, &sinusoids)
    }

    /// Residual sum of squares of a line with sinusoids of the frequencies `others` (1/s) and one of `hz`.
    fn sum_of_squares(&self, others: &[f64], hz: f64, t: &[f64], z: &[f64], cell_s: f64) -> f64 {
        let mut sinusoids = [0.0; 2];
        sinusoids[..others.len()].copy_from_slice(others);
        sinusoids[others.len()] = TAU * hz;
        let sinusoids = &sinusoids[..=others.len()];
        let rows = |row: &mut [f64; MAX_COEFFICIENTS], t: f64| self.design_row(row, t, 1, sinusoids, cell_s);
        least_squares(t, z, 2 + 2 * sinusoids.len(), &rows).map_or(f64::INFINITY, |s| s.1)
    }

    /// Whether means over [`WHITENESS_CELLS`] cells vary no more than those of white noise.
    fn is_white(&self, segment: &MotionSegment) -> bool {
        let sinusoids: Vec<f64> = segment.sinusoids.iter().map(|w| w[0]).collect();
        let mut off = Vec::with_capacity(self.t.len());
        for (t, z) in self.t.iter().zip(self.z) {
            let mut row = [0.0; MAX_COEFFICIENTS];
            self.design_row(&mut row, *t, 0, &sinusoids, self.cell_s);
            let s = (t - self.middle) / self.half;
            let [a, b, c, d] = segment.poly;
            let mut at = a + s * (b + s * (c + s * d));
            for (k, sinusoid) in segment.sinusoids.iter().enumerate() {
                at += sinusoid[1] * row[1 + 2 * k] + sinusoid[2] * row[2 + 2 * k];
            }
            off.push(z - at);
        }
        let groups = (off.len() / WHITENESS_CELLS).max(1) as f64;
        let sum: f64 = off
            .chunks_exact(WHITENESS_CELLS)
            .map(|c| c.iter().sum::<f64>().powi(2) / WHITENESS_CELLS as f64)
            .sum();
        let ratio = sum / groups / (segment.sd_m * segment.sd_m);
        ratio < 1.0 + (5.0 * (2.0 / groups).sqrt()).max(0.5)
    }
}

/// Least squares with rows from a function: coefficients and residual sum of squares.
fn least_squares(
    t: &[f64],
    z: &[f64],
    count: usize,
    rows: &impl Fn(&mut [f64; MAX_COEFFICIENTS], f64),
) -> Option<([f64; MAX_COEFFICIENTS], f64)> {
    if t.len() <= count || count > MAX_COEFFICIENTS {
        return None;
    }
    let base = z[0];
    let (mut sums, mut squares) = (NormalEquations::<MAX_COEFFICIENTS>::new(count), 0.0);
    let mut row = [0.0; MAX_COEFFICIENTS];
    for (t, z) in t.iter().zip(z) {
        rows(&mut row, *t);
        let z = z - base;
        squares += z * z;
        sums.add(&row, z);
    }
    let mut x = [0.0; MAX_COEFFICIENTS];
    x[..count].copy_from_slice(&sums.solve());
    x[0] += base;
    // Summed over residuals: the difference of sums in the normal equations loses precision.
    let mut left = 0.0;
    for (t, z) in t.iter().zip(z) {
        rows(&mut row, *t);
        let at: f64 = row.iter().zip(&x).take(count).map(|(r, x)| r * x).sum();
        left += (z - at).powi(2);
    }
    (left <= squares.max(1e-30) * 1.001 + 1e-18).then_some((x, left))
}

#[cfg(test)]
mod tests;
