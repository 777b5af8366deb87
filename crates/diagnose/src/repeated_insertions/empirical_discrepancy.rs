//! Empirical model discrepancy of repeated recordings at one speed and stroke.
//!
//! The mean residual of the other recordings of the group is added to the model's prediction, shrunk by the share of its square that its
//! own scatter explains (model discrepancy, Kennedy and O'Hagan 2001; shrinkage, James and Stein 1961). For a perfect model the correction
//! vanishes; for a poor one, model plus correction approach the mean of the other recordings. The correction is valid only at its speed and
//! is not a cause.

use super::population_prediction::{PredictedForce, Z90};
use super::segmented_recording::SegmentedRecording;
use stylet_stats::interpolate;

/// Half width (s) of the window in which the shrinkage is estimated: residuals are correlated over about 1 s.
const SHRINKAGE_HALF_WINDOW_S: f64 = 2.0;
/// Padding (s) of the time map before the start and after the retraction, longer than any recording.
const PADDING_S: f64 = 1e4;

/// Mean residual of the other recordings of a group at every sample of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EmpiricalDiscrepancy {
    /// Correction to the predicted force (N); zero where the mean is not significant.
    pub mean_n: Vec<f64>,
    /// Scale factor of the prediction band: the corrected mean no longer counts as scatter, but has the uncertainty of a mean over the
    /// other recordings.
    pub band_scale: Vec<f64>,
}

impl EmpiricalDiscrepancy {
    /// The corrected prediction.
    pub fn apply(&self, predicted: &PredictedForce) -> PredictedForce {
        let mut out = predicted.clone();
        for (i, (more, wider)) in self.mean_n.iter().zip(&self.band_scale).enumerate() {
            let mean = predicted.mean_n[i] + more;
            out.low_n[i] = mean - wider * (predicted.mean_n[i] - predicted.low_n[i]);
            out.high_n[i] = mean + wider * (predicted.high_n[i] - predicted.mean_n[i]);
            out.mean_n[i] = mean;
        }
        out
    }
}

/// Knots (s) of the piecewise linear time map between recordings: start, deepest point and begin of retraction, padded at both ends.
fn time_knots(run: &SegmentedRecording) -> [f64; 5] {
    let time_s = &run.recording.time_s;
    let at = |i: usize| time_s.get(i).or(time_s.last()).copied().unwrap_or(0.0);
    let (start, deepest, back) = (at(run.phases.start), at(run.phases.deepest), at(run.phases.retraction));
    [start - PADDING_S, start, deepest, back, back + PADDING_S]
}

/// Discrepancy of `run` from the residuals of the `others` of its group, each with its mean predicted force (N); `predicted` is the
/// prediction of `run`.
pub fn estimate_discrepancy(
    run: &SegmentedRecording,
    predicted: &PredictedForce,
    others: &[(&SegmentedRecording, Vec<f64>)],
) -> EmpiricalDiscrepancy {
    let n = others.len() as f64;
    if others.is_empty() || predicted.low_n.is_empty() || others.iter().any(|o| o.1.is_empty()) {
        return EmpiricalDiscrepancy::default();
    }
    let here = time_knots(run);
    let left: Vec<([f64; 5], &[f64], Vec<f64>)> = others
        .iter()
        .map(|(o, predicted_n)| {
            let limit_n = o.limit_n.map_or(f64::INFINITY, f64::abs);
            let residual = |(f, predicted): (&f64, &f64)| f - predicted.clamp(-limit_n, limit_n);
            let left = o.recording.force_n.iter().zip(predicted_n).map(residual).collect();
            (time_knots(o), o.recording.time_s.as_slice(), left)
        })
        .collect();
    let time_s = &run.recording.time_s;
    let (mut mean, mut noise) = (Vec::with_capacity(time_s.len()), Vec::with_capacity(time_s.len()));
    // The scatter expected by the model counts as one more recording.
    let expected: Vec<f64> =
        predicted.low_n.iter().zip(&predicted.high_n).map(|(low, high)| (high - low) / (2.0 * Z90)).collect();
    for (i, t) in time_s.iter().enumerate() {
        let all: Vec<f64> = left
            .iter()
            .map(|(there, time_s, e)| interpolate(time_s, e, interpolate(&here, there, *t)))
            .collect();
        let m = all.iter().sum::<f64>() / n;
        let square = all.iter().map(|e| (e - m).powi(2)).sum::<f64>() + expected[i] * expected[i];
        mean.push(m);
        noise.push(square / n / n);
    }
    let sums = |of: &dyn Fn(usize) -> f64| {
        let mut sum = vec![0.0; time_s.len() + 1];
        (0..time_s.len()).for_each(|i| sum[i + 1] = sum[i] + of(i));
        sum
    };
    let (squares, noises) = (sums(&|i| mean[i] * mean[i]), sums(&|i| noise[i]));
    let mut out = EmpiricalDiscrepancy::default();
    for (i, t) in time_s.iter().enumerate() {
        let from = time_s.partition_point(|s| *s < t - SHRINKAGE_HALF_WINDOW_S);
        let to = time_s.partition_point(|s| *s <= t + SHRINKAGE_HALF_WINDOW_S);
        let (square, by_chance) = (squares[to] - squares[from], noises[to] - noises[from]);
        let share = if square > by_chance { 1.0 - by_chance / square } else { 0.0 };
        out.mean_n.push(share * mean[i]);
        // Variance of a new recording: scatter of the others plus the error of their mean.
        let ratio = if expected[i] > 0.0 { (n + 1.0) * noise[i] / expected[i].powi(2) } else { 1.0 };
        out.band_scale.push((1.0 - share + share * ratio).sqrt());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{Z90, estimate_discrepancy};
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::population_prediction::PredictedForce;
    use stylet_record::Recording;

    fn run(start_s: f64, rest_s: f64, more_n: impl Fn(f64) -> f64) -> SegmentedRecording {
        let t: Vec<f64> = (0..800).map(|k| 0.02 * f64::from(k)).collect();
        let z = |t: f64| match t - start_s {
            x if x < 0.0 => 0.0,
            x if x < 5.0 => 0.004 * x,
            x if x < 5.0 + rest_s => 0.02,
            x => (0.02 - 0.008 * (x - 5.0 - rest_s)).max(0.0),
        };
        let z: Vec<f64> = t.iter().map(|t| z(*t)).collect();
        let f = z.iter().zip(&t).map(|(z, t)| 100.0 * z + more_n(*t)).collect();
        SegmentedRecording::new(String::new(), Recording::new(t, z, f).expect("clean columns"), 1)
    }

    /// Prediction proportional to the position, with a band of `sd_n` standard deviations (N).
    fn prediction(run: &SegmentedRecording, sd_n: f64) -> PredictedForce {
        let mean: Vec<f64> = run.recording.position_m.iter().map(|z| 100.0 * z).collect();
        let edge = |by: f64| mean.iter().map(|f| f + by * Z90 * sd_n).collect();
        PredictedForce { low_n: edge(-1.0), high_n: edge(1.0), mean_n: mean.clone() }
    }

    #[test]
    fn a_common_residual_is_added_to_the_prediction() {
        let recordings = [0.50, 0.52, 0.48, 0.50].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = recordings[1..].iter().map(|r| (r, prediction(r, 0.1).mean_n)).collect();
        let result = prediction(&recordings[0], 0.1);
        let a = estimate_discrepancy(&recordings[0], &result, &others);
        // Squares of three about their mean, and one more of 0.1 N: standard error of the mean 0.034 N.
        let by_chance = (0.02_f64 * 0.02 * 2.0 + 0.01) / 9.0;
        let share = 1.0 - by_chance / 0.25;
        for i in [10, 300, 700] {
            assert!((a.mean_n[i] - 0.5 * share).abs() < 1e-6, "{}", a.mean_n[i]);
            let both = a.apply(&result);
            assert!((both.mean_n[i] - result.mean_n[i] - a.mean_n[i]).abs() < 1e-12);
            let half = Z90 * ((1.0 - share) * 0.01 + share * 4.0 * by_chance).sqrt();
            assert!((both.high_n[i] - both.mean_n[i] - half).abs() < 1e-9);
            assert!((both.mean_n[i] - both.low_n[i] - half).abs() < 1e-9);
        }
    }

    #[test]
    fn a_residual_that_differs_between_recordings_is_not_added() {
        let recordings = [0.1, 0.3, -0.3, 0.1, -0.1].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = recordings[1..].iter().map(|r| (r, prediction(r, 0.2).mean_n)).collect();
        let result = prediction(&recordings[0], 0.2);
        let a = estimate_discrepancy(&recordings[0], &result, &others);
        assert!(a.mean_n.iter().all(|m| *m == 0.0) && a.apply(&result).mean_n == result.mean_n);
        let both = a.apply(&result);
        assert!(both.high_n.iter().zip(&result.high_n).all(|(a, b)| (a - b).abs() < 1e-12));
        assert_eq!(estimate_discrepancy(&recordings[0], &result, &[]).apply(&result).mean_n, result.mean_n);
    }

    #[test]
    fn the_band_shrinks_or_grows_to_the_scatter_of_the_group() {
        let recordings = [0.50, 0.53, 0.47, 0.51, 0.49].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = recordings[1..].iter().map(|r| (r, prediction(r, 0.5).mean_n)).collect();
        let result = prediction(&recordings[0], 0.5);
        let both = estimate_discrepancy(&recordings[0], &result, &others).apply(&result);
        let width = |p: &PredictedForce| p.high_n[300] - p.low_n[300];
        assert!(width(&both) < 0.75 * width(&result), "{} of {}", width(&both), width(&result));
        let recordings = [2.0, 2.6, 1.4, 2.5, 1.5].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = recordings[1..].iter().map(|r| (r, prediction(r, 0.1).mean_n)).collect();
        let result = prediction(&recordings[0], 0.1);
        let both = estimate_discrepancy(&recordings[0], &result, &others).apply(&result);
        assert!(width(&both) > 4.0 * width(&result), "{} of {}", width(&both), width(&result));
    }

    #[test]
    fn recordings_are_aligned_at_start_stop_and_retraction() {
        let bump = |back_s: f64| move |t: f64| if (t - back_s - 0.5).abs() < 0.3 { 1.0 } else { 0.0 };
        let here = run(1.0, 2.0, bump(8.0));
        let there = [(0.5, 3.0, 8.5), (1.5, 2.5, 9.0), (2.0, 2.0, 9.0)]
            .map(|(s, rest, back)| run(s, rest, bump(back)));
        let others: Vec<_> = there.iter().map(|r| (r, prediction(r, 0.05).mean_n)).collect();
        let a = estimate_discrepancy(&here, &prediction(&here, 0.05), &others);
        let at = |t: f64| a.mean_n[(t / 0.02) as usize];
        assert!(at(8.5) > 0.9 && at(8.0) < 0.1 && at(9.0) < 0.1, "{} {} {}", at(8.0), at(8.5), at(9.0));
    }

    #[test]
    fn saturated_samples_are_no_discrepancy() {
        let mut recordings = [0.0; 4].map(|more| run(1.0, 2.0, |_| more));
        for r in &mut recordings {
            r.recording.force_n.iter_mut().for_each(|f| *f = f.min(1.5));
            r.limit_n = Some(1.5);
        }
        let others: Vec<_> = recordings[1..].iter().map(|r| (r, prediction(r, 0.1).mean_n)).collect();
        let a = estimate_discrepancy(&recordings[0], &prediction(&recordings[0], 0.1), &others);
        assert!(a.mean_n.iter().all(|m| m.abs() < 1e-12));
    }
}
