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
    pub(crate) fn update(&mut self, innovation: &Innovation<N>) {
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
    pub(crate) fn reset_component(&mut self, i: usize, mean: f64, variance: f64) {
        for j in 0..N {
            self.p[i][j] = 0.0;
            self.p[j][i] = 0.0;
        }
        self.p[i][i] = at_least(TINY, variance);
        self.x[i] = mean;
    }

    /// The belief about `map x`.
    pub(crate) fn transformed(&self, map: &[[f64; N]; N]) -> Self {
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
    pub(crate) fn add_multiple(&mut self, i: usize, j: usize, by: f64) {
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
    pub(crate) fn is_finite(&self) -> bool {
        (0..N).map(|i| self.p[i][i] + self.x[i]).sum::<f64>().is_finite()
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
pub(crate) const MAX_VARIANCE_RATIO: f64 = 1e8;
/// What rounding may take from a pivot of a correlation matrix.
const ROUNDING: f64 = 1e-6;
/// Least variance kept, in units of the noise variance and the unknown's own unit squared.
const TINY: f64 = 1e-15;

#[cfg(test)]
mod tests {
    use super::*;

    type Matrix = [[f64; 3]; 3];

    /// `map diag(1, 4, 0.25) map'` about the mean `map [1, -2, 0.5]`: unknowns that hang together.
    const MAP: Matrix = [[1.0, 0.5, -1.0], [0.3, 1.0, 2.0], [-0.7, 0.2, 1.5]];
    const DIAGONAL: [f64; 3] = [1.0, 4.0, 0.25];
    const MEAN: [f64; 3] = [1.0, -2.0, 0.5];

    fn belief() -> Gaussian<3> {
        Gaussian::new(MEAN, DIAGONAL).transformed(&MAP)
    }

    fn full(g: &Gaussian<3>) -> Matrix {
        core::array::from_fn(|i| core::array::from_fn(|j| g.cov(i, j)))
    }

    fn assert_near(found: &Matrix, expected: &Matrix) {
        for (f, e) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((f - e).abs() < 1e-9, "{found:?} for {expected:?}");
        }
    }

    /// By Cramer's rule.
    fn inverse(m: &Matrix) -> Matrix {
        let cofactor = |i: usize, j: usize| {
            let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
            m[a][c] * m[b][d] - m[a][d] * m[b][c]
        };
        let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
        core::array::from_fn(|i| core::array::from_fn(|j| cofactor(j, i) / determinant))
    }

    #[test]
    fn a_linear_map_carries_mean_and_covariance_along() {
        let g = belief();
        let expected: Matrix = core::array::from_fn(|i| {
            core::array::from_fn(|j| (0..3).map(|k| MAP[i][k] * DIAGONAL[k] * MAP[j][k]).sum())
        });
        assert_near(&full(&g), &expected);
        for i in 0..3 {
            let mean: f64 = (0..3).map(|k| MAP[i][k] * MEAN[k]).sum();
            assert!((g.x[i] - mean).abs() < 1e-12);
        }
        // And once more, now that the unknowns hang together.
        let twice = g.transformed(&MAP);
        let expected: Matrix = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                (0..9).map(|n| MAP[i][n / 3] * expected[n / 3][n % 3] * MAP[j][n % 3]).sum()
            })
        });
        assert_near(&full(&twice), &expected);
    }

    /// In the information form `P⁻¹` grows by `h h'/r`, and `P⁻¹ x` by `h y/r`.
    #[test]
    fn a_measurement_adds_its_information() {
        let (h, y, r) = ([2.0, 0.0, -0.5], 1.7, 0.3);
        let before = belief();
        let innovation = before.innovation([0, 2], [h[0], h[2]], y, r);
        let spread: f64 = (0..9).map(|n| h[n / 3] * before.cov(n / 3, n % 3) * h[n % 3]).sum();
        assert!((innovation.s - (spread + r)).abs() < 1e-12);
        let mut after = before;
        after.update(&innovation);
        let information = inverse(&full(&before));
        let grown: Matrix =
            core::array::from_fn(|i| core::array::from_fn(|j| information[i][j] + h[i] * h[j] / r));
        assert_near(&full(&after), &inverse(&grown));
        for i in 0..3 {
            let was: f64 = (0..3).map(|j| information[i][j] * before.x[j]).sum();
            let is: f64 = (0..3).map(|j| grown[i][j] * after.x[j]).sum();
            assert!((is - (was + h[i] * y / r)).abs() < 1e-9, "{i}");
        }
    }

    #[test]
    fn a_shear_is_the_linear_map_that_adds_a_share_of_one_unknown_to_another() {
        for (i, j) in [(0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)] {
            let mut sheared = belief();
            sheared.add_multiple(i, j, 0.8);
            let mut map: Matrix =
                core::array::from_fn(|a| core::array::from_fn(|b| f64::from(u8::from(a == b))));
            map[i][j] = 0.8;
            let expected = belief().transformed(&map);
            assert_near(&full(&sheared), &full(&expected));
            assert!(sheared.x.iter().zip(expected.x).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    #[test]
    fn what_is_known_anew_of_one_unknown_leaves_the_others_as_they_were() {
        let mut g = belief();
        g.reset_component(1, 7.0, 9.0);
        let expected = full(&belief());
        let (x, was) = (g.x, belief().x);
        assert_eq!((x[0], x[1], x[2]), (was[0], 7.0, was[2]));
        for i in 0..3 {
            for j in 0..3 {
                let is = match (i == 1, j == 1) {
                    (true, true) => 9.0,
                    (false, false) => expected[i][j],
                    _ => 0.0,
                };
                assert_eq!(g.cov(i, j), is);
            }
        }
    }

    #[test]
    fn a_covariance_that_none_can_be_is_not_sound() {
        assert!(belief().is_positive_definite() && belief().is_finite());
        // Correlations above one; those of which any two could be but not all three; a variance below zero; what is no number.
        let mut g = Gaussian::new([0.0; 3], [1.0, 4.0, 9.0]);
        g.p[1][0] = 1.9;
        assert!(g.is_positive_definite(), "a correlation of 0.95");
        g.p[1][0] = -2.1;
        assert!(!g.is_positive_definite(), "a correlation of -1.05");
        let mut g = Gaussian::new([0.0; 3], [1.0; 3]);
        (g.p[1][0], g.p[2][0], g.p[2][1]) = (0.9, 0.9, 0.9);
        assert!(g.is_positive_definite());
        g.p[2][1] = -0.9;
        assert!(!g.is_positive_definite());
        let mut g = belief();
        g.p[2][2] = -1.0;
        assert!(!g.is_positive_definite());
        for spoil in [f64::NAN, f64::INFINITY] {
            let mut g = belief();
            g.x[1] = spoil;
            assert!(!g.is_positive_definite() && !g.is_finite());
            let mut g = belief();
            g.p[1][1] = spoil;
            assert!(!g.is_positive_definite() && !g.is_finite());
        }
    }

    #[test]
    fn bounds_hold_for_what_is_no_number_too() {
        assert_eq!([at_least(1.0, 2.0), at_least(1.0, 0.5), at_least(1.0, f64::NAN)], [2.0, 1.0, 1.0]);
        assert_eq!([at_most(1.0, 2.0), at_most(1.0, 0.5), at_most(1.0, f64::NAN)], [1.0, 0.5, 1.0]);
    }

    #[test]
    fn no_innovation_is_surer_than_its_noise_and_no_variance_falls_below_the_least() {
        // What rounding has made of a covariance that is none.
        let mut g = Gaussian::new([1.0, 2.0, 3.0], [1.0; 3]);
        g.p[1][0] = -3.0;
        let found = g.innovation([0, 1], [0.7, 0.9], 5.0, 0.3);
        assert_eq!(found.s, 0.3);
        assert!((found.e - (5.0 - 0.7 - 1.8)).abs() < 1e-12);
        let mut g = Gaussian::new([1.0, 2.0, 3.0], [0.0, 4.0, 9.0]);
        assert_eq!(g.p[0][0], 1e-15);
        let known = g.innovation([1], [1.0], 5.0, 1e-30);
        g.update(&known);
        assert_eq!((g.p[1][1], g.x[1]), (1e-15, 5.0));
        g.reset_component(2, 7.0, -1.0);
        assert_eq!((g.p[2][2], g.x[2]), (1e-15, 7.0));
    }

    #[test]
    fn large_numbers_are_numbers_and_a_variance_of_none_is_not_sound() {
        let large = Gaussian::new([1e200; 3], [1e200; 3]);
        assert!(large.is_finite() && large.is_positive_definite());
        let mut g = belief();
        (g.p[1][0], g.p[1][1], g.p[2][1]) = (0.0, 0.0, 0.0);
        assert!(!g.is_positive_definite());
        // A correlation of one up to rounding is one.
        let mut g = Gaussian::new([0.0; 3], [4.0, 9.0, 1.0]);
        g.p[1][0] = 6.0 * (1.0 + 4e-7);
        assert!(g.is_positive_definite());
        g.p[1][0] = 6.0 * (1.0 + 6e-7);
        assert!(!g.is_positive_definite());
    }
}
