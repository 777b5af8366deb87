//! The fall of the force after the declaration of a rupture: tissue that tears takes up to 0.1 s to release the force.

use super::force_predictor::MotionStep;
use super::rupture_detection::LIKELY_DROP_SDS;
use super::state::{KalmanEnhancer, MAX_DROP_DURATION_S};
use crate::sample::{CompletedDrop, Sample};

/// The drop of the last rupture while it may continue.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContinuedDrop {
    /// Fall so far in N, and the variance of its part until the declaration in N².
    drop_n: f64,
    variance_n2: f64,
    /// Mean force in N of the samples since it last fell, and their number; at the declaration that of the fallen samples.
    level_n: f64,
    count: f64,
    /// The force has fallen further since the declaration.
    has_fallen: bool,
}

impl ContinuedDrop {
    pub(super) fn new(drop_n: f64, sd_n: f64, level_n: f64) -> Self {
        Self { drop_n, variance_n2: sd_n * sd_n, level_n, count: 1.0, has_fallen: false }
    }

    /// Takes a sample with noise of variance `noise_n2`, of which so many are averaged.
    fn push(&mut self, force_n: f64, noise_n2: f64, averaged: f64) {
        let further_n = self.level_n - force_n;
        let variance = noise_n2 * (1.0 + 1.0 / self.count);
        let falls = further_n > 0.0 && further_n * further_n > LIKELY_DROP_SDS * LIKELY_DROP_SDS * variance;
        if falls {
            (self.count, self.has_fallen) = (1.0, true);
        } else if self.has_fallen && self.count < averaged {
            self.count += 1.0;
        } else {
            return;
        }
        let change_n = further_n / self.count;
        (self.drop_n, self.level_n) = (self.drop_n + change_n, self.level_n - change_n);
    }
}

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
