//! Detects jumps of the measured force between two samples, of either sign: candidates for steps of the sensor zero.

use crate::block_averages::BlockAverages;
use crate::force_drops::{ForceDrop, detect_force_drops};
use stylet_stats::order_statistics::median;

/// Samples on each side whose means are compared to localise a jump.
const LOCAL_SAMPLES: usize = 6;
/// Distance (blocks) around a detected drop within which the jump is localised.
const SEARCH_BLOCKS: usize = 2;
/// Share of its fitted size by which the force must change between the two sides; a fast ramp changes by less.
const MIN_LOCAL_SHARE: f64 = 0.6;
/// Smallest jump, in standard deviations of the same difference over the recording; coloured noise does not reach it.
const MIN_LOCAL_SD: f64 = 6.0;

/// A jump between two samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceJump {
    /// Time in s, in the middle between the two samples.
    pub time_s: f64,
    /// Size in N; negative for a drop.
    pub size_n: f64,
    /// Size in standard deviations of its estimate.
    pub score: f64,
}

/// Jumps of a recording, in order of time.
#[must_use]
pub fn detect_force_jumps(b: &BlockAverages) -> Vec<ForceJump> {
    let negated = b.with_force(b.force_n.iter().map(|f| -f).collect());
    let min_n = MIN_LOCAL_SD * difference_sd_n(&b.sample_force_n);
    let of = |drops: Vec<ForceDrop>, sign: f64| {
        drops.into_iter().filter_map(move |d| localised(b, &d, sign, min_n)).collect::<Vec<ForceJump>>()
    };
    let mut all = of(detect_force_drops(b), -1.0);
    all.extend(of(detect_force_drops(&negated), 1.0));
    all.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    all
}

/// Difference in N between the means of the samples from `i` on and before `i`.
fn difference(force: &[f64], i: usize) -> f64 {
    stylet_stats::mean(&force[i..i + LOCAL_SAMPLES]) - stylet_stats::mean(&force[i - LOCAL_SAMPLES..i])
}

/// Robust standard deviation in N of these differences: median absolute deviation over 0.6745, its value for a unit normal.
fn difference_sd_n(force: &[f64]) -> f64 {
    let mut all: Vec<f64> = (LOCAL_SAMPLES..(force.len() + 1).saturating_sub(LOCAL_SAMPLES))
        .map(|i| difference(force, i))
        .collect();
    let middle = median(&mut all);
    all.iter_mut().for_each(|d| *d = (*d - middle).abs());
    median(&mut all) / 0.6745
}

/// The jump between the two samples with the largest difference; `None` if it is below `min_n` (N) or a ramp.
fn localised(b: &BlockAverages, drop: &ForceDrop, sign: f64, min_n: f64) -> Option<ForceJump> {
    let (time, force) = (&b.sample_time_s, &b.sample_force_n);
    let reach_s = (SEARCH_BLOCKS as f64 + 0.5) * b.samples_per_block as f64 * b.sample_step_s;
    let from = time.partition_point(|t| *t < drop.time_s - reach_s).max(LOCAL_SAMPLES);
    let to =
        time.partition_point(|t| *t <= drop.time_s + reach_s).min(time.len().checked_sub(LOCAL_SAMPLES)?);
    let jump = |i: usize| sign * difference(force, i);
    let at = (from..to).max_by(|a, b| jump(*a).total_cmp(&jump(*b)))?;
    let size = jump(at);
    (size >= min_n.max(MIN_LOCAL_SHARE * drop.size_n)).then(|| ForceJump {
        time_s: 0.5 * (time[at - 1] + time[at]),
        size_n: sign * drop.size_n,
        score: drop.score,
    })
}

#[cfg(test)]
mod tests {
    use super::{ForceJump, detect_force_jumps};
    use crate::block_averages::{BLOCK_S, BlockAverages};
    use stylet_record::Recording;

    #[test]
    fn jumps_of_either_sign_are_found_between_their_samples_and_ramps_are_not() {
        let n = 4000;
        let t: Vec<f64> = (0..n).map(|k| k as f64 * 0.005).collect();
        let x: Vec<f64> = t.iter().map(|t| 0.002 * t).collect();
        // A deterministic noise of 10 mN, a jump up, a jump down and a ramp of 0.3 s.
        let noise = |k: usize| 0.01 * libm::sin(12.9898 * k as f64 + 0.3 * libm::sin(78.233 * k as f64));
        let force = |t: f64, k: usize| {
            0.02 * t + noise(k) + if t > 6.0025 { 0.3 } else { 0.0 } - if t > 12.0025 { 0.5 } else { 0.0 }
                + 0.4 * ((t - 16.0) / 0.3).clamp(0.0, 1.0)
        };
        let f = t.iter().enumerate().map(|(k, t)| force(*t, k)).collect();
        let recording = Recording::with_velocity(t, x, vec![0.002; n], f).expect("a recording");
        let found = detect_force_jumps(&BlockAverages::new(&recording, &[], BLOCK_S));
        // The ramp is no jump; what is found within it is less than an eighth of it.
        let (jumps, others): (Vec<&ForceJump>, Vec<&ForceJump>) =
            found.iter().partition(|jump| jump.score > 10.0);
        assert_eq!(jumps.len(), 2, "{found:?}");
        assert!(others.iter().all(|jump| jump.size_n.abs() < 0.06), "{found:?}");
        for (jump, (at, size)) in jumps.into_iter().zip([(6.0025, 0.3), (12.0025, -0.5)]) {
            assert!((jump.time_s - at).abs() < 1e-6 && (jump.size_n - size).abs() < 0.05, "{jump:?}");
        }
    }
}
