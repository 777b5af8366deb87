//! The fall of the force after the declaration of a rupture: tissue that tears takes up to 0.1 s to release the force.

use super::force_predictor::MotionStep;
use super::state::{KalmanEnhancer, MAX_DROP_DURATION_S};
use crate::sample::{CompletedDrop, Sample};

impl KalmanEnhancer {
    /// Reports the whole drop of the last rupture when its time is over.
    pub(super) fn complete_drop(&mut self) {
        if self.time_since_rupture_s > MAX_DROP_DURATION_S
            && let Some(drop) = self.continued_drop.take()
        {
            let level_n2 = if drop.has_fallen { self.noise.marginal_variance() / drop.count } else { 0.0 };
            self.output.completed_drop = Some(CompletedDrop {
                layer: self.output.ruptures,
                drop_n: drop.drop_n,
                drop_sd_n: libm::sqrt(drop.variance_n2 + level_n2),
            });
        }
    }

    /// Adds what the force has fallen further, beyond noise and apart from friction that a lower speed takes away.
    pub(super) fn follow_drop(&mut self, step: &MotionStep, sample: &Sample) {
        let Some(mut drop) = self.continued_drop.filter(|_| self.stop.is_none()) else { return };
        if self.misfit_weight == 0.0 {
            drop.level_n += self.snapshot.friction(sample.position_m) * step.dv_mps;
        }
        drop.push(sample.force_n, self.noise.marginal_variance(), self.averaged_samples());
        self.continued_drop = Some(drop);
    }
}
