//! Recursive least squares with two parameters, in closed form.

/// Parameters and covariance.
///
/// Supplement eq. (5): `e = y - phi'th`, `th += P phi e/(lambda + phi'P phi)`, `P -= P phi phi'P/(lambda + phi'P phi)`, and
/// `P /= lambda` for a forgetting factor below one. The covariance is kept as its three distinct entries and updated as
/// `P - (p p')/den` with `p = P phi`, so that it stays symmetric.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rls {
    /// Parameters `[K, b]`.
    pub theta: [f64; 2],
    /// Covariance entries `[P11, P12, P22]`.
    pub covariance: [f64; 3],
}

impl Rls {
    /// Zero parameters and a diagonal covariance.
    #[must_use]
    pub fn new(prior: [f64; 2]) -> Self {
        Self { theta: [0.0; 2], covariance: [prior[0], 0.0, prior[1]] }
    }

    /// Resets the covariance to the prior and keeps the parameters.
    #[inline]
    pub fn reset_covariance(&mut self, prior: [f64; 2]) {
        self.covariance = [prior[0], 0.0, prior[1]];
    }

    /// Parameters and covariance are finite.
    #[must_use]
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.theta.iter().chain(&self.covariance).sum::<f64>().is_finite()
    }

    /// Trace of the covariance.
    #[must_use]
    #[inline]
    pub fn trace(&self) -> f64 {
        self.covariance[0] + self.covariance[2]
    }

    /// `phi'th`.
    #[must_use]
    #[inline]
    pub fn predict(&self, phi: [f64; 2]) -> f64 {
        phi[0] * self.theta[0] + phi[1] * self.theta[1]
    }

    /// Takes a measurement and returns the innovation.
    #[inline]
    pub fn update(&mut self, phi: [f64; 2], y: f64, forgetting: f64) -> f64 {
        self.update_with_noise(phi, y, forgetting, 1.0)
    }

    /// As [`Rls::update`] for a measurement with relative noise variance `noise`: the denominator of the gain becomes
    /// `lambda noise + phi'P phi`.
    #[inline]
    pub fn update_with_noise(&mut self, phi: [f64; 2], y: f64, forgetting: f64, noise: f64) -> f64 {
        let [p11, p12, p22] = self.covariance;
        let error = y - self.predict(phi);
        let p0 = p11 * phi[0] + p12 * phi[1];
        let p1 = p12 * phi[0] + p22 * phi[1];
        let gain = 1.0 / (forgetting * noise + phi[0] * p0 + phi[1] * p1);
        let step = error * gain;
        self.theta[0] += p0 * step;
        self.theta[1] += p1 * step;
        self.covariance = [p11 - p0 * p0 * gain, p12 - p0 * p1 * gain, p22 - p1 * p1 * gain];
        if forgetting != 1.0 {
            for entry in &mut self.covariance {
                *entry /= forgetting;
            }
        }
        error
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{found} for {expected}");
    }

    /// An estimator with correlated parameters.
    fn known() -> Rls {
        Rls { theta: [3.0, -5.0], covariance: [0.7, 0.2, 0.4] }
    }

    #[test]
    fn an_update_is_that_of_the_supplement() {
        let mut rls = known();
        let (phi, y) = ([1.5, 0.6], 11.0);
        near(rls.predict(phi), 1.5);
        near(rls.trace(), 1.1);
        // P phi, and lambda r + phi' P phi.
        let (p_phi, denominator) = ([1.17, 0.54], 0.9 * 1.3 + 1.5 * 1.17 + 0.6 * 0.54);
        near(rls.update_with_noise(phi, y, 0.9, 1.3), 9.5);
        near(rls.theta[0], 3.0 + 1.17 * 9.5 / denominator);
        near(rls.theta[1], -5.0 + 0.54 * 9.5 / denominator);
        for (found, (was, i, j)) in rls.covariance.into_iter().zip([(0.7, 0, 0), (0.2, 0, 1), (0.4, 1, 1)]) {
            near(found, (was - p_phi[i] * p_phi[j] / denominator) / 0.9);
        }
        // The default noise is one.
        let (mut ordinary, mut one) = (known(), known());
        assert_eq!(ordinary.update(phi, y, 0.8), one.update_with_noise(phi, y, 0.8, 1.0));
        assert_eq!(ordinary, one);
    }

    #[test]
    fn recursive_updates_give_the_batch_solution_and_its_covariance() {
        // Normal equations with prior, noise weights and forgetting.
        for forgetting in [1.0, 0.9] {
            let mut rls = Rls::new([4.0, 25.0]);
            let mut information = [1.0 / 4.0, 0.0, 1.0 / 25.0];
            let mut right = [0.0; 2];
            for k in 0..9 {
                let k = f64::from(k);
                let (phi, noise) = ([1.0 + 0.3 * k, (0.7 * k).cos()], 0.5 + 0.1 * k);
                let y = 2.0 * phi[0] - 3.0 * phi[1] + 0.1 * (1.9 * k).sin();
                rls.update_with_noise(phi, y, forgetting, noise);
                let products = [phi[0] * phi[0], phi[0] * phi[1], phi[1] * phi[1]];
                for (sum, product) in information.iter_mut().zip(products) {
                    *sum = forgetting * *sum + product / noise;
                }
                for (sum, phi) in right.iter_mut().zip(phi) {
                    *sum = forgetting * *sum + phi * y / noise;
                }
            }
            let [a, b, c] = information;
            let determinant = a * c - b * b;
            for (found, expected) in rls.covariance.into_iter().zip([c, -b, a]) {
                assert!((found - expected / determinant).abs() < 1e-10, "{found}");
            }
            assert!((rls.theta[0] - (c * right[0] - b * right[1]) / determinant).abs() < 1e-10);
            assert!((rls.theta[1] - (a * right[1] - b * right[0]) / determinant).abs() < 1e-10);
        }
    }

    #[test]
    fn a_reset_changes_the_covariance_and_keeps_the_parameters() {
        let mut rls = known();
        rls.reset_covariance([6.0, 8.0]);
        assert_eq!(rls, Rls { theta: [3.0, -5.0], covariance: [6.0, 0.0, 8.0] });
        assert_eq!(Rls::new([6.0, 8.0]), Rls { theta: [0.0; 2], covariance: [6.0, 0.0, 8.0] });
    }

    #[test]
    fn an_overflow_is_reported() {
        assert!(known().is_finite());
        for spoil in [f64::NAN, f64::INFINITY] {
            for i in 0..5 {
                let mut rls = known();
                *(if i < 2 { &mut rls.theta[i] } else { &mut rls.covariance[i - 2] }) = spoil;
                assert!(!rls.is_finite(), "{i}");
            }
        }
    }
}
