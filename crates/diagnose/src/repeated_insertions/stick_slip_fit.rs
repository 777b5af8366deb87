//! Fits the stick-slip model from several starts, and selects an optimum by held-out errors.

use super::ablation::without_effect;
use super::held_out_loss::{MIN_EFFECT_LOSS, exceeds_standard_error, is_significant, relative_losses};
use super::multistart_fit::{draw_starts, multistart_fit};
use super::scored_model::{ModelFamily, ScoredModel};
use super::segmented_recording::{SegmentedRecording, have_one_speed};
use rand::rngs::ChaCha8Rng;
use stylet_identify::model::Model;
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_tissue::{DelayedPuncture, Tissue};

/// Smallest number of starts; about one in five reaches the best optimum.
const MIN_STARTS: usize = 24;
/// Product of the numbers of starts and recordings for small sets, whose start values are worse and whose fits are cheaper.
const STARTS_TIMES_RECORDINGS: usize = 300;

/// Fits the stick-slip model. Returns the optimum with the smallest residual, unless another has a significantly smaller held-out error;
/// the minimum over all held-out errors would be biased against models with a single fit.
///
/// At one speed a delayed puncture is equivalent to a puncture force, so the delay must improve prediction significantly over the simpler
/// model from the same starts.
#[must_use]
pub fn fit_stick_slip(
    assumed: &Tissue,
    recordings: &[&SegmentedRecording],
    artefacts: &SensorArtefacts,
    rng: &mut ChaCha8Rng,
) -> Option<ScoredModel> {
    let starts = draw_starts(assumed, recordings, start_count(recordings.len()), rng);
    let best_of = |starts: &[Model]| {
        let candidates = multistart_fit(starts, recordings, artefacts)
            .into_iter()
            .map(|f| ScoredModel::new(ModelFamily::ShaftSlip, f, recordings));
        best_significant(candidates.collect())
    };
    let delayed = best_of(&starts);
    if !have_one_speed(recordings) {
        return delayed;
    }
    let immediate =
        best_of(&starts.iter().map(|m| without_effect(m, &[], DelayedPuncture::ID)).collect::<Vec<_>>());
    match (&delayed, &immediate) {
        (Some(w), Some(g)) if is_significant(&relative_losses(&g.scores, &w.scores)) => delayed,
        _ => immediate.or(delayed),
    }
}

/// The first model, or the best of those that are significantly better than it.
fn best_significant(candidates: Vec<ScoredModel>) -> Option<ScoredModel> {
    let mut best: Option<ScoredModel> = None;
    let first = candidates.first()?.clone();
    for candidate in candidates
        .into_iter()
        .skip(1)
        .filter(|l| exceeds_standard_error(&relative_losses(&first.scores, &l.scores), MIN_EFFECT_LOSS))
    {
        if best.as_ref().is_none_or(|b| candidate.held_out_n() < b.held_out_n()) {
            best = Some(candidate);
        }
    }
    best.or(Some(first))
}

/// Number of starts for a number of recordings.
fn start_count(count: usize) -> usize {
    (STARTS_TIMES_RECORDINGS / count.max(1)).clamp(MIN_STARTS, 3 * MIN_STARTS)
}

#[cfg(test)]
mod tests;
