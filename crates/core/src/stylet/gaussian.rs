//! A small Gaussian belief: mean, covariance, and what a scalar measurement does to them.

/// Mean and covariance of `N` unknowns. The covariance is in units of a noise variance that the
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
            p[i][i] = v;
        }
        Self { x, p }
    }

    /// The innovation of `y = h x + noise`, whose noise has variance `r`.
    #[inline(always)]
    pub(crate) fn innovation(&self, h: &[f64; N], y: f64, r: f64) -> Innovation<N> {
        let mut ph = [0.0; N];
        let mut s = r;
        let mut e = y;
        for i in 0..N {
            let mut sum = 0.0;
            for j in 0..N {
                sum += self.p[i][j] * h[j];
            }
            ph[i] = sum;
            s += sum * h[i];
            e -= h[i] * self.x[i];
        }
        Innovation { e, s, ph }
    }

    /// Takes the measurement: `x += P h e/s`, `P -= (P h)(P h)'/s`, which keeps `P` symmetric.
    #[inline(always)]
    pub(crate) fn take(&mut self, innovation: &Innovation<N>) {
        let Innovation { e, s, ph } = innovation;
        let gain = 1.0 / s;
        for i in 0..N {
            let k = ph[i] * gain;
            self.x[i] += k * e;
            for j in 0..N {
                self.p[i][j] -= k * ph[j];
            }
        }
        // What rounding may take from a variance that is known very well.
        for i in 0..N {
            if self.p[i][i] < TINY {
                self.p[i][i] = TINY;
            }
        }
    }

    /// Forgets what is known of one unknown: a new variance, no correlation with the others.
    pub(crate) fn renew(&mut self, i: usize, mean: f64, variance: f64) {
        for j in 0..N {
            self.p[i][j] = 0.0;
            self.p[j][i] = 0.0;
        }
        self.p[i][i] = variance;
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
                    half[i][j] += map[i][k] * self.p[k][j];
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
        for k in 0..N {
            self.p[i][k] += by * self.p[j][k];
        }
        for k in 0..N {
            self.p[k][i] += by * self.p[k][j];
        }
    }

    /// True while all entries are numbers.
    pub(crate) fn is_finite(&self) -> bool {
        self.x.iter().chain(self.p.iter().flatten()).sum::<f64>().is_finite()
    }
}

/// Least variance kept, in units of the noise variance and the unknown's own unit squared.
const TINY: f64 = 1e-18;
