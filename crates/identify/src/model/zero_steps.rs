//! Steps of the sensor's zero: a piecewise constant offset of each recording.

use super::Model;
use crate::block_averages::BlockAverages;

/// A step of the zero in one recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroStep {
    /// Time in s, between two samples.
    pub time_s: f64,
    /// Size in N: the zero after minus the zero before.
    pub size_n: f64,
}

impl ZeroStep {
    /// Adds `factor` times the step to the means `force_n` of blocks with these limits.
    pub fn add_to(&self, start_s: &[f64], end_s: &[f64], force_n: &mut [f64], factor: f64) {
        let first = end_s.partition_point(|end| *end <= self.time_s);
        for (k, force) in force_n.iter_mut().enumerate().skip(first) {
            let after = ((end_s[k] - self.time_s) / (end_s[k] - start_s[k])).clamp(0.0, 1.0);
            *force += factor * self.size_n * after;
        }
    }
}

impl Model {
    /// Adds the steps of recording `r` to the predicted block means `force_n`.
    pub fn add_zero_steps(&self, r: usize, blocks: &BlockAverages, force_n: &mut [f64]) {
        for step in self.zero_steps.get(r).into_iter().flatten() {
            step.add_to(&blocks.start_s, &blocks.end_s, force_n, 1.0);
        }
    }

    /// Largest number of steps in one recording.
    pub(super) fn most_zero_steps(&self) -> usize {
        self.zero_steps.iter().map(Vec::len).max().unwrap_or(0)
    }

    /// Number of steps in all recordings.
    #[must_use]
    pub fn zero_step_count(&self) -> usize {
        self.zero_steps.iter().map(Vec::len).sum()
    }
}
