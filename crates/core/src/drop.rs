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

/// Traces a declared rupture back to the steepest fall of the force: the number of the first
/// sample after the drop. At most [`LOOK_BACK`] samples are looked at, none before `first`.
pub(crate) fn locate<B: AsRef<[Sample]> + AsMut<[Sample]>>(history: &History<B>, first: u64) -> u64 {
    let newest = history.next().saturating_sub(1);
    let earliest = first.max(history.oldest()).max(newest.saturating_sub(LOOK_BACK));
    let force = |number: u64| history.get(number).map_or(0.0, |s| s.force_n);
    let mut best = (f64::INFINITY, newest);
    for after in (earliest + EDGE)..=newest {
        // The fall from the samples before to those after; near the end there are fewer after.
        let mut before_n = 0.0;
        for k in 1..=EDGE {
            before_n += force(after - k);
        }
        let mut after_n = 0.0;
        let available = (newest - after + 1).min(EDGE);
        for k in 0..available {
            after_n += force(after + k);
        }
        let fall = after_n / available as f64 - before_n / EDGE as f64;
        // Fewer samples weigh less: a fall must stand out of the noise of its mean.
        let weighed = fall * libm::sqrt(available as f64 / EDGE as f64);
        if weighed < best.0 {
            best = (weighed, after);
        }
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
        let Some(edge) = after.checked_sub(1).and_then(|n| history.get(n)) else {
            return drop;
        };
        drop.rupture_m = edge.position_m;
        drop.velocity_mps = edge.velocity_mps;
        let earliest = first.max(after.saturating_sub(LOOK_BACK));
        for number in (earliest..after).rev() {
            match history.get(number) {
                Some(s) if s.position_m >= drop.rupture_m - LINE_TRAVEL_M => {
                    drop.before.add(s.position_m, s.force_n);
                    drop.highest_n = drop.highest_n.max(s.force_n);
                }
                _ => break,
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
