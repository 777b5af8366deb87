//! Fitted models of repeated recordings with their cross-validation scores.

use super::cross_validation::{PredictionScore, population_without, score_prediction};
use super::multistart_fit::{SET_BLOCK_S, SetFit};
use super::population_prediction::predict_force;
use super::random_effects_population::Population;
use super::segmented_recording::{SegmentedRecording, group_by_speed_and_stroke, have_several_speeds};
use crate::base_law_fit::COARSENING_FACTOR;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::model::Model;
use stylet_stats::parallel::*;
use stylet_tissue::Effect;

/// Number of cross-validation folds for more than [`LEAVE_ONE_OUT_LIMIT`] recordings.
const FOLDS: usize = 3;
/// Largest number of recordings that are held out one by one.
const LEAVE_ONE_OUT_LIMIT: usize = 8;
/// Iterations of a refit in cross-validation.
pub(super) const REFIT_ITERATIONS: usize = 5;
/// Draws of a prediction in cross-validation.
const DRAWS: usize = 16;

/// Family of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFamily {
    /// Base law with random effects.
    Base,
    /// Base law with effects from the library search.
    Library,
    /// Stick-slip of the shaft with delayed punctures and releases in every layer.
    ShaftSlip,
}

/// A fitted model with its cross-validation scores.
#[derive(Clone, Debug)]
pub struct ScoredModel {
    /// Family.
    pub family: ModelFamily,
    /// Fit to all recordings.
    pub set_fit: SetFit,
    /// Held-out RMS error (N) per recording.
    pub errors_n: Vec<f64>,
    /// Held-out scores per recording; `None` without a prediction.
    pub scores: Vec<Option<PredictionScore>>,
}

impl ScoredModel {
    /// Cross-validates a fit.
    pub(super) fn new(kind: ModelFamily, fitted: SetFit, recordings: &[&SegmentedRecording]) -> Self {
        let scores = cross_validate(&fitted, recordings);
        let errors_n = rms_errors_n(&scores);
        Self { family: kind, set_fit: fitted, errors_n, scores }
    }

    /// Mean held-out RMS error (N).
    #[must_use]
    pub fn held_out_n(&self) -> f64 {
        stylet_stats::mean(&self.errors_n)
    }
}

/// The fit on coarser blocks; unchanged if its blocks are already coarse.
pub(super) fn with_coarse_blocks(fitted: &SetFit) -> SetFit {
    let long = |b: &BlockAverages| b.block_s() > 1.5 * SET_BLOCK_S;
    if fitted.data.recordings.iter().all(long) {
        return fitted.clone();
    }
    SetFit { data: fitted.data.coarsened(COARSENING_FACTOR), ..fitted.clone() }
}

/// Indices of the recordings of each cross-validation fold.
pub(super) fn folds(total: usize) -> Vec<Vec<usize>> {
    let count = if total <= LEAVE_ONE_OUT_LIMIT { total } else { FOLDS };
    (0..count).map(|k| (k..total).step_by(count.max(1)).collect()).collect()
}

/// Scores of the held-out recordings `which`.
pub(super) fn predict_fold(
    population: &Population,
    day_of: &[usize],
    recordings: &[&SegmentedRecording],
    which: &[usize],
) -> Vec<(usize, PredictionScore)> {
    let one = |r: usize| {
        score_prediction(
            recordings[r],
            &predict_force(population, recordings[r], day_of.get(r).copied(), DRAWS),
        )
    };
    which.iter().map(|r| (*r, one(*r))).collect()
}

/// Cross-validation scores per recording; `None` without a prediction.
pub(super) fn cross_validate(
    fitted: &SetFit,
    recordings: &[&SegmentedRecording],
) -> Vec<Option<PredictionScore>> {
    let at = with_coarse_blocks(fitted);
    held_out_scores(&at, recordings, &folds(recordings.len()), &at.fit.model.day_of)
}

/// Scores with the recording's whole group held out; empty for a single group.
pub(super) fn cross_validate_speeds(
    fitted: &SetFit,
    recordings: &[&SegmentedRecording],
) -> Vec<Option<PredictionScore>> {
    if have_several_speeds(recordings) {
        held_out_scores(&with_coarse_blocks(fitted), recordings, &group_by_speed_and_stroke(recordings), &[])
    } else {
        Vec::new()
    }
}

/// Scores of every recording, predicted by a fit without its part; `day_of` are the known days.
fn held_out_scores(
    at: &SetFit,
    recordings: &[&SegmentedRecording],
    parts: &[Vec<usize>],
    day_of: &[usize],
) -> Vec<Option<PredictionScore>> {
    let done: Vec<Vec<(usize, PredictionScore)>> = parts
        .par_iter()
        .map(|part| {
            let Some(p) = population_without(at, recordings, part, &[REFIT_ITERATIONS]) else {
                return Vec::new();
            };
            predict_fold(&p, day_of, recordings, part)
        })
        .collect();
    let mut out = vec![None; recordings.len()];
    for (r, s) in done.into_iter().flatten() {
        out[r] = Some(s).filter(|s| s.rmse_n.is_finite());
    }
    out
}

/// Held-out RMS error (N) per recording; infinite without a prediction.
pub(super) fn rms_errors_n(scores: &[Option<PredictionScore>]) -> Vec<f64> {
    scores.iter().map(|s| s.as_ref().map_or(f64::INFINITY, |s| s.rmse_n)).collect()
}

/// Active effects of a model, without repetition.
#[must_use]
pub fn active_effects(model: &Model) -> Vec<&'static str> {
    let mut out: Vec<&str> = Vec::new();
    for c in &model.effects {
        let neutral = c.effect().is_none_or(|e| e.is_inactive());
        if !neutral && !out.contains(&c.info.id) {
            out.push(c.info.id);
        }
    }
    out
}

#[cfg(test)]
mod tests;
