//! First-order low-passes whose coefficients follow the sampling interval.

/// Coefficient `1 - exp(-dt/tau)`, recomputed only when the interval changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Coefficient {
    time_constant_s: f64,
    dt_s: f64,
    value: f64,
}

impl Coefficient {
    pub(crate) fn new(time_constant_s: f64) -> Self {
        Self { time_constant_s, dt_s: 0.0, value: 0.0 }
    }

    #[inline]
    pub(crate) fn at(&mut self, dt_s: f64) -> f64 {
        // Time stamps carry rounding: intervals equal to a billionth of themselves are the same.
        if (dt_s - self.dt_s).abs() > 1e-9 * dt_s {
            self.dt_s = dt_s;
            self.value = 1.0 - libm::exp(-dt_s / self.time_constant_s);
        }
        self.value
    }
}

/// Filtered force derivative \[S (1)\]: low-pass, difference quotient, low-pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ForceDerivative {
    force: Coefficient,
    derivative: Coefficient,
    force_n: f64,
    value_n_per_s: f64,
    started: bool,
}

impl ForceDerivative {
    pub(crate) fn new(config: &crate::config::DerivativeConfig) -> Self {
        Self {
            force: Coefficient::new(config.force_time_constant_s),
            derivative: Coefficient::new(config.derivative_time_constant_s),
            force_n: 0.0,
            value_n_per_s: 0.0,
            started: false,
        }
    }

    /// The derivative in N/s after the last sample.
    pub(crate) fn value_n_per_s(&self) -> f64 {
        self.value_n_per_s
    }

    /// Takes a sample and returns the derivative in N/s.
    #[inline]
    pub(crate) fn update(&mut self, dt_s: f64, force_n: f64) -> f64 {
        if !self.started {
            self.started = true;
            self.force_n = force_n;
        } else if dt_s > 0.0 {
            let step = self.force.at(dt_s) * (force_n - self.force_n);
            self.force_n += step;
            self.value_n_per_s += self.derivative.at(dt_s) * (step / dt_s - self.value_n_per_s);
        }
        self.value_n_per_s
    }
}
