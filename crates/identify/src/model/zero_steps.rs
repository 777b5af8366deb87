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

impl Model {
    /// Adds the steps of recording `r` to the predicted block means `force_n`.
    pub fn add_zero_steps(&self, r: usize, blocks: &BlockAverages, force_n: &mut [f64]) {
        for step in self.zero_steps.get(r).into_iter().flatten() {
            let first = blocks.end_s.partition_point(|end| *end <= step.time_s);
            for (k, force) in force_n.iter_mut().enumerate().skip(first) {
                let (start_s, end_s) = (blocks.start_s[k], blocks.end_s[k]);
                let after = ((end_s - step.time_s) / (end_s - start_s)).clamp(0.0, 1.0);
                *force += step.size_n * after;
            }
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
