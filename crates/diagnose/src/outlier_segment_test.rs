//! Outlier segment test: detects a few seconds of one recording with a residual far above the rest.
//!
//! A motion that only one recording contains (a hold, a retraction) may reveal a missing effect. Its residual is not common to several
//! recordings and its mean square is small, but slow noise would be as large everywhere.

use stylet_identify::block_averages::BlockAverages;
use stylet_identify::likelihood::FitData;
use stylet_stats::order_statistics::median;

/// Length in s of the windows whose means are compared.
const WINDOW_S: f64 = 1.0;
/// Number of consecutive windows of a segment; the residual of a misplaced rupture is shorter.
const SEGMENT_WINDOWS: usize = 2;
/// Ratio of the window means of a segment to the typical one; coloured normal noise practically never reaches it.
const MIN_TYPICAL_RATIO: f64 = 10.0;
/// Ratio of the window means of a segment to the noise of a block.
const MIN_NOISE_RATIO: f64 = 3.0;

/// p-value of the most extreme segment in residuals `e` (N), `None` without one. A segment has consecutive window means of one sign above
/// both ratios. The p-value is that of a normal mean of this size, times the number of windows.
pub fn outlier_segment_p_value(data: &FitData, e: &[Vec<f64>]) -> Option<f64> {
    let of = |(b, e): (&BlockAverages, &Vec<f64>)| -> Vec<f64> {
        let per = ((WINDOW_S / b.block_s()).round() as usize).max(1);
        let mean = |from: usize| {
            let (mut sum, mut n) = (0.0, 0_usize);
            for k in (from..(from + per).min(b.len())).filter(|k| b.used[*k] && e[*k].is_finite()) {
                sum += e[k] / data.noise.bin_at(b.abs_force_n[k]).sd_n;
                n += 1;
            }
            // Windows with less than half of their blocks do not count.
            if 2 * n >= per { sum / n as f64 } else { f64::NAN }
        };
        (0..b.len()).step_by(per).map(mean).collect()
    };
    let means: Vec<Vec<f64>> = data.recordings.iter().zip(e).map(of).collect();
    let mut sizes: Vec<f64> = means.iter().flatten().filter(|m| m.is_finite()).map(|m| m.abs()).collect();
    let count = sizes.len() as f64;
    let typical = (median(&mut sizes) * stylet_stats::MAD_TO_SD).max(MIN_NOISE_RATIO / MIN_TYPICAL_RATIO);
    // Smallest mean of a segment, relative to the typical one.
    let least = |w: &[f64]| {
        let (low, high) = stylet_stats::extremes(w);
        if w.iter().all(|m| m.is_finite()) { low.max(-high) / typical } else { 0.0 }
    };
    let most = means.iter().flat_map(|m| m.windows(SEGMENT_WINDOWS)).map(least).fold(0.0, f64::max);
    (most > MIN_TYPICAL_RATIO)
        .then(|| (2.0 * count * stylet_stats::normal::sf(most)).clamp(f64::MIN_POSITIVE, 1.0))
}

#[cfg(test)]
mod tests {
    use super::outlier_segment_p_value;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::likelihood::FitData;
    use stylet_identify::noise::Noise;
    use stylet_record::Recording;

    /// Four recordings of 40 s.
    fn recordings() -> FitData {
        let t: Vec<f64> = (0..8000).map(|k| f64::from(k) / 200.0).collect();
        let z: Vec<f64> = t.iter().map(|t| 1e-3 * t).collect();
        let f = vec![0.0; t.len()];
        let r = Recording::new(t, z, f).expect("a recording");
        let b = BlockAverages::new(&r, &vec![false; r.time_s.len()], BLOCK_S);
        FitData::new(Arc::new(vec![b; 4]), Noise::white(1.0), 0.0)
    }

    /// White noise plus a slow drift of `drift_sd` times its size.
    fn noise(data: &FitData, drift_sd: f64, seed: u64) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = move || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let mut one = |n: usize| {
            let (mut slow, keep) = (normal(), 0.995_f64);
            (0..n)
                .map(|_| {
                    slow = keep * slow + (1.0 - keep * keep).sqrt() * normal();
                    drift_sd * slow + normal()
                })
                .collect()
        };
        data.recordings.iter().map(|b| one(b.len())).collect()
    }

    #[test]
    fn outlier_segment_is_detected() {
        let data = recordings();
        for drift_sd in [0.0, 1.0] {
            let mut e = noise(&data, drift_sd, 7);
            e[2][900..1110].iter_mut().for_each(|x| *x -= 16.0);
            assert!(outlier_segment_p_value(&data, &e).is_some_and(|p| p < 1e-12), "{drift_sd}");
        }
    }

    #[test]
    fn drift_and_late_rupture_are_no_outlier_segments() {
        let data = recordings();
        for seed in 0..60 {
            let drift_sd = f64::from(seed as u32 % 6);
            let mut e = noise(&data, drift_sd, 100 + seed);
            assert!(outlier_segment_p_value(&data, &e).is_none(), "seed {seed}");
            e[1][500..505].iter_mut().for_each(|x| *x += 100.0);
            assert!(outlier_segment_p_value(&data, &e).is_none(), "seed {seed}, with a late rupture");
        }
    }

    /// Eight windows of one second, 50 blocks each: alternating means, and a segment of two that stand out.
    fn windows(means: &[f64]) -> (FitData, Vec<Vec<f64>>) {
        let t: Vec<f64> = (0..100 * means.len()).map(|k| k as f64 / 100.0).collect();
        let z: Vec<f64> = t.iter().map(|t| 1e-3 * t).collect();
        let r = Recording::new(t.clone(), z, vec![0.0; t.len()]).expect("a recording");
        let data = FitData::new(Arc::new(vec![BlockAverages::new(&r, &[], BLOCK_S)]), Noise::white(0.5), 0.0);
        assert_eq!(data.recordings[0].len(), 50 * means.len());
        let e = (0..data.recordings[0].len())
            .map(|k| 0.5 * (means[k / 50] + if k % 2 == 0 { 3.0 } else { -3.0 }))
            .collect();
        (data, vec![e])
    }

    /// The deviate is the smaller of two neighbouring means of one sign over 1.4826 times the median of all; the
    /// p-value is twice its tail times the number of windows.
    #[test]
    fn p_value_is_that_of_the_largest_of_many_normal_means() {
        let result = |means: &[f64]| {
            let (data, e) = windows(means);
            outlier_segment_p_value(&data, &e)
        };
        let calm = [0.4, -0.5, 0.6, -0.5, 0.4, -0.6, 0.5];
        let with = |a: f64, b: f64| [&calm[..3], &[a, b], &calm[3..]].concat();
        let typical = 0.5 * stylet_stats::MAD_TO_SD;
        for (a, b, least) in [(-9.0, -12.0, 9.0), (8.5, 8.0, 8.0)] {
            let p = result(&with(a, b)).expect("a stretch");
            let wanted = 2.0 * 9.0 * stylet_stats::normal::sf(least / typical);
            assert!((p / wanted - 1.0).abs() < 1e-6, "{p:e} for {wanted:e}");
        }
        // Around ten times the typical mean.
        assert!(result(&with(9.0, 10.1 * typical)).is_some());
        assert_eq!(result(&with(9.0, 9.9 * typical)), None);
        // Windows of opposite sign, or a single window, are not a segment.
        assert_eq!(result(&with(9.0, -9.0)), None);
        assert_eq!(result(&with(90.0, 0.5)), None);
        // The typical mean is at least 0.3 of the noise.
        let small: Vec<f64> = with(3.1, 3.1).iter().map(|m| if *m > 3.0 { *m } else { 0.01 * m }).collect();
        assert!(result(&small).is_some());
        let less: Vec<f64> = small.iter().map(|m| if *m > 3.0 { 2.9 } else { *m }).collect();
        assert_eq!(result(&less), None);
        // The p-value is never zero.
        assert_eq!(result(&with(900.0, 900.0)), Some(f64::MIN_POSITIVE));
    }

    #[test]
    fn windows_with_gaps_do_not_count() {
        let means = [0.4, -0.5, 0.6, 9.0, 9.0, -0.5, 0.4, -0.6, 0.5];
        let (data, e) = windows(&means);
        let without = |from: usize, to: usize| {
            let mut blocks = data.recordings.to_vec();
            blocks[0].used[from..to].fill(false);
            outlier_segment_p_value(&data.with_recordings(blocks), &e)
        };
        // Half of a window's blocks are enough.
        assert!(without(200, 225).is_some());
        assert_eq!(without(200, 226), None);
        // Nine windows, two of them missing: a median of seven.
        let kept: Vec<f64> = [0.4, 0.5, 0.6, 9.0, 9.0, 0.6, 0.5].to_vec();
        let typical = stylet_stats::median_of(kept) * stylet_stats::MAD_TO_SD;
        let p = without(250, 350).expect("a stretch");
        let wanted = 2.0 * 7.0 * stylet_stats::normal::sf(9.0 / typical);
        assert!((p / wanted - 1.0).abs() < 1e-6, "{p:e} for {wanted:e}");
        let mut holed = e.clone();
        holed[0][200..230].fill(f64::NAN);
        assert_eq!(outlier_segment_p_value(&data, &holed), None);
    }
}
