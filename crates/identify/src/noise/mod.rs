//! The noise of measured force: autoregressive, one set of coefficients and one size per range of the force.
//!
//! Growth with the force, tails and missing air need no special case then. Residuals are means over blocks.
//!
//! | module | what |
//! |---|---|
//! | `bin` | noise in one range of the force, and how it is estimated |
//! | `slow` | the memory of a slow wander |
//! | `whiten` | normalised innovations of residuals, and back |
//! | `calm` | residuals without their smooth course |

mod bin;
mod calm;
mod slow;
mod whiten;

pub use bin::{Bin, First, ORDER};
pub use whiten::Laid;

use crate::blocks::Blocks;
use calm::calm;
use rayon::prelude::*;
use stylet_stats::Loss;
use stylet_stats::order::quantile_of_sorted;

/// Most ranges of the force.
const BINS: usize = 5;
/// Fewest blocks of a range: a size is then known to a twentieth.
const LEAST: usize = 220;
/// Beyond so many standard deviations a residual counts linearly (Huber).
pub const HUBER: f64 = 2.5;
/// What a normalised residual costs, in nats.
pub const LOSS: Loss = Loss::Huber { k: HUBER };
/// Smallest noise in N: rounding of numbers in files.
const FLOOR_N: f64 = 1e-6;

/// The noise of a set of recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Upper edges in N of all ranges but the last.
    pub edges_n: Vec<f64>,
    /// The ranges.
    pub bins: Vec<Bin>,
    /// The memory of a slow wander reaches through breaks of the recording, such as jumps of the speed.
    pub lasting: bool,
}

/// How residuals are looked at when the noise is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum From {
    /// As they are: everything that is left is noise.
    Whole,
    /// As they are, and however slow: what intervals have to reckon with.
    Lasting,
    /// The same of noise that was drawn: it is normal, so that plain least squares do.
    Drawn,
    /// Less what is smooth over a second, in the calmer windows: structure that a law lacks is no noise.
    Calm,
}

impl From {
    /// Whether a wander's memory reaches through breaks of the recording.
    fn lasts(self) -> bool {
        matches!(self, Self::Lasting | Self::Drawn)
    }
}

impl Noise {
    /// Independent noise of one size.
    #[must_use]
    pub fn white(sd_n: f64) -> Self {
        Self { edges_n: Vec::new(), bins: vec![Bin::white(sd_n)], lasting: false }
    }

    /// The noise of residuals `e` (N), one column per recording; nowhere less than `floor_n`.
    #[must_use]
    pub fn estimate(blocks: &[Blocks], e: &[Vec<f64>], from: From, floor_n: f64) -> Self {
        let columns: Vec<Vec<f64>> = match from {
            From::Whole | From::Lasting | From::Drawn => e.to_vec(),
            From::Calm => blocks.par_iter().zip(e).map(|(b, e)| calm(b, e)).collect(),
        };
        let mut sizes: Vec<f64> = Vec::new();
        for b in blocks {
            sizes.extend(b.size_n.iter().zip(&b.used).filter(|(_, u)| **u).map(|(s, _)| *s));
        }
        sizes.sort_unstable_by(f64::total_cmp);
        let count = (sizes.len() / LEAST).clamp(1, BINS);
        let edges_n: Vec<f64> =
            (1..count).map(|k| quantile_of_sorted(&sizes, k as f64 / count as f64)).collect();
        let mut noise = Self { edges_n, bins: Vec::new(), lasting: from.lasts() };
        noise.bins = (0..count)
            .into_par_iter()
            .map(|bin| noise.fit(blocks, &columns, bin, from, floor_n.max(FLOOR_N)))
            .collect();
        noise
    }

    /// The range in which a size of the force lies.
    #[must_use]
    pub fn bin(&self, size_n: f64) -> usize {
        self.edges_n.iter().take_while(|e| **e <= size_n).count()
    }

    /// The noise of a block of a size of the force.
    #[must_use]
    pub fn of(&self, size_n: f64) -> &Bin {
        &self.bins[self.bin(size_n).min(self.bins.len() - 1)]
    }

    /// Sum of the logarithms of the innovations' standard deviations, `ln(s/N)`, over the blocks compared.
    #[must_use]
    pub fn ln_sizes(&self, blocks: &[Blocks]) -> f64 {
        let mut sum = 0.0;
        for b in blocks {
            let mut run = 0;
            for k in 0..b.len() {
                run = if b.restart[k] { 0 } else { run + 1 };
                if b.used[k] {
                    sum += libm::log(self.of(b.size_n[k]).size_n(run));
                }
            }
        }
        sum
    }

    /// Standard deviation in N over all ranges, root mean square.
    #[must_use]
    pub fn sd_n(&self) -> f64 {
        let n = self.bins.len().max(1) as f64;
        (self.bins.iter().map(|b| b.sd_n * b.sd_n).sum::<f64>() / n).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocks::BLOCK_S;
    use stylet_record::Recording;

    /// Blocks of a needle at rest; of none is anything known but its time.
    pub(in crate::noise) fn still(blocks: usize) -> Blocks {
        let t: Vec<f64> = (0..4 * blocks).map(|k| k as f64 / 200.0).collect();
        let zero = vec![0.0; t.len()];
        let r = Recording::new(t, zero.clone(), zero).expect("a recording");
        let b = Blocks::new(&r, &vec![false; r.time_s.len()], BLOCK_S);
        assert_eq!(b.len(), blocks);
        b
    }

    /// Normal numbers: twelve even ones of a linear congruence (Knuth's MMIX) each.
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
    fn a_size_of_the_force_lies_in_the_range_that_begins_there() {
        let mut noise = Noise::white(0.3);
        assert_eq!((noise.bin(0.0), noise.bin(9.0)), (0, 0));
        near(noise.sd_n(), 0.3);
        noise.edges_n = vec![0.5, 1.5];
        noise.bins = vec![Bin::white(0.3), Bin::white(0.5), Bin::white(1.1)];
        assert_eq!([0.49, 0.5, 1.49, 1.5, 7.0].map(|s| noise.bin(s)), [0, 1, 1, 2, 2]);
        near(noise.sd_n(), ((0.09 + 0.25 + 1.21) / 3.0_f64).sqrt());
        let bin = &noise.bins[1];
        assert_eq!((bin.size_n(0), bin.size_n(3), bin.size_n(4), bin.a), (0.5, 0.5, 0.5, [0.0; ORDER]));
        assert!(!bin.wanders());
        assert!(Bin { slow: [0.0, 0.0, 0.1], ..*bin }.wanders());
        let mut first = *bin;
        first.first[2].slow[1] = 0.2;
        assert!(first.wanders());
    }

    /// Ranges have the same number of blocks, of which a size needs 220; no more than five ranges.
    #[test]
    fn ranges_hold_as_many_blocks_each_as_a_size_needs() {
        for (blocks, ranges) in [(219, 1), (439, 1), (440, 2), (659, 2), (660, 3), (1100, 5), (1500, 5)] {
            let mut b = still(blocks + 1);
            b.used[0] = false;
            b.size_n = (0..=blocks).map(|k| (k * 7919 % (blocks + 1)) as f64).collect();
            b.size_n[0] = 1e6;
            let e: Vec<f64> = normal(3, blocks + 1);
            let noise = Noise::estimate(&[b.clone()], &[e], From::Whole, 0.0);
            assert_eq!(noise.bins.len(), ranges, "{blocks}");
            let mut sizes: Vec<f64> = b.size_n[1..].to_vec();
            sizes.sort_unstable_by(f64::total_cmp);
            for (k, edge) in noise.edges_n.iter().enumerate() {
                near(*edge, quantile_of_sorted(&sizes, (k + 1) as f64 / ranges as f64));
            }
        }
    }

    /// A wander that lasts some seconds goes on after a break: what is left of the first blocks there is small, and those of one
    /// break know nothing of one another. As if they began anew they would count as many times what they tell.
    #[test]
    fn a_slow_wander_lasts_through_a_break() {
        let n = 12_000;
        let t: Vec<f64> = (0..4 * n).map(|k| f64::from(k) / 200.0).collect();
        let zero = vec![0.0; t.len()];
        let r = Recording::new(t, zero.clone(), zero).expect("a recording");
        let mut b = Blocks::new(&r, &vec![false; r.time_s.len()], BLOCK_S);
        for k in (0..b.len()).filter(|k| k % 40 == 0) {
            b.used[k] = false;
            b.restart[k + 1] = true;
        }
        // Twelve even numbers of a linear congruence (Knuth's MMIX) make a normal one.
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
        let spread = |from: From| {
            let blocks = [b.clone()];
            let noise = Noise::estimate(&blocks, std::slice::from_ref(&e), from, 0.0);
            let w = noise.whiten(&noise.laid(&b), &e);
            let sums: Vec<f64> =
                (0..b.len() / 40).map(|k| w[40 * k + 1..40 * k + 5].iter().sum::<f64>()).collect();
            sums[20..].iter().map(|s| s * s / 4.0).sum::<f64>() / (sums.len() - 20) as f64
        };
        let (anew, lasting) = (spread(From::Whole), spread(From::Lasting));
        assert!(anew > 2.0, "{anew}");
        assert!(lasting > 0.6 && lasting < 1.5, "{lasting}");
    }
}
