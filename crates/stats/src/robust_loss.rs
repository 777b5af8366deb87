//! Robust losses and the M-estimate of location.

use crate::student_t;

/// Loss of a residual `r` in units of its standard deviation, in nats: the negative logarithm of a density up to a constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loss {
    /// `r^2 / 2`: normal noise.
    Squares,
    /// Quadratic up to `k`, linear beyond (Huber 1964). `k = 1.345` keeps 95 % of the efficiency on normal noise.
    Huber {
        /// Start of the linear part, in standard deviations.
        k: f64,
    },
    /// `(dof + 1)/2 ln(1 + r^2/dof)`: Student's distribution (Lange, Little and Taylor 1989). Small `dof`, heavy tails.
    Student {
        /// Degrees of freedom.
        dof: f64,
    },
}

impl Loss {
    /// Huber's loss with 95 % efficiency on normal noise.
    pub const HUBER: Self = Self::Huber { k: 1.345 };

    /// The loss, zero at zero.
    #[inline]
    #[must_use]
    pub fn value(self, r: f64) -> f64 {
        match self {
            Self::Squares => 0.5 * r * r,
            Self::Huber { k } if r.abs() > k => k * (r.abs() - 0.5 * k),
            Self::Huber { .. } => 0.5 * r * r,
            Self::Student { dof } => 0.5 * (dof + 1.0) * libm::log1p(r * r / dof),
        }
    }

    /// Its derivative, the influence of a residual.
    #[inline]
    #[must_use]
    pub fn influence(self, r: f64) -> f64 {
        self.weight(r) * r
    }

    /// Influence over residual: the weight in iteratively re-weighted least squares.
    #[inline]
    #[must_use]
    pub fn weight(self, r: f64) -> f64 {
        match self {
            Self::Squares => 1.0,
            Self::Huber { k } if r.abs() > k => k / r.abs(),
            Self::Huber { .. } => 1.0,
            Self::Student { dof } => (dof + 1.0) / (dof + r * r),
        }
    }

    /// Second derivative, for Newton's method (negative for large residuals of Student's loss).
    #[inline]
    #[must_use]
    pub fn curvature(self, r: f64) -> f64 {
        match self {
            Self::Squares => 1.0,
            Self::Huber { k } => f64::from(u8::from(r.abs() <= k)),
            Self::Student { dof } => (dof + 1.0) * (dof - r * r) / ((dof + r * r) * (dof + r * r)),
        }
    }

    /// Negative logarithm of the density at zero (unit scale). [`value`](Self::value) plus this and the logarithm of the scale
    /// is the negative log-likelihood of a sample.
    #[must_use]
    pub fn normaliser(self) -> f64 {
        match self {
            Self::Squares => 0.5 * libm::log(core::f64::consts::TAU),
            Self::Huber { k } => {
                let middle = libm::sqrt(core::f64::consts::TAU) * (1.0 - 2.0 * crate::normal::sf(k));
                libm::log(middle + 2.0 / k * libm::exp(-0.5 * k * k))
            }
            Self::Student { dof } => -student_t::ln_pdf(0.0, dof),
        }
    }
}

/// M-estimate of location: minimises the summed loss of `values` in units of `scale`, by reweighted means from the median on.
/// Returns it with the sum of the weights. `NaN` without values.
#[must_use]
pub fn location(values: &[f64], scale: f64, loss: Loss) -> (f64, f64) {
    /// Iterations; linear convergence with a factor of a third has 13 digits by then.
    const ITERATIONS: usize = 30;
    let mut at = crate::order_statistics::median_of(values.iter().copied());
    let mut total = values.len() as f64;
    if values.is_empty() || scale.is_nan() || scale <= 0.0 {
        return (at, total);
    }
    for _ in 0..ITERATIONS {
        let (mut sum, mut weights) = (0.0, 0.0);
        for x in values {
            let weight = loss.weight((x - at) / scale);
            sum += weight * x;
            weights += weight;
        }
        let next = sum / weights;
        total = weights;
        if (next - at).abs() <= 1e-14 * scale {
            return (next, total);
        }
        at = next;
    }
    (at, total)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Loss; 3] = [Loss::Squares, Loss::HUBER, Loss::Student { dof: 4.0 }];

    #[test]
    fn influence_and_curvature_are_the_derivatives() {
        let h = 1e-5;
        for loss in ALL {
            for r in [-3.7, -1.0, -0.2, 0.0, 0.6, 1.2, 2.5, 40.0] {
                let slope = (loss.value(r + h) - loss.value(r - h)) / (2.0 * h);
                assert!((slope - loss.influence(r)).abs() < 1e-6, "{loss:?} at {r}");
                let bend = (loss.influence(r + h) - loss.influence(r - h)) / (2.0 * h);
                assert!((bend - loss.curvature(r)).abs() < 1e-5, "{loss:?} at {r}");
            }
        }
    }

    #[test]
    fn densities_integrate_to_one() {
        for loss in ALL {
            let (step, mut sum) = (1e-2, 0.0);
            for i in -400_000..=400_000 {
                sum += libm::exp(-loss.value(f64::from(i) * step) - loss.normaliser()) * step;
            }
            assert!((sum - 1.0).abs() < 1e-4, "{loss:?}: {sum}");
        }
    }

    #[test]
    fn outliers_move_a_robust_location_little() {
        let mut values: Vec<f64> =
            (1..100).map(|i| 5.0 + crate::normal::quantile(f64::from(i) / 100.0)).collect();
        values.extend([1e6; 10]);
        let (huber, weight) = location(&values, 1.0, Loss::HUBER);
        assert!((huber - 5.0).abs() < 0.3 && weight < 100.0, "{huber} {weight}");
        let (student, _) = location(&values, 1.0, Loss::Student { dof: 4.0 });
        assert!((student - 5.0).abs() < 1e-3, "{student}");
        assert!(location(&values, 1.0, Loss::Squares).0 > 1e4);
        assert!(location(&[], 1.0, Loss::HUBER).0.is_nan());
    }

    #[test]
    fn a_loss_is_zero_at_zero_and_continuous_at_the_corner_of_huber_s_loss() {
        for loss in ALL {
            assert_eq!((loss.value(0.0), loss.influence(0.0)), (0.0, 0.0));
            for r in [0.3, 2.0, 9.0] {
                assert!((loss.weight(r) * r - loss.influence(r)).abs() < 1e-15);
                assert_eq!((loss.value(r), loss.weight(r)), (loss.value(-r), loss.weight(-r)));
            }
        }
        let k = 1.345;
        assert!((Loss::HUBER.value(k + 1e-9) - Loss::HUBER.value(k - 1e-9)).abs() < 1e-8);
        assert_eq!((Loss::HUBER.curvature(k), Loss::HUBER.curvature(k + 1e-9)), (1.0, 0.0));
    }

    #[test]
    fn a_location_is_where_the_influences_cancel_and_moves_with_the_values() {
        let values = [-3.0, 0.1, 0.4, 0.5, 0.9, 1.1, 2.0, 14.0];
        for loss in [Loss::HUBER, Loss::Student { dof: 4.0 }] {
            for scale in [0.5, 2.0] {
                let (at, weights) = location(&values, scale, loss);
                let pull: f64 = values.iter().map(|x| loss.influence((x - at) / scale)).sum();
                assert!(pull.abs() < 1e-8, "{loss:?} {scale}: {pull}");
                let sum: f64 = values.iter().map(|x| loss.weight((x - at) / scale)).sum();
                assert!((sum - weights).abs() < 1e-6, "{loss:?} {scale}: {sum} {weights}");
                let moved = values.map(|x| 10.0 - 3.0 * x);
                let (there, _) = location(&moved, 3.0 * scale, loss);
                assert!((there - (10.0 - 3.0 * at)).abs() < 1e-8, "{loss:?} {scale}: {at} {there}");
            }
        }
        // Without a scale it is the median, and every value counts.
        for scale in [0.0, -1.0, f64::NAN] {
            assert_eq!(location(&values, scale, Loss::HUBER), (0.7, 8.0));
        }
        assert_eq!(location(&[1.0, 2.0, 6.0], 1.0, Loss::Squares), (3.0, 3.0));
    }

    #[test]
    fn the_weight_is_the_derivative_of_the_loss_over_the_residual() {
        let loss = Loss::Huber { k: 2.5 };
        for (w, value, weight) in
            [(1.3, 0.845, 1.0), (-2.4, 2.88, 1.0), (4.0, 6.875, 0.625), (-7.5, 15.625, 1.0 / 3.0)]
        {
            assert!((loss.value(w) - value).abs() < 1e-12 && (loss.weight(w) - weight).abs() < 1e-12, "{w}");
        }
        assert_eq!(loss.weight(2.5), 1.0);
        for w in [-6.3, -1.1, 0.4, 2.2, 3.7] {
            let slope = (loss.value(w + 1e-6) - loss.value(w - 1e-6)) / 2e-6;
            assert!((loss.weight(w) * w - slope).abs() < 1e-6, "{w}");
        }
    }
}
