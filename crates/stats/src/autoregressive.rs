//! Autoregressive noise: `e_t = a_1 e_(t-1) + ... + a_p e_(t-p) + w_t`, `w_t` independent with standard deviation `s`.
//!
//! Fitted by Burg's method (Burg 1967), which is always stationary, over any number of separate segments of data (recordings,
//! or parts of one between gaps). The model keeps the predictors of every lower order for the first samples of a segment:
//! the likelihood is that of the stationary process, not conditional on the first `p` samples.

use crate::moments::Sum;
use core::f64::consts::TAU;

/// Highest order.
pub const MAX_ORDER: usize = 32;

/// Criterion of order selection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Criterion {
    /// Akaike 1974: `n ln s^2 + 2 p`.
    Aic,
    /// Schwarz 1978: `n ln s^2 + p ln n`.
    Bic,
}

/// A stationary autoregressive model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ar {
    order: usize,
    /// Reflection coefficients (partial autocorrelations), each inside -1 to 1.
    reflection: [f64; MAX_ORDER],
    /// Row `k - 1`: the predictor of order `k`, packed row by row.
    predictors: [f64; MAX_ORDER * (MAX_ORDER + 1) / 2],
    /// Standard deviation of the process.
    sd: f64,
}

/// Offset of the predictor of an order in the packed rows.
const fn row(order: usize) -> usize {
    order * (order - 1) / 2
}

impl Ar {
    /// Independent noise of standard deviation `sd`.
    #[must_use]
    pub fn white(sd: f64) -> Self {
        Self {
            order: 0,
            reflection: [0.0; MAX_ORDER],
            predictors: [0.0; MAX_ORDER * (MAX_ORDER + 1) / 2],
            sd,
        }
    }

    /// First-order noise of standard deviation `sd` with the lag-one correlation `phi` (inside -1 to 1).
    #[must_use]
    pub fn first_order(phi: f64, sd: f64) -> Self {
        Self::from_reflection(&[phi], sd)
    }

    /// From reflection coefficients (partial autocorrelations, clipped to stay stationary; at most [`MAX_ORDER`] are
    /// taken) and the standard deviation of the process.
    #[must_use]
    pub fn from_reflection(reflection: &[f64], sd: f64) -> Self {
        let mut ar = Self::white(sd);
        for k in reflection.iter().take(MAX_ORDER) {
            ar.push(*k);
        }
        ar
    }

    /// From the autocovariances at lags `0..=p` (Levinson and Durbin); the model has exactly these.
    #[must_use]
    pub fn from_autocovariance(lags: &[f64]) -> Self {
        let variance = lags.first().copied().unwrap_or(0.0);
        let mut ar = Self::white(variance.max(0.0).sqrt());
        let mut left = variance;
        for p in 1..lags.len().min(MAX_ORDER + 1) {
            if left <= 0.0 {
                break;
            }
            let predicted: f64 = ar.coefficients().iter().enumerate().map(|(j, a)| a * lags[p - 1 - j]).sum();
            ar.push((lags[p] - predicted) / left);
            let k = ar.reflection[p - 1];
            left *= 1.0 - k * k;
        }
        ar
    }

    /// Burg's fit of order `order` (less where the data are too few: a third of the longest segment) about zero.
    #[must_use]
    pub fn burg(segments: &[&[f64]], order: usize) -> Self {
        let mut last = Self::white(0.0);
        burg(segments, order, |ar, _| last = *ar);
        last
    }

    /// Burg's fit about zero, with the order up to `max_order` that minimises the criterion.
    #[must_use]
    pub fn fit(segments: &[&[f64]], max_order: usize, criterion: Criterion) -> Self {
        let n: usize = segments.iter().map(|s| s.len()).sum();
        let penalty = match criterion {
            Criterion::Aic => 2.0,
            Criterion::Bic => libm::log(n.max(1) as f64),
        };
        let (mut best, mut lowest) = (Self::white(0.0), f64::INFINITY);
        burg(segments, max_order, |ar, innovations| {
            let cost = n as f64 * libm::log(innovations.max(f64::MIN_POSITIVE)) + penalty * ar.order as f64;
            if cost < lowest {
                (best, lowest) = (*ar, cost);
            }
        });
        best
    }

    /// Raises the order by one reflection coefficient.
    fn push(&mut self, k: f64) {
        /// Keeps the process stationary where rounding or a pure tone would not.
        const NEARLY_ONE: f64 = 1.0 - 1e-9;
        let k = if k.is_nan() { 0.0 } else { k.clamp(-NEARLY_ONE, NEARLY_ONE) };
        let p = self.order + 1;
        for j in 0..p - 1 {
            let of = row(p - 1);
            self.predictors[row(p) + j] = self.predictors[of + j] - k * self.predictors[of + p - 2 - j];
        }
        self.predictors[row(p) + p - 1] = k;
        self.reflection[p - 1] = k;
        self.order = p;
    }

    /// The order `p`.
    #[must_use]
    pub fn order(&self) -> usize {
        self.order
    }

    /// `a_1 ... a_p`.
    #[must_use]
    pub fn coefficients(&self) -> &[f64] {
        self.predictor(self.order)
    }

    fn predictor(&self, order: usize) -> &[f64] {
        if order == 0 { &[] } else { &self.predictors[row(order)..row(order) + order] }
    }

    /// Reflection coefficients (partial autocorrelations).
    #[must_use]
    pub fn reflection(&self) -> &[f64] {
        &self.reflection[..self.order]
    }

    /// Standard deviation of the process.
    #[must_use]
    pub fn sd(&self) -> f64 {
        self.sd
    }

    /// Standard deviation of the innovations.
    #[must_use]
    pub fn innovations_sd(&self) -> f64 {
        self.sd_after(self.order)
    }

    /// The same autocorrelation with another standard deviation of the process.
    #[must_use]
    pub fn with_sd(mut self, sd: f64) -> Self {
        self.sd = sd;
        self
    }

    /// Standard deviation of the prediction from `known` (at most `p`) previous samples.
    fn sd_after(&self, known: usize) -> f64 {
        self.sd * self.reflection[..known].iter().map(|k| 1.0 - k * k).product::<f64>().sqrt()
    }

    /// Autocovariance at lags `0..out.len()`.
    pub fn autocovariance(&self, out: &mut [f64]) {
        for lag in 0..out.len() {
            out[lag] = if lag == 0 {
                self.sd * self.sd
            } else {
                // Beyond the order the predictor of full order holds; below, Levinson backwards.
                let order = lag.min(self.order);
                self.predictor(order).iter().enumerate().map(|(j, a)| a * out[lag - 1 - j]).sum()
            };
        }
    }

    /// Whitens one segment: `out` has mean zero, unit variance, no correlation where `e` is of this model. Linear in `e`, so that the
    /// same call whitens the columns of a sensitivity. If the slices differ in length, the rest of the longer one is not used.
    pub fn whiten(&self, e: &[f64], out: &mut [f64]) {
        let n = e.len().min(out.len());
        let start = self.order.min(n);
        for t in 0..start {
            let predicted: f64 = self.predictor(t).iter().enumerate().map(|(j, a)| a * e[t - 1 - j]).sum();
            out[t] = (e[t] - predicted) / self.sd_after(t);
        }
        let per_sd = 1.0 / self.innovations_sd();
        let a = self.coefficients();
        for t in start..n {
            let predicted: f64 = a.iter().zip(e[t - self.order..t].iter().rev()).map(|(a, e)| a * e).sum();
            out[t] = (e[t] - predicted) * per_sd;
        }
    }

    /// Mean and standard deviation of the next sample of a segment, given all previous ones (oldest first).
    #[must_use]
    pub fn predict(&self, before: &[f64]) -> (f64, f64) {
        let known = self.order.min(before.len());
        let mean = self.predictor(known).iter().zip(before.iter().rev()).map(|(a, e)| a * e).sum();
        (mean, self.sd_after(known))
    }

    /// Sum of the logarithms of the standard deviations by which [`whiten`](Self::whiten) divides a segment of `n` samples:
    /// half the log-determinant of the covariance.
    #[must_use]
    pub fn ln_sd_sum(&self, n: usize) -> f64 {
        let start = self.order.min(n);
        let first: f64 = (0..start).map(|t| libm::log(self.sd_after(t))).sum();
        first + (n - start) as f64 * libm::log(self.innovations_sd())
    }

    /// Log-likelihood in nats of one segment, exact for the stationary normal process. `work` is overwritten; it must be as
    /// long as `e`.
    #[must_use]
    pub fn ln_likelihood(&self, e: &[f64], work: &mut [f64]) -> f64 {
        self.whiten(e, work);
        let squares: Sum = work[..e.len()].iter().map(|w| w * w).collect();
        -0.5 * squares.value() - self.ln_sd_sum(e.len()) - 0.5 * e.len() as f64 * libm::log(TAU)
    }
}

/// Burg's recursion over several segments; calls `on_order` with the model of every order from 0 on and the variance of its
/// innovations.
fn burg(segments: &[&[f64]], order: usize, mut on_order: impl FnMut(&Ar, f64)) {
    let n: usize = segments.iter().map(|s| s.len()).sum();
    let longest = segments.iter().map(|s| s.len()).max().unwrap_or(0);
    if n == 0 {
        return on_order(&Ar::white(f64::NAN), f64::NAN);
    }
    let squares: Sum = segments.iter().flat_map(|s| s.iter()).map(|x| x * x).collect();
    let variance = squares.value() / n as f64;
    let mut ar = Ar::white(variance.sqrt());
    let mut left = variance;
    on_order(&ar, left);
    let mut forward: Vec<f64> = segments.iter().flat_map(|s| s.iter().copied()).collect();
    let mut backward = forward.clone();
    for p in 1..=order.min(MAX_ORDER).min(longest / 3) {
        let (mut cross, mut power, mut from) = (Sum::default(), Sum::default(), 0);
        for segment in segments {
            for t in from + p..from + segment.len() {
                cross.add(forward[t] * backward[t - 1]);
                power.add(forward[t] * forward[t] + backward[t - 1] * backward[t - 1]);
            }
            from += segment.len();
        }
        if power.value() <= 0.0 {
            break;
        }
        ar.push(2.0 * cross.value() / power.value());
        let k = ar.reflection[p - 1];
        let mut from = 0;
        for segment in segments {
            for t in (from + p..from + segment.len()).rev() {
                let (f, b) = (forward[t], backward[t - 1]);
                forward[t] = f - k * b;
                backward[t] = b - k * f;
            }
            from += segment.len();
        }
        left *= 1.0 - k * k;
        on_order(&ar, left);
    }
}

/// Whether a process with these coefficients, newest first, is stationary (Schur-Cohn criterion by Levinson's recursion
/// downwards). Partial autocorrelations of 0.999 and more count as not stationary.
#[must_use]
pub fn stationary(a: &[f64]) -> bool {
    let mut a = a.to_vec();
    while let Some(k) = a.pop() {
        if k.abs() >= 0.999 {
            return false;
        }
        let rest = a.clone();
        let m = rest.len();
        for i in 0..m {
            a[i] = (rest[i] + k * rest[m - 1 - i]) / (1.0 - k * k);
        }
    }
    true
}

#[cfg(test)]
mod tests;
