//! Slow noise: whether what a residual has beyond the noise of its quiet parts is noise of single recordings, or a missing force.

use crate::outlier_segment_test::outlier_segment_p_value;
use crate::residual_tests::test_residuals;
use crate::tone_detection::detect_tones;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;

/// Corrected p-value above which a residual has no structure that is worth a longer search.
const MIN_NOISE_P_VALUE: f64 = 0.01;
/// Excess variance from which a residual is not noise, whatever its autocorrelation: a slow standard deviation of 2.5 times the fast one.
pub(crate) const MIN_EXCESS_SLOW: f64 = 6.0;

/// Whether the residual of a fit to several recordings is slow noise: not too large, without structure common to the recordings, without
/// tones and without an outlier segment.
pub(crate) fn leaves_slow_noise(f: &Fit, data: &FitData) -> bool {
    let e = &f.residuals.residual_n;
    data.recording_count() > 1
        && excess(data, e) < MIN_EXCESS_SLOW
        && outlier_segment_p_value(data, e).is_none()
        && detect_tones(f, data).is_empty()
        && test_residuals(f, data).coloured_noise.p_value > MIN_NOISE_P_VALUE
}

/// Excess variance of a residual in units of the noise variance, with outliers limited.
pub(crate) fn excess(data: &FitData, e: &[Vec<f64>]) -> f64 {
    /// Residuals are limited to this many standard deviations.
    const OUTLIER_LIMIT_SD: f64 = 6.0;
    /// Blocks excluded on both sides of a velocity jump of uncertain time.
    const JUMP_MARGIN_BLOCKS: usize = 4;
    let (mut sum, mut n) = (0.0, 0.0);
    for (b, e) in data.recordings.iter().zip(e) {
        let mut near = vec![false; b.len()];
        for jump in &b.motion.jumps {
            let (lo, hi) =
                (b.block_at(jump.time_s - jump.time_sd_s), b.block_at(jump.time_s + jump.time_sd_s));
            let (lo, hi) =
                (lo.saturating_sub(JUMP_MARGIN_BLOCKS), (hi + JUMP_MARGIN_BLOCKS + 1).min(b.len()));
            near[lo.min(hi)..hi].fill(true);
        }
        for k in (0..b.len()).filter(|k| b.used[*k] && !near[*k]) {
            let sd = data.noise.bin_at(b.abs_force_n[k]).sd_n;
            sum += (e[k] / sd).powi(2).min(OUTLIER_LIMIT_SD * OUTLIER_LIMIT_SD);
            n += 1.0;
        }
    }
    sum / f64::max(n, 1.0) - 1.0
}

#[cfg(test)]
mod tests;
