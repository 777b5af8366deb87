//! When a fall of the force is a rupture: three one-sided CUSUMs on the standardised innovations of the local
//! predictor, for drops of one, two and four of its standard deviations.
//!
//! For a shift `-mu` the log-likelihood ratio of one innovation `z` is `mu (-z - mu/2)`; the sum, kept
//! above zero, alarms above `h`. The mean time between false alarms of such a sum is, with Siegmund's correction
//! for the overshoot (Siegmund 1985, Sequential Analysis, eq. 2.57), `(exp(h + 1.166 mu) - h - 1.166 mu - 1) 2/mu²` samples.
//! It is solved for `h` from the rate that the configuration states, which the three share.

use super::gaussian::at_least;

/// Drops that the sums are made for, in standard deviations of an innovation.
const SHIFTS: [f64; 3] = [1.0, 2.0, 4.0];
/// Mean overshoot of a random walk of unit normal steps.
const OVERSHOOT: f64 = 1.166;

#[derive(Clone, Copy, Debug)]
pub(crate) struct CusumBank {
    sums: [f64; 3],
    thresholds: [f64; 3],
}

impl CusumBank {
    /// For `per_hour` false alarms with samples `step_s` apart.
    pub(crate) fn new(per_hour: f64, step_s: f64) -> Self {
        let samples = 3600.0 / (step_s.max(1e-6) * per_hour.max(1e-9)) * SHIFTS.len() as f64;
        let thresholds = SHIFTS.map(|mu| {
            let h = libm::log(samples * mu * mu / 2.0) - OVERSHOOT * mu;
            h.max(1.0)
        });
        Self { sums: [0.0; 3], thresholds }
    }

    pub(crate) fn reset(&mut self) {
        self.sums = [0.0; 3];
    }

    /// Takes a standardised innovation. Returns whether the sums were all zero before, whether this sample alone
    /// outweighs what was summed up before, and whether there is an alarm.
    #[inline(always)]
    pub(crate) fn update(&mut self, z: f64) -> CusumOutcome {
        let mut heard =
            CusumOutcome { all_zero: true, outweighs_history: true, alarm: false, excess_nats: 0.0 };
        for ((sum, threshold), mu) in self.sums.iter_mut().zip(&self.thresholds).zip(SHIFTS) {
            let gain = mu * (-z - 0.5 * mu);
            if gain <= *sum {
                heard.outweighs_history = false;
            }
            *sum = at_least(0.0, *sum + gain);
            if *sum > 0.0 {
                heard.all_zero = false;
            }
            if *sum > *threshold {
                heard.alarm = true;
            }
            heard.excess_nats = at_least(heard.excess_nats, *sum - *threshold);
        }
        heard
    }

    /// Largest sum as a share of its threshold.
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
    /// Nothing is summed up: all is as it should be.
    pub(crate) all_zero: bool,
    /// This sample alone says more than all before.
    pub(crate) outweighs_history: bool,
    /// A rupture.
    pub(crate) alarm: bool,
    /// Log-likelihood above the threshold, in nats.
    pub(crate) excess_nats: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Mean number of samples of unit noise with this shift until the alarm.
    fn mean_samples(per_hour: f64, step_s: f64, shift: f64) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut samples, runs) = (0, 1000);
        for _ in 0..runs {
            let mut alarm = CusumBank::new(per_hour, step_s);
            loop {
                let w: f64 = StandardNormal.sample(&mut rng);
                samples += 1;
                if alarm.update(w + shift).alarm {
                    break;
                }
            }
        }
        f64::from(samples) / f64::from(runs)
    }

    #[test]
    fn false_alarms_come_as_often_as_they_are_accepted_at_every_sampling_rate() {
        // The three sums share the rate, and alarm together now and then: somewhat fewer.
        for (per_hour, step_s) in [(720.0, 0.005), (3600.0, 0.001), (72.0, 0.05)] {
            let ratio = mean_samples(per_hour, step_s, 0.0) * step_s * per_hour / 3600.0;
            assert!((0.8..1.6).contains(&ratio), "{ratio} of the accepted time at {step_s} s");
        }
    }

    #[test]
    fn a_fall_is_heard_about_as_soon_as_the_sum_made_for_it_can() {
        // Siegmund: the sum for a shift mu takes (a - 1)/(mu²/2) samples, a = log(samples mu²/2) being threshold and overshoot.
        for mu in [1.0, 2.0, 4.0] {
            let reached = (3.0 * 720_000.0 * mu * mu / 2.0_f64).ln();
            let expected = (reached - 1.0) / (mu * mu / 2.0);
            let found = mean_samples(1.0, 0.005, -mu);
            assert!((0.75..1.3).contains(&(found / expected)), "{found} samples for {expected} at {mu}");
        }
    }

    #[test]
    fn what_is_heard_is_told_from_what_was_summed_up_before() {
        let mut alarm = CusumBank::new(0.05, 0.005);
        let heard = alarm.update(0.3);
        assert!(heard.all_zero && !heard.alarm && heard.excess_nats == 0.0);
        // A fall by one: the sums for one and two have something, all of it new.
        let heard = alarm.update(-1.5);
        assert!(!heard.all_zero && !heard.alarm);
        // Less than what is there does not outweigh it; much more does.
        assert!(!alarm.update(-1.0).outweighs_history);
        let heard = alarm.update(-30.0);
        assert!(heard.outweighs_history && heard.alarm && heard.excess_nats > 50.0, "{heard:?}");
        assert!(alarm.relative_level() > 1.0);
        alarm.reset();
        assert_eq!(alarm.relative_level(), 0.0);
        assert!(alarm.update(0.0).all_zero);
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{found} for {expected}");
    }

    #[test]
    fn thresholds_are_siegmunds_for_a_third_of_the_rate_and_at_least_one() {
        // 720 an hour at 200 Hz are one in a thousand samples, in three thousand for each of the sums.
        let alarm = CusumBank::new(720.0, 0.005);
        for (threshold, mu) in alarm.thresholds.into_iter().zip([1.0, 2.0, 4.0_f64]) {
            near(threshold, (1500.0 * mu * mu).ln() - 1.166 * mu);
        }
        assert_eq!(CusumBank::new(1e9, 0.005).thresholds, [1.0; 3]);
        // Nobody samples faster than a megahertz, nor waits longer than for one alarm in 10^9 hours.
        assert_eq!(CusumBank::new(720.0, 1e-9).thresholds, CusumBank::new(720.0, 1e-6).thresholds);
        assert_eq!(CusumBank::new(0.0, 0.005).thresholds, CusumBank::new(1e-9, 0.005).thresholds);
    }

    #[test]
    fn the_sums_are_of_log_likelihood_ratios_and_evidence_is_what_is_above_the_threshold() {
        let mut alarm = CusumBank::new(720.0, 0.005);
        let h = alarm.thresholds;
        // For a fall by z the sum for mu grows by mu (z - mu/2).
        let heard = alarm.update(-1.7);
        assert_eq!(
            (heard.all_zero, heard.outweighs_history, heard.alarm, heard.excess_nats),
            (false, false, false, 0.0)
        );
        near(alarm.sums[0], 1.2);
        near(alarm.sums[1], 1.4);
        assert_eq!(alarm.sums[2], 0.0);
        near(alarm.relative_level(), f64::max(1.2 / h[0], 1.4 / h[1]));
        let heard = alarm.update(-2.6);
        near(alarm.sums[0], 3.3);
        near(alarm.sums[1], 4.6);
        near(alarm.sums[2], 2.4);
        assert!(heard.outweighs_history && !heard.alarm);
        let heard = alarm.update(-4.0);
        for (sum, expected) in alarm.sums.into_iter().zip([6.8, 10.6, 10.4]) {
            near(sum, expected);
        }
        assert!(heard.alarm && heard.outweighs_history);
        near(heard.excess_nats, f64::max(f64::max(6.8 - h[0], 10.6 - h[1]), 10.4 - h[2]));
        // What is as expected takes from each what it stands for.
        let heard = alarm.update(0.5);
        for (sum, expected) in alarm.sums.into_iter().zip([5.8, 7.6, 0.4]) {
            near(sum, expected);
        }
        assert!(!heard.outweighs_history && heard.alarm && !heard.all_zero);
        for _ in 0..7 {
            alarm.update(0.5);
        }
        assert!(alarm.update(0.5).all_zero && alarm.relative_level() == 0.0);
    }
}
