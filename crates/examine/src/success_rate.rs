//! Success rates with confidence intervals, as printed in tables.

use serde::{Deserialize, Serialize};

/// A rate with its 95 % interval after Wilson.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SuccessRate {
    /// Number of successes.
    pub hits: usize,
    /// Number of cases.
    pub of: usize,
}

impl SuccessRate {
    /// The share of the items for which `holds` is true.
    pub fn of<T>(items: impl IntoIterator<Item = T>, holds: impl Fn(&T) -> bool) -> Self {
        let mut rate = Self::default();
        for item in items {
            rate.of += 1;
            rate.hits += usize::from(holds(&item));
        }
        rate
    }

    /// The rate; NaN without cases.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.hits as f64 / self.of as f64
    }

    /// Wilson's 95 % interval.
    #[must_use]
    pub fn interval(&self) -> (f64, f64) {
        let rate = stylet_stats::wilson(self.hits, self.of);
        (rate.low, rate.high)
    }
}

impl core::fmt::Display for SuccessRate {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.of == 0 {
            return f.pad("-");
        }
        let (low, high) = self.interval();
        f.pad(&format!(
            "{}/{} = {:.0} % ({:.0} to {:.0})",
            self.hits,
            self.of,
            100.0 * self.share(),
            100.0 * low,
            100.0 * high
        ))
    }
}
