//! A small Gaussian belief: mean, covariance, and what a scalar measurement does to them.
#![allow(clippy::needless_range_loop, reason = "matrices read best with their indices")]

/// Mean and covariance of `N` unknowns; of the covariance the lower triangle. The covariance is in units of a noise variance that the
/// caller keeps, so that gains do not change when the noise is re-estimated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gaussian<const N: usize> {
    pub(crate) x: [f64; N],
    pub(crate) p: [[f64; N]; N],
}

/// What a measurement says before it is used.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Innovation<const N: usize> {
    /// Measured less predicted.
    pub(crate) e: f64,
    /// Its variance, in units of the noise variance.
    pub(crate) s: f64,
    ph: [f64; N],
}

impl<const N: usize> Gaussian<N> {
    /// Independent unknowns with these means and variances.
    pub(crate) fn new(x: [f64; N], variance: [f64; N]) -> Self {
        let mut p = [[0.0; N]; N];
        for (i, v) in variance.into_iter().enumerate() {
            p[i][i] = at_least(TINY, v);
        }
        Self { x, p }
    }

    /// Covariance of two unknowns: the lower triangle is what is kept.
    #[inline(always)]
    pub(crate) fn cov(&self, i: usize, j: usize) -> f64 {
        if i >= j { self.p[i][j] } else { self.p[j][i] }
    }

    /// The innovation of `y = sum h_k x_(columns_k) + noise`, whose noise has variance `r`.
    #[inline(always)]
    pub(crate) fn innovation<const M: usize>(
        &self,
        columns: [usize; M],
        h: [f64; M],
        y: f64,
        r: f64,
    ) -> Innovation<N> {
        let mut ph = [0.0; N];
        for (i, ph) in ph.iter_mut().enumerate() {
            let mut sum = 0.0;
            for k in 0..M {
                sum += self.cov(i, columns[k]) * h[k];
            }
            *ph = sum;
        }
        let (mut s, mut e) = (r, y);
        for k in 0..M {
            s += ph[columns[k]] * h[k];
            e -= h[k] * self.x[columns[k]];
        }
        // Never less than the noise alone, whatever rounding does.
        Innovation { e, s: at_least(r, s), ph }
    }

    /// Takes the measurement: `x += P h e/s`, `P -= (P h)(P h)'/s`.
    #[inline(always)]
    pub(crate) fn take(&mut self, innovation: &Innovation<N>) {
        let Innovation { e, s, ph } = innovation;
        let gain = 1.0 / s;
        for i in 0..N {
            let k = ph[i] * gain;
            self.x[i] += k * e;
            for j in 0..i {
                self.p[i][j] -= k * ph[j];
            }
            // What rounding may take from a variance that is known very well.
            let variance = self.p[i][i] - k * ph[i];
            self.p[i][i] = at_least(TINY, variance);
        }
    }

    /// Forgets what is known of one unknown: a new variance, no correlation with the others.
    pub(crate) fn renew(&mut self, i: usize, mean: f64, variance: f64) {
        for j in 0..N {
            self.p[i][j] = 0.0;
            self.p[j][i] = 0.0;
        }
        self.p[i][i] = at_least(TINY, variance);
        self.x[i] = mean;
    }

    /// The belief about `map x`.
    pub(crate) fn mapped(&self, map: &[[f64; N]; N]) -> Self {
        let mut out = Self { x: [0.0; N], p: [[0.0; N]; N] };
        let mut half = [[0.0; N]; N];
        for i in 0..N {
            for j in 0..N {
                out.x[i] += map[i][j] * self.x[j];
                for k in 0..N {
                    half[i][j] += map[i][k] * self.cov(k, j);
                }
            }
        }
        for i in 0..N {
            for j in 0..=i {
                for k in 0..N {
                    out.p[i][j] += half[i][k] * map[j][k];
                }
                out.p[j][i] = out.p[i][j];
            }
        }
        out
    }

    /// `x_i += by x_j`, with the covariance.
    #[inline(always)]
    pub(crate) fn shear(&mut self, i: usize, j: usize, by: f64) {
        self.x[i] += by * self.x[j];
        self.p[i][i] += by * (2.0 * self.cov(i, j) + by * self.p[j][j]);
        for k in 0..N {
            if k != i {
                let more = by * self.cov(j, k);
                if i > k {
                    self.p[i][k] += more;
                } else {
                    self.p[k][i] += more;
                }
            }
        }
    }

    /// True while all entries are numbers and the covariance is positive definite: its Cholesky factor, of the matrix scaled to
    /// a unit diagonal, exists up to rounding.
    pub(crate) fn is_sound(&self) -> bool {
        let mut l = [[0.0; N]; N];
        for i in 0..N {
            for j in 0..=i {
                let scale = libm::sqrt(self.p[i][i] * self.p[j][j]);
                let mut sum = self.p[i][j] / scale;
                for k in 0..j {
                    sum -= l[i][k] * l[j][k];
                }
                if i == j {
                    if !(sum > -ROUNDING && self.p[i][i] > 0.0) {
                        return false;
                    }
                    l[i][i] = libm::sqrt(sum.max(ROUNDING));
                } else {
                    l[i][j] = sum / l[j][j];
                }
            }
        }
        self.x.iter().chain(self.p.iter().flatten()).sum::<f64>().is_finite()
    }

    /// Variances and means are numbers: cheap enough for every sample. A variance that is a number is positive, because
    /// [`Gaussian::take`] sees to it.
    #[inline(always)]
    pub(crate) fn is_usable(&self) -> bool {
        let mut sum = 0.0;
        for i in 0..N {
            sum += self.p[i][i] + self.x[i];
        }
        sum.is_finite()
    }
}

/// `x`, and the bound where `x` is less or no number: one instruction, where `f64::max` takes several.
#[inline(always)]
pub(crate) fn at_least(bound: f64, x: f64) -> f64 {
    if x > bound { x } else { bound }
}

/// `x`, and the bound where `x` is more or no number.
#[inline(always)]
pub(crate) fn at_most(bound: f64, x: f64) -> f64 {
    if x < bound { x } else { bound }
}

/// Largest variance of a force that a prior may state, in units of the noise's: wide enough to be no prior at all, and far enough from
/// what 16 digits can tell apart from the noise.
pub(crate) const WIDEST: f64 = 1e8;
/// What rounding may take from a pivot of a correlation matrix.
const ROUNDING: f64 = 1e-6;
/// Least variance kept, in units of the noise variance and the unknown's own unit squared.
const TINY: f64 = 1e-15;
