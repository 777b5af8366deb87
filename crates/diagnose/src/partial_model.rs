//! The best model in the presence of an unmodelled force: the part of the misfit that library effects explain.

use crate::diagnosis_json::PartialModel;
use crate::held_out::{FreeRunResidual, pooled_rms};
use crate::selection_state::Search;

/// The best model of a search, if it predicts held-out recordings better than the base law; `noise_n` is the noise of a sample in N.
pub(crate) fn partial_model(
    search: &Search,
    base: &[Option<FreeRunResidual>],
    best: &[Option<FreeRunResidual>],
    noise_n: f64,
) -> Option<PartialModel> {
    let effects: Vec<String> = search.best.model.effects.iter().map(|e| e.info.id.to_owned()).collect();
    let beyond = |held_out: &[Option<FreeRunResidual>]| {
        (pooled_rms(held_out, &search.data).powi(2) - noise_n * noise_n).max(0.0)
    };
    let (before, after) = (beyond(base), beyond(best));
    (!effects.is_empty() && after < before)
        .then(|| PartialModel { effects, share: (1.0 - after / before.max(1e-300)).clamp(0.0, 1.0) })
}
