//! Offset of the force sensor's zero, from the force before the needle reaches the tissue.

use stylet_identify::block_averages::BlockAverages;
use stylet_stats::order_statistics::median;

/// Distance (m) above the model's surface up to which the needle is in air; the surface of most other groups lies within it.
const AIR_MARGIN_M: f64 = 2e-3;
/// Fewest blocks in air.
const MIN_AIR_BLOCKS: usize = 20;
/// Smallest offset, in standard deviations of the noise of a sample: a smaller one does not matter.
const MIN_OFFSET_SDS: f64 = 3.0;

/// Median difference (N) of measured and predicted force in air at the beginning of a recording; `None` if it is negligible, or if the
/// recording does not begin in air.
pub fn zero_offset_n(b: &BlockAverages, predicted_n: &[f64], surface_m: f64, noise_n: f64) -> Option<f64> {
    let in_air = |k: &usize| b.motion.at(0.5 * (b.start_s[*k] + b.end_s[*k])).0 < surface_m - AIR_MARGIN_M;
    let used = (0..b.len()).take_while(in_air).filter(|k| b.used[*k]);
    let mut differences: Vec<f64> = used.map(|k| b.force_n[k] - predicted_n[k]).collect();
    if differences.len() < MIN_AIR_BLOCKS {
        return None;
    }
    let offset_n = median(&mut differences);
    (offset_n.abs() > MIN_OFFSET_SDS * noise_n).then_some(offset_n)
}
