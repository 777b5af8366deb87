//! State of a drop that may continue after the declaration of its rupture.

/// Size of a drop in standard deviations where the base law is rejected: outside its 95 % interval.
pub(super) const LIKELY_DROP_SDS: f64 = 2.0;

/// The drop of the last rupture while it may continue.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContinuedDrop {
    /// Fall so far in N, and the variance of its part until the declaration in N².
    pub(super) drop_n: f64,
    pub(super) variance_n2: f64,
    /// Mean force in N of the samples since it last fell, and their number; at the declaration that of the fallen samples.
    pub(super) level_n: f64,
    pub(super) count: f64,
    /// The force has fallen further since the declaration.
    pub(super) has_fallen: bool,
}

impl ContinuedDrop {
    pub(super) fn new(drop_n: f64, sd_n: f64, level_n: f64) -> Self {
        Self { drop_n, variance_n2: sd_n * sd_n, level_n, count: 1.0, has_fallen: false }
    }

    /// Takes a sample with noise of variance `noise_n2`, of which so many are averaged.
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
