//! Autoregressive noise: `e_t = a_1 e_(t-1) + ... + a_p e_(t-p) + w_t`, `w_t` independent with standard deviation `s`.
//!
//! Fitted by Burg's method (Burg 1967), always stationary, over any number of separate stretches of data (recordings, or
//! the parts of one between gaps). The model keeps the predictors of every lower order, so that the first samples of a
//! stretch are whitened by what is known of them: the likelihood is that of the stationary process, not conditional on
//! the first `p` samples.

use crate::moments::Sum;
use core::f64::consts::TAU;

/// Highest order.
pub const MAX_ORDER: usize = 32;

/// What chooses the order.
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
    /// Row `k - 1`: the predictor of order `k`, packed one row behind the other.
    predictors: [f64; MAX_ORDER * (MAX_ORDER + 1) / 2],
    /// Standard deviation of the process.
    sd: f64,
}

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

    /// Noise of standard deviation `sd` whose neighbours correlate by `phi` (inside -1 to 1).
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

    /// From the autocovariances at lags `0..=p` (Levinson and Durbin): the model with exactly these.
    #[must_use]
    pub fn from_autocovariance(lags: &[f64]) -> Self {
        let variance = lags.first().copied().unwrap_or(0.0);
        let mut ar = Self::white(variance.max(0.0).sqrt());
        let mut left = variance;
        for p in 1..lags.len().min(MAX_ORDER + 1) {
            if left <= 0.0 {
                break;
            }
            let told: f64 = ar.coefficients().iter().enumerate().map(|(j, a)| a * lags[p - 1 - j]).sum();
            ar.push((lags[p] - told) / left);
            let k = ar.reflection[p - 1];
            left *= 1.0 - k * k;
        }
        ar
    }

    /// Burg's fit of order `order` (less where the data are too few: a third of the longest stretch) about zero.
    #[must_use]
    pub fn burg(stretches: &[&[f64]], order: usize) -> Self {
        let mut last = Self::white(0.0);
        burg(stretches, order, |ar, _| last = *ar);
        last
    }

    /// Burg's fit with the order up to `max_order` that the criterion prefers. About zero.
    #[must_use]
    pub fn fit(stretches: &[&[f64]], max_order: usize, criterion: Criterion) -> Self {
        let n: usize = stretches.iter().map(|s| s.len()).sum();
        let price = match criterion {
            Criterion::Aic => 2.0,
            Criterion::Bic => libm::log(n.max(1) as f64),
        };
        let (mut best, mut lowest) = (Self::white(0.0), f64::INFINITY);
        burg(stretches, max_order, |ar, innovations| {
            let cost = n as f64 * libm::log(innovations.max(f64::MIN_POSITIVE)) + price * ar.order as f64;
            if cost < lowest {
                (best, lowest) = (*ar, cost);
            }
        });
        best
    }

    /// The next order: one more reflection coefficient.
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

    /// The same colour at another size: standard deviation of the process.
    #[must_use]
    pub fn with_sd(mut self, sd: f64) -> Self {
        self.sd = sd;
        self
    }

    /// Standard deviation of what `known` (at most `p`) samples before leave open of the next.
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

    /// Whitens one stretch: `out` has mean zero, unit variance, no correlation where `e` is of this model. Linear in `e`, so
    /// that the same call whitens the columns of a sensitivity. `out` must be as long as `e`; the longer's rest is left.
    pub fn whiten(&self, e: &[f64], out: &mut [f64]) {
        let n = e.len().min(out.len());
        let start = self.order.min(n);
        for t in 0..start {
            let told: f64 = self.predictor(t).iter().enumerate().map(|(j, a)| a * e[t - 1 - j]).sum();
            out[t] = (e[t] - told) / self.sd_after(t);
        }
        let per_sd = 1.0 / self.innovations_sd();
        let a = self.coefficients();
        for t in start..n {
            let told: f64 = a.iter().zip(e[t - self.order..t].iter().rev()).map(|(a, e)| a * e).sum();
            out[t] = (e[t] - told) * per_sd;
        }
    }

    /// The next sample's mean and standard deviation, from those before it in one stretch (all that are known, oldest
    /// first).
    #[must_use]
    pub fn predict(&self, before: &[f64]) -> (f64, f64) {
        let known = self.order.min(before.len());
        let mean = self.predictor(known).iter().zip(before.iter().rev()).map(|(a, e)| a * e).sum();
        (mean, self.sd_after(known))
    }

    /// Sum of the logarithms of the standard deviations by which [`whiten`](Self::whiten) divides a stretch of `n` samples:
    /// the log-determinant's half.
    #[must_use]
    pub fn ln_sd_sum(&self, n: usize) -> f64 {
        let start = self.order.min(n);
        let first: f64 = (0..start).map(|t| libm::log(self.sd_after(t))).sum();
        first + (n - start) as f64 * libm::log(self.innovations_sd())
    }

    /// Log-likelihood in nats of one stretch, exact for the stationary normal process. `work` is overwritten; it must be as
    /// long as `e`.
    #[must_use]
    pub fn ln_likelihood(&self, e: &[f64], work: &mut [f64]) -> f64 {
        self.whiten(e, work);
        let squares: Sum = work[..e.len()].iter().map(|w| w * w).collect();
        -0.5 * squares.value() - self.ln_sd_sum(e.len()) - 0.5 * e.len() as f64 * libm::log(TAU)
    }
}

/// Burg's recursion over several stretches; hands every order from 0 on to `take` with its innovations' variance.
fn burg(stretches: &[&[f64]], order: usize, mut take: impl FnMut(&Ar, f64)) {
    let n: usize = stretches.iter().map(|s| s.len()).sum();
    let longest = stretches.iter().map(|s| s.len()).max().unwrap_or(0);
    if n == 0 {
        return take(&Ar::white(f64::NAN), f64::NAN);
    }
    let squares: Sum = stretches.iter().flat_map(|s| s.iter()).map(|x| x * x).collect();
    let variance = squares.value() / n as f64;
    let mut ar = Ar::white(variance.sqrt());
    let mut left = variance;
    take(&ar, left);
    let mut forward: Vec<f64> = stretches.iter().flat_map(|s| s.iter().copied()).collect();
    let mut backward = forward.clone();
    for p in 1..=order.min(MAX_ORDER).min(longest / 3) {
        let (mut cross, mut power, mut from) = (Sum::default(), Sum::default(), 0);
        for stretch in stretches {
            for t in from + p..from + stretch.len() {
                cross.add(forward[t] * backward[t - 1]);
                power.add(forward[t] * forward[t] + backward[t - 1] * backward[t - 1]);
            }
            from += stretch.len();
        }
        if power.value() <= 0.0 {
            break;
        }
        ar.push(2.0 * cross.value() / power.value());
        let k = ar.reflection[p - 1];
        let mut from = 0;
        for stretch in stretches {
            for t in (from + p..from + stretch.len()).rev() {
                let (f, b) = (forward[t], backward[t - 1]);
                forward[t] = f - k * b;
                backward[t] = b - k * f;
            }
            from += stretch.len();
        }
        left *= 1.0 - k * k;
        take(&ar, left);
    }
}

/// Whether a process with these coefficients, newest first, has a finite variance (Schur-Cohn by Levinson's recursion downwards);
/// partial autocorrelations of 0.999 and more count as none.
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
mod tests {
    use super::*;

    /// Normal numbers by the quantile of a small counter-based generator (SplitMix64).
    fn normals(seed: u64, n: usize) -> Vec<f64> {
        let mut state = seed;
        (0..n)
            .map(|_| {
                state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
                let mut z = state;
                z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                crate::normal::quantile(((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + 2f64.powi(-54))
            })
            .collect()
    }

    fn coloured(seed: u64, n: usize, a: &[f64], sd: f64) -> Vec<f64> {
        let mut e = vec![0.0; n + 500];
        for (t, w) in normals(seed, n + 500).into_iter().enumerate() {
            let told: f64 = a.iter().enumerate().filter(|(j, _)| *j < t).map(|(j, a)| a * e[t - 1 - j]).sum();
            e[t] = told + sd * w;
        }
        e.split_off(500)
    }

    #[test]
    fn whitened_noise_of_the_fitted_model_is_white_with_unit_variance() {
        let e = coloured(1, 20_000, &[1.2, -0.5, 0.1], 0.02);
        let ar = Ar::fit(&[&e], 10, Criterion::Bic);
        assert!((2..=4).contains(&ar.order()), "{}", ar.order());
        assert!((ar.innovations_sd() / 0.02 - 1.0).abs() < 0.02, "{}", ar.innovations_sd());
        let mut w = vec![0.0; e.len()];
        ar.whiten(&e, &mut w);
        assert!((crate::rms(&w) - 1.0).abs() < 0.01);
        for lag in 1..20 {
            let r = w.iter().zip(&w[lag..]).map(|(x, y)| x * y).sum::<f64>() / w.len() as f64;
            assert!(r.abs() < 4.0 / (w.len() as f64).sqrt(), "lag {lag}: {r}");
        }
    }

    #[test]
    fn bic_calls_white_noise_white() {
        let wrong =
            (0..200).filter(|seed| Ar::fit(&[&normals(*seed, 2000)], 8, Criterion::Bic).order() > 0).count();
        assert!(wrong <= 6, "{wrong} of 200");
    }

    #[test]
    fn a_seam_between_recordings_teaches_nothing() {
        // Many short stretches with a step between them, which a fit across the seams would take for colour.
        let noise = normals(9, 5000);
        let stretches: Vec<Vec<f64>> = noise.chunks(50).map(<[f64]>::to_vec).collect();
        let parts: Vec<&[f64]> = stretches.iter().map(Vec::as_slice).collect();
        let ar = Ar::burg(&parts, 1);
        assert!(ar.coefficients()[0].abs() < 0.05);
        let e = coloured(4, 8000, &[0.9], 1.0);
        let whole = Ar::burg(&[&e], 1).coefficients()[0];
        let split: Vec<&[f64]> = e.chunks(200).collect();
        assert!((Ar::burg(&split, 1).coefficients()[0] - whole).abs() < 0.005);
    }

    #[test]
    fn autocovariances_there_and_back() {
        let ar = Ar::from_reflection(&[0.9, -0.4, 0.2], 0.3);
        let mut lags = [0.0; 12];
        ar.autocovariance(&mut lags);
        let back = Ar::from_autocovariance(&lags[..4]);
        for (a, b) in ar.coefficients().iter().zip(back.coefficients()) {
            assert!((a - b).abs() < 1e-12);
        }
        assert!((back.innovations_sd() / ar.innovations_sd() - 1.0).abs() < 1e-12);
        // Seen through more lags than it has: the rest of the reflection coefficients is nothing.
        let longer = Ar::from_autocovariance(&lags);
        assert!(longer.reflection()[3..].iter().all(|k| k.abs() < 1e-10));
    }

    #[test]
    fn degenerate_data_are_survived() {
        assert!(Ar::burg(&[], 3).sd().is_nan());
        assert_eq!(Ar::burg(&[&[0.0; 100]], 3).sd(), 0.0);
        assert_eq!(Ar::burg(&[&[1.0, 2.0]], 3).order(), 0);
        let constant = Ar::burg(&[&[1.0; 100]], 3);
        assert!(constant.reflection().iter().all(|k| k.abs() < 1.0) && constant.innovations_sd() > 0.0);
        let tone: Vec<f64> = (0..1000).map(|i| libm::sin(0.1 * f64::from(i))).collect();
        assert!(Ar::fit(&[&tone], 8, Criterion::Aic).innovations_sd().is_finite());
    }

    #[test]
    fn the_prediction_is_what_whitening_takes_off() {
        let ar = Ar::from_reflection(&[0.8, -0.5, 0.3], 2.0);
        let e = [1.0, -0.5, 2.0, 0.25, -3.0, 1.5];
        let mut w = [0.0; 6];
        ar.whiten(&e, &mut w);
        for t in 0..6 {
            let (mean, sd) = ar.predict(&e[..t]);
            assert!(((e[t] - mean) / sd - w[t]).abs() < 1e-14, "{t}");
        }
        // Of the first sample nothing is known; of order three at the latest no more than three samples matter.
        assert_eq!(ar.predict(&[]), (0.0, 2.0));
        assert_eq!(ar.predict(&[9.0, 1.0, 2.0, 3.0]), ar.predict(&[1.0, 2.0, 3.0]));
        // One sample before: correlation 0.8, and what it leaves open of the variance 4.
        let (mean, sd) = ar.predict(&[1.5]);
        assert!((mean - 1.2).abs() < 1e-15 && (sd - 2.0 * 0.6).abs() < 1e-15);
        assert_eq!(
            (Ar::white(3.0).predict(&[1.0]), Ar::first_order(0.5, 1.0).coefficients()),
            ((0.0, 3.0), &[0.5][..])
        );
    }

    #[test]
    fn the_order_chosen_has_the_lowest_price() {
        for seed in 0..20 {
            let e = coloured(seed, 120, &[0.5, -0.2, 0.15], 1.0);
            let halves = [&e[..50], &e[50..]];
            for (criterion, price) in [(Criterion::Aic, 2.0), (Criterion::Bic, 120f64.ln())] {
                let cost = |p: usize| 240.0 * Ar::burg(&halves, p).innovations_sd().ln() + price * p as f64;
                let best = (0..=6).min_by(|a, b| cost(*a).total_cmp(&cost(*b)));
                assert_eq!(Some(Ar::fit(&halves, 6, criterion).order()), best, "{seed} {criterion:?}");
            }
        }
    }

    #[test]
    fn burg_s_first_coefficient_is_that_by_hand() {
        // 2 sum f b / sum (f^2 + b^2) over neighbours inside the stretches: 2 (2 + 2 + 12 - 2)/(5 + 5 + 25 + 5).
        let ar = Ar::burg(&[&[1.0, 2.0, 1.0], &[3.0, 4.0], &[-1.0, 2.0]], 1);
        assert!((ar.coefficients()[0] - 0.7).abs() < 1e-15);
        assert!((ar.sd() - (36.0_f64 / 7.0).sqrt()).abs() < 1e-15);
        assert!((ar.innovations_sd() - ar.sd() * (1.0 - 0.49_f64).sqrt()).abs() < 1e-15);
        // Of a stretch of three one coefficient can be told, of two none, whatever is asked.
        assert_eq!(Ar::burg(&[&[1.0, 2.0, 1.0]], 9).order(), 1);
        assert_eq!(Ar::burg(&[&normals(3, 200)], 40).order(), MAX_ORDER);
    }

    #[test]
    fn a_recording_heard_twice_teaches_what_it_teaches_once() {
        let e = coloured(11, 90, &[0.9, -0.4, 0.2], 1.0);
        let (once, thrice) = (Ar::burg(&[&e], 4), Ar::burg(&[&e, &e, &e], 4));
        assert_eq!((once.order(), thrice.order()), (4, 4));
        for (a, b) in once.reflection().iter().zip(thrice.reflection()) {
            assert!((a - b).abs() < 1e-13, "{once:?} {thrice:?}");
        }
        // Nor does it matter which of two recordings comes first.
        let (short, long) = (&e[..30], &e[30..]);
        let (ab, ba) = (Ar::burg(&[short, long], 4), Ar::burg(&[long, short], 4));
        assert!(
            ab.reflection().iter().zip(ba.reflection()).all(|(a, b)| (a - b).abs() < 1e-13),
            "{ab:?} {ba:?}"
        );
    }

    #[test]
    fn a_model_stays_stationary_and_within_its_largest_order() {
        assert_eq!(Ar::from_reflection(&[0.1; 40], 1.0).order(), MAX_ORDER);
        let clipped = Ar::from_reflection(&[2.0, -2.0, f64::NAN], 1.0);
        assert!(clipped.reflection().iter().all(|k| k.abs() < 1.0) && clipped.innovations_sd() > 0.0);
        assert_eq!(clipped.reflection()[2], 0.0);
        for (lags, order) in [(&[][..], 0), (&[-1.0, 0.5], 0), (&[0.0, 0.0], 0), (&[1.0, 0.5], 1)] {
            assert_eq!(Ar::from_autocovariance(lags).order(), order, "{lags:?}");
        }
        assert_eq!(Ar::from_autocovariance(&[0.1; 50]).order(), MAX_ORDER);
        assert_eq!(Ar::from_reflection(&[0.5], 1.0).with_sd(3.0), Ar::from_reflection(&[0.5], 3.0));
    }

    #[test]
    fn the_likelihood_of_short_stretches_is_that_of_the_normal_distribution() {
        let ar = Ar::from_reflection(&[0.6, -0.3], 2.0);
        let mut lags = [0.0; 3];
        ar.autocovariance(&mut lags);
        assert!((lags[0] - 4.0).abs() < 1e-15 && (lags[1] - 2.4).abs() < 1e-15);
        // One sample: variance 4. Two: a bivariate normal with correlation 0.6.
        let one = -0.5 * (1.5 * 1.5 / 4.0 + (TAU * 4.0).ln());
        assert!((ar.ln_likelihood(&[1.5], &mut [0.0]) - one).abs() < 1e-14);
        let (x, y, r) = (1.5_f64, -1.0_f64, 0.6_f64);
        let rest: f64 = 1.0 - r * r;
        let two = -0.5 * (x * x - 2.0 * r * x * y + y * y) / (4.0 * rest) - (TAU * 4.0 * rest.sqrt()).ln();
        assert!((ar.ln_likelihood(&[x, y], &mut [0.0; 2]) - two).abs() < 1e-14);
        assert!((ar.ln_sd_sum(2) - (2.0_f64 * 2.0 * 0.8).ln()).abs() < 1e-14);
        assert_eq!(ar.ln_likelihood(&[], &mut []), 0.0);
    }

    /// The roots of the characteristic polynomial all lie inside the unit circle.
    #[test]
    fn a_process_is_stationary_when_its_roots_are_inside_the_unit_circle() {
        // Coefficients of `(1 - p z)(1 - q z)(1 - r z)`.
        let product = |p: f64, q: f64, r: f64| [p + q + r, -(p * q + p * r + q * r), p * q * r];
        for (p, q, r, wanted) in [
            (0.5, 0.3, -0.4, true),
            (0.95, 0.9, 0.85, true),
            (0.95, -0.97, 0.3, true),
            (1.05, 0.4, 0.2, false),
            (0.5, -1.02, 0.1, false),
            (0.2, 1.2, 0.9, false),
            (0.2, 1.2, 0.7, false),
        ] {
            assert_eq!(stationary(&product(p, q, r)), wanted, "{p} {q} {r}");
        }
        // The triangle of two coefficients.
        for (a, b, wanted) in [
            (0.5, 0.45, true),
            (0.5, 0.55, false),
            (-1.4, -0.6, true),
            (-1.7, -0.6, false),
            (0.2, -0.998, true),
            (0.2, -0.9995, false),
            (1.5, -0.6, true),
        ] {
            assert_eq!(stationary(&[a, b]), wanted, "{a} {b}");
        }
        assert!(stationary(&[]) && stationary(&[0.998]) && !stationary(&[0.999]) && !stationary(&[-1.0]));
    }
}
