//! Parametric segments of commanded motion: a rest, a line, a parabola or cubic, a line with one or two
//! sinusoids.
//!
//! A local window narrow enough for a ripple of 1 Hz leaves 0.1 mm/s of encoder noise in the velocity, which
//! friction turns into the largest force error. When a whole interval has one of these forms, a few parameters
//! are estimated from all its samples and the velocity is a hundred times more accurate. An interval with
//! coloured residuals under every form is left to local windows (`smooth_positions`).

use core::f64::consts::{PI, TAU};
use stylet_stats::linear_algebra::SymmetricMatrix;

/// Highest frequency in Hz that is searched.
const HIGHEST_HZ: f64 = 3.0;
/// Length in s of the means used in the frequency search.
const SEARCH_MEAN_S: f64 = 0.1;
/// Smallest and largest number of these means.
const MIN_SEARCH_MEANS: f64 = 24.0;
const MAX_SEARCH_MEANS: f64 = 400.0;
/// Intervals shorter than this in s are searched over all frequencies, with or without hints.
const SHORT_SEGMENT_S: f64 = 6.0;
/// Cells per mean in the whiteness test.
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
    /// Nats of residuals and parameters.
    pub cost: f64,
    /// Whether the residual is white.
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

    /// Whether all amplitudes exceed `amplitude_m`.
    fn sinusoids_exceed(&self, amplitude_m: f64) -> bool {
        self.sinusoids.iter().all(|[_, x, y]| libm::hypot(*x, *y) > amplitude_m)
    }

    /// Angular frequencies in 1/s.
    pub fn frequencies(&self) -> impl Iterator<Item = f64> + '_ {
        self.sinusoids.iter().map(|w| w[0])
    }

    /// The best segment for cells at `t` (s, midpoints, `cell_s` apart) with mean positions `z` (m). A long
    /// interval is tried only with the angular frequencies in `hints` (1/s), if there are any. A sinusoid
    /// smaller than `rounded_m` may be an artefact of quantisation at constant velocity, which beats with the
    /// sampling; it is discarded, and the line counts as white if nothing else remains.
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
        // A union of intervals may be a sinusoid although, being short, it resembles a cubic.
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

    /// The better of a rest and a line.
    pub fn fit_constant_velocity(t: &[f64], z: &[f64], cell_s: f64) -> Option<Self> {
        let frame = SegmentFit::new(t, z, cell_s)?;
        Some(cheaper(frame.fit(0, &[])?, frame.fit(1, &[])))
    }
}

/// The cheaper of two.
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
    fn fit(&self, degree: usize, waves: &[f64]) -> Option<MotionSegment> {
        let rows =
            |row: &mut [f64; MAX_COEFFICIENTS], t: f64| self.design_row(row, t, degree, waves, self.cell_s);
        let count = degree + 1 + 2 * waves.len();
        let (x, squares) = least_squares(self.t, self.z, count, &rows)?;
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
        let mut course = MotionSegment {
            middle: self.middle,
            half: self.half,
            poly,
            sinusoids: waves,
            sd_m: variance.sqrt(),
            cost: 0.5 * n * libm::log(variance) + numbers * libm::log(n),
            white: false,
        };
        course.white = self.is_white(&course);
        Some(course)
    }

    /// Row of the design matrix, as means over a cell.
    fn design_row(
        &self,
        row: &mut [f64; MAX_COEFFICIENTS],
        t: f64,
        degree: usize,
        waves: &[f64],
        cell_s: f64,
    ) {
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

    /// A line with one sinusoid in addition to those of the given frequencies.
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

    /// A line with sinusoids of the given frequencies and one near `hz`, by golden section on all cells.
    fn refine_frequency(&self, others: &[f64], hz: f64, within_hz: f64) -> Option<MotionSegment> {
        let (mut lo, mut hi) = ((hz - within_hz).max(1e-4), hz + within_hz);
        let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
        let all = |hz: f64| self.sum_of_squares(others, hz, self.t, self.z, self.cell_s);
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

    /// Residual sum of squares of a line with sinusoids of the given frequencies and one of `hz`.
    fn sum_of_squares(&self, others: &[f64], hz: f64, t: &[f64], z: &[f64], cell_s: f64) -> f64 {
        let mut waves = [0.0; 2];
        waves[..others.len()].copy_from_slice(others);
        waves[others.len()] = TAU * hz;
        let waves = &waves[..=others.len()];
        let rows = |row: &mut [f64; MAX_COEFFICIENTS], t: f64| self.design_row(row, t, 1, waves, cell_s);
        least_squares(t, z, 2 + 2 * waves.len(), &rows).map_or(f64::INFINITY, |s| s.1)
    }

    /// Whether means over several cells vary no more than white noise allows.
    fn is_white(&self, course: &MotionSegment) -> bool {
        let waves: Vec<f64> = course.sinusoids.iter().map(|w| w[0]).collect();
        let mut off = Vec::with_capacity(self.t.len());
        for (t, z) in self.t.iter().zip(self.z) {
            let mut row = [0.0; MAX_COEFFICIENTS];
            self.design_row(&mut row, *t, 0, &waves, self.cell_s);
            let s = (t - self.middle) / self.half;
            let [a, b, c, d] = course.poly;
            let mut at = a + s * (b + s * (c + s * d));
            for (k, wave) in course.sinusoids.iter().enumerate() {
                at += wave[1] * row[1 + 2 * k] + wave[2] * row[2 + 2 * k];
            }
            off.push(z - at);
        }
        let groups = (off.len() / WHITENESS_CELLS).max(1) as f64;
        let sum: f64 = off
            .chunks_exact(WHITENESS_CELLS)
            .map(|c| c.iter().sum::<f64>().powi(2) / WHITENESS_CELLS as f64)
            .sum();
        let ratio = sum / groups / (course.sd_m * course.sd_m);
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
    let (mut m, mut g, mut squares) =
        ([[0.0; MAX_COEFFICIENTS]; MAX_COEFFICIENTS], [0.0; MAX_COEFFICIENTS], 0.0);
    let mut row = [0.0; MAX_COEFFICIENTS];
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
    let mut h = SymmetricMatrix::zeros(count);
    for (a, line) in m.iter().enumerate().take(count) {
        for (b, value) in line.iter().enumerate().take(a + 1) {
            h.add(a, b, *value);
        }
    }
    let solved = h.cholesky().solve(&g[..count]);
    let mut x = [0.0; MAX_COEFFICIENTS];
    x[..count].copy_from_slice(&solved);
    x[0] += base;
    // From the residuals themselves: the normal equations lose it to rounding.
    let mut left = 0.0;
    for (t, z) in t.iter().zip(z) {
        rows(&mut row, *t);
        let at: f64 = row.iter().zip(&x).take(count).map(|(r, x)| r * x).sum();
        left += (z - at).powi(2);
    }
    (left <= squares.max(1e-30) * 1.001 + 1e-18).then_some((x, left))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-6), "{told} for {wanted}");
    }

    /// Normal numbers: sums of twelve uniform ones from a linear congruential generator (Knuth's MMIX).
    fn normal(n: usize) -> Vec<f64> {
        let mut state = 11_u64;
        let mut even = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..n).map(|_| (0..12).map(|_| even()).sum::<f64>() - 6.0).collect()
    }

    const CELL_S: f64 = 0.02;

    /// Cell midpoints from 3 s on.
    fn cells(n: usize) -> Vec<f64> {
        (0..n).map(|k| 3.0 + CELL_S * k as f64).collect()
    }

    /// Positions with 10 µm of noise.
    fn noisy(t: &[f64], course: impl Fn(f64) -> f64) -> Vec<f64> {
        t.iter().zip(normal(t.len())).map(|(t, n)| course(*t) + 1e-5 * n).collect()
    }

    fn frame<'a>(t: &'a [f64], z: &'a [f64]) -> SegmentFit<'a> {
        SegmentFit::new(t, z, CELL_S).expect("cells")
    }

    fn plain(poly: [f64; 4], waves: &[[f64; 3]], sd_m: f64) -> MotionSegment {
        MotionSegment {
            middle: 4.0,
            half: 2.0,
            poly,
            sinusoids: waves.to_vec(),
            sd_m,
            cost: 0.0,
            white: false,
        }
    }

    #[test]
    fn a_segment_is_a_cubic_plus_sinusoids() {
        let c = plain([0.3, 0.5, -0.7, 0.11], &[[5.0, 0.2, -0.4], [9.0, 0.05, 0.01]], 1.0);
        for t in [2.0_f64, 3.1, 4.0, 5.7] {
            let s = (t - 4.0) / 2.0;
            let cubic = 0.3 + 0.5 * s - 0.7 * s.powi(2) + 0.11 * s.powi(3);
            let wave = |w: f64, x: f64, y: f64| x * (w * (t - 4.0)).cos() + y * (w * (t - 4.0)).sin();
            near(c.at(t).0, cubic + wave(5.0, 0.2, -0.4) + wave(9.0, 0.05, 0.01));
            // The derivative of a sinusoid leads by a quarter period, scaled by its frequency.
            let slope = 0.5 - 1.4 * s + 0.33 * s.powi(2);
            near(c.at(t).1, slope / 2.0 + wave(5.0, 5.0 * -0.4, -5.0 * 0.2) + wave(9.0, 0.09, -0.45));
        }
        assert_eq!(c.frequencies().collect::<Vec<_>>(), [5.0, 9.0]);
    }

    #[test]
    fn a_rest_has_neither_slope_nor_sinusoid() {
        assert!(plain([0.3, 0.0, 0.0, 0.0], &[], 1.0).is_at_rest());
        for k in 1..4 {
            let mut poly = [0.3, 0.0, 0.0, 0.0];
            poly[k] = 1e-9;
            assert!(!plain(poly, &[], 1.0).is_at_rest());
        }
        assert!(!plain([0.3, 0.0, 0.0, 0.0], &[[1.0, 0.0, 0.1]], 1.0).is_at_rest());
    }

    #[test]
    fn amplitudes_combine_cosine_and_sine() {
        let c = plain([0.0; 4], &[[1.0, 0.3, -0.4], [2.0, 5.0, 12.0]], 1.0);
        assert!(c.sinusoids_exceed(0.499) && !c.sinusoids_exceed(0.501));
        assert!(plain([0.0; 4], &[], 1.0).sinusoids_exceed(9.0));
    }

    #[test]
    fn design_columns_are_cell_means() {
        let t = cells(50);
        let f = frame(&t, &t);
        for (w, cell_s) in [(3.0, 0.3), (40.0, 0.05), (1e-5, 0.02)] {
            let mut row = [7.0; MAX_COEFFICIENTS];
            f.design_row(&mut row, 3.4, 1, &[w, 2.0 * w], cell_s);
            near(row[0], 1.0);
            near(row[1], (3.4 - f.middle) / f.half);
            let mean = |g: &dyn Fn(f64) -> f64| {
                let n = 20_000;
                (0..n)
                    .map(|k| g(3.4 - f.middle + cell_s * ((f64::from(k) + 0.5) / f64::from(n) - 0.5)))
                    .sum::<f64>()
                    / f64::from(n)
            };
            let wanted = [
                mean(&|s| (w * s).cos()),
                mean(&|s| (w * s).sin()),
                mean(&|s| (2.0 * w * s).cos()),
                mean(&|s| (2.0 * w * s).sin()),
            ];
            for (told, wanted) in row[2..].iter().zip(wanted) {
                assert!((told - wanted).abs() < 1e-7, "{told} for {wanted}");
            }
        }
        let mut row = [7.0; MAX_COEFFICIENTS];
        f.design_row(&mut row, 4.2, 3, &[], CELL_S);
        let s = (4.2 - f.middle) / f.half;
        near(row[2], s * s);
        near(row[3], s * s * s);
        assert_eq!(row[4..], [7.0; 2]);
    }

    #[test]
    fn every_form_is_recovered() {
        let t = cells(400);
        let wave = |t: f64, hz: f64, a: f64| a * (TAU * hz * t + 0.4).sin();
        type Form<'a> = (&'a dyn Fn(f64) -> f64, usize, &'a [f64]);
        let forms: [Form; 6] = [
            (&|_| 0.05, 0, &[]),
            (&|t| 0.05 - 0.003 * t, 1, &[]),
            (&|t| 0.004 * t + 0.0005 * t * t, 2, &[]),
            (&|t| 0.004 * t - 0.0003 * (t - 6.0).powi(3), 3, &[]),
            (&|t| 0.003 * t + wave(t, 0.77, 0.0004), 1, &[0.77]),
            (&|t| 0.003 * t + wave(t, 0.9, 0.0004) + wave(t, 2.3, 0.0002), 1, &[0.9, 2.3]),
        ];
        for (form, degree, hz) in forms {
            let z = noisy(&t, form);
            let c = MotionSegment::fit_best(&t, &z, CELL_S, &[], 0.0).expect("a form");
            assert!(c.white);
            assert_eq!(c.poly.iter().rposition(|x| *x != 0.0), Some(degree));
            assert_eq!(c.is_at_rest(), degree == 0);
            assert_eq!(c.sinusoids.len(), hz.len());
            for (told, hz) in c.frequencies().zip(hz) {
                assert!((told / TAU - hz).abs() < 2e-3, "{} for {hz}", told / TAU);
            }
            assert!((c.sd_m / 1e-5 - 1.0).abs() < 0.1, "{}", c.sd_m);
            // Means over 20 ms hardly attenuate the sinusoids.
            for t in &t[20..380] {
                let (z, v) = c.at(*t);
                let slope = (form(t + 1e-5) - form(t - 1e-5)) / 2e-5;
                assert!((z - form(*t)).abs() < 8e-6 && (v - slope).abs() < 6e-5, "{z} {v} at {t}");
            }
        }
    }

    #[test]
    fn the_cost_of_a_segment_is_residual_plus_parameters() {
        let t = cells(60);
        let z = noisy(&t, |t| 0.002 * t + 0.0004 * (TAU * 0.9 * t).sin());
        let f = frame(&t, &z);
        for (degree, waves) in [(0, &[][..]), (1, &[]), (3, &[]), (1, &[5.0]), (0, &[5.0, 9.0])] {
            let c = f.fit(degree, waves).expect("a form");
            // A frequency is a parameter, too.
            let numbers = (degree + 1 + 3 * waves.len()) as f64;
            let mut x = [0.0; MAX_COEFFICIENTS];
            let count = degree + 1 + 2 * waves.len();
            x[..=degree].copy_from_slice(&c.poly[..=degree]);
            for (k, wave) in c.sinusoids.iter().enumerate() {
                assert_eq!(wave[0], waves[k]);
                x[degree + 1 + 2 * k..degree + 3 + 2 * k].copy_from_slice(&wave[1..]);
            }
            let left = |t: f64, z: f64| {
                let mut row = [0.0; MAX_COEFFICIENTS];
                f.design_row(&mut row, t, degree, waves, CELL_S);
                z - (0..count).map(|k| row[k] * x[k]).sum::<f64>()
            };
            let squares: f64 = t.iter().zip(&z).map(|(t, z)| left(*t, *z).powi(2)).sum();
            let variance = squares / (60.0 - numbers);
            near(c.sd_m, variance.sqrt());
            near(c.cost, 30.0 * variance.ln() + numbers * 60.0_f64.ln());
            // The residual is orthogonal to the columns.
            for k in 0..count {
                let with = |t: f64| {
                    let mut row = [0.0; MAX_COEFFICIENTS];
                    f.design_row(&mut row, t, degree, waves, CELL_S);
                    row[k]
                };
                let together: f64 = t.iter().zip(&z).map(|(t, z)| left(*t, *z) * with(*t)).sum();
                assert!(together.abs() < 1e-8 * (squares * 60.0).sqrt(), "{together}");
            }
            if degree == 1 && !waves.is_empty() {
                near(f.sum_of_squares(&[], 5.0 / TAU, &t, &z, CELL_S), squares);
            }
        }
        // The choice does not depend on the unit: costs differ by a constant.
        let exact: Vec<f64> = t.iter().map(|t| 0.002 * t).collect();
        near(frame(&t, &exact).fit(1, &[]).expect("a form").sd_m, 1e-10);
    }

    #[test]
    fn a_segment_needs_four_more_cells_than_parameters() {
        let f = |n: usize, degree: usize, waves: &[f64]| {
            let (t, z) = (cells(n), normal(n));
            frame(&t, &z).fit(degree, waves).is_some()
        };
        assert!(f(5, 0, &[]) && !f(4, 0, &[]));
        assert!(f(8, 3, &[]) && !f(7, 3, &[]));
        assert!(f(9, 1, &[50.0]) && !f(8, 1, &[50.0]));
        assert!(f(12, 1, &[50.0, 90.0]) && !f(11, 1, &[50.0, 90.0]));
        let of = |n: usize| MotionSegment::fit_best(&cells(n), &normal(n), CELL_S, &[], 0.0);
        assert!(of(12).is_some() && of(11).is_none());
    }

    #[test]
    fn the_whiteness_test_compares_group_means_with_single_cells() {
        // Eight cells with a common offset: their squared mean is eight times that of white noise of this size.
        let white = |n: usize, off: f64, sd_m: f64| {
            let t = cells(n);
            let (poly, waves) = ([0.2, 0.1, -0.3, 0.05], [[6.0, 0.01, 0.02]]);
            let mut c = plain(poly, &waves, sd_m);
            let f = frame(&t, &t);
            (c.middle, c.half) = (f.middle, f.half);
            // Alternating groups.
            let z: Vec<f64> = t
                .iter()
                .enumerate()
                .map(|(k, t)| {
                    let mean = (6.0 * 0.5 * CELL_S).sin() / (6.0 * 0.5 * CELL_S);
                    let cubic = plain(poly, &[], 1.0);
                    let smooth = MotionSegment { middle: f.middle, half: f.half, ..cubic }.at(*t).0;
                    let wave = 0.01 * (6.0 * (t - f.middle)).cos() + 0.02 * (6.0 * (t - f.middle)).sin();
                    let group = if k / 8 % 2 == 0 { off } else { -off };
                    // Cells after the last whole group do not count.
                    smooth + mean * wave + if k >= n / 8 * 8 { 9.0 } else { group }
                })
                .collect();
            frame(&t, &z).is_white(&c)
        };
        for (groups, most) in
            [(10_usize, 1.0 + 5.0 * 0.2_f64.sqrt()), (100, 1.0 + 5.0 * 0.02_f64.sqrt()), (400, 1.5)]
        {
            for beyond in [0, 5] {
                let limit = (most / 8.0_f64).sqrt() * 3e-5;
                assert!(white(8 * groups + beyond, 0.999 * limit, 3e-5), "{groups}");
                assert!(!white(8 * groups + beyond, 1.001 * limit, 3e-5), "{groups}");
            }
        }
    }

    #[test]
    fn least_squares_needs_more_cells_than_coefficients() {
        let row =
            |row: &mut [f64; MAX_COEFFICIENTS], t: f64| *row = core::array::from_fn(|k| t.powi(k as i32));
        let t = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        let z = t.map(|t| 1e4 + 2.0 * t - 0.5 * t * t);
        let (x, left) = least_squares(&t, &z, 3, &row).expect("a solution");
        for (told, wanted) in x.iter().zip([1e4, 2.0, -0.5, 0.0, 0.0, 0.0]) {
            assert!((told - wanted).abs() < 1e-9, "{x:?}");
        }
        assert!(left < 1e-20);
        // A mean leaves the deviations.
        let (x, left) = least_squares(&t[..4], &[1.0, 2.0, 3.0, 6.0], 1, &row).expect("a solution");
        near(x[0], 3.0);
        near(left, 14.0);
        assert!(
            least_squares(&t[..4], &z[..4], 3, &row).is_some()
                && least_squares(&t[..3], &z[..3], 3, &row).is_none()
        );
        assert!(least_squares(&t, &z, 6, &row).is_some() && least_squares(&t, &z, 7, &row).is_none());
    }

    #[test]
    fn the_cheaper_of_two_is_taken() {
        let of = |cost: f64| MotionSegment { cost, ..plain([cost; 4], &[], 1.0) };
        assert_eq!(cheaper(of(1.0), Some(of(2.0))).cost, 1.0);
        assert_eq!(cheaper(of(3.0), Some(of(2.0))).cost, 2.0);
        assert_eq!(cheaper(of(3.0), None).cost, 3.0);
    }

    #[test]
    fn a_frequency_is_estimated_to_a_thousandth_of_the_resolution() {
        for (n, hz) in [(300, 0.31), (300, 2.9), (1500, 1.37), (60, 1.1)] {
            let t = cells(n);
            let z: Vec<f64> = t.iter().map(|t| 0.003 * t + 3e-4 * (TAU * hz * t + 1.0).sin()).collect();
            let f = frame(&t, &z);
            let resolved = 1.0 / (2.0 * f.half);
            let told = f.add_sinusoid(&[]).expect("a wave").sinusoids[0][0] / TAU;
            assert!((told - hz).abs() < 1e-3 * resolved, "{told} for {hz}");
            // From a nearby frequency.
            for off in [-0.19, 0.12] {
                let told =
                    f.refine_frequency(&[], hz + off * resolved, 0.2 * resolved).expect("a wave").sinusoids
                        [0][0]
                        / TAU;
                assert!((told - hz).abs() < 1e-3 * resolved, "{told} for {hz}");
            }
            // Not outside of the search interval.
            let told =
                f.refine_frequency(&[], hz - 0.5 * resolved, 0.2 * resolved).expect("a wave").sinusoids[0][0]
                    / TAU;
            assert!((told - (hz - 0.3 * resolved)).abs() < 0.01 * resolved, "{told} for {hz}");
        }
        // Frequencies above 3 Hz, or above the resolution of the cells, are not searched.
        let at_most = |n: usize, hz: f64| {
            let t = cells(n);
            let z: Vec<f64> = t.iter().map(|t| 3e-4 * (TAU * hz * t).sin()).collect();
            frame(&t, &z).add_sinusoid(&[]).expect("a wave").sinusoids[0][0] / TAU
        };
        assert!(at_most(300, 3.6) < 3.1 && at_most(300, 2.95) > 2.9);
    }

    #[test]
    fn a_second_sinusoid_has_another_frequency() {
        let t = cells(500);
        let z: Vec<f64> =
            t.iter().map(|t| 4e-4 * (TAU * 0.8 * t).sin() + 1e-4 * (TAU * 1.9 * t).cos()).collect();
        let f = frame(&t, &z);
        // A known frequency is not found again.
        let told = f.add_sinusoid(&[TAU * 0.8]).expect("two waves");
        assert_eq!(told.sinusoids[0][0], TAU * 0.8);
        assert!((told.sinusoids[1][0] / TAU - 1.9).abs() < 1e-3);
        // Cells are means, which attenuates the sinusoid.
        for (wave, size) in told.sinusoids.iter().zip([4e-4, 1e-4]) {
            let mean = (0.5 * CELL_S * wave[0]).sin() / (0.5 * CELL_S * wave[0]);
            assert!((wave[1].hypot(wave[2]) * mean / size - 1.0).abs() < 1e-5, "{wave:?}");
        }
        assert!(told.sd_m < 1e-9 && told.poly[1].abs() < 1e-9);
    }

    #[test]
    fn long_intervals_use_frequency_hints_only() {
        let (long, short) = (cells(400), cells(290));
        let of = |t: &[f64], hints: &[f64]| {
            let z = noisy(t, |t| 0.003 * t + 4e-4 * (TAU * 0.8 * t).sin());
            MotionSegment::fit_best(t, &z, CELL_S, hints, 0.0).expect("a form")
        };
        assert!(of(&long, &[TAU * 0.81]).white);
        assert_eq!(of(&long, &[TAU * 0.81]).sinusoids.len(), 1);
        assert!(!of(&long, &[TAU * 1.6]).white);
        // Near a hint the search covers a third of the resolution.
        assert!(of(&long, &[TAU * (0.8 + 0.28 / 8.0)]).white);
        assert!(!of(&long, &[TAU * (0.8 + 0.45 / 8.0)]).white);
        // Below six seconds all frequencies are searched.
        assert!(of(&short, &[TAU * 1.6]).white);
        // A short one resembles a cubic and is a sinusoid all the same.
        let t = cells(120);
        let z = noisy(&t, |t| 0.003 * t + 4e-4 * (TAU * 0.3 * t).sin());
        let cubic = MotionSegment::fit_best(&t, &z, CELL_S, &[], 0.0).expect("a form");
        let wave = MotionSegment::fit_best(&t, &z, CELL_S, &[1e-3], 0.0).expect("a form");
        assert!(wave.cost <= cubic.cost);
    }

    #[test]
    fn a_quantisation_artefact_is_not_a_sinusoid() {
        let t = cells(400);
        let z = noisy(&t, |t| 0.003 * t + 2e-5 * (TAU * 0.8 * t).sin());
        let of = |rounded_m: f64| MotionSegment::fit_best(&t, &z, CELL_S, &[], rounded_m).expect("a form");
        let wave = of(1.8e-5);
        assert!(wave.white && wave.sinusoids.len() == 1);
        let line = of(2.2e-5);
        assert!(line.white && line.sinusoids.is_empty() && !line.is_at_rest());
        assert!(line.sd_m > wave.sd_m);
    }
}
