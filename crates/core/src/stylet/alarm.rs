//! When a fall of the force is a rupture: three one-sided CUSUMs on the standardised innovations of the local
//! predictor, for drops of one, two and four of its standard deviations.
//!
//! For a shift `-mu` the log-likelihood ratio of one innovation `z` is `mu (-z - mu/2)`; the sum, kept
//! above zero, alarms above `h`. The mean time between false alarms of such a sum is, with Siegmund's correction
//! for the overshoot (Siegmund 1985, Sequential Analysis, eq. 2.57), `(exp(h + 1.166 mu) - h - 1.166 mu - 1) 2/mu²` samples.
//! It is solved for `h` from the rate that the configuration states, which the three share.

/// Drops that the sums are made for, in standard deviations of an innovation.
const SHIFTS: [f64; 3] = [1.0, 2.0, 4.0];
/// Mean overshoot of a random walk of unit normal steps.
const OVERSHOOT: f64 = 1.166;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Alarm {
    sums: [f64; 3],
    thresholds: [f64; 3],
}

impl Alarm {
    /// For `per_hour` false alarms with samples `step_s` apart.
    pub(crate) fn new(per_hour: f64, step_s: f64) -> Self {
        let samples = 3600.0 / (step_s.max(1e-6) * per_hour.max(1e-9)) * SHIFTS.len() as f64;
        let thresholds = SHIFTS.map(|mu| {
            let h = libm::log(samples * mu * mu / 2.0) - OVERSHOOT * mu;
            h.max(1.0)
        });
        Self { sums: [0.0; 3], thresholds }
    }

    pub(crate) fn rest(&mut self) {
        self.sums = [0.0; 3];
    }

    /// Takes a standardised innovation. Returns whether the sums were all zero before, whether this sample alone
    /// outweighs what was summed up before, and whether there is an alarm.
    #[inline(always)]
    pub(crate) fn take(&mut self, z: f64) -> Heard {
        let mut heard = Heard { quiet: true, outweighs: true, alarm: false, evidence: 0.0 };
        for ((sum, threshold), mu) in self.sums.iter_mut().zip(&self.thresholds).zip(SHIFTS) {
            let gain = mu * (-z - 0.5 * mu);
            if gain <= *sum {
                heard.outweighs = false;
            }
            let next = *sum + gain;
            *sum = if next > 0.0 { next } else { 0.0 };
            if *sum > 0.0 {
                heard.quiet = false;
            }
            if *sum > *threshold {
                heard.alarm = true;
            }
            let evidence = *sum - *threshold;
            if evidence > heard.evidence {
                heard.evidence = evidence;
            }
        }
        heard
    }

    /// Largest sum as a share of its threshold.
    pub(crate) fn level(&self) -> f64 {
        let mut level = 0.0;
        for (sum, threshold) in self.sums.iter().zip(&self.thresholds) {
            level = f64::max(level, sum / threshold);
        }
        level
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Heard {
    /// Nothing is summed up: all is as it should be.
    pub(crate) quiet: bool,
    /// This sample alone says more than all before.
    pub(crate) outweighs: bool,
    /// A rupture.
    pub(crate) alarm: bool,
    /// Log-likelihood above the threshold, in nats.
    pub(crate) evidence: f64,
}
