//! Recursive least squares with two parameters, in closed form.

/// State of the estimator: parameters and covariance.
///
/// Supplement eq. (5): `e = y - phi'th`, `th += P phi e/(lambda + phi'P phi)`,
/// `P -= P phi phi'P/(lambda + phi'P phi)`, and `P /= lambda` for a forgetting factor below one.
/// The covariance is kept as its three distinct entries and updated as `P - (p p')/den` with
/// `p = P phi`, so that it stays symmetric.
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

    /// Puts the covariance back to the prior; the parameters stay.
    #[inline]
    pub fn reset_covariance(&mut self, prior: [f64; 2]) {
        self.covariance = [prior[0], 0.0, prior[1]];
    }

    /// True while parameters and covariance are numbers.
    #[must_use]
    #[inline]
    pub fn is_finite(&self) -> bool {
        (self.theta[0] + self.theta[1] + self.covariance[0] + self.covariance[1] + self.covariance[2])
            .is_finite()
    }

    /// Trace of the covariance.
    #[must_use]
    #[inline]
    pub fn trace(&self) -> f64 {
        self.covariance[0] + self.covariance[2]
    }

    /// What the present parameters predict.
    #[must_use]
    #[inline]
    pub fn predict(&self, phi: [f64; 2]) -> f64 {
        phi[0] * self.theta[0] + phi[1] * self.theta[1]
    }

    /// Takes one measurement and returns the innovation, the error before the update.
    #[inline]
    pub fn update(&mut self, phi: [f64; 2], y: f64, forgetting: f64) -> f64 {
        self.update_with_noise(phi, y, forgetting, 1.0)
    }

    /// As [`Rls::update`] for a measurement whose noise variance is `noise` times the ordinary one:
    /// the gain's denominator becomes `lambda noise + phi'P phi`.
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
