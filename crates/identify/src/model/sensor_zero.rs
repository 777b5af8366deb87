//! Adds the sensor zero to the predicted force.

use super::Model;
use crate::block_averages::BlockAverages;

impl Model {
    /// Adds the steps of the sensor zero of recording `r` to the predicted block means `force_n`.
    pub fn add_zero_steps(&self, r: usize, blocks: &BlockAverages, force_n: &mut [f64]) {
        for step in self.zero_steps.get(r).into_iter().flatten() {
            step.add_to(&blocks.start_s, &blocks.end_s, force_n, 1.0);
        }
    }

    /// Largest number of steps of the zero in one recording.
    pub(super) fn most_zero_steps(&self) -> usize {
        self.zero_steps.iter().map(Vec::len).max().unwrap_or(0)
    }

    /// Number of steps of the zero in all recordings.
    #[must_use]
    pub fn zero_step_count(&self) -> usize {
        self.zero_steps.iter().map(Vec::len).sum()
    }
}
