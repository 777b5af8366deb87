//! Predicts held-out recordings, and estimates effect strengths by the jackknife.

use crate::varying_coefficient_test::varying_coefficient_test;
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::{FitData, ReplayCache, replay};
use stylet_identify::model::{Model, NO_RUPTURE, RecordingParameters};
use stylet_identify::score_test::ScoreTest;
use stylet_stats::parallel::*;

/// Largest shift (samples) of a predicted rupture to its best fit: the phase within a sampling interval is not an error.
const RUPTURE_SHIFT_SAMPLES: f64 = 2.0;

/// Residual of a free-run prediction of one recording, with ruptures at predicted times.
#[derive(Clone, Debug, Default)]
pub struct FreeRunResidual {
    /// Mean square in N² over the compared blocks.
    pub mean_square_n2: f64,
    /// The same given the observed ruptures, surface and friction of the recording: the error without scatter between recordings.
    pub given_scatter_n2: f64,
    /// Number of compared blocks.
    pub compared_blocks: usize,
    /// Residual of every block in N.
    pub residual_n: Vec<f64>,
    /// Predicted rupture times in s.
    pub rupture_times_s: Vec<f64>,
}

/// Free-run prediction of recording `r`; each predicted rupture is shifted by at most two samples to its best fit.
pub fn predict_free_run(model: &Model, data: &FitData, r: usize) -> Option<FreeRunResidual> {
    let mut cache = ReplayCache::new(model, data, r)?;
    let b = &data.recordings[r];
    let mut rupture_times_s = cache.free_rupture_times();
    cache.rebase(data, r, &rupture_times_s);
    let (first, last) = b.span_s();
    for layer in 0..rupture_times_s.len() {
        let predicted_s = rupture_times_s[layer];
        if predicted_s == NO_RUPTURE {
            continue;
        }
        let mut best = (f64::INFINITY, predicted_s);
        for k in [0.0, -0.5, 0.5, -1.0, 1.0, -RUPTURE_SHIFT_SAMPLES, RUPTURE_SHIFT_SAMPLES] {
            rupture_times_s[layer] = (predicted_s + k * b.sample_step_s).clamp(first, last);
            let nats = cache.nats_with_ruptures(model, data, r, &rupture_times_s);
            if nats < best.0 {
                best = (nats, rupture_times_s[layer]);
            }
        }
        rupture_times_s[layer] = best.1;
    }
    let mut at = model.clone();
    at.rupture_times_s[r].clone_from(&rupture_times_s);
    let predicted = replay(&at, data, r)?;
    let residual_n = residual(data, r, &predicted.force_n);
    let mean_square_n2 = mean_square(&residual_n, data, r);
    let compared_blocks = b.compared_block_count();
    Some(FreeRunResidual {
        mean_square_n2,
        given_scatter_n2: mean_square_n2,
        compared_blocks,
        residual_n,
        rupture_times_s,
    })
}

/// Predicts every recording from a fit to the others; a single recording is predicted by its own fit.
pub fn held_out_residuals(best: &Fit, data: &FitData) -> Vec<Option<FreeRunResidual>> {
    held_out_residuals_with(best, data, |_| RecordingParameters::default())
}

/// As [`held_out_residuals`], but with the random effects (surface, friction) of the held-out recording known, so that the gain of a cause
/// does not depend on where the needle touched.
pub fn held_out_residuals_with_random_effects(best: &Fit, data: &FitData) -> Vec<Option<FreeRunResidual>> {
    held_out_residuals_with(best, data, |r| best.model.per_recording[r])
}

fn held_out_residuals_with(
    best: &Fit,
    data: &FitData,
    random_effects: impl Fn(usize) -> RecordingParameters + Sync,
) -> Vec<Option<FreeRunResidual>> {
    let n = data.recording_count();
    (0..n)
        .into_par_iter()
        .map(|r| {
            let mut model = if n < 2 { best.model.clone() } else { refit_without(best, data, r)? };
            if n > 1 {
                model.per_recording[r] = random_effects(r);
            }
            let mut result = predict_free_run(&model, data, r)?;
            model.per_recording[r] = best.model.per_recording[r];
            model.rupture_times_s[r].clone_from(&best.model.rupture_times_s[r]);
            let given_n2 =
                replay(&model, data, r).map(|f| mean_square(&residual(data, r, &f.force_n), data, r));
            result.given_scatter_n2 =
                given_n2.map_or(result.mean_square_n2, |g| g.min(result.mean_square_n2));
            Some(result)
        })
        .collect()
}

/// Measured minus predicted force of a recording in N.
fn residual(data: &FitData, r: usize, predicted_n: &[f64]) -> Vec<f64> {
    data.recordings[r].force_n.iter().zip(predicted_n).map(|(y, f)| y - f).collect()
}

/// Mean square over the compared blocks of a recording, in N².
fn mean_square(residual_n: &[f64], data: &FitData, r: usize) -> f64 {
    let kept = residual_n.iter().zip(&data.recordings[r].used).filter(|(_, used)| **used);
    let (square, count) = kept.fold((0.0, 0.0), |(s, n), (e, _)| (s + e * e, n + 1.0));
    square / f64::max(count, 1.0)
}

/// Leave-one-recording-out results for one effect.
#[derive(Clone, Debug)]
pub struct JackknifeResult {
    /// Largest jackknife standard error of its strengths, relative to them.
    pub relative_se: f64,
    /// Share of the held-out mean square above the noise that the effect removes.
    pub held_out_gain: f64,
    /// Gain of the [`varying_coefficient_test`](crate::varying_coefficient_test) as a share of the loss without the effect.
    pub varying_coefficient_share: f64,
}

/// Jackknife of every effect of a fit; `floor_n` is the noise standard deviation of a sample in N.
pub fn jackknife_effects(best: &Fit, data: &FitData, floor_n: f64) -> Vec<JackknifeResult> {
    let n = data.recording_count();
    if n < 2 {
        let none = JackknifeResult { relative_se: 0.0, held_out_gain: 0.0, varying_coefficient_share: 0.0 };
        return vec![none; best.model.effects.len()];
    }
    let square = |residuals: &[Option<FreeRunResidual>]| {
        let (sum, blocks) = residuals.iter().flatten().fold((0.0, 0.0), |(s, n), l| {
            (s + l.mean_square_n2 * l.compared_blocks as f64, n + l.compared_blocks as f64)
        });
        sum / f64::max(blocks, 1.0)
    };
    let models: Vec<Option<Model>> = (0..n).into_par_iter().map(|r| refit_without(best, data, r)).collect();
    let full: Vec<Option<FreeRunResidual>> =
        models.iter().enumerate().map(|(r, m)| predict_free_run(m.as_ref()?, data, r)).collect();
    let full_n2 = square(&full);
    let score_test = ScoreTest::new(best, data);
    (0..best.model.effects.len())
        .map(|k| {
            let choice = &best.model.effects[k];
            let mut relative_se = 0.0_f64;
            for (p, _) in choice.info.parameters.iter().enumerate().filter(|(_, p)| p.strength) {
                let values: Vec<f64> = models.iter().flatten().map(|m| m.effects[k].values[p]).collect();
                let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
                let sum: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
                let count = values.len() as f64;
                relative_se = relative_se.max((sum * (count - 1.0) / count).sqrt() / mean.abs().max(1e-300));
            }
            let reduced =
                fit(&best.model.without_effect(k), data, Effort { max_iterations: 3, min_gain_nats: 1.0 });
            let Some(reduced) = reduced else {
                return JackknifeResult {
                    relative_se,
                    held_out_gain: 0.0,
                    varying_coefficient_share: f64::INFINITY,
                };
            };
            let reduced_n2 = square(&held_out_residuals(&reduced, data));
            let held_out_gain = (reduced_n2 - full_n2) / (reduced_n2 - floor_n * floor_n).max(1e-12);
            let varying = varying_coefficient_test(&score_test, k, reduced.nats() - best.nats());
            JackknifeResult {
                relative_se,
                held_out_gain,
                varying_coefficient_share: varying.map_or(f64::INFINITY, |o| o.share),
            }
        })
        .collect()
}

/// The model fitted to all recordings except `r`; the random effects of `r` are zero.
fn refit_without(best: &Fit, data: &FitData, r: usize) -> Option<Model> {
    let others: Vec<usize> = (0..data.recording_count()).filter(|k| *k != r).collect();
    let mut model = best.model.clone();
    model.rupture_times_s.remove(r);
    model.per_recording.remove(r);
    let zero_steps = (r < model.zero_steps.len()).then(|| model.zero_steps.remove(r));
    let fitted = fit(&model, &data.subset(&others), Effort { max_iterations: 2, min_gain_nats: 0.5 })?;
    let mut model = fitted.model;
    model.rupture_times_s.insert(r, vec![NO_RUPTURE; best.model.layers()]);
    if let Some(zero_steps) = zero_steps {
        model.zero_steps.insert(r, zero_steps);
    }
    model.per_recording.insert(r, RecordingParameters::default());
    Some(model)
}

/// RMS residual (N) over all recordings, including the noise of samples within their blocks.
pub fn pooled_rms(residuals: &[Option<FreeRunResidual>], data: &FitData) -> f64 {
    pooled_rms_of(residuals, data, |l| l.mean_square_n2)
}

/// The same given the scatter between recordings.
pub fn pooled_rms_given_scatter(residuals: &[Option<FreeRunResidual>], data: &FitData) -> f64 {
    pooled_rms_of(residuals, data, |l| l.given_scatter_n2)
}

fn pooled_rms_of(
    residuals: &[Option<FreeRunResidual>],
    data: &FitData,
    square_n2: impl Fn(&FreeRunResidual) -> f64,
) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (l, b) in residuals.iter().zip(data.recordings.iter()) {
        if let Some(l) = l {
            sum += l.compared_blocks as f64 * (square_n2(l) + b.within_block_sd_n().powi(2));
            n += l.compared_blocks as f64;
        }
    }
    (sum / f64::max(n, 1.0)).sqrt()
}

/// Standard deviation in N of the noise of a single sample.
pub fn sample_noise_sd_n(data: &FitData) -> f64 {
    let n = data.recording_count().max(1) as f64;
    let within = data.recordings.iter().map(|b| b.within_block_sd_n().powi(2)).sum::<f64>() / n;
    (data.noise.sd_n().powi(2) + within).sqrt()
}

#[cfg(test)]
mod tests;
