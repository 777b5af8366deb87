//! First-order low-pass filters whose gains follow the sampling interval.

/// Gains of low-passes that are updated together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LowPassCoefficients<const N: usize> {
    time_constants_s: [f64; N],
    dt_s: f64,
    values: [f64; N],
}

impl<const N: usize> LowPassCoefficients<N> {
    pub(crate) fn new(time_constants_s: [f64; N]) -> Self {
        Self { time_constants_s, dt_s: 0.0, values: [0.0; N] }
    }

    /// `1 - exp(-dt/tau)` of each, recomputed only when the interval changes.
    #[inline]
    pub(crate) fn at_interval(&mut self, dt_s: f64) -> &[f64; N] {
        // Relative differences below 1e-9 are rounding errors of the time stamps.
        if (dt_s - self.dt_s).abs() > 1e-9 * dt_s {
            self.recompute(dt_s);
        }
        &self.values
    }

    #[cold]
    fn recompute(&mut self, dt_s: f64) {
        self.dt_s = dt_s;
        for (value, tau_s) in self.values.iter_mut().zip(self.time_constants_s) {
            *value = 1.0 - libm::exp(-dt_s / tau_s);
        }
    }
}

/// Filtered force derivative \[S (1)\]: low-pass, difference quotient, low-pass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ForceDerivative {
    force_n: f64,
    value_n_per_s: f64,
}

impl ForceDerivative {
    pub(crate) fn value_n_per_s(&self) -> f64 {
        self.value_n_per_s
    }

    /// The first sample.
    pub(crate) fn begin(&mut self, force_n: f64) {
        self.force_n = force_n;
    }

    /// Takes a sample, `dt_s` after the previous one, with the gains of both low-passes; returns the derivative in N/s.
    #[inline]
    pub(crate) fn update(&mut self, dt_s: f64, [force_gain, derivative_gain]: [f64; 2], force_n: f64) -> f64 {
        let step = force_gain * (force_n - self.force_n);
        self.force_n += step;
        self.value_n_per_s += derivative_gain * (step / dt_s - self.value_n_per_s);
        self.value_n_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_response_has_the_time_constant_at_every_interval() {
        // With intervals of 5, 1 and 20 ms the step response is 1 - exp(-t/tau).
        let mut coefficients = LowPassCoefficients::new([0.05, 0.4]);
        let (mut time_s, mut values) = (0.0_f64, [0.0_f64; 2]);
        for k in 0..300 {
            let dt_s = [0.005, 0.001, 0.02][k / 7 % 3];
            time_s += dt_s;
            let shares = *coefficients.at_interval(dt_s);
            for ((value, share), tau_s) in values.iter_mut().zip(shares).zip([0.05, 0.4]) {
                *value += share * (1.0 - *value);
                assert!((1.0 - *value - (-time_s / tau_s).exp()).abs() < 1e-9, "after {time_s} s");
            }
        }
    }

    #[test]
    fn the_derivative_of_a_ramp_is_its_slope_and_of_a_constant_zero() {
        for bias_n in [0.0, 5.0] {
            let mut derivative = ForceDerivative::default();
            derivative.begin(bias_n);
            for _ in 0..100 {
                assert_eq!(derivative.update(0.005, [0.01, 0.1], bias_n), 0.0);
            }
            let mut force_n = bias_n;
            for _ in 0..4000 {
                force_n += 0.3 * 0.005;
                derivative.update(0.005, [0.01, 0.1], force_n);
            }
            assert!((derivative.value_n_per_s() - 0.3).abs() < 1e-9, "{derivative:?}");
        }
        // First sample after a step: both gains over the interval.
        let mut derivative = ForceDerivative::default();
        assert!((derivative.update(0.005, [0.01, 0.1], 2.0) - 0.1 * 0.01 * 2.0 / 0.005).abs() < 1e-12);
    }
}
