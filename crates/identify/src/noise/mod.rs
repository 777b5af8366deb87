//! Noise of measured force: autoregressive, with one set of coefficients and one variance per range of the
//! force.
//!
//! This covers noise that grows with the force and quiet stretches in air without special cases. Residuals are
//! block means.
//!
//! | module | contents |
//! |---|---|
//! | `force_bin` | noise in one range of the force and its estimation |
//! | `long_memory` | regressors of slow drift |
//! | `whiten` | normalised innovations of residuals and the inverse |
//! | `detrend` | residuals without their smooth trend |

mod detrend;
mod force_bin;
mod long_memory;
mod whiten;

pub use force_bin::{AR_ORDER, AfterBreak, ForceBinNoise};
pub use whiten::WhiteningPlan;

use crate::block_averages::BlockAverages;
use detrend::detrended_residuals;
use rayon::prelude::*;
use stylet_stats::Loss;
use stylet_stats::order_statistics::quantile_of_sorted;

/// Largest number of force ranges.
const MAX_FORCE_BINS: usize = 5;
/// Smallest number of blocks per range: its standard deviation is then known to 5 %.
const MIN_BLOCKS_PER_BIN: usize = 220;
/// Threshold in standard deviations beyond which a residual counts linearly (Huber).
pub const HUBER_K: f64 = 2.5;
/// Loss of a normalised residual in nats.
pub const HUBER_LOSS: Loss = Loss::Huber { k: HUBER_K };
/// Smallest noise in N: rounding of numbers in files.
const MIN_NOISE_N: f64 = 1e-6;

/// Noise model of a set of recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Upper edges in N of all force ranges except the last.
    pub edges_n: Vec<f64>,
    /// Noise per force range.
    pub bins: Vec<ForceBinNoise>,
    /// The long memory extends across breaks of a recording, such as velocity jumps.
    pub long_memory: bool,
}

/// Which residuals the noise is estimated from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseSource {
    /// Residuals as they are: all of them is noise.
    Residual,
    /// Residuals as they are, with long memory: for intervals.
    LongMemory,
    /// As `LongMemory`, for simulated (bootstrap) residuals: they are normal, so plain least squares suffice.
    Bootstrap,
    /// Residuals minus their trend over one second, in the quieter windows: unmodelled structure is not noise.
    Detrended,
}

impl NoiseSource {
    /// Whether the memory extends across breaks of a recording.
    fn has_long_memory(self) -> bool {
        matches!(self, Self::LongMemory | Self::Bootstrap)
    }
}

impl Noise {
    /// Independent noise of one standard deviation.
    #[must_use]
    pub fn white(sd_n: f64) -> Self {
        Self { edges_n: Vec::new(), bins: vec![ForceBinNoise::white(sd_n)], long_memory: false }
    }

    /// Noise of residuals `e` (N), one column per recording, with a lower bound of `floor_n`.
    #[must_use]
    pub fn estimate(blocks: &[BlockAverages], e: &[Vec<f64>], from: NoiseSource, floor_n: f64) -> Self {
        let columns: Vec<Vec<f64>> = match from {
            NoiseSource::Residual | NoiseSource::LongMemory | NoiseSource::Bootstrap => e.to_vec(),
            NoiseSource::Detrended => {
                blocks.par_iter().zip(e).map(|(b, e)| detrended_residuals(b, e)).collect()
            }
        };
        let mut sizes: Vec<f64> = Vec::new();
        for b in blocks {
            sizes.extend(b.abs_force_n.iter().zip(&b.used).filter(|(_, u)| **u).map(|(s, _)| *s));
        }
        sizes.sort_unstable_by(f64::total_cmp);
        let count = (sizes.len() / MIN_BLOCKS_PER_BIN).clamp(1, MAX_FORCE_BINS);
        let edges_n: Vec<f64> =
            (1..count).map(|k| quantile_of_sorted(&sizes, k as f64 / count as f64)).collect();
        let mut noise = Self { edges_n, bins: Vec::new(), long_memory: from.has_long_memory() };
        noise.bins = (0..count)
            .into_par_iter()
            .map(|bin| noise.fit_bin(blocks, &columns, bin, from, floor_n.max(MIN_NOISE_N)))
            .collect();
        noise
    }

    /// Index of the range in which a force magnitude lies.
    #[must_use]
    pub fn bin_index(&self, size_n: f64) -> usize {
        self.edges_n.iter().take_while(|e| **e <= size_n).count()
    }

    /// Noise at a force magnitude.
    #[must_use]
    pub fn bin_at(&self, size_n: f64) -> &ForceBinNoise {
        &self.bins[self.bin_index(size_n).min(self.bins.len() - 1)]
    }

    /// Sum of `ln(s/N)` of the innovations' standard deviations `s` over the compared blocks.
    #[must_use]
    pub fn sum_ln_sd(&self, blocks: &[BlockAverages]) -> f64 {
        let mut sum = 0.0;
        for b in blocks {
            let mut run = 0;
            for k in 0..b.len() {
                run = if b.memory_reset[k] { 0 } else { run + 1 };
                if b.used[k] {
                    sum += libm::log(self.bin_at(b.abs_force_n[k]).innovation_sd_after_n(run));
                }
            }
        }
        sum
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
    use crate::block_averages::BLOCK_S;
    use stylet_record::Recording;

    /// Blocks of a needle at rest.
    pub(in crate::noise) fn still(blocks: usize) -> BlockAverages {
        let t: Vec<f64> = (0..4 * blocks).map(|k| k as f64 / 200.0).collect();
        let zero = vec![0.0; t.len()];
        let r = Recording::new(t, zero.clone(), zero).expect("a recording");
        let b = BlockAverages::new(&r, &vec![false; r.time_s.len()], BLOCK_S);
        assert_eq!(b.len(), blocks);
        b
    }

    /// Normal numbers: sums of twelve uniform ones from a linear congruential generator (Knuth's MMIX).
    pub(in crate::noise) fn normal(seed: u64, n: usize) -> Vec<f64> {
        let mut state = seed;
        let mut even = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..n).map(|_| (0..12).map(|_| even()).sum::<f64>() - 6.0).collect()
    }

    pub(in crate::noise) fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-9), "{told} for {wanted}");
    }

    #[test]
    fn lower_edges_belong_to_their_range() {
        let mut noise = Noise::white(0.3);
        assert_eq!((noise.bin_index(0.0), noise.bin_index(9.0)), (0, 0));
        near(noise.sd_n(), 0.3);
        noise.edges_n = vec![0.5, 1.5];
        noise.bins = vec![ForceBinNoise::white(0.3), ForceBinNoise::white(0.5), ForceBinNoise::white(1.1)];
        assert_eq!([0.49, 0.5, 1.49, 1.5, 7.0].map(|s| noise.bin_index(s)), [0, 1, 1, 2, 2]);
        near(noise.sd_n(), ((0.09 + 0.25 + 1.21) / 3.0_f64).sqrt());
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
                near(*edge, quantile_of_sorted(&sizes, (k + 1) as f64 / ranges as f64));
            }
        }
    }

    /// Drift over some seconds continues after a break. Treated as independent after each break, the first
    /// blocks would count as several independent observations.
    #[test]
    fn slow_drift_continues_through_a_break() {
        let n = 12_000;
        let t: Vec<f64> = (0..4 * n).map(|k| f64::from(k) / 200.0).collect();
        let zero = vec![0.0; t.len()];
        let r = Recording::new(t, zero.clone(), zero).expect("a recording");
        let mut b = BlockAverages::new(&r, &vec![false; r.time_s.len()], BLOCK_S);
        for k in (0..b.len()).filter(|k| k % 40 == 0) {
            b.used[k] = false;
            b.memory_reset[k + 1] = true;
        }
        // Normal numbers: sums of twelve uniform ones from a linear congruential generator (Knuth's MMIX).
        let mut state = 11_u64;
        let mut even = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut normal = || (0..12).map(|_| even()).sum::<f64>() - 6.0;
        let mut slow = 0.0;
        let e: Vec<f64> = (0..b.len())
            .map(|_| {
                slow = 0.998 * slow + 0.063 * 0.03 * normal();
                slow + 0.01 * normal()
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
        let (anew, lasting) = (spread(NoiseSource::Residual), spread(NoiseSource::LongMemory));
        assert!(anew > 2.0, "{anew}");
        assert!(lasting > 0.6 && lasting < 1.5, "{lasting}");
    }
}
