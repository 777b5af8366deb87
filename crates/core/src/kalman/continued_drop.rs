//! The fall of the force after the declaration of a rupture: tissue that tears takes up to 0.1 s to release the force.

use crate::sample::CompletedDrop;

/// Size in standard deviations, outside the 95 % interval, of a drop where the base law is rejected, and of a further fall.
pub(super) const LIKELY_DROP_SDS: f64 = 2.0;

/// The drop of the last rupture while it may continue.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContinuedDrop {
    /// Fall so far in N, and the variance of its part until the declaration in N².
    drop_n: f64,
    variance_n2: f64,
    /// Mean force in N of the samples since it last fell, and their number; at the declaration that of the fallen samples.
    pub(super) level_n: f64,
    count: f64,
    /// The force has fallen further since the declaration.
    has_fallen: bool,
}

impl ContinuedDrop {
    pub(super) fn new(drop_n: f64, sd_n: f64, level_n: f64) -> Self {
        Self { drop_n, variance_n2: sd_n * sd_n, level_n, count: 1.0, has_fallen: false }
    }

    /// The drop of a layer, with noise of variance `noise_n2` on the samples behind it.
    pub(super) fn completed(&self, layer: usize, noise_n2: f64) -> CompletedDrop {
        let level_n2 = if self.has_fallen { noise_n2 / self.count } else { 0.0 };
        CompletedDrop { layer, drop_n: self.drop_n, drop_sd_n: libm::sqrt(self.variance_n2 + level_n2) }
    }

    /// Adds a sample with noise of variance `noise_n2` in N², of which `averaged` are averaged.
    pub(super) fn push(&mut self, force_n: f64, noise_n2: f64, averaged: f64) {
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
