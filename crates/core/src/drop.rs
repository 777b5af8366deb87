//! Measuring the force drop of a rupture.

use crate::config::{DropConfig, DropEstimator};
use crate::history::History;
use crate::line::Line;
use crate::sample::Sample;

/// Travel either side of the rupture over which the straight lines are fitted, in m \[D\].
const LINE_TRAVEL_M: f64 = 0.001;
/// Samples looked at before the rupture: bounds the work of the tick that declares it.
const LOOK_BACK: u64 = 256;
/// Samples either side over which a drop is weighed when it is traced back.
const EDGE: u64 = 3;

/// Traces a declared rupture back to the steepest fall of the force among the samples from number
/// `first` on: the number of the first sample after the drop. At most [`LOOK_BACK`] places are looked
/// at, evenly spread when there are more samples.
pub(crate) fn locate<B: AsRef<[Sample]> + AsMut<[Sample]>>(history: &History<B>, first: u64) -> u64 {
    let newest = history.next().saturating_sub(1);
    let earliest = first.max(history.oldest());
    let stride = (newest.saturating_sub(earliest) / LOOK_BACK).max(1);
    let force = |number: u64| history.get(number).map_or(0.0, |s| s.force_n);
    let mut best = (f64::INFINITY, newest);
    let mut after = earliest + EDGE * stride;
    while after <= newest {
        // The fall from the samples before to those after; near the end there are fewer after.
        let mut before_n = 0.0;
        for k in 1..=EDGE {
            before_n += force(after - k * stride);
        }
        let mut after_n = 0.0;
        let available = ((newest - after) / stride + 1).min(EDGE);
        for k in 0..available {
            after_n += force(after + k * stride);
        }
        let fall = after_n / available as f64 - before_n / EDGE as f64;
        // Fewer samples weigh less: a fall must stand out of the noise of its mean.
        let weighed = fall * libm::sqrt(available as f64 / EDGE as f64);
        if weighed < best.0 {
            best = (weighed, after);
        }
        after += stride;
    }
    best.1
}

/// The drop being measured.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Drop {
    before: Line,
    after: Line,
    highest_n: f64,
    lowest_n: f64,
    rupture_m: f64,
    velocity_mps: f64,
}

impl Drop {
    /// Begins at the sample number `after`, the first after the drop; looks back over at most
    /// [`LOOK_BACK`] samples, none before `first`.
    pub(crate) fn begin<B: AsRef<[Sample]> + AsMut<[Sample]>>(
        history: &History<B>,
        first: u64,
        after: u64,
    ) -> Self {
        let mut drop = Drop { highest_n: f64::NEG_INFINITY, lowest_n: f64::INFINITY, ..Drop::default() };
        let before = |back: u64| after.checked_sub(back).and_then(|n| history.get(n));
        let Some(edge) = before(1) else {
            return drop;
        };
        let before_edge = before(2).unwrap_or(edge);
        drop.rupture_m = edge.position_m;
        drop.velocity_mps = edge.velocity_mps;
        // As many samples as the line's travel takes at the present speed, evenly thinned out to the
        // number that a tick may look at.
        let step_m = edge.velocity_mps.abs() * (edge.time_s - before_edge.time_s);
        let wanted = if step_m > 0.0 { LINE_TRAVEL_M / step_m } else { 0.0 };
        let stride = ((wanted / LOOK_BACK as f64) as u64 + 1).min(1 << 20);
        let mut number = after;
        for _ in 0..LOOK_BACK {
            number = number.saturating_sub(if number == after { 1 } else { stride });
            match history.get(number) {
                Some(s) if number >= first && s.position_m >= drop.rupture_m - LINE_TRAVEL_M => {
                    drop.before.add(s.position_m, s.force_n);
                    drop.highest_n = drop.highest_n.max(s.force_n);
                }
                _ => break,
            }
            if number == 0 {
                break;
            }
        }
        for number in after..history.next() {
            if let Some(s) = history.get(number) {
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
        self.lowest_n = self.lowest_n.min(sample.force_n);
    }

    /// The drop in N and the elastic share of the force at the rupture, `kappa`, given the
    /// cumulative friction of the layers before.
    pub(crate) fn share(&self, config: &DropConfig, cumulative_ns_per_m: f64) -> (f64, f64) {
        let (top_n, bottom_n) = match config.estimator {
            DropEstimator::Lines => {
                (self.before.at(self.rupture_m).unwrap_or(0.0), self.after.at(self.rupture_m).unwrap_or(0.0))
            }
            DropEstimator::Extremes => (self.highest_n, self.lowest_n),
        };
        let drop_n = top_n - bottom_n;
        let local_n = top_n - cumulative_ns_per_m * self.velocity_mps;
        let [low, high] = config.share_limits;
        let share = drop_n / local_n;
        let share = if drop_n <= 0.0 || share.is_nan() {
            low
        } else if local_n <= 0.0 {
            high
        } else {
            share.clamp(low, high)
        };
        (drop_n, share)
    }
}
