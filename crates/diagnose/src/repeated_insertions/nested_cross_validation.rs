//! Nested cross-validation: held-out errors that include the selection of the model.
//!
//! The cross-validation error of a selected model is biased, because the selection used all recordings. Here the selection, including
//! ablation, is repeated without each fold (Varma and Simon 2006).

use super::ablation::ablate;
use super::cross_validation::{refit_without, training_recordings};
use super::model_selection::{CandidateModels, best_candidate};
use super::random_effects_population::Population;
use super::scored_model::{
    REFIT_ITERATIONS, ScoredModel, active_effects, folds, predict_fold, with_coarse_blocks,
};
use super::segmented_recording::SegmentedRecording;
use serde::Serialize;

/// Held-out errors with and without selection bias.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NestedCrossValidation {
    /// RMS error (N) of the model selected with all recordings and fitted without the fold.
    pub selected_with_n: f64,
    /// RMS error (N) of the model selected and fitted without the fold.
    pub selected_without_n: f64,
    /// Effects selected without each fold.
    pub effects: Vec<Vec<String>>,
}

/// Repeats the selection without each fold, with the start values of the fits to all recordings. `None` when a fold leaves too few
/// recordings.
pub fn nested_cross_validation(
    candidates: &CandidateModels,
    recordings: &[&SegmentedRecording],
) -> Option<NestedCrossValidation> {
    let (mut errors, mut chosen) = (Vec::new(), Vec::new());
    for fold in folds(recordings.len()) {
        let some = training_recordings(recordings, &fold);
        let of = |candidate: &ScoredModel| {
            Some(ScoredModel::new(
                candidate.family,
                refit_without(&with_coarse_blocks(&candidate.set_fit), &fold, &[REFIT_ITERATIONS])?,
                &some,
            ))
        };
        let (base, slip) = (of(&candidates.base)?, candidates.slip.as_ref().and_then(of));
        let library = candidates.library.as_ref().and_then(of);
        let mut best = best_candidate(&base, slip.as_ref(), library.as_ref()).clone();
        ablate(&mut best, &some);
        let tried = [Some(&candidates.base), candidates.slip.as_ref(), candidates.library.as_ref()];
        let days = tried
            .into_iter()
            .flatten()
            .find(|l| l.family == best.family)
            .map(|l| &l.set_fit.fit.model.day_of);
        let population = Population::from_fit(&best.set_fit, &some);
        errors.extend(
            predict_fold(&population, days.map_or(&[][..], Vec::as_slice), recordings, &fold)
                .into_iter()
                .map(|e| e.1.rmse_n),
        );
        chosen.push(active_effects(&best.set_fit.fit.model).into_iter().map(str::to_owned).collect());
    }
    let selected_without_n = stylet_stats::mean(&errors);
    selected_without_n.is_finite().then(|| NestedCrossValidation {
        selected_with_n: candidates.best.held_out_n(),
        selected_without_n,
        effects: chosen,
    })
}

#[cfg(test)]
mod tests {
    use super::nested_cross_validation;
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::model_selection::CandidateModels;
    use crate::repeated_insertions::scored_model::{ModelFamily, ScoredModel};
    use crate::test_fixtures;
    use stylet_tissue::{AnyEffect, CoulombFriction, ForceBias};

    #[test]
    fn the_selection_is_repeated_without_every_fold() {
        let friction: AnyEffect = CoulombFriction { c_n_per_m: 150.0 }.into();
        let bias: AnyEffect = ForceBias { force_n: 1e-3 }.into();
        let speeds =
            [[0.008, 1e-4], [0.008, -1e-4], [0.016, 0.0], [0.016, 1e-4], [0.008, 0.0], [0.016, -1e-4]];
        let recordings = test_fixtures::simulated_recordings(std::slice::from_ref(&friction), &speeds);
        let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
        let base =
            ScoredModel::new(ModelFamily::Base, test_fixtures::fit_from_truth(&[], &recordings), &recordings);
        let library = ScoredModel::new(
            ModelFamily::Library,
            test_fixtures::fit_from_truth(&[bias, friction], &recordings),
            &recordings,
        );
        let candidates = CandidateModels {
            base,
            best: library.clone(),
            library: Some(library),
            slip: None,
            terms: Vec::new(),
        };
        let result = nested_cross_validation(&candidates, &recordings).expect("six recordings");
        assert_eq!(result.effects, vec![vec!["coulomb_friction".to_owned()]; 6]);
        assert_eq!(result.selected_with_n, candidates.best.held_out_n());
        assert!((result.selected_without_n / result.selected_with_n - 1.0).abs() < 0.2, "{result:?}");
    }
}
