//! The colour and size of the noise: an autoregressive model of order two at most, and the whitening
//! that goes with it.

use crate::track::Track;

/// Autoregressive noise `e_i = a1 e_(i-1) + a2 e_(i-2) + w_i`, `w` of standard deviation `innovation_n`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Coefficients.
    pub a: [f64; 2],
    /// Standard deviation of the innovations in N.
    pub innovation_n: f64,
    /// Standard deviation of the noise itself in N.
    pub marginal_n: f64,
}

impl Noise {
    /// Independent noise.
    #[must_use]
    pub fn white(sd_n: f64) -> Self {
        Self { a: [0.0; 2], innovation_n: sd_n, marginal_n: sd_n }
    }

    /// The model that fits the residuals `e` of the samples chosen by `chosen(track, i)`: robust least
    /// squares, order by BIC. `None` with fewer than 60 samples.
    #[must_use]
    pub fn estimate(
        parts: &[(&Track, &[f64])],
        chosen: impl Fn(usize, usize) -> bool,
        least_n: f64,
    ) -> Option<Self> {
        let mut rows: Vec<[f64; 3]> = Vec::new();
        for (r, (track, e)) in parts.iter().enumerate() {
            for i in 2..track.len() {
                if track.used[i] && !track.restart[i] && chosen(r, i) && chosen(r, i - 1) && chosen(r, i - 2)
                {
                    rows.push([e[i], e[i - 1], e[i - 2]]);
                }
            }
        }
        if rows.len() < 60 {
            return None;
        }
        let mut size: Vec<f64> = rows.iter().map(|row| row[0].abs()).collect();
        let mad = median(&mut size) * 1.4826;
        let limit = 5.0 * mad.max(least_n);
        rows.retain(|row| row.iter().all(|x| x.abs() <= limit));
        let n = rows.len() as f64;
        if n < 40.0 {
            return None;
        }
        let dot = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum::<f64>() / n;
        let (c00, c01, c02, c11, c12, c22) =
            (dot(0, 0), dot(0, 1), dot(0, 2), dot(1, 1), dot(1, 2), dot(2, 2));
        let tiny = least_n * least_n;
        let one = (c01 / c11.max(tiny)).clamp(-0.995, 0.995);
        let s1 = c00 - 2.0 * one * c01 + one * one * c11;
        let det = c11 * c22 - c12 * c12;
        let (mut a, mut b) = (one, 0.0);
        let mut s2 = s1;
        if det > 1e-12 * c11 * c22 {
            a = (c01 * c22 - c02 * c12) / det;
            b = (c02 * c11 - c01 * c12) / det;
            s2 = c00 - 2.0 * a * c01 - 2.0 * b * c02 + a * a * c11 + 2.0 * a * b * c12 + b * b * c22;
        }
        let bic = |s: f64, p: f64| n * s.max(tiny).ln() + p * n.ln();
        let stationary = b.abs() < 0.99 && a + b < 0.995 && b - a < 0.995;
        let (a, s) = if stationary && bic(s2, 2.0) < bic(s1, 1.0) && bic(s2, 2.0) < bic(c00, 0.0) {
            ([a, b], s2)
        } else if bic(s1, 1.0) < bic(c00, 0.0) {
            ([one, 0.0], s1)
        } else {
            ([0.0; 2], c00)
        };
        Some(Self::of(a, s.max(tiny).sqrt()))
    }

    /// The model with these coefficients.
    #[must_use]
    pub fn of(a: [f64; 2], innovation_n: f64) -> Self {
        let rho = a[0] / (1.0 - a[1]);
        let gain = 1.0 - a[0] * rho - a[1] * (a[1] + a[0] * rho);
        Self { a, innovation_n, marginal_n: innovation_n / gain.max(1e-4).sqrt() }
    }

    /// The noise of means over blocks of `q` samples, by its first three autocovariances.
    #[must_use]
    pub fn blocks(&self, q: usize) -> Self {
        if q < 2 {
            return *self;
        }
        let mut r = vec![1.0, self.a[0] / (1.0 - self.a[1])];
        for k in 2..3 * q {
            r.push(self.a[0] * r[k - 1] + self.a[1] * r[k - 2]);
        }
        let variance = self.marginal_n * self.marginal_n / (q * q) as f64;
        let covariance = |lag: usize| {
            let mut sum = 0.0;
            for i in 0..q {
                for j in 0..q {
                    sum += r[(lag * q + j).abs_diff(i)];
                }
            }
            sum * variance
        };
        let (c0, c1, c2) = (covariance(0), covariance(1), covariance(2));
        let det = (c0 * c0 - c1 * c1).max(1e-12 * c0 * c0);
        let a = [(c1 * c0 - c1 * c2) / det, (c2 * c0 - c1 * c1) / det];
        let left = c0 - a[0] * c1 - a[1] * c2;
        Self::of(a, left.max(1e-6 * c0).sqrt())
    }

    /// One whitened residual from those at sample `i` and the two before.
    #[inline]
    #[must_use]
    pub fn one(&self, track: &Track, i: usize, e: [f64; 3]) -> f64 {
        if !track.used[i] {
            0.0
        } else if track.restart[i] {
            e[0] / self.marginal_n
        } else {
            (e[0] - self.a[0] * e[1] - self.a[1] * e[2]) / self.innovation_n
        }
    }

    /// Whitens residuals: unit variance, independent, zero where the track is not used.
    pub fn whiten(&self, track: &Track, e: &[f64], out: &mut [f64]) {
        let (inner, marginal) = (1.0 / self.innovation_n, 1.0 / self.marginal_n);
        let [a1, a2] = self.a;
        for i in 0..e.len() {
            out[i] = if !track.used[i] {
                0.0
            } else if track.restart[i] {
                e[i] * marginal
            } else {
                (e[i] - a1 * e[i - 1] - a2 * e[i - 2]) * inner
            };
        }
    }
}

/// Median; zero of nothing.
pub fn median(x: &mut [f64]) -> f64 {
    if x.is_empty() {
        return 0.0;
    }
    let middle = x.len() / 2;
    *x.select_nth_unstable_by(middle, f64::total_cmp).1
}
