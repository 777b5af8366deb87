//! Kalman filter for a few unknowns with scalar measurements, shared by force predictor and layer estimator.
#![allow(clippy::needless_range_loop, reason = "matrices read best with their indices")]

use crate::bounds::at_least;

/// Mean and covariance of `N` unknowns. Only the lower triangle of the covariance is kept, in units of a noise variance
/// that the caller holds, so that gains do not change when the noise is re-estimated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gaussian<const N: usize> {
    pub(crate) x: [f64; N],
    pub(crate) p: [[f64; N]; N],
}

/// Innovation of a measurement before the update.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Innovation<const N: usize> {
    /// Measured minus predicted.
    pub(crate) e: f64,
    /// Variance of `e` in units of the noise variance.
    pub(crate) s: f64,
    ph: [f64; N],
}

impl<const N: usize> Gaussian<N> {
    /// Independent unknowns with these means and variances.
    pub(crate) fn new(x: [f64; N], variance: [f64; N]) -> Self {
        let mut p = [[0.0; N]; N];
        for (i, v) in variance.into_iter().enumerate() {
            p[i][i] = at_least(MIN_VARIANCE, v);
        }
        Self { x, p }
    }

    /// Covariance of two unknowns.
    #[inline(always)]
    pub(crate) fn cov(&self, i: usize, j: usize) -> f64 {
        if i >= j { self.p[i][j] } else { self.p[j][i] }
    }

    /// Innovation of `y = sum h_k x_(columns_k) + noise` with noise variance `r`.
    #[inline(always)]
    pub(crate) fn innovation<const M: usize>(
        &self,
        columns: [usize; M],
        h: [f64; M],
        y: f64,
        r: f64,
    ) -> Innovation<N> {
        self.leading_innovation::<N, M>(columns, h, y, r)
    }

    /// As [`Gaussian::innovation`] where only the first `R` unknowns are in use.
    #[inline(always)]
    pub(crate) fn leading_innovation<const R: usize, const M: usize>(
        &self,
        columns: [usize; M],
        h: [f64; M],
        y: f64,
        r: f64,
    ) -> Innovation<N> {
        let mut ph = [0.0; N];
        for (i, ph) in ph.iter_mut().enumerate().take(R) {
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
        // Rounding must not make it smaller than the noise alone.
        Innovation { e, s: at_least(r, s), ph }
    }

    /// Measurement update: `x += P h e/s`, `P -= (P h)(P h)'/s`.
    #[inline(always)]
    pub(crate) fn update(&mut self, innovation: &Innovation<N>) {
        self.leading_update::<N>(innovation);
    }

    /// As [`Gaussian::update`] where only the first `R` unknowns are in use.
    #[inline(always)]
    pub(crate) fn leading_update<const R: usize>(&mut self, innovation: &Innovation<N>) {
        let Innovation { e, s, ph } = innovation;
        let gain = 1.0 / s;
        let mut lost = false;
        for i in 0..R {
            let k = ph[i] * gain;
            self.x[i] += k * e;
            for j in 0..i {
                self.p[i][j] -= k * ph[j];
            }
            // Rounding must not make a small variance negative.
            let variance = self.p[i][i] - k * ph[i];
            lost |= variance < LOST_SHARE * self.p[i][i];
            self.p[i][i] = at_least(MIN_VARIANCE, variance);
        }
        if lost {
            self.restore_definiteness();
        }
    }

    /// Removes all correlations if rounding has made them larger than the variances allow.
    #[cold]
    #[inline(never)]
    fn restore_definiteness(&mut self) {
        if !self.is_positive_definite() {
            for i in 0..N {
                for j in 0..i {
                    self.p[i][j] = 0.0;
                }
            }
        }
    }

    /// Replaces mean and variance of one unknown and removes its correlations.
    pub(crate) fn reset_component(&mut self, i: usize, mean: f64, variance: f64) {
        for j in 0..N {
            self.p[i][j] = 0.0;
            self.p[j][i] = 0.0;
        }
        self.p[i][i] = at_least(MIN_VARIANCE, variance);
        self.x[i] = mean;
    }

    /// The distribution of `map x`.
    #[cfg(test)]
    pub(crate) fn transformed(&self, map: &[[f64; N]; N]) -> Self {
        self.leading_transformed::<N>(map)
    }

    /// The distribution of `map x` where only the first `R` unknowns are in use; the others are kept.
    pub(crate) fn leading_transformed<const R: usize>(&self, map: &[[f64; N]; N]) -> Self {
        let mut out = *self;
        for i in 0..R {
            (out.x[i], out.p[i]) = (0.0, [0.0; N]);
        }
        let mut half = [[0.0; N]; N];
        for i in 0..R {
            for j in 0..R {
                out.x[i] += map[i][j] * self.x[j];
                for k in 0..R {
                    half[i][j] += map[i][k] * self.cov(k, j);
                }
            }
        }
        for i in 0..R {
            for j in 0..=i {
                for k in 0..R {
                    out.p[i][j] += half[i][k] * map[j][k];
                }
                out.p[j][i] = out.p[i][j];
            }
        }
        out
    }

    /// `x_i += factor x_j`, covariance included.
    #[inline(always)]
    pub(crate) fn add_multiple(&mut self, i: usize, j: usize, factor: f64) {
        self.x[i] += factor * self.x[j];
        let variance = self.p[i][i] + factor * (2.0 * self.cov(i, j) + factor * self.p[j][j]);
        self.p[i][i] = at_least(MIN_VARIANCE, variance);
        for k in 0..N {
            if k != i {
                let more = factor * self.cov(j, k);
                if i > k {
                    self.p[i][k] += more;
                } else {
                    self.p[k][i] += more;
                }
            }
        }
        if variance < MIN_VARIANCE {
            self.restore_definiteness();
        }
    }

    /// True while all entries are finite and the covariance is positive definite: the Cholesky factor of the correlation
    /// matrix exists up to rounding.
    pub(crate) fn is_positive_definite(&self) -> bool {
        let mut l = [[0.0; N]; N];
        for i in 0..N {
            for j in 0..=i {
                let scale = libm::sqrt(self.p[i][i] * self.p[j][j]);
                let mut sum = self.p[i][j] / scale;
                for k in 0..j {
                    sum -= l[i][k] * l[j][k];
                }
                if i == j {
                    if !(sum > -PIVOT_ROUNDING && self.p[i][i] > 0.0) {
                        return false;
                    }
                    l[i][i] = libm::sqrt(sum.max(PIVOT_ROUNDING));
                } else {
                    l[i][j] = sum / l[j][j];
                }
            }
        }
        self.x.iter().chain(self.p.iter().flatten()).sum::<f64>().is_finite()
    }

    /// Means and variances are finite; cheap enough for every sample. [`Gaussian::update`] keeps finite variances positive.
    #[inline(always)]
    pub(crate) fn is_finite(&self) -> bool {
        (0..N).map(|i| self.p[i][i] + self.x[i]).sum::<f64>().is_finite()
    }
}

/// Largest prior variance of a force in units of the noise variance: uninformative, and small enough that double precision
/// still resolves the noise.
pub(crate) const MAX_VARIANCE_RATIO: f64 = 1e8;
/// Largest error that rounding leaves in a pivot of a correlation matrix.
const PIVOT_ROUNDING: f64 = 1e-6;
/// Share of a variance that an update leaves, below which rounding may have made the covariance indefinite: its errors, 1e-16 of the
/// variances before, are then more than 1e-10 of those after, and of correlations close to one much more.
const LOST_SHARE: f64 = 1e-6;
/// Smallest variance kept, in units of the noise variance and the unknown's unit squared.
const MIN_VARIANCE: f64 = 1e-15;

#[cfg(test)]
mod tests;
