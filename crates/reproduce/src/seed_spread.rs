//! Spread of a quantity over the noise seeds.

use serde::Serialize;

/// Median, 5th and 95th percentile, mean and standard deviation over the seeds that gave a value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Median.
    pub median: f64,
    /// 5th percentile.
    pub p5: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation (of a sample).
    pub sd: f64,
    /// Number of seeds that gave a value.
    pub n: usize,
    /// Number of all seeds.
    pub of: usize,
}

impl Spread {
    /// Of one value per seed; seeds without a value are counted, not filled in. `None` without any.
    #[must_use]
    pub fn of(values: impl Iterator<Item = Option<f64>>) -> Option<Self> {
        let all: Vec<Option<f64>> = values.collect();
        let sorted = stylet_stats::sorted(all.iter().copied().flatten().filter(|x| x.is_finite()));
        if sorted.is_empty() {
            return None;
        }
        let at = |q: f64| stylet_stats::quantile_of_sorted(&sorted, q);
        Some(Self {
            median: at(0.5),
            p5: at(0.05),
            p95: at(0.95),
            mean: stylet_stats::mean(&sorted),
            // One seed has no spread; zero keeps the tables readable.
            sd: if sorted.len() > 1 { stylet_stats::sd(&sorted) } else { 0.0 },
            n: sorted.len(),
            of: all.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_a_hundred_and_one_numbers() {
        let s = Spread::of((0..=100).rev().map(|i| Some(f64::from(i))).chain([None])).expect("values");
        assert_eq!((s.p5, s.median, s.p95, s.mean, s.n, s.of), (5.0, 50.0, 95.0, 50.0, 101, 102));
        assert!((s.sd - 29.300_170_647).abs() < 1e-6, "{s:?}");
        assert_eq!(Spread::of([None].into_iter()), None);
    }
}
