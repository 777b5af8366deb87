//! Autoregressive noise model of block means, with coefficients and variance per range of the force.
//!
//! The ranges cover noise that grows with the force as well as quiet stretches in air.
//!
//! | module | contents |
//! |---|---|
//! | `force_bin` | noise in one range of the force |
//! | `estimate` | estimation of the noise model from residuals |
//! | `long_memory` | regressors of slow drift |
//! | `whiten` | normalised innovations of residuals, and the inverse |
//! | `detrend` | residuals without their smooth trend |

mod detrend;
mod estimate;
mod force_bin;
mod long_memory;
mod whiten;

pub use estimate::NoiseSource;
pub use force_bin::{AfterBreak, ForceBinNoise};
pub use long_memory::AR_ORDER;
pub use whiten::WhiteningPlan;

/// Huber threshold in standard deviations: beyond it the loss of a residual is linear.
pub const HUBER_K: f64 = 2.5;

/// Huber loss of a normalised residual, in nats.
#[inline]
#[must_use]
pub fn huber_loss(r: f64) -> f64 {
    stylet_stats::robust_loss::huber_loss(r, HUBER_K)
}

/// Weight of a normalised residual in re-weighted least squares.
#[inline]
#[must_use]
pub fn huber_weight(r: f64) -> f64 {
    stylet_stats::robust_loss::huber_weight(r, HUBER_K)
}

/// Noise model of a set of recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Upper edges in N of all force ranges except the last.
    pub edges_n: Vec<f64>,
    /// Noise per force range.
    pub bins: Vec<ForceBinNoise>,
    /// Whether the long memory extends across breaks of a recording, such as velocity jumps.
    pub long_memory: bool,
}

impl Noise {
    /// White noise with standard deviation `sd_n` (N).
    #[must_use]
    pub fn white(sd_n: f64) -> Self {
        Self { edges_n: Vec::new(), bins: vec![ForceBinNoise::white(sd_n)], long_memory: false }
    }

    /// Index of the range in which a force magnitude lies.
    pub(crate) fn bin_index(&self, size_n: f64) -> usize {
        self.edges_n.iter().take_while(|e| **e <= size_n).count()
    }

    /// Noise of the range of a force magnitude (N).
    #[must_use]
    pub fn bin_at(&self, size_n: f64) -> &ForceBinNoise {
        &self.bins[self.bin_index(size_n).min(self.bins.len() - 1)]
    }

    /// Root mean square of the standard deviations of all ranges, in N.
    #[must_use]
    pub fn sd_n(&self) -> f64 {
        let n = self.bins.len().max(1) as f64;
        (self.bins.iter().map(|b| b.sd_n * b.sd_n).sum::<f64>() / n).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block_averages::BlockAverages;
    use crate::test_support::{assert_close, normal, sampled};
    use stylet_stats::order_statistics::quantile_of_sorted;

    /// Blocks of a needle at rest.
    pub(in crate::noise) fn still(blocks: usize) -> BlockAverages {
        let b = sampled(4 * blocks, |_| 0.0, |_| 0.0);
        assert_eq!(b.len(), blocks);
        b
    }

    #[test]
    fn lower_edges_belong_to_their_range() {
        let mut noise = Noise::white(0.3);
        assert_eq!((noise.bin_index(0.0), noise.bin_index(9.0)), (0, 0));
        assert_close(noise.sd_n(), 0.3);
        noise.edges_n = vec![0.5, 1.5];
        noise.bins = vec![ForceBinNoise::white(0.3), ForceBinNoise::white(0.5), ForceBinNoise::white(1.1)];
        assert_eq!([0.49, 0.5, 1.49, 1.5, 7.0].map(|s| noise.bin_index(s)), [0, 1, 1, 2, 2]);
        assert_close(noise.sd_n(), ((0.09 + 0.25 + 1.21) / 3.0_f64).sqrt());
        let bin = &noise.bins[1];
        assert_eq!(
            (
                bin.innovation_sd_after_n(0),
                bin.innovation_sd_after_n(3),
                bin.innovation_sd_after_n(4),
                bin.ar
            ),
            (0.5, 0.5, 0.5, [0.0; AR_ORDER])
        );
        assert!(!bin.has_long_memory());
        assert!(ForceBinNoise { long_memory: [0.0, 0.0, 0.1], ..*bin }.has_long_memory());
        let mut first = *bin;
        first.after_break[2].long_memory[1] = 0.2;
        assert!(first.has_long_memory());
    }

    /// Ranges hold equally many blocks, at least 220; there are at most five.
    #[test]
    fn force_ranges_hold_enough_blocks() {
        for (blocks, ranges) in [(219, 1), (439, 1), (440, 2), (659, 2), (660, 3), (1100, 5), (1500, 5)] {
            let mut b = still(blocks + 1);
            b.used[0] = false;
            b.abs_force_n = (0..=blocks).map(|k| (k * 7919 % (blocks + 1)) as f64).collect();
            b.abs_force_n[0] = 1e6;
            let e: Vec<f64> = normal(3, blocks + 1);
            let noise = Noise::estimate(&[b.clone()], &[e], NoiseSource::Residual, 0.0);
            assert_eq!(noise.bins.len(), ranges, "{blocks}");
            let mut sizes: Vec<f64> = b.abs_force_n[1..].to_vec();
            sizes.sort_unstable_by(f64::total_cmp);
            for (k, edge) in noise.edges_n.iter().enumerate() {
                assert_close(*edge, quantile_of_sorted(&sizes, (k + 1) as f64 / ranges as f64));
            }
        }
    }

    /// Drift over some seconds continues after a break. Treated as independent after each break, the first
    /// blocks would count as several independent observations.
    #[test]
    fn slow_drift_continues_through_a_break() {
        let mut b = still(12_000);
        for k in (0..b.len()).filter(|k| k % 40 == 0) {
            b.used[k] = false;
            b.memory_reset[k + 1] = true;
        }
        let draw = normal(11, 2 * b.len());
        let mut slow = 0.0;
        let e: Vec<f64> = (0..b.len())
            .map(|k| {
                slow = 0.998 * slow + 0.063 * 0.03 * draw[2 * k];
                slow + 0.01 * draw[2 * k + 1]
            })
            .collect();
        let spread = |from: NoiseSource| {
            let blocks = [b.clone()];
            let noise = Noise::estimate(&blocks, std::slice::from_ref(&e), from, 0.0);
            let w = noise.whiten(&noise.whitening_plan(&b), &e);
            let sums: Vec<f64> =
                (0..b.len() / 40).map(|k| w[40 * k + 1..40 * k + 5].iter().sum::<f64>()).collect();
            sums[20..].iter().map(|s| s * s / 4.0).sum::<f64>() / (sums.len() - 20) as f64
        };
        let (restarted, continued) = (spread(NoiseSource::Residual), spread(NoiseSource::LongMemory));
        assert!(restarted > 2.0, "{restarted}");
        assert!(continued > 0.6 && continued < 1.5, "{continued}");
    }
}
