//! Whitens residuals with the noise model, and inverts the whitening.

use super::long_memory::{STRETCHES, running_sums, stretch_means};
use super::{AR_ORDER, ForceBinNoise, Noise};
use crate::block_averages::BlockAverages;

/// Precomputed whitening of one recording: predictor and standard deviation per block.
#[derive(Clone, Debug, PartialEq)]
pub struct WhiteningPlan {
    rows: Vec<BlockWhitening>,
    /// Whether any force range has a long memory.
    has_long_memory: bool,
}

/// Whitening of one block.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BlockWhitening {
    /// Index of the force range.
    bin: u32,
    /// Number of predecessors since the last break.
    blocks_since_break: u32,
    /// Number of preceding blocks in the long memory.
    memory_blocks: u32,
    /// Standard deviation of the innovation in N; infinite when the block is not compared.
    sd_n: f64,
    /// Whether the prediction is that of the autoregression alone, from [`AR_ORDER`] predecessors.
    is_plain: bool,
}

impl Noise {
    /// Computes the whitening plan of a recording.
    pub(crate) fn whitening_plan(&self, b: &BlockAverages) -> WhiteningPlan {
        let mut run = 0;
        let lasting = self.long_memory;
        let rows = (0..b.len()).map(|k| {
            run = if b.memory_reset[k] { 0 } else { run + 1 };
            if !b.used[k] {
                return BlockWhitening {
                    bin: 0,
                    blocks_since_break: 0,
                    memory_blocks: 0,
                    sd_n: f64::INFINITY,
                    is_plain: false,
                };
            }
            let bin = self.bin_index(b.abs_force_n[k]).min(self.bins.len() - 1);
            let of = &self.bins[bin];
            let sd = of.innovation_sd_after_n(run);
            let sd_n = if b.extra_sd_n[k] > 0.0 { libm::hypot(sd, b.extra_sd_n[k]) } else { sd };
            BlockWhitening {
                bin: bin as u32,
                blocks_since_break: run as u32,
                memory_blocks: if lasting { k as u32 } else { run as u32 },
                sd_n,
                is_plain: run >= AR_ORDER && !of.has_long_memory(),
            }
        });
        let rows = rows.collect();
        WhiteningPlan { rows, has_long_memory: self.bins.iter().any(ForceBinNoise::has_long_memory) }
    }

    /// Normalised innovations of residuals `e` (N) of a recording; zero in blocks that are not compared.
    #[must_use]
    pub fn whiten(&self, plan: &WhiteningPlan, e: &[f64]) -> Vec<f64> {
        let sums = match (plan.has_long_memory, self.long_memory) {
            (false, _) => Vec::new(),
            (true, false) => running_sums(e, |_| true),
            (true, true) => running_sums(e, |k| plan.rows[k].sd_n.is_finite()),
        };
        let one = |k: usize, row: &BlockWhitening| {
            if row.sd_n == f64::INFINITY {
                return 0.0;
            }
            let (ar, long_memory) = self.predictor(row);
            let run = AR_ORDER.min(row.blocks_since_break as usize);
            let mut w = e[k];
            for (a, before) in ar.iter().zip(e[k - run..k].iter().rev()) {
                w -= a * before;
            }
            if plan.has_long_memory && *long_memory != [0.0; STRETCHES.len()] {
                let means = stretch_means(&sums, k, row.memory_blocks as usize);
                for (mean, a) in means.iter().zip(long_memory) {
                    w -= a * mean;
                }
            }
            w / row.sd_n
        };
        let mut out = vec![0.0; e.len()];
        // Whitened values are zero before the first non-zero residual, and after the last one beyond the memory.
        let reach = if plan.has_long_memory { STRETCHES[STRETCHES.len() - 1].1 } else { AR_ORDER };
        let first = e.iter().position(|e| *e != 0.0).unwrap_or(e.len());
        let end = e.iter().rposition(|e| *e != 0.0).map_or(0, |k| (k + 1 + reach).min(e.len()));
        for k in first..end {
            let row = &plan.rows[k];
            out[k] = match e[..k].last_chunk::<AR_ORDER>().filter(|_| row.is_plain) {
                Some(before) => {
                    let ar = &self.bins[row.bin as usize].ar;
                    (0..AR_ORDER).fold(e[k], |w, i| w - ar[i] * before[AR_ORDER - 1 - i]) / row.sd_n
                }
                None => one(k, row),
            };
        }
        out
    }

    /// Residuals (N) of a recording with normalised innovations `w`: the inverse of [`whiten`](Self::whiten),
    /// zero in blocks that are not compared.
    #[must_use]
    pub fn unwhiten(&self, plan: &WhiteningPlan, w: &[f64]) -> Vec<f64> {
        let mut e = vec![0.0; w.len()];
        let mut sums = vec![0.0; w.len() + 1];
        for (k, row) in plan.rows.iter().enumerate() {
            if row.sd_n.is_finite() {
                let (ar, long_memory) = self.predictor(row);
                let run = AR_ORDER.min(row.blocks_since_break as usize);
                let mut x = w[k] * row.sd_n;
                for (a, before) in ar.iter().zip(e[k - run..k].iter().rev()) {
                    x += a * before;
                }
                if plan.has_long_memory {
                    let means = stretch_means(&sums, k, row.memory_blocks as usize);
                    x += means.iter().zip(long_memory).map(|(mean, a)| a * mean).sum::<f64>();
                }
                e[k] = x;
            }
            sums[k + 1] = sums[k] + e[k];
        }
        e
    }

    /// Coefficients of the predecessors and of the stretch means that predict a block.
    fn predictor(&self, row: &BlockWhitening) -> (&[f64; AR_ORDER], &[f64; STRETCHES.len()]) {
        let bin = &self.bins[row.bin as usize];
        bin.after_break
            .get(row.blocks_since_break as usize)
            .map_or((&bin.ar, &bin.long_memory), |f| (&f.ar, &f.long_memory))
    }
}

#[cfg(test)]
mod tests;
