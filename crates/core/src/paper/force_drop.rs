//! Measurement of the force drop at a rupture.

use super::line_fit::LineFit;
use super::sample_ring::{SampleRing, Storage};
use crate::bounds::{at_least, at_most};
use crate::config::{DropConfig, DropEstimator};
use crate::sample::Sample;

/// Travel on either side of the rupture over which the lines are fitted, in m \[D\].
const LINE_TRAVEL_M: f64 = 0.001;
/// Samples inspected before the rupture: bounds the work of the step that declares it.
const MAX_LOOK_BACK: u64 = 256;
/// Samples on either side that are averaged when a drop is located.
const AVERAGED_SAMPLES: u64 = 3;

/// Locates a declared rupture at the steepest fall of the force among the samples from index `first` on; returns the index of
/// the first sample after the drop. At most [`MAX_LOOK_BACK`] places are inspected, evenly spread when there are more
/// samples.
pub(crate) fn locate_drop(ring: &SampleRing<impl Storage>, first: u64) -> u64 {
    let newest = ring.next_index().saturating_sub(1);
    let earliest = first.max(ring.oldest_index());
    let stride = (newest.saturating_sub(earliest) / MAX_LOOK_BACK).max(1);
    let force = |index: u64| ring.get(index).map_or(0.0, |s| s.force_n);
    let mut best = (f64::INFINITY, newest);
    let mut after = earliest + AVERAGED_SAMPLES * stride;
    while after <= newest {
        let mut before_n = 0.0;
        for k in 1..=AVERAGED_SAMPLES {
            before_n += force(after - k * stride);
        }
        // Near the newest sample fewer samples follow.
        let mut after_n = 0.0;
        let available = ((newest - after) / stride + 1).min(AVERAGED_SAMPLES);
        for k in 0..available {
            after_n += force(after + k * stride);
        }
        let fall = after_n / available as f64 - before_n / AVERAGED_SAMPLES as f64;
        // Weighted by the noise of the mean: fewer samples count less.
        let weighted = fall * libm::sqrt(available as f64 / AVERAGED_SAMPLES as f64);
        if weighted < best.0 {
            best = (weighted, after);
        }
        after += stride;
    }
    best.1
}

/// The drop being measured.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ForceDrop {
    before: LineFit,
    after: LineFit,
    max_before_n: f64,
    min_after_n: f64,
    rupture_m: f64,
    velocity_mps: f64,
}

impl ForceDrop {
    /// Begins at sample index `after`, the first after the drop; looks back over at most [`MAX_LOOK_BACK`] samples, none
    /// before `first`.
    pub(crate) fn begin(ring: &SampleRing<impl Storage>, first: u64, after: u64) -> Self {
        let mut drop =
            Self { max_before_n: f64::NEG_INFINITY, min_after_n: f64::INFINITY, ..Self::default() };
        let before = |back: u64| after.checked_sub(back).and_then(|n| ring.get(n));
        let Some(edge) = before(1) else {
            return drop;
        };
        let before_edge = before(2).unwrap_or(edge);
        drop.rupture_m = edge.position_m;
        drop.velocity_mps = edge.velocity_mps;
        // Samples in the travel of the line at the present speed, thinned out to the permitted number.
        let step_m = edge.velocity_mps.abs() * (edge.time_s - before_edge.time_s);
        let wanted = if step_m > 0.0 { LINE_TRAVEL_M / step_m } else { 0.0 };
        let stride = ((wanted / MAX_LOOK_BACK as f64) as u64).saturating_add(1).min(1 << 20);
        let mut index = after;
        for _ in 0..MAX_LOOK_BACK {
            index = index.saturating_sub(if index == after { 1 } else { stride });
            match ring.get(index) {
                Some(s) if index >= first && s.position_m >= drop.rupture_m - LINE_TRAVEL_M => {
                    drop.before.add(s.position_m, s.force_n);
                    drop.max_before_n = drop.max_before_n.max(s.force_n);
                }
                _ => break,
            }
            if index == 0 {
                break;
            }
        }
        for index in after..ring.next_index() {
            if let Some(s) = ring.get(index) {
                drop.add(s);
            }
        }
        drop
    }

    /// Takes a sample after the rupture.
    #[inline]
    pub(crate) fn add(&mut self, sample: &Sample) {
        if sample.position_m <= self.rupture_m + LINE_TRAVEL_M {
            self.after.add(sample.position_m, sample.force_n);
        }
        self.min_after_n = self.min_after_n.min(sample.force_n);
    }

    /// The drop in N and the elastic share `kappa` of the force at the rupture, given the cumulative friction of the previous
    /// layers.
    pub(crate) fn drop_and_elastic_share(&self, config: &DropConfig, cumulative_ns_per_m: f64) -> (f64, f64) {
        let [low, high] = config.share_limits;
        let sides = match config.estimator {
            DropEstimator::Lines => self.before.y_at(self.rupture_m).zip(self.after.y_at(self.rupture_m)),
            DropEstimator::Extremes => Some((self.max_before_n, self.min_after_n)),
        };
        let Some((top_n, bottom_n)) = sides.filter(|(top, bottom)| (top - bottom).is_finite()) else {
            // No samples are kept on one side.
            return (0.0, low);
        };
        let drop_n = top_n - bottom_n;
        let layer_n = top_n - cumulative_ns_per_m * self.velocity_mps;
        let share = drop_n / layer_n;
        let share = if drop_n <= 0.0 || share.is_nan() {
            low
        } else if layer_n <= 0.0 {
            high
        } else {
            at_least(low, at_most(high, share))
        };
        (drop_n, share)
    }
}

#[cfg(test)]
mod tests;
