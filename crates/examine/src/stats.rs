//! The few statistics that tables need. To be replaced by the crate `stats`.

use serde::{Deserialize, Serialize};

/// A rate with its 95 % interval after Wilson.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// How many.
    pub hits: usize,
    /// Of how many.
    pub of: usize,
}

/// Normal quantile of a two-sided 95 % interval.
const Z95: f64 = 1.959_963_984_540_054;

impl Rate {
    /// How many of the items hold.
    pub fn of<T>(items: impl IntoIterator<Item = T>, holds: impl Fn(&T) -> bool) -> Self {
        let mut rate = Self::default();
        for item in items {
            rate.of += 1;
            rate.hits += usize::from(holds(&item));
        }
        rate
    }

    /// The share; not a number of nothing.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.hits as f64 / self.of as f64
    }

    /// Wilson's 95 % interval.
    #[must_use]
    pub fn interval(&self) -> (f64, f64) {
        if self.of == 0 {
            return (0.0, 1.0);
        }
        let (n, p, z2) = (self.of as f64, self.share(), Z95 * Z95);
        let middle = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
        let half = Z95 / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
        ((middle - half).max(0.0), (middle + half).min(1.0))
    }
}

impl core::fmt::Display for Rate {
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

/// The `q`-quantile, nearest rank; not a number of nothing.
#[must_use]
pub fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(((sorted.len().max(1) - 1) as f64 * q).round() as usize).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wilson 1927; Brown, Cai and DasGupta 2001, table for 5 of 10: 0.237 to 0.763.
    #[test]
    fn wilson_interval_of_five_in_ten() {
        let (low, high) = Rate { hits: 5, of: 10 }.interval();
        assert!((low - 0.2366).abs() < 1e-4 && (high - 0.7634).abs() < 1e-4, "{low} {high}");
    }
}
