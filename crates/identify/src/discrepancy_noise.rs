//! White noise equivalent to the correlated residuals of an incomplete model.
//!
//! Model discrepancy reaches fifty times the sensor noise and is correlated over about a second; with the sensor noise, a fit would overfit
//! it. `n` residuals with standard deviation `s` and integrated autocorrelation time `c` (blocks) contain `n/c` independent values, the
//! information of white noise with standard deviation `s sqrt(c)`. The estimate decreases as the model improves.

use crate::block_averages::BlockAverages;
use crate::noise::Noise;

/// Largest lag (s) of the autocorrelation sum: several correlation times of the observed discrepancy.
const MAX_LAG_S: f64 = 4.0;
/// The autocorrelation sum ends at the first value below this.
const MIN_CORRELATION: f64 = 0.05;
/// Residuals are clipped at this many robust standard deviations, which limits the influence of ruptures.
const CLIP_SDS: f64 = 4.0;

/// White noise equivalent to residuals `e` (N, one column per recording), at least `floor_n` (N).
#[must_use]
pub fn discrepancy_noise(blocks: &[BlockAverages], e: &[Vec<f64>], floor_n: f64) -> Noise {
    let mut sizes: Vec<f64> = Vec::new();
    for (b, e) in blocks.iter().zip(e) {
        sizes.extend(e.iter().zip(&b.used).filter(|(e, u)| **u && e.is_finite()).map(|(e, _)| e.abs()));
    }
    let limit = CLIP_SDS
        * stylet_stats::MAD_TO_SD
        * stylet_stats::order_statistics::median(&mut sizes).max(floor_n).max(1e-9);
    let cut = |e: f64| e.clamp(-limit, limit);
    let (mut square, mut n) = (0.0, 0.0);
    for (b, e) in blocks.iter().zip(e) {
        for k in (0..b.len()).filter(|k| b.used[*k]) {
            square += cut(e[k]).powi(2);
            n += 1.0;
        }
    }
    let variance = square / f64::max(n, 1.0);
    let block_s = blocks.first().map_or(1.0, BlockAverages::block_s).max(1e-6);
    let mut time = 1.0;
    for lag in 1..((MAX_LAG_S / block_s) as usize).max(2) {
        let (mut sum, mut pairs) = (0.0, 0.0);
        for (b, e) in blocks.iter().zip(e) {
            for k in (lag..b.len()).filter(|k| b.used[*k] && b.used[*k - lag]) {
                sum += cut(e[k]) * cut(e[k - lag]);
                pairs += 1.0;
            }
        }
        let correlation = sum / f64::max(pairs, 1.0) / variance.max(1e-300);
        if correlation < MIN_CORRELATION {
            break;
        }
        time += 2.0 * correlation;
    }
    Noise::white((variance * time).sqrt().max(floor_n).max(1e-6))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block_averages::BLOCK_S;
    use stylet_record::Recording;

    fn blocks() -> BlockAverages {
        let t: Vec<f64> = (0..4000).map(|k| f64::from(k) * 0.01).collect();
        let z: Vec<f64> = t.iter().map(|t| 1e-3 * t).collect();
        let r = Recording::new(t.clone(), z, vec![0.0; t.len()]).expect("clean columns");
        BlockAverages::new(&r, &vec![false; t.len()], BLOCK_S)
    }

    #[test]
    fn correlated_residuals_count_once_per_correlation_time() {
        let b = blocks();
        let mut x = 1u64;
        let mut draw = || {
            x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (x >> 40) as f64 / f64::from(1u32 << 24) - 0.5
        };
        let white: Vec<f64> = (0..b.len()).map(|_| draw()).collect();
        let sd = (1.0_f64 / 12.0).sqrt();
        let of = |e: Vec<f64>| discrepancy_noise(std::slice::from_ref(&b), &[e], 0.0).sd_n();
        assert!((of(white.clone()) / sd - 1.0).abs() < 0.2);
        // Ten equal blocks: the triangular autocorrelation sums to ten.
        let slow: Vec<f64> = (0..b.len()).map(|k| white[k / 10]).collect();
        assert!((of(slow) / sd / 10.0_f64.sqrt() - 1.0).abs() < 0.25);
    }
}
