//! The fall of the force after the declaration of a rupture: tissue that tears takes up to 0.1 s to release the force.

use super::rupture_detection::LIKELY_DROP_SDS;
use super::state::{KalmanEnhancer, MAX_DROP_DURATION_S};
use crate::sample::{CompletedDrop, Sample};

/// The drop of the last rupture while it may continue.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContinuedDrop {
    /// Fall so far and its standard deviation in N.
    pub(super) drop_n: f64,
    pub(super) sd_n: f64,
    /// Force in N to which it has fallen, and the present averaged force.
    pub(super) lowest_n: f64,
    pub(super) level_n: f64,
}

impl KalmanEnhancer {
    /// Adds what the force has fallen further, beyond noise; reports the whole drop when its time is over.
    pub(super) fn follow_drop(&mut self, sample: &Sample) {
        let Some(mut drop) = self.continued_drop else { return };
        if self.time_since_rupture_s > MAX_DROP_DURATION_S {
            self.continued_drop = None;
            self.output.completed_drop = Some(CompletedDrop {
                layer: self.output.ruptures,
                drop_n: drop.drop_n,
                drop_sd_n: drop.sd_n,
            });
            return;
        }
        let count = self.averaged_samples();
        drop.level_n += (sample.force_n - drop.level_n) / count;
        let further_n = drop.lowest_n - drop.level_n;
        let variance = self.noise.marginal_variance() * self.noise.long_run_factor() / count;
        if further_n > 0.0 && further_n * further_n > LIKELY_DROP_SDS * LIKELY_DROP_SDS * variance {
            (drop.drop_n, drop.lowest_n) = (drop.drop_n + further_n, drop.level_n);
        }
        self.continued_drop = Some(drop);
    }
}
