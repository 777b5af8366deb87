//! A stretch of motion as what robots are told to do: a rest, a straight line, a parabola or cubic, a line with one or
//! two sinusoids on it.
//!
//! A window that is narrow enough for a ripple of 1 Hz leaves a tenth of a millimetre per second of encoder noise in the
//! velocity, and friction makes that the force's largest error. When a whole stretch is one of these forms, a handful of
//! numbers are estimated from all its samples, and the velocity is known a hundred times better. A stretch
//! that is none of them (its residual is coloured) is left to local windows (`settle`).

use crate::linear::Symmetric;
use core::f64::consts::{PI, TAU};

/// Highest frequency in Hz that is looked for.
const HIGHEST_HZ: f64 = 3.0;
/// Length in s of the means that frequencies are looked for with.
const GROUP_S: f64 = 0.1;
/// ... and how many of them there are at least and at most.
const FEW_GROUPS: f64 = 24.0;
const GROUPS: f64 = 400.0;
/// A stretch shorter than this, in s, is searched for any frequency, hints or not.
const SHORT_S: f64 = 6.0;
/// Cells in a mean by which the residual's colour is judged.
const TOGETHER: usize = 8;
/// Most numbers: a line and two sinusoids.
const MOST: usize = 6;
/// Fewest cells of a stretch.
pub(crate) const FEWEST: usize = 12;

/// A form with its numbers.
#[derive(Clone, Debug)]
pub(crate) struct Course {
    middle: f64,
    half: f64,
    /// Coefficients of `1, s, s², s³` with `s = (t - middle) / half`.
    poly: [f64; 4],
    /// Angular frequency (1/s), coefficients of cosine and sine of `w (t - middle)`.
    waves: Vec<[f64; 3]>,
    /// Standard deviation of the residual per cell in m.
    pub sd_m: f64,
    /// Nats of the residual and of the numbers spent.
    pub cost: f64,
    /// Whether the residual is as white as noise is.
    pub white: bool,
}

impl Course {
    /// Position in m and velocity in m/s at an instant.
    pub fn at(&self, t: f64) -> (f64, f64) {
        let s = (t - self.middle) / self.half;
        let [a, b, c, d] = self.poly;
        let mut z = a + s * (b + s * (c + s * d));
        let mut v = (b + s * (2.0 * c + 3.0 * s * d)) / self.half;
        for [w, x, y] in &self.waves {
            let (sin, cos) = libm::sincos(w * (t - self.middle));
            z += x * cos + y * sin;
            v += w * (y * cos - x * sin);
        }
        (z, v)
    }

    /// Whether it stands still.
    pub fn rests(&self) -> bool {
        self.waves.is_empty() && self.poly[1..].iter().all(|c| *c == 0.0)
    }

    /// Whether all its waves are larger than so many m.
    fn waves_beyond(&self, amplitude_m: f64) -> bool {
        self.waves.iter().all(|[_, x, y]| libm::hypot(*x, *y) > amplitude_m)
    }

    /// Angular frequencies in 1/s.
    pub fn frequencies(&self) -> impl Iterator<Item = f64> + '_ {
        self.waves.iter().map(|w| w[0])
    }

    /// The best form of cells at `t` (s, middle of each, `cell_s` apart) with mean positions `z` (m). Angular frequencies in
    /// `hints` (1/s) are all that a long stretch is tried with, when there are any. A wave smaller than `rounded_m` may be what rounding
    /// makes of a line: steps at an even speed beat with the sampling. It is none, and a line is white that leaves nothing else.
    pub fn of(t: &[f64], z: &[f64], cell_s: f64, hints: &[f64], rounded_m: f64) -> Option<Self> {
        let n = t.len();
        if n < FEWEST {
            return None;
        }
        let (first, last) = (t[0], t[n - 1]);
        let frame =
            Frame { middle: 0.5 * (first + last), half: (0.5 * (last - first)).max(1e-9), cell_s, t, z };
        let mut best = frame.fit(0, &[])?;
        for degree in 1..=3 {
            best = better(best, frame.fit(degree, &[]));
        }
        // A union of stretches may be a wave although, being short, it passes for a cubic.
        let union = !hints.is_empty();
        if !best.white || union {
            let narrow = 0.3 / (2.0 * frame.half);
            for w in hints {
                best =
                    better(best, frame.refined(&[], w / TAU, narrow).filter(|c| c.waves_beyond(rounded_m)));
            }
            let wanted = if union { 2.0 * frame.half < SHORT_S } else { !best.white };
            if wanted && let Some(one) = frame.wave(&[]) {
                if one.waves_beyond(rounded_m) {
                    let two = if one.white { None } else { frame.wave(&[one.waves[0][0]]) };
                    best = better(better(best, Some(one)), two.filter(|c| c.waves_beyond(rounded_m)));
                } else if one.white && best.waves.is_empty() {
                    best.white = true;
                }
            }
        }
        Some(best)
    }
}

/// The cheaper of two.
fn better(a: Course, b: Option<Course>) -> Course {
    match b {
        Some(b) if b.cost < a.cost => b,
        _ => a,
    }
}

/// A stretch under examination.
struct Frame<'a> {
    middle: f64,
    half: f64,
    cell_s: f64,
    t: &'a [f64],
    z: &'a [f64],
}

impl Frame<'_> {
    /// Least squares of a polynomial of a degree and waves of given frequencies.
    fn fit(&self, degree: usize, waves: &[f64]) -> Option<Course> {
        let rows = |row: &mut [f64; MOST], t: f64| self.row(row, t, degree, waves, self.cell_s);
        let count = degree + 1 + 2 * waves.len();
        let (x, squares) = solve(self.t, self.z, count, &rows)?;
        let n = self.t.len() as f64;
        let free = n - (count + waves.len()) as f64;
        if free < 4.0 {
            return None;
        }
        let variance = (squares / free).max(1e-20);
        let mut poly = [0.0; 4];
        poly[..=degree].copy_from_slice(&x[..=degree]);
        let waves: Vec<[f64; 3]> = waves
            .iter()
            .enumerate()
            .map(|(k, w)| {
                let at = degree + 1 + 2 * k;
                [*w, x[at], x[at + 1]]
            })
            .collect();
        let numbers = (count + waves.len()) as f64;
        let mut course = Course {
            middle: self.middle,
            half: self.half,
            poly,
            waves,
            sd_m: variance.sqrt(),
            cost: 0.5 * n * libm::log(variance) + numbers * libm::log(n),
            white: false,
        };
        course.white = self.is_white(&course);
        Some(course)
    }

    /// Values of the form's columns, as means over a cell.
    fn row(&self, row: &mut [f64; MOST], t: f64, degree: usize, waves: &[f64], cell_s: f64) {
        let s = (t - self.middle) / self.half;
        let mut power = 1.0;
        for slot in row.iter_mut().take(degree + 1) {
            *slot = power;
            power *= s;
        }
        for (k, w) in waves.iter().enumerate() {
            let half = 0.5 * w * cell_s;
            let mean = if half > 1e-6 { libm::sin(half) / half } else { 1.0 };
            let (sin, cos) = libm::sincos(w * (t - self.middle));
            row[degree + 1 + 2 * k] = mean * cos;
            row[degree + 2 + 2 * k] = mean * sin;
        }
    }

    /// A line with one more wave than those of the given frequencies.
    fn wave(&self, others: &[f64]) -> Option<Course> {
        let group_s = GROUP_S.min(2.0 * self.half / FEW_GROUPS).max(2.0 * self.half / GROUPS);
        let together = ((group_s / self.cell_s).round() as usize).max(1);
        let mean = |x: &[f64]| -> Vec<f64> {
            x.chunks(together).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect()
        };
        let (t, z) = (mean(self.t), mean(self.z));
        if t.len() < MOST + 2 {
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
            .map(|hz| (hz, self.off(others, hz, &t, &z, cell_s)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?
            .0;
        self.refined(others, coarse, step_hz)
    }

    /// A line with waves of the given frequencies and one near `hz`, by golden section on all cells.
    fn refined(&self, others: &[f64], hz: f64, within_hz: f64) -> Option<Course> {
        let (mut lo, mut hi) = ((hz - within_hz).max(1e-4), hz + within_hz);
        let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
        let all = |hz: f64| self.off(others, hz, self.t, self.z, self.cell_s);
        let (mut a, mut b) = (hi - ratio * (hi - lo), lo + ratio * (hi - lo));
        let (mut fa, mut fb) = (all(a), all(b));
        for _ in 0..24 {
            if fa < fb {
                (hi, b, fb) = (b, a, fa);
                a = hi - ratio * (hi - lo);
                fa = all(a);
            } else {
                (lo, a, fa) = (a, b, fb);
                b = lo + ratio * (hi - lo);
                fb = all(b);
            }
        }
        let mut waves = others.to_vec();
        waves.push(PI * (lo + hi));
        self.fit(1, &waves)
    }

    /// Sum of squares that a line with waves of the given frequencies and one of `hz` leaves.
    fn off(&self, others: &[f64], hz: f64, t: &[f64], z: &[f64], cell_s: f64) -> f64 {
        let mut waves = [0.0; 2];
        waves[..others.len()].copy_from_slice(others);
        waves[others.len()] = TAU * hz;
        let waves = &waves[..=others.len()];
        let rows = |row: &mut [f64; MOST], t: f64| self.row(row, t, 1, waves, cell_s);
        solve(t, z, 2 + 2 * waves.len(), &rows).map_or(f64::INFINITY, |s| s.1)
    }

    /// Whether means over several cells vary no more than white noise lets them.
    fn is_white(&self, course: &Course) -> bool {
        let waves: Vec<f64> = course.waves.iter().map(|w| w[0]).collect();
        let mut off = Vec::with_capacity(self.t.len());
        for (t, z) in self.t.iter().zip(self.z) {
            let mut row = [0.0; MOST];
            self.row(&mut row, *t, 0, &waves, self.cell_s);
            let s = (t - self.middle) / self.half;
            let [a, b, c, d] = course.poly;
            let mut at = a + s * (b + s * (c + s * d));
            for (k, wave) in course.waves.iter().enumerate() {
                at += wave[1] * row[1 + 2 * k] + wave[2] * row[2 + 2 * k];
            }
            off.push(z - at);
        }
        let groups = (off.len() / TOGETHER).max(1) as f64;
        let sum: f64 =
            off.chunks_exact(TOGETHER).map(|c| c.iter().sum::<f64>().powi(2) / TOGETHER as f64).sum();
        let ratio = sum / groups / (course.sd_m * course.sd_m);
        ratio < 1.0 + (5.0 * (2.0 / groups).sqrt()).max(0.5)
    }
}

/// Least squares with rows from a function: coefficients, and the sum of squares that they leave.
fn solve(
    t: &[f64],
    z: &[f64],
    count: usize,
    rows: &impl Fn(&mut [f64; MOST], f64),
) -> Option<([f64; MOST], f64)> {
    if t.len() <= count || count > MOST {
        return None;
    }
    let base = z[0];
    let (mut m, mut g, mut squares) = ([[0.0; MOST]; MOST], [0.0; MOST], 0.0);
    let mut row = [0.0; MOST];
    for (t, z) in t.iter().zip(z) {
        rows(&mut row, *t);
        let z = z - base;
        squares += z * z;
        for a in 0..count {
            g[a] += row[a] * z;
            for b in 0..=a {
                m[a][b] += row[a] * row[b];
            }
        }
    }
    let mut h = Symmetric::zeros(count);
    for (a, line) in m.iter().enumerate().take(count) {
        for (b, value) in line.iter().enumerate().take(a + 1) {
            h.add(a, b, *value);
        }
    }
    let solved = h.factor().solve(&g[..count]);
    let mut x = [0.0; MOST];
    x[..count].copy_from_slice(&solved);
    x[0] += base;
    // By the residual itself: what the normal equations say of it drowns in rounding.
    let mut left = 0.0;
    for (t, z) in t.iter().zip(z) {
        rows(&mut row, *t);
        let at: f64 = row.iter().zip(&x).take(count).map(|(r, x)| r * x).sum();
        left += (z - at).powi(2);
    }
    (left <= squares.max(1e-30) * 1.001 + 1e-18).then_some((x, left))
}
