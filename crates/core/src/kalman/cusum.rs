//! Rupture alarm: three one-sided CUSUMs on standardised innovations, tuned to force drops of one, two and four standard
//! deviations.
//!
//! For a shift `-mu` the log-likelihood ratio of an innovation `z` is `mu (-z - mu/2)`. Its cumulative sum, kept at zero
//! or above, raises the alarm at a threshold `h`. With the overshoot correction of Siegmund (*Sequential Analysis*, 1985,
//! eq. 2.57) the mean number of samples between false alarms is `(exp(h + 1.166 mu) - h - 1.166 mu - 1) 2/mu²`; `h` follows
//! from the configured false-alarm rate, of which each sum takes a third.

use crate::bounds::at_least;

/// Shifts that the sums are tuned to, in standard deviations of an innovation.
const SHIFTS: [f64; 3] = [1.0, 2.0, 4.0];
/// Twice the mean overshoot of a random walk with standard normal steps.
const OVERSHOOT: f64 = 1.166;

#[derive(Clone, Copy, Debug)]
pub(crate) struct CusumBank {
    sums: [f64; 3],
    thresholds: [f64; 3],
}

impl CusumBank {
    /// Thresholds for `per_hour` false alarms at a sampling interval of `interval_s`.
    pub(crate) fn new(per_hour: f64, interval_s: f64) -> Self {
        let samples = 3600.0 / (interval_s.max(1e-6) * per_hour.max(1e-9)) * SHIFTS.len() as f64;
        let thresholds = SHIFTS.map(|mu| {
            let h = libm::log(samples * mu * mu / 2.0) - OVERSHOOT * mu;
            h.max(1.0)
        });
        Self { sums: [0.0; 3], thresholds }
    }

    pub(crate) fn reset(&mut self) {
        self.sums = [0.0; 3];
    }

    /// Adds a standardised innovation.
    #[inline(always)]
    pub(crate) fn update(&mut self, z: f64) -> CusumOutcome {
        let mut outcome =
            CusumOutcome { all_zero: true, outweighs_history: true, alarm: false, excess_nats: 0.0 };
        for ((sum, threshold), mu) in self.sums.iter_mut().zip(&self.thresholds).zip(SHIFTS) {
            let gain = mu * (-z - 0.5 * mu);
            if gain <= *sum {
                outcome.outweighs_history = false;
            }
            *sum = at_least(0.0, *sum + gain);
            if *sum > 0.0 {
                outcome.all_zero = false;
            }
            if *sum > *threshold {
                outcome.alarm = true;
            }
            outcome.excess_nats = at_least(outcome.excess_nats, *sum - *threshold);
        }
        outcome
    }

    /// Largest sum as a fraction of its threshold.
    pub(crate) fn relative_level(&self) -> f64 {
        let mut level = 0.0;
        for (sum, threshold) in self.sums.iter().zip(&self.thresholds) {
            level = f64::max(level, sum / threshold);
        }
        level
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CusumOutcome {
    /// All sums are zero.
    pub(crate) all_zero: bool,
    /// In every sum this sample alone adds more than had accumulated before.
    pub(crate) outweighs_history: bool,
    /// A sum exceeds its threshold.
    pub(crate) alarm: bool,
    /// Largest log-likelihood ratio above its threshold, in nats.
    pub(crate) excess_nats: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Mean number of samples until the alarm, for unit noise with this shift.
    fn mean_samples(per_hour: f64, step_s: f64, shift: f64) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut samples, runs) = (0, 1000);
        for _ in 0..runs {
            let mut cusum = CusumBank::new(per_hour, step_s);
            loop {
                let w: f64 = StandardNormal.sample(&mut rng);
                samples += 1;
                if cusum.update(w + shift).alarm {
                    break;
                }
            }
        }
        f64::from(samples) / f64::from(runs)
    }

    #[test]
    fn the_false_alarm_rate_is_as_configured_at_every_sampling_rate() {
        // The three sums share the rate and sometimes alarm together.
        for (per_hour, step_s) in [(720.0, 0.005), (3600.0, 0.001), (72.0, 0.05)] {
            let ratio = mean_samples(per_hour, step_s, 0.0) * step_s * per_hour / 3600.0;
            assert!((0.8..1.6).contains(&ratio), "{ratio} of the accepted time at {step_s} s");
        }
    }

    #[test]
    fn a_fall_is_detected_as_early_as_the_sum_tuned_to_it_allows() {
        // Siegmund: (a - 1)/(mu²/2) samples with a = log(samples mu²/2), threshold plus overshoot.
        for mu in [1.0, 2.0, 4.0] {
            let reached = (3.0 * 720_000.0 * mu * mu / 2.0_f64).ln();
            let expected = (reached - 1.0) / (mu * mu / 2.0);
            let found = mean_samples(1.0, 0.005, -mu);
            assert!((0.75..1.3).contains(&(found / expected)), "{found} samples for {expected} at {mu}");
        }
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{found} for {expected}");
    }

    #[test]
    fn thresholds_follow_siegmund_for_a_third_of_the_rate_and_are_at_least_one() {
        // 720 per hour at 200 Hz: one in 1000 samples, one in 3000 for each sum.
        let cusum = CusumBank::new(720.0, 0.005);
        for (threshold, mu) in cusum.thresholds.into_iter().zip([1.0, 2.0, 4.0_f64]) {
            near(threshold, (1500.0 * mu * mu).ln() - 1.166 * mu);
        }
        assert_eq!(CusumBank::new(1e9, 0.005).thresholds, [1.0; 3]);
        // Interval and rate have lower bounds.
        assert_eq!(CusumBank::new(720.0, 1e-9).thresholds, CusumBank::new(720.0, 1e-6).thresholds);
        assert_eq!(CusumBank::new(0.0, 0.005).thresholds, CusumBank::new(1e-9, 0.005).thresholds);
    }

    #[test]
    fn the_sums_are_log_likelihood_ratios() {
        let mut cusum = CusumBank::new(720.0, 0.005);
        let h = cusum.thresholds;
        // For a fall of z the sum for mu grows by mu (z - mu/2).
        let outcome = cusum.update(-1.7);
        assert_eq!(
            (outcome.all_zero, outcome.outweighs_history, outcome.alarm, outcome.excess_nats),
            (false, false, false, 0.0)
        );
        near(cusum.sums[0], 1.2);
        near(cusum.sums[1], 1.4);
        assert_eq!(cusum.sums[2], 0.0);
        near(cusum.relative_level(), f64::max(1.2 / h[0], 1.4 / h[1]));
        let outcome = cusum.update(-2.6);
        near(cusum.sums[0], 3.3);
        near(cusum.sums[1], 4.6);
        near(cusum.sums[2], 2.4);
        assert!(outcome.outweighs_history && !outcome.alarm);
        let outcome = cusum.update(-4.0);
        for (sum, expected) in cusum.sums.into_iter().zip([6.8, 10.6, 10.4]) {
            near(sum, expected);
        }
        assert!(outcome.alarm && outcome.outweighs_history);
        near(outcome.excess_nats, f64::max(f64::max(6.8 - h[0], 10.6 - h[1]), 10.4 - h[2]));
        // A sample above the prediction reduces each sum.
        let outcome = cusum.update(0.5);
        for (sum, expected) in cusum.sums.into_iter().zip([5.8, 7.6, 0.4]) {
            near(sum, expected);
        }
        assert!(!outcome.outweighs_history && outcome.alarm && !outcome.all_zero);
        for _ in 0..7 {
            cusum.update(0.5);
        }
        assert!(cusum.update(0.5).all_zero && cusum.relative_level() == 0.0);
    }
}
