//! Cross-validation of repeated recordings, with one recording or one speed held out: scores by phase, and the repeatability floor.

use super::empirical_discrepancy::estimate_discrepancy;
use super::insertion_phase::{InsertionPhase, phase_at};
use super::multistart_fit::{SetFit, fit_with_noise_updates};
use super::population_prediction::{DRAWS, PredictedForce, predict_force};
use super::random_effects_population::Population;
use super::segmented_recording::{SegmentedRecording, group_by_speed_and_stroke};
use stylet_stats::interpolate;
use stylet_stats::parallel::*;

/// Half width (s) of the puncture window around a rupture.
const RUPTURE_HALF_WINDOW_S: f64 = 0.5;
/// Names of the entries of [`PredictionScore::phase_squares`].
pub const PHASE_NAMES: [&str; 5] = ["loading", "puncture window", "cutting", "hold", "retraction"];

/// Score of a predicted force. The default is that of no prediction: NaN, and no samples.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictionScore {
    /// RMS error over all samples in N.
    pub rmse_n: f64,
    /// Share of samples inside the 90 % band.
    pub coverage: f64,
    /// Sum of squared errors (N²) and number of samples by phase, in the order of [`PHASE_NAMES`].
    pub phase_squares: [(f64, f64); 5],
}

impl Default for PredictionScore {
    fn default() -> Self {
        Self { rmse_n: f64::NAN, coverage: f64::NAN, phase_squares: [(0.0, 0.0); 5] }
    }
}

/// Scores a predicted force.
pub(crate) fn score_prediction(run: &SegmentedRecording, p: &PredictedForce) -> PredictionScore {
    let r = &run.recording;
    let mut out = PredictionScore::default();
    let first = run.first_rupture_s();
    let (mut sum, mut inside) = (0.0, 0.0);
    let limit_n = run.limit_n.map_or(f64::INFINITY, f64::abs);
    let clamped = |f: f64| f.clamp(-limit_n, limit_n);
    for i in 0..r.len().min(p.mean_n.len()) {
        let e = r.force_n[i] - clamped(p.mean_n[i]);
        sum += e * e;
        let within = |(l, h): (&f64, &f64)| clamped(*l) <= r.force_n[i] && r.force_n[i] <= clamped(*h);
        inside += f64::from(u8::from(p.low_n.get(i).zip(p.high_n.get(i)).is_some_and(within)));
        let t = r.time_s[i];
        let near = run.ruptures_s.iter().any(|at| (t - at).abs() < RUPTURE_HALF_WINDOW_S);
        let k = match phase_at(run, t, first) {
            _ if near => 1,
            InsertionPhase::Loading => 0,
            InsertionPhase::Cutting => 2,
            InsertionPhase::Hold => 3,
            InsertionPhase::Retraction => 4,
        };
        out.phase_squares[k].0 += e * e;
        out.phase_squares[k].1 += 1.0;
    }
    if !p.mean_n.is_empty() {
        let n = r.len() as f64;
        (out.rmse_n, out.coverage) = ((sum / n).sqrt(), inside / n);
    }
    out
}

/// Recordings that are not held out.
pub(crate) fn training_recordings<'a>(
    recordings: &[&'a SegmentedRecording],
    out: &[usize],
) -> Vec<&'a SegmentedRecording> {
    (0..recordings.len()).filter(|r| !out.contains(r)).map(|r| recordings[r]).collect()
}

/// Refits without the recordings `out`; `rounds` are the numbers of iterations between noise updates.
pub(crate) fn refit_without(all: &SetFit, out: &[usize], rounds: &[usize]) -> Option<SetFit> {
    let kept: Vec<usize> = (0..all.drop_times_s.len()).filter(|r| !out.contains(r)).collect();
    let drops: Vec<Vec<f64>> = kept.iter().map(|r| all.drop_times_s[*r].clone()).collect();
    let (fit, data) =
        fit_with_noise_updates(&all.fit.model.subset(&kept), all.data.subset(&kept), &drops, rounds)?;
    Some(SetFit { fit, data, drop_times_s: drops, starts: all.starts })
}

/// Population of a refit without the recordings `out`.
pub(crate) fn population_without(
    all: &SetFit,
    recordings: &[&SegmentedRecording],
    out: &[usize],
    rounds: &[usize],
) -> Option<Population> {
    Some(Population::from_fit(&refit_without(all, out, rounds)?, &training_recordings(recordings, out)))
}

/// Prediction of a held-out recording; the scores are NaN if the fit without it failed.
#[derive(Clone, Debug, Default)]
pub struct HeldOutPrediction {
    /// Score of the model with its empirical discrepancy.
    pub score: PredictionScore,
    /// Prediction of the model with its empirical discrepancy.
    pub prediction: PredictedForce,
    /// Score of the model alone.
    pub model_score: PredictionScore,
    /// Mean force (N) of the model alone.
    pub model_force_n: Vec<f64>,
    /// Population without this recording; `None` if the fit failed.
    pub population: Option<Population>,
}

/// Leave-one-out scores of the model alone.
#[must_use]
pub fn leave_one_out_scores(all: &SetFit, recordings: &[&SegmentedRecording]) -> Vec<PredictionScore> {
    leave_one_out(all, recordings).into_iter().map(|o| o.model_score).collect()
}

/// Leave-one-out predictions with and without the empirical discrepancy of the group.
#[must_use]
pub fn leave_one_out(all: &SetFit, recordings: &[&SegmentedRecording]) -> Vec<HeldOutPrediction> {
    let groups = group_by_speed_and_stroke(recordings);
    let one = |r: usize| {
        let day_of = &all.fit.model.day_of;
        // The random effect of the day is estimated if another recording was made on it.
        let day = day_of.get(r).copied().filter(|day| day_of.iter().filter(|d| *d == day).count() > 1);
        let population = population_without(all, recordings, &[r], &[5])?;
        let predict_one = |r: usize| predict_force(&population, recordings[r], day, DRAWS);
        let predicted = predict_one(r);
        let model_score = score_prediction(recordings[r], &predicted);
        let group = groups.iter().find(|g| g.contains(&r)).map_or(&[][..], Vec::as_slice);
        let others: Vec<(&SegmentedRecording, Vec<f64>)> =
            group.iter().filter(|o| **o != r).map(|o| (recordings[*o], predict_one(*o).mean_n)).collect();
        let prediction = estimate_discrepancy(recordings[r], &predicted, &others).apply(&predicted);
        let model_force_n = predicted.mean_n;
        Some(HeldOutPrediction {
            score: score_prediction(recordings[r], &prediction),
            prediction,
            model_score,
            model_force_n,
            population: Some(population),
        })
    };
    (0..recordings.len()).into_par_iter().map(|r| one(r).unwrap_or_default()).collect()
}

/// Scores with the whole group of equal speed and stroke held out; empty for a single group.
#[must_use]
pub fn leave_speed_out(all: &SetFit, recordings: &[&SegmentedRecording]) -> Vec<PredictionScore> {
    let groups = group_by_speed_and_stroke(recordings);
    if groups.len() < 2 {
        return Vec::new();
    }
    let mut out = vec![PredictionScore::default(); recordings.len()];
    let done: Vec<Vec<(usize, PredictionScore)>> = groups
        .par_iter()
        .map(|group| {
            let Some(fit) = refit_without(all, group, &[10, 6, 6, 6]) else { return Vec::new() };
            let p = Population::from_fit(&fit, &training_recordings(recordings, group))
                .with_parameter_uncertainty(&fit);
            group
                .iter()
                .map(|r| {
                    (*r, score_prediction(recordings[*r], &predict_force(&p, recordings[*r], None, DRAWS)))
                })
                .collect()
        })
        .collect();
    for (r, s) in done.into_iter().flatten() {
        out[r] = s;
    }
    out
}

/// Repeatability floor of each recording: score of the mean of the `n` other recordings of its group, aligned at the start of motion, and
/// `n`. The scatter of that mean increases the floor by `sqrt((n + 1)/n)`.
#[must_use]
pub fn repeatability_floor(recordings: &[&SegmentedRecording]) -> Vec<Option<(PredictionScore, usize)>> {
    let groups = group_by_speed_and_stroke(recordings);
    (0..recordings.len())
        .map(|i| {
            let others: Vec<&SegmentedRecording> = groups
                .iter()
                .find(|g| g.contains(&i))?
                .iter()
                .filter(|j| **j != i)
                .map(|j| recordings[*j])
                .collect();
            if others.is_empty() {
                return None;
            }
            let start = |r: &SegmentedRecording| r.recording.time_s[r.phases.start];
            let mean = recordings[i].recording.time_s.iter().map(|t| {
                let at = |o: &SegmentedRecording| {
                    interpolate(
                        &o.recording.time_s,
                        &o.recording.force_n,
                        t - start(recordings[i]) + start(o),
                    )
                };
                others.iter().map(|o| at(o)).sum::<f64>() / others.len() as f64
            });
            let p = PredictedForce { mean_n: mean.collect(), ..PredictedForce::default() };
            Some((score_prediction(recordings[i], &p), others.len()))
        })
        .collect()
}

#[cfg(test)]
mod tests;
